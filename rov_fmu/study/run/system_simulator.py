"""Run a system many times, with new instances for each run."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from rov_fmu.bridges.system.master import Master
from rov_fmu.bridges.system.part import Value
from rov_fmu.study.plan.prepared import Job
from rov_fmu.study.plan.system_model import SystemModel, split


class SystemSimulator:
    """An unpacked system, in a process of its own."""

    def __init__(self, folder: str, job: Job, model: SystemModel) -> None:
        self._job, self._model = job, model
        folders = {name: f"{folder}/{name}" for name in model.sources}
        self._master = Master(folders, model.connections, [split(name) for name in job.recorded])
        self._inputs = {split(name): [self._value(name, x) for x in values] for name, values in job.inputs.items()}

    def run(self, values: Sequence[float]) -> dict[str, npt.NDArray[Any]]:
        """Run once and return every recorded variable at every communication point. Raises RunError.

        `values` are those of the varied variables.
        """
        plan = self._job.plan
        start = {component: dict(own) for component, own in self._model.values.items()}
        for name, value in {**plan.set, **dict(zip(self._job.varied, values, strict=True))}.items():
            component, own = split(name)
            start[component][own] = self._value(name, value)
        rows = [self._master.begin(start, plan.step, plan.stop_time, plan.start_time, self._inputs)]
        rows += self._master.step(plan.steps)
        columns = np.array(rows, np.float64).reshape(plan.steps + 1, -1).T
        has = self._model.variables
        return {
            name: column.astype(has[name].dtype(2)) for name, column in zip(self._job.recorded, columns, strict=True)
        }

    def renew(self) -> None:
        """End the instances."""
        self._master.end()

    reset = renew

    def _value(self, name: str, value: float) -> Value:
        """Return a value as the type of a variable has it."""
        kind = self._model.variables[name].type
        return bool(value) if kind == "Boolean" else int(value) if kind == "Integer" else float(value)
