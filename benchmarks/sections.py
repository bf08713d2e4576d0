"""The sections of the table, of what was measured."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from .fleet import INSTANCES, Runs
from .importer import INTERVAL, NATIVE, STOP
from .page import Section, digits, duration, error
from .plain_c import BDF, CLOSED, CVODE, EULER, FMU, FMU_3, FMU_3_SET, FMU_SET, RK4, Reals
from .steps import KINDS, NAMES, SUBSTEP, TARGET, H, HeavyPlan, Job, Measured, Plan, compared, methods
from .studies import Cost, overhead

_STEPS = [f"step {h:g} s" if h >= 1.0 else f"step {1000 * h:g} ms" for h in H]
_OURS = {FMU: "ours, fmi2DoStep", CLOSED: "ours, without FMI"}
_MORE = {
    FMU_SET: "ours, fmi2SetReal and fmi2DoStep",
    FMU_3: "ours, fmi3DoStep",
    FMU_3_SET: "ours, fmi3SetFloat64 and fmi3DoStep",
}
_SUBSTEPS = f"sub-steps ≤ {1000 * SUBSTEP:g} ms"
_NAMES = {**_MORE, **_OURS, RK4: f"RK4, {_SUBSTEPS}", EULER: f"forward Euler, {_SUBSTEPS}"}


def plain_c(plan: Plan, measured: Measured) -> Iterator[Section]:
    """What a communication step costs (velocities, and the whole state turning, straight, and straight ahead), and a
    held command of 1 s where all have the same error."""
    titles = ("Velocities u, w, r", "Velocities and pose, turning", "Velocities and pose, straight")
    for title, (states, straight) in zip(titles, KINDS, strict=True):
        section = [[title, *_STEPS]]
        for method, tolerance in methods(states):
            name = _NAMES.get(method) or f"{NAMES[method]}, tolerance {error(tolerance)}"
            jobs = [plan.job(method, states, h, straight, tolerance) for h in H]
            section.append([name, *(f"{duration(measured.cost(j))}  {error(measured.error(j)):>5}" for j in jobs)])
        yield section
    ahead = {name: [duration(measured.cost(plan.job(m, 7, h, ahead=True))) for h in H] for m, name in _OURS.items()}
    yield [["The same, nothing turns back", *_STEPS], *([name, *costs] for name, costs in ahead.items())]
    ours = {states: plan.job(CLOSED, states, 1.0) for states in (3, 7)}
    cells = [cell for job in ours.values() for cell in (duration(measured.cost(job)), "1")]
    section = [["ours, to rounding", *cells]]
    for method, name in NAMES.items():
        section.append([name])
        for states, job in ours.items():
            if (states, method) in plan.sweeps:
                cost, times = compared(measured, plan.sweeps[states, method], job)
                section[-1] += [duration(cost), digits(times)]
    headings = ["velocities", "times ours", "and pose, turning", "times ours"]
    yield [[f"A command of 1 s to {error(TARGET)}", *headings], *section]


def heavy(plan: HeavyPlan, measured: Measured) -> Section:
    """All states of a vehicle with coupling and lag."""
    rows = {"ours, without FMI": plan.ours, _NAMES[RK4]: plan.rk4}
    return [
        ["BlueROV2 Heavy, coupling and lag", *_STEPS],
        *([name, *(f"{duration(measured.cost(job))}  {error(measured.error(job)):>5}" for job in jobs.values())]
          for name, jobs in rows.items()),
    ]  # fmt: skip


def through_fmpy(simulated: Mapping[str, tuple[Reals, float]], stepped: Mapping[str, Reals]) -> Section:
    """The manoeuvre in an importer: as a user simulates it, and the functions of a step alone."""

    def row(name: str, seconds: Reals, native: Reals, end: str) -> list[str]:
        total = float(np.median(seconds))
        return [name, duration(total / STOP * INTERVAL), duration(total), end, digits(np.median(seconds / native))]

    return [
        [f"FMPy, {STOP:g} s at {1000 * INTERVAL:g} ms, turning", "a step", "all", "error at the end", "times native"],
        *(row(f"simulate_fmu, {name}", seconds, simulated[NATIVE][0], error(end))
          for name, (seconds, end) in simulated.items()),
        *(row(f"set, doStep, get, {name}", seconds, stepped[NATIVE], "") for name, seconds in stepped.items()),
    ]  # fmt: skip


def instances(found: Reals) -> Section:
    """Many instances, stepped in turn."""
    return [
        ["Instances in turn, straight and down", *(f"{n:,}" for n in INSTANCES)],
        ["a step of 10 ms", *map(duration, found[:, 0])],
        ["memory of each", *(f"{memory:,.0f} B" for memory in found[:, 1])],
    ]


def variations(runs: Mapping[str, Runs]) -> Section:
    """Runs with other parameters."""
    return [
        ["Variations of α and β, 100 s, turning", "runs", "a run", "runs a second", "error at the end"],
        *([name, f"{found.count:,}", duration(1.0 / found.rate), digits(found.rate), error(found.error)]
          for name, found in runs.items()),
    ]  # fmt: skip


def studies(pairs: Sequence[tuple[Cost, Cost]], costs: Sequence[Cost]) -> Section:
    """Runs by the engine of studies, beside those alone: processor time of who does them, and time on the clock."""
    runs = pairs[0][0].runs
    sides = zip(("the runs alone, in a loop", "by one worker"), zip(*pairs, strict=True), strict=True)
    started = float(np.median([cost.started for cost in costs]))
    return [
        ["A study: 30 s, two outputs each 0.1 s, three figures", "runs", "a run", "on the clock", "memory grows by"],
        *([name, f"{runs:,}", duration(float(np.median([cost.processor for cost in side])) / runs),
           duration(float(np.median([cost.clock for cost in side])))] for name, side in sides),
        ["which is more by", "", f"{overhead(pairs, 'processor'):+.0%}", f"{overhead(pairs, 'clock'):+.0%}"],
        *(["by two workers", f"{cost.runs:,}", duration(cost.processor / cost.runs), duration(cost.clock),
           f"{cost.growth / 1e6:,.0f} MB"] for cost in costs),
        ["until two workers are there", "", "", duration(started)],
    ]  # fmt: skip


def archive(builds: Mapping[str, tuple[int, float, float]], loaded: Sequence[float]) -> Iterator[Section]:
    """Size, build time and load time."""
    rows = [
        [name, f"{size / 1000:,.0f} kB", duration(cold), duration(warm)] for name, (size, cold, warm) in builds.items()
    ]
    yield [["The archive", "size", "build, cold", "build, warm"], *rows]
    yield [
        ["Loading it through FMPy", "extract", "description", "instance", "library alone"],
        ["for this machine", *map(duration, loaded)],
    ]


FINE = 1e-10
"""The error at which the Heavy is compared with RK4."""


def _ratio(measured: Measured, ours: Job, other: Job) -> float:
    return float(np.median(measured.seconds[ours] / measured.seconds[other]))


def promises(plan: Plan, measured: Measured, heavier: HeavyPlan, measured_heavy: Measured) -> Section:
    """What was promised of the cost of a step. Ratios and differences are the medians of those in each repetition."""
    velocity, held = plan.job(CLOSED, 3, SUBSTEP), plan.job(CLOSED, 3, 1.0)
    step = _ratio(measured, velocity, plan.job(RK4, 3, SUBSTEP))
    to_rk4 = {(h, straight): _ratio(measured, plan.job(CLOSED, 7, h, straight), plan.job(RK4, 7, h, straight))
              for h in (0.001, SUBSTEP) for straight in (False, True)}  # fmt: skip
    set_too = _ratio(measured, plan.job(FMU_SET, 7, SUBSTEP), plan.job(RK4, 7, SUBSTEP))
    coupled = _ratio(measured_heavy, heavier.ours[SUBSTEP], heavier.rk4[SUBSTEP])
    finer = compared(measured_heavy, heavier.sweep, heavier.ours[SUBSTEP], FINE)[1]
    worst = max(measured.error(job) for job in (velocity, held))
    times = {method: compared(measured, plan.sweeps[3, method], held)[1] for method in (RK4, *CVODE)}
    best = min(CVODE, key=lambda method: times[method])
    spread = _spread(measured, [plan.job(CLOSED, 7, h, ahead=True) for h in H])
    turning_back = _spread(measured, [plan.job(CLOSED, 7, h, straight=True) for h in H])
    fmu, bare = (measured.seconds[plan.job(method, 7, SUBSTEP, straight=True)] for method in (FMU, CLOSED))
    layer = max(0.0, float(np.median(fmu - bare)))
    versions = {h: _ratio(measured, plan.job(FMU_3_SET, 7, h), plan.job(FMU_SET, 7, h)) for h in H}
    per = f"at {error(TARGET)} a command of 1 s"
    steps = [(f"{'straight' if straight else 'turning'} step of all states to one of RK4, {1000 * h:g} ms", found)
             for (h, straight), found in to_rk4.items()]  # fmt: skip
    made = [
        *((what, digits(found), "≤ 1.5", found <= 1.5) for what, found in steps),
        ("turning, with fmi2SetReal and fmi2DoStep, 10 ms", digits(set_too), "≤ 2", set_too <= 2.0),
        ("Heavy, coupling and lag, to one of RK4, 10 ms", digits(coupled), "≤ 5", coupled <= 5.0),
        (f"RK4 to ours of the Heavy, to {error(FINE)}", digits(finer), "≥ 5", finer >= 5.0),
        ("velocity step of 3 axes to one of RK4, 10 ms", digits(step), "≤ 1", step <= 1.0),
        ("its error, m/s, rad/s", error(worst), "≤ 1e-14", worst <= 1e-14),
        (f"RK4 to ours, {per}", digits(times[RK4]), "≥ 20", times[RK4] >= 20.0),
        (f"{NAMES[best]} to ours, {per}", digits(times[best]), "≥ 500", times[best] >= 500.0),
        (f"{NAMES[BDF]}, as FMPy uses it, to ours", digits(times[BDF]), "≥ 500", times[BDF] >= 500.0),
        ("dearest to cheapest step, 1 ms to 100 s, ahead", digits(spread), "≤ 1.5", spread <= 1.5),
        ("the same, straight but turning back", digits(turning_back), "≤ 1.5", turning_back <= 1.5),
        ("what FMI adds to a step of 10 ms", duration(layer), "≤ 20 ns", layer <= 20e-9),
        *(
            (f"turning, set and step, FMI 3.0 to FMI 2.0, {step}", digits(found), "≤ 1.05", found <= 1.05)
            for step, found in zip(_STEPS, versions.values(), strict=True)
        ),
    ]
    rows = [(what, found, promised, "kept" if kept else "NOT KEPT") for what, found, promised, kept in made]
    return [("Promised", "measured", "promised", ""), *rows]


def _spread(measured: Measured, jobs: Sequence[Job]) -> float:
    costs = np.array([measured.seconds[job] for job in jobs])
    return float(np.median(costs.max(axis=0) / costs.min(axis=0)))
