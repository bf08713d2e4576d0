"""Runs in child processes: when the FMU ends its process, or does not return, only that run fails."""

import shutil
import tempfile
from pathlib import Path
from threading import get_ident

from rov_fmu.fmus.description import budget
from rov_fmu.fmus.instance import Array, LoadError, RunError
from rov_fmu.fmus.simulation import Simulation
from rov_fmu.io.child_process import ChildError, ChildProcess, LimitError
from rov_fmu.study.plan.study import Study
from rov_fmu.study.run.run import Evaluation, Run, lost
from rov_fmu.study.run.system import SystemModel, SystemSimulator

_MANY = 10.0
"""The seconds that the runs of a task may take in addition to the limit of one run. A task is made to take 1 s."""


class Children:
    """The child processes of a study on one machine: one for each thread that does runs."""

    def __init__(self, study: Study, parent: str) -> None:
        """Unpack the FMU into a new folder in the folder `parent`. Raises FileError."""
        self._folder = Path(tempfile.mkdtemp(prefix="fmu-", dir=parent)).absolute()
        self.study = study.unpacked(self._folder)
        self._of_threads = dict[int, Child]()

    def runs(self, values: Array) -> list[Run]:
        """Run once with each row of values. Raises LoadError."""
        return self._of_threads.setdefault(get_ident(), Child(self._folder, self.study)).runs(values)

    def close(self) -> None:
        """End the processes, and remove the folder. Other threads that are doing runs get a LoadError."""
        for child in [*self._of_threads.values()]:
            child.close()
        shutil.rmtree(self._folder, ignore_errors=True)


class Child:
    """A child process that does runs, and is started again when it ends."""

    def __init__(self, folder: Path, study: Study) -> None:
        self._folder, self._study, self._is_closed = folder, study, False
        self._process: ChildProcess | None = None

    def runs(self, values: Array) -> list[Run]:
        """Run once with each row of values. If the process ends, each row is run alone. Raises LoadError."""
        plan = self._study.plan
        limits = budget(plan.time_limit + (len(values) > 1) * _MANY)
        process = self._process = self._process or self._started()
        try:
            found: list[Run] = process.call("runs", values, limits=limits)
        except ChildError as error:
            self._process = None
            if len(values) > 1:
                return [run for n in range(len(values)) for run in self.runs(values[n : n + 1])]
            return [lost(self._words(error))]
        return found

    def close(self) -> None:
        """End the process for good."""
        self._is_closed, process, self._process = True, self._process, None
        if process:
            process.close()

    def _started(self) -> ChildProcess:
        if self._is_closed:
            raise LoadError("the study has ended")
        folder, limits = self._folder, budget(self._study.plan.time_limit)
        try:
            # Its own folder is in that of the worker, which the study removes even where Dask kills the worker.
            return ChildProcess(_Runner, str(folder), self._study, limits=limits, temporary=str(folder.parent))
        except ChildError as error:
            raise LoadError(self._words(error)) from error

    def _words(self, error: ChildError) -> str:
        """Return what an FMU did."""
        exceeds_time = isinstance(error, LimitError) and error.limit == "time"
        did = f"did not return within time_limit = {self._study.plan.time_limit:g} s" if exceeds_time else error
        return f"{self._study.model.running(str(self._folder))} {did}"


def simulator(folder: str, study: Study) -> Simulation | SystemSimulator:
    """Return the runs of an unpacked FMU or system. Raises LoadError."""
    if isinstance(study.model, SystemModel):
        return SystemSimulator(folder, study, study.model)
    plan = study.plan
    given = (plan.set, study.inputs, study.recorded, study.varied, plan.tolerance)
    return Simulation(folder, plan.times, plan.step, *given)


class _Runner:
    """The object in the child process: an FMU or a system, and the figures."""

    def __init__(self, folder: str, study: Study) -> None:
        self._simulator, self._evaluation = simulator(folder, study), Evaluation(study)

    def runs(self, values: Array) -> list[Run]:
        """Run once with each row of values."""
        return [self._run(row) for row in values.tolist()]

    def _run(self, values: list[float]) -> Run:
        try:
            return self._evaluation.run(values, self._simulator.run(values))
        except RunError as error:
            return lost(error)
