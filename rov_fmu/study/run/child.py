"""Runs in a child process: when the FMU ends the process, or does not return, only that run fails."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rov_fmu.fmus.description import budget
from rov_fmu.fmus.instance import Array, LoadError, RunError
from rov_fmu.fmus.simulation import Simulation
from rov_fmu.io.child_process import ChildError, ChildProcess, LimitError
from rov_fmu.study.plan.prepared import Job
from rov_fmu.study.run.run import Evaluation, Run, failed_run
from rov_fmu.study.run.system import SystemModel, SystemSimulator

_MANY = 10.0
"""The seconds that the runs of a task may take in addition to the limit of one run. A task is made to take 1 s."""


class Child:
    """An instance of the FMU in a child process, which is started again when it ends. Raises LoadError."""

    def __init__(self, folder: str, job: Job) -> None:
        self._folder, self._job = folder, job
        self._process: ChildProcess | None = None
        self._resets = self._can_be_reset()

    def runs(self, rows: Array) -> list[Run]:
        """Run once with each row of values. If the process ends, each row is run alone."""
        limit = self._job.plan.time_limit
        try:
            found: list[Run] = self._call("runs", rows, self._resets, time=limit + (len(rows) > 1) * _MANY)
        except ChildError as error:
            if len(rows) > 1:
                return [run for n in range(len(rows)) for run in self.runs(rows[n : n + 1])]
            return [failed_run(self._job, self._words(error, limit))]
        return found

    def close(self) -> None:
        """End the process."""
        if self._process:
            self._process.close()

    def _can_be_reset(self) -> bool:
        """True if a run after a reset is bit-identical to one of a new instance, in the first trial that ends.

        A system gets new instances for each run.
        """
        if isinstance(self._job.model, SystemModel):
            return False
        for values in self._job.trials:
            try:
                return bool(self._call("can_be_reset", values, self._job.trials[-1], time=self._job.plan.time_limit))
            except (RunError, ChildError):
                continue
        return False

    def _call(self, method: str, *arguments: Any, time: float) -> Any:
        limits = budget(time)
        if not self._process:
            try:
                # In the folder of the worker, which the study removes even where Dask kills the worker.
                beside = str(Path(self._folder).parent)
                self._process = ChildProcess(_Runner, self._folder, self._job, limits=limits, temporary=beside)
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
        return f"{self._job.model.running(self._folder)} {did}"


def simulation(folder: str, job: Job) -> Simulation:
    """Return the runs of an unpacked FMU. Raises LoadError."""
    plan = job.plan
    given = (plan.set, job.inputs, job.recorded, job.varied, plan.tolerance)
    return Simulation(folder, plan.times, plan.step, *given)


class _Runner:
    """The object in the child process: an instance of the FMU, and the figures."""

    def __init__(self, folder: str, job: Job) -> None:
        self._job = job
        self._simulator: Simulation | SystemSimulator
        if isinstance(job.model, SystemModel):
            self._simulator = SystemSimulator(folder, job, job.model)
        else:
            self._simulator = simulation(folder, job)
        self._evaluation = Evaluation(job)

    def can_be_reset(self, values: Array, others: Array) -> bool:
        """Repeat a run in the same instance, after a run with other values, and compare it. Raises RunError."""
        self._simulator.renew()
        first = {name: recorded.copy() for name, recorded in self._simulator.run(values.tolist()).items()}
        for row in (others, values):
            self._simulator.reset()
            again = self._simulator.run(row.tolist())
        self._simulator.renew()
        return all(np.array_equal(first[name], again[name], equal_nan=True) for name in first)

    def runs(self, rows: Array, resets: bool) -> list[Run]:
        """Run once with each row of values."""
        return [self._run(values, resets) for values in rows.tolist()]

    def _run(self, values: Sequence[float], resets: bool) -> Run:
        try:
            outputs = self._simulator.run(values)
        except RunError as error:
            return failed_run(self._job, str(error))
        run = self._evaluation.run(values, outputs)
        if resets:
            self._simulator.reset()
        else:
            self._simulator.renew()
        return run
