"""The cost and the error of a step in plain C: ours, forward Euler, RK4 and CVODE on the same commands."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import chain

import numpy as np

from rov_fmu.vehicle.vehicle import Vehicle

from .plain_c import ADAMS, BDF, CORE, CVODE, EULER, FMU, FMUS, HEYOKA, RK4, PlainC, Reals
from .taylor import installed
from .work import Work

TARGET = 1e-9
"""The error of a held command of 1 s at which costs are compared (SI units)."""
SUBSTEP = 0.01
"""The longest sub-step of the explicit methods (s)."""
H = (0.001, 0.01, 1.0, 100.0)
TOLERANCES = (1e-6, 1e-9)
NAMES = {RK4: "RK4", BDF: "CVODE BDF", ADAMS: "CVODE Adams"}
METHODS = [
    *((method, 0.0) for method in (*FMUS, CORE, RK4, EULER)),
    *((method, tolerance) for method in CVODE for tolerance in TOLERANCES),
]
"""The rows of the table, with the solvers' tolerances."""
_SWEEP = {
    EULER: [10.0, 30.0, 100.0, 300.0, 1e3, 3e3, 1e4, 3e4, 1e5],
    RK4: [3.0, 5.0, *(10.0 * 2**n for n in range(9))],
    **{method: [10.0**-n for n in range(3, 14)] for method in CVODE},
}
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


class Plan:
    """The jobs of the table and, for the picture, of cost over error of a held command of 1 s."""

    def __init__(self, rov: Vehicle, commands: int, starts: int) -> None:
        @cache
        def work(straight: bool, long: bool, ahead: bool) -> Work:
            known = 4 if ahead else starts // 4 if long else starts
            return Work(rov, straight, 100.0 if long else 1.0, commands, known, ahead)

        self._work = work
        self.sweeps = {
            method: [self.job(method, 1.0, setting=setting) for setting in settings]
            for method, settings in _SWEEP.items()
        }
        rows = [
            self.job(method, h, straight, setting)
            for straight in (False, True)
            for method, setting in METHODS
            for h in H
        ]
        ahead = [self.job(method, h, ahead=True) for method in (FMU, CORE) for h in H]
        self.jobs = list(dict.fromkeys([*rows, *ahead, *chain.from_iterable(self.sweeps.values())]))

    def job(self, method: str, h: float, straight: bool = False, setting: float = 0.0, ahead: bool = False) -> Job:
        """Return the job of one cell. `ahead`: all commands are positive, so no velocity reverses."""
        setting = setting or (max(1.0, round(h / SUBSTEP)) if method in (EULER, RK4) else 1.0)
        return Job(method, setting, self._work(straight or ahead, h > 1.0, ahead), h)


class HeavyPlan:
    """The jobs of a vehicle with six axes and lag: our steps, and RK4 with ever shorter steps."""

    def __init__(self, rov: Vehicle, commands: int, starts: int) -> None:
        short, long = (Work(rov, False, hold, commands, known) for hold, known in ((1.0, starts), (100.0, starts // 4)))
        works = {h: long if h > 1.0 else short for h in H}
        self.ours = {h: Job(CORE, 1.0, work, h) for h, work in works.items()}
        self.rk4 = {h: Job(RK4, max(1.0, round(h / SUBSTEP)), work, h) for h, work in works.items()}
        self.sweep = [Job(RK4, float(2**n), short, SUBSTEP) for n in range(8)]
        self.jobs = list(dict.fromkeys([*self.ours.values(), *self.rk4.values(), *self.sweep]))


class TaylorPlan:
    """The jobs of the comparison with heyoka, while no velocity reverses."""

    def __init__(self, rov: Vehicle, commands: int, starts: int) -> None:
        def job(method: str, h: float) -> Job:
            hold, known = (100.0, starts // 4) if h > 1.0 else (1.0, starts)
            setting = max(1.0, round(h / SUBSTEP)) if method == RK4 else 1.0
            work = Work(rov, False, hold, commands, known, one_way=True)
            return Job(method, setting, work, h)

        methods = (CORE, RK4, *((HEYOKA,) if installed() else ()))
        self.rows = {method: {h: job(method, h) for h in H} for method in methods}
        self.jobs = [job for row in self.rows.values() for job in row.values()]


def cost_at(measured: Measured, jobs: Sequence[Job], target: float = TARGET) -> Reals:
    """Return the seconds at which a method reaches an error, in each repetition.

    The cost is interpolated between settings, on logarithmic axes. A setting is left out if another one is as exact and
    cheaper.
    """
    errors = np.array([measured.error(job) for job in jobs])
    costs = np.array([measured.seconds[job] for job in jobs])
    exact_first = np.argsort(errors)
    typical = np.median(costs, axis=1)[exact_first]
    best = exact_first[typical <= np.minimum.accumulate(typical)]
    return np.array(
        [np.exp(np.interp(np.log(target), np.log(errors[best]), np.log(repetition))) for repetition in costs[best].T]
    )


def compared(measured: Measured, jobs: Sequence[Job], ours: Job, target: float = TARGET) -> tuple[float, float]:
    """Return the median seconds of a method at an error, and their ratio to ours."""
    costs = cost_at(measured, jobs, target)
    return float(np.median(costs)), float(np.median(costs / measured.seconds[ours]))
