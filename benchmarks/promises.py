"""What was promised of the cost of a step, beside what was measured."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .page import Page, digits, duration, error
from .steps import BDF, CLOSED, CVODE, FMU, NAMES, RK4, SUBSTEP, TARGET, H, Job, Measured, Plan, compared


@dataclass(frozen=True)
class Promise:
    """A statement; what was measured and what was promised, as they are printed; whether it is kept."""

    what: str
    measured: str
    promised: str
    kept: bool


def promises(plan: Plan, measured: Measured) -> list[Promise]:
    """All of them. Ratios and differences are the medians of those in each repetition."""
    velocity, held = plan.job(CLOSED, 3, SUBSTEP), plan.job(CLOSED, 3, 1.0)
    step = _median(measured.ratios(velocity, plan.job(RK4, 3, SUBSTEP)))
    worst = max(measured.error(job) for job in (velocity, held))
    times = {method: compared(measured, plan.sweeps[3, method], held)[1] for method in (RK4, *CVODE)}
    best = min(CVODE, key=lambda method: times[method])
    spread = _spread(measured, [plan.job_ahead(CLOSED, h) for h in H])
    turning_back = _spread(measured, [plan.job(CLOSED, 7, h, straight=True) for h in H])
    layer = _layer(measured, plan.job(FMU, 7, SUBSTEP, straight=True), plan.job(CLOSED, 7, SUBSTEP, straight=True))
    per = f"at {error(TARGET)} a command of 1 s"
    return [
        Promise("velocity step of 3 axes to one of RK4, 10 ms", digits(step), "≤ 1", step <= 1.0),
        Promise("its error, m/s, rad/s", error(worst), "≤ 1e-14", worst <= 1e-14),
        Promise(f"RK4 to ours, {per}", digits(times[RK4]), "≥ 20", times[RK4] >= 20.0),
        Promise(f"{NAMES[best]} to ours, {per}", digits(times[best]), "≥ 500", times[best] >= 500.0),
        Promise(f"{NAMES[BDF]}, as FMPy uses it, to ours", digits(times[BDF]), "≥ 500", times[BDF] >= 500.0),
        Promise("dearest to cheapest step, 1 ms to 100 s, ahead", digits(spread), "≤ 1.5", spread <= 1.5),
        Promise("the same, straight but turning back", digits(turning_back), "≤ 1.5", turning_back <= 1.5),
        Promise("what FMI adds to a step of 10 ms", duration(layer), "≤ 20 ns", layer <= 20e-9),
    ]


def section(page: Page, made: list[Promise]) -> None:
    """Promised and measured."""
    page.section("Promised", "measured", "promised", "")
    for promise in made:
        page.row(promise.what, promise.measured, promise.promised, "kept" if promise.kept else "NOT KEPT")


def _median(values: NDArray[np.float64]) -> float:
    return float(np.median(values))


def _spread(measured: Measured, jobs: list[Job]) -> float:
    costs = np.array([measured.seconds[job] for job in jobs])
    return _median(costs.max(axis=0) / costs.min(axis=0))


def _layer(measured: Measured, fmu: Job, bare: Job) -> float:
    return max(0.0, _median(measured.seconds[fmu] - measured.seconds[bare]))
