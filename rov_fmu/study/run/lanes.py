"""Do the runs of a vehicle in this process, many at once in the vectors of the processor, without an FMU."""

from contextlib import ExitStack, closing
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rov_fmu.c.compile import LANES_FILE
from rov_fmu.c.library import load_library
from rov_fmu.c.simulation import simulate
from rov_fmu.io.interrupts import temporary_folder
from rov_fmu.io.messages import StudyError
from rov_fmu.study.plan.figures import Array
from rov_fmu.study.plan.model import vehicle_fmu
from rov_fmu.study.plan.prepared import Job
from rov_fmu.study.run.run import Evaluation, Run, rows_of
from rov_fmu.study.run.work import Work
from rov_fmu.vehicle.vehicle import Vehicle

if TYPE_CHECKING:
    from rov_fmu.study.run.child import Child

_AT_ONCE = 4_000_000
"""The number of recorded values that are in memory at a time."""
_MOST = 10_000
"""The most runs at a time, so that no more than a second of work is lost when the process is killed."""


def do_in_lanes(work: Work, vehicle: Vehicle, workers: int | None) -> None:
    """Do all missing runs, with `workers` threads. Raises BuildError, StudyError, WriteError."""
    began = perf_counter()
    load_library(vehicle, LANES_FILE)
    work.spent.started = perf_counter() - began
    job = work.job
    most = max(1, min(_MOST, _AT_ONCE // (len(job.recorded) * len(job.plan.times))))
    with ExitStack() as stack, work.watched():
        runs = _Runs(job, vehicle, workers, stack)
        while work.missing:
            first, end = work.take(most)
            began = perf_counter()
            values = work.design.rows(first, end)
            found = runs.do(values)
            work.write(first, end, rows_of(job, first, values, found, perf_counter() - began))
            work.spent.elapsed += perf_counter() - began


def simulated(job: Job, vehicle: Vehicle, values: Array, workers: int | None = None) -> tuple[Array, NDArray[np.bool_]]:
    """Simulate a vehicle with each row of values of the varied variables.

    Return the recorded variables, runs x variables x communication points, and whether each run ended with finite ones.
    Raises BuildError, MemoryError.
    """
    held = {name: np.append(signal, signal[-1]) for name, signal in job.inputs.items()}
    varied = {name: column[:, None] for name, column in zip(job.varied, values.T, strict=True)}
    given, times = {**job.plan.set, **held, **varied}, job.plan.times
    count = len(values)
    found = simulate(vehicle, times, given, job.recorded, vehicles=count, workers=workers, lanes=True, ended=True)
    ended = (found.failed == len(times)) & np.isfinite(found.values).all(axis=(0, 2))
    return found.values.transpose(1, 0, 2), ended


class _Runs:
    """Does runs of a vehicle. The FMU repeats those whose outputs are not finite, and tells the reason."""

    def __init__(self, job: Job, vehicle: Vehicle, workers: int | None, stack: ExitStack) -> None:
        self._job, self._vehicle, self._workers, self._stack = job, vehicle, workers, stack
        self._evaluation = Evaluation(job)
        self._fmu: Child | None = None

    def do(self, values: Array) -> list[Run]:
        """Return a run for each row of values of the varied variables."""
        job = self._job
        try:
            outputs, ended = simulated(job, self._vehicle, values, self._workers)
        except MemoryError as error:
            needs = "the outputs of a run need more than the available memory: use longer steps, or keep fewer outputs"
            raise StudyError(needs) from error
        repeated = iter(self._repeated(values[~ended]))
        return [
            self._evaluation.run(row, dict(zip(job.recorded, own, strict=True))) if does_end else next(repeated)
            for row, own, does_end in zip(values.tolist(), outputs, ended.tolist(), strict=True)
        ]

    def _repeated(self, values: Array) -> list[Run]:
        """Return the runs that the FMU does, for each row of values. Raises BuildError, LoadError."""
        if not len(values):
            return []
        if not self._fmu:
            from rov_fmu.study.run.child import Child

            model = replace(self._job.model, content=b"")
            self._fmu = Child(str(self._unpacked()), replace(self._job, model=model))
            self._stack.enter_context(closing(self._fmu))
        return [run for row in values for run in self._fmu.runs(row[None])]  # each has a time limit of its own

    def _unpacked(self) -> Path:
        """Return a folder with the FMU, which is built for this machine. Raises BuildError."""
        folder = Path(self._stack.enter_context(temporary_folder("study-")), "fmu")
        folder.mkdir()
        vehicle_fmu(self._vehicle).unpack(folder)
        return folder
