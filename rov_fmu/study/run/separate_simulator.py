"""Runs in a child process: when the FMU ends the process, or does not return, only that run fails."""

from collections.abc import Sequence
from typing import Any

import fmpy
import numpy.typing as npt

from rov_fmu.engine.child_process import ChildError, ChildProcess
from rov_fmu.study.plan.model import Model
from rov_fmu.study.run.simulator import LoadError, Manoeuvre, RunError, Simulator


class SeparateSimulator:
    """A Simulator in a child process. Raises LoadError."""

    def __init__(self, folder: str, model: Model, manoeuvre: Manoeuvre, time_limit: float) -> None:
        self._arguments, self._time_limit = (folder, model, manoeuvre), time_limit
        self._child = self._start()

    def run(self, values: Sequence[float]) -> dict[str, npt.NDArray[Any]]:
        """Run once and return every recorded variable at every communication point. Raises RunError, also if the
        process ends."""
        try:
            found: dict[str, npt.NDArray[Any]] = self._child.call("run", list(values))
        except ChildError as error:
            self._child = self._start()
            raise RunError(str(error)) from error
        return found

    def reset(self) -> None:
        """Make ready for the next run."""
        self._call_or_restart("reset")

    def renew(self) -> None:
        """Continue with a new instance."""
        self._call_or_restart("renew")

    def free(self) -> None:
        """End the process."""
        self._child.close()

    def _call_or_restart(self, method: str) -> None:
        try:
            self._child.call(method)
        except ChildError:
            self._child = self._start()

    def _start(self) -> ChildProcess:
        try:
            return ChildProcess(_simulator, *self._arguments, time_limit=self._time_limit)
        except ChildError as error:
            raise LoadError(str(error)) from error


def _simulator(folder: str, model: Model, manoeuvre: Manoeuvre) -> Simulator:
    return Simulator(folder, fmpy.read_model_description(folder, validate=False), model, manoeuvre)
