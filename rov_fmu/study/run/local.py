"""Do the runs of a study on this machine: of a vehicle in this process, or of an FMU or a system in child processes."""

from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rov_fmu.c.compile import LANES_FILE
from rov_fmu.c.library import load_library
from rov_fmu.c.simulation import simulate, usable_cores
from rov_fmu.io.interrupts import temporary_folder
from rov_fmu.io.messages import StudyError
from rov_fmu.study.plan.figures import Array
from rov_fmu.study.plan.model import vehicle_fmu
from rov_fmu.study.plan.study import Study
from rov_fmu.study.run.child import Children
from rov_fmu.study.run.run import Evaluation, Run, rows_of
from rov_fmu.study.run.work import Work
from rov_fmu.vehicle.vehicle import Vehicle

_AT_ONCE = 4_000_000
"""The most recorded values of a task of a vehicle, which are in memory."""
_MOST = 10_000
"""The most runs of such a task, so that no more than a second of work is lost when the process is killed."""


def do_here(work: Work, workers: int | None) -> None:
    """Do all missing runs, with so many threads of a vehicle, or child processes.

    Raises BuildError, FileError, LoadError, StudyError, WriteError.
    """
    study, vehicle = work.study, work.study.model.vehicle
    threads = 1 if vehicle else workers or usable_cores()
    with (
        temporary_folder("study-") as folder,
        ThreadPoolExecutor(threads) as pool,  # it ends after what its threads wait for
        closing(Lanes(study, vehicle, folder, workers) if vehicle else Children(study, folder)) as runner,
    ):
        most = max(1, min(_MOST, _AT_ONCE // (len(study.recorded) * len(study.plan.times)))) if vehicle else None
        work.do_tasks(lambda *task: pool.submit(rows_of, study, runner.runs, *task), lambda: threads, most)


class Lanes:
    """The runs of a vehicle in this process, many at once in the vectors of the processor, without an FMU."""

    def __init__(self, study: Study, vehicle: Vehicle, folder: str, workers: int | None) -> None:
        """The vehicle's FMU is built in a folder if a run needs it. Raises BuildError."""
        self._study, self._vehicle, self._folder, self._workers = study, vehicle, folder, workers
        load_library(vehicle, LANES_FILE)

    def runs(self, values: Array) -> list[Run]:
        """Run once with each row of values. Raises BuildError, LoadError, StudyError.

        The FMU repeats the runs whose outputs are not finite, and has the reason.
        """
        study = self._study
        try:
            outputs, ended = simulated(study, self._vehicle, values, self._workers)
        except MemoryError as error:
            needs = "the outputs of a run need more than the available memory: use longer steps, or keep fewer outputs"
            raise StudyError(needs) from error
        evaluation = Evaluation(study)
        return [
            evaluation.run(row.tolist(), dict(zip(study.recorded, own, strict=True)))
            if does_end
            else self.fmu.runs(row[None])[0]  # each has a time limit of its own
            for row, own, does_end in zip(values, outputs, ended.tolist(), strict=True)
        ]

    @cached_property
    def fmu(self) -> Children:
        """The vehicle's FMU, built for this machine."""
        return Children(replace(self._study, model=vehicle_fmu(self._vehicle)), self._folder)

    def close(self) -> None:
        """End the process of the FMU, if it was needed."""
        if "fmu" in vars(self):
            self.fmu.close()


def simulated(
    study: Study, vehicle: Vehicle, values: Array, workers: int | None = None
) -> tuple[Array, NDArray[np.bool_]]:
    """Simulate a vehicle with each row of values of the varied variables.

    Return the recorded variables, runs x variables x communication points, and whether each run ended with finite ones.
    Raises BuildError, MemoryError.
    """
    held = {name: np.append(signal, signal[-1]) for name, signal in study.inputs.items()}
    varied = {name: column[:, None] for name, column in zip(study.varied, values.T, strict=True)}
    given, times = {**study.plan.set, **held, **varied}, study.plan.times
    count = len(values)
    found = simulate(vehicle, times, given, study.recorded, vehicles=count, workers=workers, lanes=True, ended=True)
    ended = (found.failed == len(times)) & np.isfinite(found.values).all(axis=(0, 2))
    return found.values.transpose(1, 0, 2), ended
