"""The sections of the table of results."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from .fleet import INSTANCES, Runs
from .importer import INTERVAL, NATIVE, STOP
from .page import Section, digits, duration, error
from .plain_c import ADAMS, BDF, CORE, EULER, FMU, FMU_3, FMU_3_SET, FMU_SET, HEYOKA, RK4, Reals
from .steps import METHODS, NAMES, SUBSTEP, TARGET, H, HeavyPlan, Job, Measured, Plan, TaylorPlan, compared
from .studies import Cost, overhead
from .taylor import BATCHES, LANES, NOT_INSTALLED, OURS, Many

_STEPS = [f"step {h:g} s" if h >= 1.0 else f"step {1000 * h:g} ms" for h in H]
_OURS = {FMU: "ours, fmi2DoStep", CORE: "ours, without FMI"}
_MORE = {
    FMU_SET: "ours, fmi2SetReal and fmi2DoStep",
    FMU_3: "ours, fmi3DoStep",
    FMU_3_SET: "ours, fmi3SetFloat64 and fmi3DoStep",
}
_SUBSTEPS = f"sub-steps ≤ {1000 * SUBSTEP:g} ms"
_NAMES = {**_MORE, **_OURS, RK4: f"RK4, {_SUBSTEPS}", EULER: f"forward Euler, {_SUBSTEPS}"}


def plain_c(plan: Plan, measured: Measured) -> Iterator[Section]:
    """Return the cost of a communication step (turning, straight, straight ahead), and of a command at equal error."""
    for straight in (False, True):
        section = [[f"Velocities and pose, {_direction(straight)}", *_STEPS]]
        for method, tolerance in METHODS:
            name = _NAMES.get(method) or f"{NAMES[method]}, tolerance {error(tolerance)}"
            jobs = [plan.job(method, h, straight, tolerance) for h in H]
            section.append([name, *(f"{duration(measured.cost(j))}  {error(measured.error(j)):>5}" for j in jobs)])
        yield section
    ahead = {name: [duration(measured.cost(plan.job(m, h, ahead=True))) for h in H] for m, name in _OURS.items()}
    yield [["The same, nothing turns back", *_STEPS], *([name, *costs] for name, costs in ahead.items())]
    ours = plan.job(CORE, 1.0)
    section = [["ours, to rounding", duration(measured.cost(ours)), "1"]]
    for method, name in NAMES.items():
        cost, times = compared(measured, plan.sweeps[method], ours)
        section.append([name, duration(cost), digits(times)])
    yield [[f"A command of 1 s to {error(TARGET)}", "turning", "times ours"], *section]


def _direction(straight: bool) -> str:
    return "straight" if straight else "turning"


def heavy(plan: HeavyPlan, measured: Measured) -> Section:
    """Return the cost of a step of a vehicle with six axes and lag."""
    rows = {"ours, without FMI": plan.ours, _NAMES[RK4]: plan.rk4}
    return [
        ["BlueROV2 Heavy, six axes and lag", *_STEPS],
        *(
            [name, *(f"{duration(measured.cost(job))}  {error(measured.error(job)):>5}" for job in jobs.values())]
            for name, jobs in rows.items()
        ),
    ]


def taylor(plan: TaylorPlan, measured: Measured) -> Section:
    """Return the cost of heyoka on the same system, and its ratio to ours."""
    names = {CORE: _OURS[CORE], RK4: _NAMES[RK4], HEYOKA: "heyoka, loop in C++, thrust ahead and not timed"}
    section: list[list[str]] = [["Velocities and pose, turning one way", *_STEPS]]
    for method, jobs in plan.rows.items():
        cells = (f"{duration(measured.cost(job))}  {error(measured.error(job)):>5}" for job in jobs.values())
        section.append([names[method], *cells])
    if HEYOKA not in plan.rows:
        return [*section, [f"heyoka: {NOT_INSTALLED}"]]
    ratios = (digits(_ratio(measured, plan.rows[HEYOKA][h], plan.rows[CORE][h])) for h in H)
    return [*section, ["heyoka / ours", *ratios]]


def many(name: str, found: Sequence[Many], limit: float) -> Section:
    """Return the cost of many vehicles that are stepped together, and the ratio to the best of heyoka's batches.

    At 10 ms the promised ratio is at most `limit`.
    """
    where = "one core" if found[0].cores == 1 else f"{found[0].cores} cores"
    section = [[f"Many of {name}, {where}, each and step", *(f"{one.h:g} s" for one in found)]]
    for way in found[0].seconds:
        cells = [duration(float(np.median(one.seconds[way]))) for one in found]
        if way in found[0].taken:
            steps = (one.taken[way] for one in found)
            cells = [
                f"{cell}  {f'{n:.3g} steps' if np.isfinite(n) else 'not finite'}"
                for cell, n in zip(cells, steps, strict=True)
            ]
        section.append([way, *cells])
    if set(BATCHES) <= set(found[0].seconds):
        section.append(
            [
                f"lanes / best of heyoka, promised ≤ {limit:g} at 0.01 s",
                *(digits(one.ratio(LANES, BATCHES)) for one in found),
            ]
        )
    return [*section, ["lanes / one after the other", *(digits(one.ratio(LANES, [OURS])) for one in found)]]


def through_fmpy(simulated: Mapping[str, tuple[Reals, float]], stepped: Mapping[str, Reals]) -> Section:
    """Return the cost of a manoeuvre in FMPy, simulated as a user does and by the functions of a step."""

    def row(name: str, seconds: Reals, native: Reals, end: str) -> list[str]:
        total = float(np.median(seconds))
        return [name, duration(total / STOP * INTERVAL), duration(total), end, digits(np.median(seconds / native))]

    return [
        [f"FMPy, {STOP:g} s at {1000 * INTERVAL:g} ms, turning", "a step", "all", "error at the end", "times native"],
        *(
            row(f"simulate_fmu, {name}", seconds, simulated[NATIVE][0], error(end))
            for name, (seconds, end) in simulated.items()
        ),
        *(row(f"set, doStep, get, {name}", seconds, stepped[NATIVE], "") for name, seconds in stepped.items()),
    ]


def instances(found: Reals) -> Section:
    """Return the cost of many instances that are stepped in turn."""
    return [
        ["Instances in turn, straight and down", *(f"{n:,}" for n in INSTANCES)],
        ["a step of 10 ms", *map(duration, found[:, 0])],
        ["memory of each", *(f"{memory:,.0f} B" for memory in found[:, 1])],
    ]


def variations(runs: Mapping[str, Runs]) -> Section:
    """Return the cost of runs with varied parameters."""
    return [
        ["Variations of α and β, 100 s, turning", "runs", "a run", "runs a second", "error at the end"],
        *(
            [name, f"{found.count:,}", duration(1.0 / found.rate), digits(found.rate), error(found.error)]
            for name, found in runs.items()
        ),
    ]


def studies(pairs: Sequence[tuple[Cost, Cost]], costs: Sequence[Cost]) -> Section:
    """Return the processor time and the elapsed time of studies and of the same runs alone."""
    runs = pairs[0][0].runs
    sides = zip(("the runs alone, in a loop", "by one worker"), zip(*pairs, strict=True), strict=True)
    started = float(np.median([cost.started for cost in costs]))
    return [
        ["A study: 30 s, two outputs each 0.1 s, three figures", "runs", "a run", "on the clock", "memory grows by"],
        *(
            [
                name,
                f"{runs:,}",
                duration(float(np.median([cost.processor for cost in side])) / runs),
                duration(float(np.median([cost.clock for cost in side]))),
            ]
            for name, side in sides
        ),
        ["which is more by", "", f"{overhead(pairs, 'processor'):+.0%}", f"{overhead(pairs, 'clock'):+.0%}"],
        *(
            [
                "by two workers",
                f"{cost.runs:,}",
                duration(cost.processor / cost.runs),
                duration(cost.clock),
                f"{cost.growth / 1e6:,.0f} MB",
            ]
            for cost in costs
        ),
        ["until two workers are there", "", "", duration(started)],
    ]


def archive(builds: Mapping[str, tuple[int, float, float]], loaded: Sequence[float]) -> Iterator[Section]:
    """Return the size, the build time and the load time of the archive."""
    rows = [
        [name, f"{size / 1000:,.0f} kB", duration(cold), duration(warm)] for name, (size, cold, warm) in builds.items()
    ]
    yield [["The archive", "size", "build, cold", "build, warm"], *rows]
    yield [
        ["Loading it through FMPy", "extract", "description", "instance", "library alone"],
        ["for this machine", *map(duration, loaded)],
    ]


FINE = 1e-12
"""The error at which the Heavy is compared with RK4."""
_SHORT = (0.001, SUBSTEP)
_TO_RK4 = {(0.001, False): 1.5, (SUBSTEP, False): 1.7, (0.001, True): 2.2, (SUBSTEP, True): 2.2}
"""The promised ratio of a step's cost to RK4's, by the length of the step and whether it is straight."""
_TO_OURS = {RK4: 5.0, ADAMS: 8.0, BDF: 18.0}
"""The promised minimal ratio of each method's cost to ours, for a command of 1 s at the error TARGET."""


def _ratio(measured: Measured, ours: Job, other: Job) -> float:
    """Return the median ratio of the costs of two jobs."""
    return float(np.median(measured.seconds[ours] / measured.seconds[other]))


def promises(
    plan: Plan,
    measured: Measured,
    heavier: HeavyPlan,
    measured_heavy: Measured,
    series: TaylorPlan,
    measured_series: Measured,
) -> Section:
    """Compare the measurements with the promises. Ratios and differences are medians over the repetitions."""
    made: list[tuple[str, str, str, bool]] = []

    def at_most(what: str, ratio: float, limit: float) -> None:
        made.append((what, digits(ratio), f"≤ {limit:g}", ratio <= limit))

    def at_least(what: str, ratio: float, limit: float) -> None:
        made.append((what, digits(ratio), f"≥ {limit:g}", ratio >= limit))

    for (h, straight), limit in _TO_RK4.items():
        ratio = _ratio(measured, plan.job(CORE, h, straight), plan.job(RK4, h, straight))
        at_most(f"{_direction(straight)} step to one of RK4, {1000 * h:g} ms", ratio, limit)
    set_too = _ratio(measured, plan.job(FMU_SET, SUBSTEP), plan.job(RK4, SUBSTEP))
    at_most("turning, with fmi2SetReal and fmi2DoStep, 10 ms", set_too, 2.0)
    for h in _SHORT:
        ratio = _ratio(measured_heavy, heavier.ours[h], heavier.rk4[h])
        at_most(f"Heavy, six axes and lag, to one of RK4, {1000 * h:g} ms", ratio, 16.0)
    worst = max(measured.error(plan.job(CORE, h, straight)) for h in (SUBSTEP, 1.0) for straight in (False, True))
    made.append(("its error after 1 s, in steps of 10 ms and 1 s", error(worst), "≤ 1e-13", worst <= 1e-13))
    longest = measured.cost(plan.job(CORE, H[-1], straight=True))
    made.append(("straight step of 100 s", duration(longest), "≤ 2 µs", longest <= 2e-6))
    for method, limit in _TO_OURS.items():
        times = compared(measured, plan.sweeps[method], plan.job(CORE, 1.0))[1]
        at_least(f"{NAMES[method]} to ours, at {error(TARGET)} a command of 1 s", times, limit)
    finer = compared(measured_heavy, heavier.sweep, heavier.ours[SUBSTEP], FINE)[1]
    at_least(f"RK4 to ours of the Heavy, to {error(FINE)}", finer, 2.0)
    fmu, bare = (measured.seconds[plan.job(method, SUBSTEP, straight=True)] for method in (FMU, CORE))
    layer = max(0.0, float(np.median(fmu - bare)))
    made.append(("what FMI adds to a step of 10 ms", duration(layer), "≤ 20 ns", layer <= 20e-9))
    for step, h in zip(_STEPS, H, strict=True):
        ratio = _ratio(measured, plan.job(FMU_3_SET, h), plan.job(FMU_SET, h))
        at_most(f"turning, set and step, FMI 3.0 to FMI 2.0, {step}", ratio, 1.05)
    for h in _SHORT if HEYOKA in series.rows else ():
        times = _ratio(measured_series, series.rows[HEYOKA][h], series.rows[CORE][h])
        at_least(f"heyoka to ours, turning, {1000 * h:g} ms", times, 4.0)
    rows = [(what, found, promised, "kept" if kept else "NOT KEPT") for what, found, promised, kept in made]
    return [("Promised", "measured", "promised", ""), *rows]
