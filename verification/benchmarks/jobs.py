"""The cost and the error of a step in plain C: ours, forward Euler, RK4, CVODE and heyoka on the same commands."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rov_fmu.vehicle.vehicle import Vehicle

from .page import Section, digits, duration, error
from .plain_c import ADAMS, BDF, CORE, EULER, FMU, FMU_SET, HEYOKA, RK4, PlainC, Reals
from .work import Work

TARGET = 1e-9
"""The error of a held command of 1 s at which costs are compared (SI units)."""
SUBSTEP = 0.01
"""The longest sub-step of RK4 (s)."""
H = (0.001, 0.01, 1.0, 100.0)
"""The lengths of the steps (s)."""
STEPS = [f"step {h:g} s" if h >= 1.0 else f"step {1000 * h:g} ms" for h in H]
NAMES = {
    CORE: "ours, without FMI",
    FMU: "ours, fmi2DoStep",
    FMU_SET: "ours, fmi2SetReal and fmi2DoStep",
    RK4: f"RK4, sub-steps ≤ {1000 * SUBSTEP:g} ms",
    HEYOKA: "heyoka, loop in C++, thrust ahead and not timed",
}
SWEEPS = {
    EULER: [10.0, 30.0, 100.0, 300.0, 1e3, 3e3, 1e4, 3e4, 1e5],
    RK4: [3.0, 5.0, *(10.0 * 2**n for n in range(9))],
    **{method: [10.0**-n for n in range(3, 14)] for method in (BDF, ADAMS)},
}
"""The sub-steps or tolerances with which other methods simulate a command of 1 s, by method."""
SOLVERS = {RK4: "RK4", BDF: "CVODE BDF", ADAMS: "CVODE Adams"}
"""The methods that reach the error TARGET."""
_FEW = 8
_PASS = 4e-3
"""Seconds of one measurement. It is short, so that each minute has measurements of all methods."""


@dataclass(frozen=True)
class Job:
    """A method with sub-steps or a tolerance, in communication steps of h s."""

    method: str
    setting: float
    work: Work
    h: float

    def hold(self, plain_c: PlainC, start: int, commands: int) -> tuple[float, Reals]:
        """Hold commands from the known start of the first one. Return seconds per step, and the final state."""
        held, state = self.work.array[start : start + commands], self.work.states[start]
        steps = round(self.work.hold / self.h)
        return plain_c.hold(self.method, self.setting, self.h, steps, held, state)

    def commands(self, plain_c: PlainC) -> int:
        """Return the number of commands to time: many of cheap ones, so that branches stay unpredictable."""
        seconds = self.hold(plain_c, 0, _FEW)[0] * self.work.hold / self.h
        return min(self.work.commands, max(_FEW, round(_PASS / seconds)))


class Measured:
    """The seconds per communication step in each repetition, and the error, by job."""

    def __init__(self, plain_c: PlainC, jobs: Sequence[Job], repetitions: int) -> None:
        self.ends = {job: [job.hold(plain_c, n, 1)[1].tolist() for n in range(job.work.starts)] for job in jobs}
        commands = {job: job.commands(plain_c) for job in jobs}
        turns = [
            [job.hold(plain_c, 0, commands[job])[0] for job in jobs[:: (-1) ** n]][:: (-1) ** n]
            for n in range(repetitions)
        ]
        self.seconds = dict(zip(jobs, np.array(turns).T, strict=True))

    def error(self, job: Job) -> float:
        """Return the largest error at the end of a held command."""
        return job.work.error(self.ends[job])

    def cost(self, job: Job) -> float:
        """Return the median seconds per communication step."""
        return float(np.median(self.seconds[job]))

    def ratio(self, job: Job, other: Job) -> float:
        """Return the median ratio of the costs of two jobs."""
        return float(np.median(self.seconds[job] / self.seconds[other]))

    def cost_at_target(self, jobs: Sequence[Job]) -> Reals:
        """Return the seconds at which a method reaches the error TARGET, in each repetition.

        The cost is interpolated between settings, on logarithmic axes. A setting is left out if another one is as exact
        and cheaper.
        """
        errors = np.array([self.error(job) for job in jobs])
        costs = np.array([self.seconds[job] for job in jobs])
        exact_first = np.argsort(errors)
        typical = np.median(costs, axis=1)[exact_first]
        best = exact_first[typical <= np.minimum.accumulate(typical)]
        log_costs = (np.interp(np.log(TARGET), np.log(errors[best]), row) for row in np.log(costs[best]).T)
        return np.exp([*log_costs])

    def compared(self, jobs: Sequence[Job], ours: Job) -> tuple[float, float]:
        """Return the median seconds of a method at the error TARGET, and their ratio to ours."""
        costs = self.cost_at_target(jobs)
        return float(np.median(costs)), float(np.median(costs / self.seconds[ours]))


class Table:
    """The jobs of some methods (rows) for each length of a step (columns), on the same commands."""

    def __init__(
        self, title: str, rov: Vehicle, methods: Sequence[str], commands: int, starts: int, **kind: bool
    ) -> None:
        short, long = (
            Work(rov, hold, commands, n, **kind) for hold, n in ((1.0, starts), (100.0, max(1, starts // 4)))
        )
        self.title, self.methods = title, methods
        self.jobs = {
            (method, h): Job(
                method, max(1.0, round(h / SUBSTEP)) if method == RK4 else 1.0, long if h > 1.0 else short, h
            )
            for method in methods
            for h in H
        }

    def sweep(self, method: str, settings: Sequence[float]) -> list[Job]:
        """Return the jobs of a method with several settings, in steps of 1 s."""
        return [Job(method, setting, self.jobs[CORE, 1.0].work, 1.0) for setting in settings]

    def section(self, measured: Measured) -> Section:
        """Return the cost and the error of a step by each method, and what heyoka costs relative to ours."""
        rows = [
            [NAMES[m], *(f"{duration(measured.cost(job))}  {error(measured.error(job)):>5}" for job in self._row(m))]
            for m in self.methods
        ]
        if HEYOKA in self.methods:
            pairs = zip(self._row(HEYOKA), self._row(CORE), strict=True)
            rows.append(["heyoka / ours", *(digits(measured.ratio(*pair)) for pair in pairs)])
        return [[self.title, *STEPS], *rows]

    def _row(self, method: str) -> list[Job]:
        return [self.jobs[method, h] for h in H]
