"""Runs in a child process: when the FMU ends the process, or does not return, only that run fails."""

from pathlib import Path
from typing import Any

import numpy as np

from rov_fmu.fmus.description import budget
from rov_fmu.fmus.instance import Array, LoadError, RunError
from rov_fmu.fmus.simulation import Simulation
from rov_fmu.io.child_process import ChildError, ChildProcess, LimitError
from rov_fmu.study.plan.study import Study
from rov_fmu.study.run.run import FAILED, Evaluation, Run
from rov_fmu.study.run.system import SystemModel, SystemSimulator

_MANY = 10.0
"""The seconds that the runs of a task may take in addition to the limit of one run. A task is made to take 1 s."""


class Child:
    """An instance of the FMU in a child process, which is started again when it ends. Raises LoadError."""

    def __init__(self, folder: str, study: Study) -> None:
        self._folder, self._study = folder, study
        self._process: ChildProcess | None = None
        self._resets = self._can_be_reset()

    def runs(self, rows: Array) -> list[Run]:
        """Run once with each row of values. If the process ends, each row is run alone."""
        limit = self._study.plan.time_limit
        try:
            found: list[Run] = self._call("runs", rows, self._resets, time=limit + (len(rows) > 1) * _MANY)
        except ChildError as error:
            if len(rows) > 1:
                return [run for n in range(len(rows)) for run in self.runs(rows[n : n + 1])]
            return [Run(FAILED, self._words(error, limit))]
        return found

    def close(self) -> None:
        """End the process."""
        if self._process:
            self._process.close()

    def _can_be_reset(self) -> bool:
        """True if a run after a reset is bit-identical to one of a new instance, in the first trial that ends.

        A system gets new instances for each run.
        """
        study = self._study
        for values in () if isinstance(study.model, SystemModel) else study.trials:
            try:
                return bool(self._call("can_be_reset", values, study.trials[-1], time=study.plan.time_limit))
            except (RunError, ChildError):
                continue
        return False

    def _call(self, method: str, *arguments: Any, time: float) -> Any:
        limits = budget(time)
        if not self._process:
            try:
                # In the folder of the worker, which the study removes even where Dask kills the worker.
                beside = str(Path(self._folder).parent)
                self._process = ChildProcess(_Runner, self._folder, self._study, limits=limits, temporary=beside)
            except ChildError as error:
                raise LoadError(self._words(error, time)) from error
        try:
            return self._process.call(method, *arguments, limits=limits)
        except ChildError:
            self._process = None
            raise

    def _words(self, error: ChildError, limit: float) -> str:
        """Return what an FMU did."""
        exceeds_time = isinstance(error, LimitError) and error.limit == "time"
        did = f"did not return within time_limit = {limit:g} s" if exceeds_time else error
        return f"{self._study.model.running(self._folder)} {did}"


def simulator(folder: str, study: Study) -> Simulation | SystemSimulator:
    """Return the runs of an unpacked FMU or system. Raises LoadError."""
    if isinstance(study.model, SystemModel):
        return SystemSimulator(folder, study, study.model)
    plan = study.plan
    given = (plan.set, study.inputs, study.recorded, study.varied, plan.tolerance)
    return Simulation(folder, plan.times, plan.step, *given)


class _Runner:
    """The object in the child process: an instance of the FMU, and the figures."""

    def __init__(self, folder: str, study: Study) -> None:
        self._simulator, self._evaluation = simulator(folder, study), Evaluation(study)

    def can_be_reset(self, values: Array, others: Array) -> bool:
        """Repeat a run in the same instance, after a run with other values, and compare it. Raises RunError."""
        first = {name: recorded.copy() for name, recorded in self._simulator.run(values.tolist()).items()}
        for row in (others, values):
            self._simulator.reset()
            again = self._simulator.run(row.tolist())
        self._simulator.renew()
        return all(np.array_equal(first[name], again[name], equal_nan=True) for name in first)

    def runs(self, rows: Array, resets: bool) -> list[Run]:
        """Run once with each row of values."""
        found = []
        for values in rows.tolist():
            try:
                found.append(self._evaluation.run(values, self._simulator.run(values)))
            except RunError as error:
                found.append(Run(FAILED, str(error)))
            else:
                (self._simulator.reset if resets else self._simulator.renew)()
        return found
