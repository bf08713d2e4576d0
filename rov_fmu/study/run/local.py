"""Do the runs of a study on this machine: of a vehicle in this process, or of an FMU or a system in child processes."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing
from dataclasses import replace
from functools import cache
from time import perf_counter
from typing import TYPE_CHECKING

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
from rov_fmu.study.run.run import Evaluation, Run, rows_of
from rov_fmu.study.run.work import Work
from rov_fmu.vehicle.vehicle import Vehicle

if TYPE_CHECKING:
    from rov_fmu.study.run.child import Children

_AT_ONCE = 4_000_000
"""The number of recorded values that are in memory at a time."""
_MOST = 10_000
"""The most runs at a time, so that no more than a second of work is lost when the process is killed."""


def do_in_processes(work: Work, workers: int | None) -> None:
    """Do all missing runs, each in one of `workers` child processes. Raises FileError, LoadError, WriteError."""
    count = workers or usable_cores()
    with (
        ExitStack() as stack,
        ThreadPoolExecutor(count) as pool,  # it ends after its child processes
        closing(_children(work.study, stack)) as children,
    ):
        work.do_tasks(lambda *task: pool.submit(children.rows, *task), lambda: count)


def do_in_lanes(work: Work, vehicle: Vehicle, workers: int | None) -> None:
    """Do all missing runs, many at once in the vectors of the processor, with `workers` threads.

    Raises BuildError, StudyError, WriteError.
    """
    load_library(vehicle, LANES_FILE)
    study = work.study
    most = max(1, min(_MOST, _AT_ONCE // (len(study.recorded) * len(study.plan.times))))
    work.begin()
    with ExitStack() as stack:
        fmu = cache(lambda: stack.enter_context(closing(_children(replace(study, model=vehicle_fmu(vehicle)), stack))))
        while work.missing:
            began = perf_counter()
            span, values = work.take(most)
            found = runs(study, vehicle, values, workers, lambda rows: fmu().runs(rows))
            work.write(span, rows_of(study, span[0], values, found, perf_counter() - began))


def _children(study: Study, stack: ExitStack) -> "Children":
    """Return the child processes of an FMU or a system. Raises FileError."""
    from rov_fmu.study.run.child import Children

    return Children(study, stack.enter_context(temporary_folder("study-")))


def runs(
    study: Study, vehicle: Vehicle, values: Array, workers: int | None, by_fmu: Callable[[Array], list[Run]]
) -> list[Run]:
    """Return a run for each row of values. The FMU repeats those whose outputs are not finite, and has the reason."""
    try:
        outputs, ended = simulated(study, vehicle, values, workers)
    except MemoryError as error:
        needs = "the outputs of a run need more than the available memory: use longer steps, or keep fewer outputs"
        raise StudyError(needs) from error
    evaluation = Evaluation(study)
    return [
        evaluation.run(row.tolist(), dict(zip(study.recorded, own, strict=True)))
        if does_end
        else by_fmu(row[None])[0]  # each has a time limit of its own
        for row, own, does_end in zip(values, outputs, ended.tolist(), strict=True)
    ]


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
