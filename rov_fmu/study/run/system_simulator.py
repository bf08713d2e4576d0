"""Run a system many times, with new instances for each run."""

from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rov_fmu.bridges.system.half_step import half_step
from rov_fmu.bridges.system.master import Master
from rov_fmu.fmus.description import budget
from rov_fmu.fmus.instance import Array, RunError
from rov_fmu.io.child_process import ChildError, ChildProcess, Functions
from rov_fmu.io.interrupts import temporary_folder
from rov_fmu.study.plan.prepared import Job
from rov_fmu.study.plan.system_model import SystemModel, split


class SystemSimulator:
    """An unpacked system, in a process of its own."""

    def __init__(self, folder: str, job: Job, model: SystemModel, parts: int = 1) -> None:
        """Each step of the job is made of some `parts`, between which the FMUs exchange values, too."""
        self._job, self._model, self._parts = job, model, parts
        self._master = Master(folder, [*model.sources], model.connections, [split(name) for name in job.recorded])
        self._inputs = {split(name): np.repeat(values, parts) for name, values in job.inputs.items()}

    def run(self, values: Sequence[float]) -> dict[str, npt.NDArray[Any]]:
        """Run once and return every recorded variable at every communication point. Raises RunError.

        `values` are those of the varied variables.
        """
        plan = self._job.plan
        start = {component: dict(own) for component, own in self._model.values.items()}
        for name, value in {**plan.set, **dict(zip(self._job.varied, values, strict=True))}.items():
            component, own = split(name)
            start[component][own] = value
        rows = [self._master.begin(start, plan.step / self._parts, plan.stop_time, plan.start_time, self._inputs)]
        rows += self._master.step(plan.steps * self._parts)[self._parts - 1 :: self._parts]
        columns = np.array(rows, np.float64).reshape(plan.steps + 1, -1).T
        has = self._model.variables
        return {name: column.astype(has[name].dtype) for name, column in zip(self._job.recorded, columns, strict=True)}

    def renew(self) -> None:
        """End the instances."""
        self._master.end()

    reset = renew


def half_step_words(job: Job, model: SystemModel) -> str:
    """Return a line about what half the step changes in one run of a study; none if nothing is connected."""
    starts = dict.fromkeys(".".join(one.start) for one in model.connections)
    if not (names := [name for name in starts if name in model.variables]):
        return ""
    alike, limits = replace(job, recorded=names), budget(2.0 * job.plan.time_limit)
    with temporary_folder("system-") as folder:
        model.unpack(Path(folder))
        try:
            with closing(ChildProcess(Functions, limits=limits)) as child:
                rows = [child.call("call", _rows, folder, alike, model, parts) for parts in (1, 2)]
        except (ChildError, RunError) as error:
            who = f"{model.running(folder)} " if isinstance(error, ChildError) else ""
            return f"half the step was tried in one run, which cannot be done: {who}{error}"
    half = half_step(rows[0], rows[1], [model.variables[name].unit for name in names])
    return f"in one run, {half.words([*map(split, names)])}"


def _rows(folder: str, job: Job, model: SystemModel, parts: int) -> Array:
    """Return what a run records, a row for each communication point."""
    simulator = SystemSimulator(folder, job, model, parts)
    recorded = simulator.run(job.trials[0])
    simulator.renew()
    return np.array([recorded[name] for name in job.recorded], np.float64).T
