"""The sections of the table, of what was measured."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .archive import Built, Loaded
from .fleet import Instances, Runs
from .importer import INTERVAL, MODEL_EXCHANGE, NATIVE, PYTHONFMU, RELATIVE_TOLERANCE, STOP, Simulated
from .page import Page, digits, duration, error
from .steps import (
    BDF,
    CLOSED,
    EULER,
    FIXED_POINT,
    FMU,
    NAMES,
    RK4,
    SUBSTEP,
    TARGET,
    TOLERANCES,
    H,
    Measured,
    Plan,
    compared,
)

_HEADINGS = tuple(f"step {h:g} s" if h >= 1.0 else f"step {1000 * h:g} ms" for h in H)


def plain_c(page: Page, plan: Plan, measured: Measured) -> None:
    """What a communication step costs: velocities, and the whole state turning, straight, and straight ahead."""
    for title, states, straight in (
        ("Velocities u, w, r", 3, False),
        ("Velocities and pose, turning", 7, False),
        ("Velocities and pose, straight", 7, True),
    ):
        page.section(title, *_HEADINGS)
        if states == 7:
            _step_row(page, plan, measured, "ours, fmi2DoStep", FMU, states, straight)
        _step_row(page, plan, measured, "ours, without FMI", CLOSED, states, straight)
        for name, method in (("RK4", RK4), ("forward Euler", EULER)):
            _step_row(page, plan, measured, f"{name}, sub-steps ≤ {1000 * SUBSTEP:g} ms", method, states, straight)
        for method in (BDF, FIXED_POINT):
            for tolerance in TOLERANCES:
                name = f"{NAMES[method]}, tolerance {error(tolerance)}"
                _step_row(page, plan, measured, name, method, states, straight, tolerance)
    page.section("The same, nothing turns back", *_HEADINGS)
    for name, method in (("ours, fmi2DoStep", FMU), ("ours, without FMI", CLOSED)):
        page.row(name, *(duration(measured.cost(plan.job_ahead(method, h))) for h in H))


def _step_row(
    page: Page, plan: Plan, measured: Measured, name: str, method: str, states: int, straight: bool, setting: float = 0
) -> None:
    jobs = [plan.job(method, states, h, straight, setting) for h in H]
    page.row(name, *(f"{duration(measured.cost(job))}  {error(measured.error(job)):>5}" for job in jobs))


def at_equal_error(page: Page, plan: Plan, measured: Measured) -> None:
    """The cost of a held command of 1 s where all have the same error."""
    headings = ("velocities", "times ours", "and pose, turning", "times ours")
    page.section(f"A command of 1 s to {error(TARGET)}", *headings)
    ours = {states: plan.job(CLOSED, states, 1.0) for states in (3, 7)}
    page.row("ours, to rounding", *(cell for job in ours.values() for cell in (duration(measured.cost(job)), "1")))
    for method, name in {RK4: "RK4", **NAMES}.items():
        cells = []
        for states, job in ours.items():
            if (states, method) in plan.sweeps:
                cost, times = compared(measured, plan.sweeps[states, method], job)
                cells += [duration(cost), digits(times)]
        page.row(name, *cells)


def through_fmpy(page: Page, simulated: Mapping[str, Simulated], stepped: Mapping[str, NDArray[Any]]) -> None:
    """The manoeuvre in an importer: as a user simulates it, and the functions of a step alone."""
    title = f"FMPy, {STOP:g} s at {1000 * INTERVAL:g} ms, turning"
    page.section(title, "a step", "all", "error at the end", "times native")
    names = {
        NATIVE: "native",
        PYTHONFMU: "PythonFMU flavour",
        MODEL_EXCHANGE: f"Model Exchange, CVode {error(RELATIVE_TOLERANCE)}",
    }

    def row(name: str, seconds: NDArray[Any], native: NDArray[Any], end: str) -> None:
        total = float(np.median(seconds))
        page.row(name, duration(total / STOP * INTERVAL), duration(total), end, digits(np.median(seconds / native)))

    for key, run in simulated.items():
        row(f"simulate_fmu, {names[key]}", run.seconds, simulated[NATIVE].seconds, error(run.error))
    for key, seconds in stepped.items():
        row(f"set, doStep, get, {names[key]}", seconds, stepped[NATIVE], "")


def instances(page: Page, found: Mapping[int, Instances]) -> None:
    """Many instances, stepped in turn."""
    page.section("Instances in turn, straight and down", *(f"{n:,}" for n in found))
    page.row("a step of 10 ms", *(duration(i.seconds) for i in found.values()))
    page.row("memory of each", *(f"{i.bytes:,.0f} B" for i in found.values()))


def variations(page: Page, runs: Mapping[str, Runs]) -> None:
    """Runs with other parameters."""
    page.section("Variations of α and β, 100 s, turning", "runs", "a run", "runs a second", "error at the end")
    for name, found in runs.items():
        page.row(name, f"{found.count:,}", duration(1.0 / found.rate), digits(found.rate), error(found.error))


def archive(page: Page, builds: Mapping[str, Built], loaded: Loaded) -> None:
    """Size, load time and build time."""
    page.section("The archive", "size", "build, cold", "build, warm")
    for name, built in builds.items():
        page.row(name, f"{built.size / 1000:,.0f} kB", duration(built.cold), duration(built.warm))
    page.section("Loading it through FMPy", "extract", "description", "instance", "library alone")
    page.row("for this machine", *map(duration, (loaded.extract, loaded.describe, loaded.instantiate, loaded.library)))
