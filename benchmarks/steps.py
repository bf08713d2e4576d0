"""What a step costs in plain C: ours, forward Euler, RK4 and CVODE on the same commands, with the errors."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rov_fmu.motion.rov import Coefficients

from .plain_c import Programs, sundials_folder
from .work import Ends, Work

TARGET = 1e-9
"""The error of a held command of 1 s at which costs are compared, m/s."""
SUBSTEP = 0.01
"""Of the explicit methods, at most, s."""
H = (0.001, 0.01, 1.0, 100.0)
TOLERANCES = (1e-6, 1e-9)
# as the C program names them: the FMU, the formulas without FMI, the explicit methods, CVODE's
FMU, CLOSED, EULER, RK4 = "fmu", "closed", "euler", "rk4"
BDF, ADAMS, FIXED_POINT = CVODE = ("bdf", "adams", "adams-fixed")
NAMES = {BDF: "CVODE BDF", ADAMS: "CVODE Adams, Newton", FIXED_POINT: "CVODE Adams"}
_SWEEP = {
    EULER: [10.0, 30.0, 100.0, 300.0, 1e3, 3e3, 1e4, 3e4, 1e5],
    RK4: [3.0, 5.0, 10.0, 20.0, 40.0, 80.0, 160.0, 320.0, 640.0, 1280.0, 2560.0],
    **{method: [10.0**-n for n in range(3, 14)] for method in CVODE},
}
_MANY, _FEW = 16384, 8
_PASS = 4e-3
"""Seconds to measure at a time: short, so that all are measured in the same minute, again and again."""
# Seconds, about: of a step of 3 and of 7 states, of a held command in CVODE, of our turn of 1 s and of 100 s.
_STEP = {EULER: (7e-9, 20e-9), RK4: (23e-9, 65e-9), CLOSED: (20e-9, 250e-9), FMU: (0.0, 250e-9)}
_COMMAND_OF_CVODE = 25e-6
_TURN = {1.0: 4e-6, 100.0: 90e-6}


@dataclass(frozen=True)
class Job:
    """A method on 3 or 7 states, with sub-steps or a tolerance, in communication steps of h s."""

    method: str
    states: int
    setting: float
    work: Work
    h: float

    def commands(self) -> int:
        """How many to time: of our velocities and straight runs so many that no branch is known by heart."""
        steps = self.work.hold / self.h
        if self.method in CVODE:
            seconds = _COMMAND_OF_CVODE * (self.states / 3) * max(1.0, self.work.hold / 10.0)
        elif self.method in (FMU, CLOSED) and self.states == 7 and not self.work.straight and steps == 1:
            seconds = _TURN[self.h]
        else:
            seconds = _STEP[self.method][self.states == 7] * self.setting * steps
        return min(self.work.commands, max(_FEW, round(_PASS / seconds)))

    def text(self, place: int) -> str:
        """For the C program."""
        hold, commands = self.work.hold, self.commands()
        return f"{self.method} {self.states} {self.setting!r} {place} {self.h!r} {hold!r} {commands}"


class Measured:
    """Seconds a communication step in each repetition, and the error, by job."""

    def __init__(self, programs: Programs, jobs: Sequence[Job], repetitions: int) -> None:
        works = list(dict.fromkeys(job.work for job in jobs))
        text = f"{len(works)} {len(jobs)}\n" + "".join(work.text() for work in works)
        text += "\n".join(job.text(works.index(job.work)) for job in jobs)
        ends: dict[int, list[tuple[float, ...]]] = defaultdict(list)
        times: dict[int, list[float]] = defaultdict(list)
        for kind, number, *values in programs.run(
            ["steps.c", "explicit.c"], sundials_folder(), str(repetitions), work=text
        ):
            if kind == "end":
                ends[int(number)].append(tuple(float.fromhex(value) for value in values))
            else:
                times[int(number)].append(1e-9 * float(values[0]))
        self.seconds: dict[Job, NDArray[Any]] = {job: np.array(times[n]) for n, job in enumerate(jobs)}
        self.ends: dict[Job, Ends] = {job: tuple(ends[n]) for n, job in enumerate(jobs)}
        self._errors: dict[Job, float] = {}

    def error(self, job: Job) -> float:
        """The largest error at the end of a held command."""
        if job not in self._errors:
            self._errors[job] = job.work.error(self.ends[job])
        return self._errors[job]

    def cost(self, job: Job) -> float:
        """Seconds a communication step, the median."""
        return float(np.median(self.seconds[job]))

    def ratios(self, job: Job, to: Job) -> NDArray[Any]:
        """Cost of one to that of another, in each repetition."""
        return np.asarray(self.seconds[job] / self.seconds[to])


class Plan:
    """What is measured: the table's jobs and, for the picture, cost against error of a held command of 1 s."""

    def __init__(self, coefficients: Coefficients, commands: int = _MANY, starts: int = 64) -> None:
        def work(straight: bool, hold: float, known: int, ahead: bool = False) -> Work:
            return Work(coefficients, straight, hold, commands, known, ahead)

        self.works = {
            (straight, long): work(straight, 100.0 if long else 1.0, starts // 4 if long else starts)
            for straight in (False, True)
            for long in (False, True)
        }
        self.ahead = {long: work(True, 100.0 if long else 1.0, 4, ahead=True) for long in (False, True)}
        self.sweeps = {
            (states, method): [Job(method, states, setting, self.works[False, False], 1.0) for setting in settings]
            for states in (3, 7)
            for method, settings in _SWEEP.items()
            if states == 3 or method != ADAMS
        }
        rows = [
            self.job(method, states, h, straight)
            for method in (FMU, CLOSED, EULER, RK4)
            for states, straight in ((3, False), (7, False), (7, True))
            for h in H
            if method != FMU or states == 7
        ]
        solvers = [
            self.job(method, states, h, straight, tolerance)
            for method in (BDF, FIXED_POINT)
            for tolerance in TOLERANCES
            for states, straight in ((3, False), (7, False), (7, True))
            for h in H
        ]
        ahead = [self.job_ahead(method, h) for method in (FMU, CLOSED) for h in H]
        swept = [job for jobs in self.sweeps.values() for job in jobs]
        self.jobs = list(dict.fromkeys([*rows, *ahead, *solvers, *swept]))

    def job(self, method: str, states: int, h: float, straight: bool = False, tolerance: float = 0.0) -> Job:
        """A cell of the table. The explicit methods take sub-steps of at most 10 ms."""
        setting = tolerance or (max(1.0, round(h / SUBSTEP)) if method in (EULER, RK4) else 1.0)
        return Job(method, states, setting, self.works[straight, h > 1.0], h)

    def job_ahead(self, method: str, h: float) -> Job:
        """Straight ahead and down, nothing turns back."""
        return Job(method, 7, 1.0, self.ahead[h > 1.0], h)


def cost_at(measured: Measured, jobs: Sequence[Job], target: float = TARGET) -> NDArray[Any]:
    """Seconds at which a method reaches an error, in each repetition: between its settings, on logarithmic axes.

    A setting that costs more than another one which is as exact is left out.
    """
    errors = np.array([measured.error(job) for job in jobs])
    costs = np.array([measured.seconds[job] for job in jobs])
    exact_first = np.argsort(errors)
    typical = np.median(costs, axis=1)[exact_first]
    best = exact_first[typical <= np.minimum.accumulate(typical)]
    return np.array(
        [np.exp(np.interp(np.log(target), np.log(errors[best]), np.log(repetition))) for repetition in costs[best].T]
    )


def compared(measured: Measured, jobs: Sequence[Job], ours: Job) -> tuple[float, float]:
    """Medians at TARGET: the seconds of a method, and how many times ours they are."""
    costs = cost_at(measured, jobs)
    return float(np.median(costs)), float(np.median(costs / measured.seconds[ours]))
