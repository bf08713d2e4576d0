"""Runs in a child process: when the FMU ends the process, or does not return, only that run fails."""

from collections.abc import Sequence
from typing import Any

import fmpy
import numpy.typing as npt

from rov_fmu.fmu.proof import DISK, MEMORY
from rov_fmu.io.child_process import ChildError, ChildProcess, LimitError, Limits
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
            raise RunError(self._reason(error)) from error
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
            return ChildProcess(
                _simulator, *self._arguments, limits=Limits(time=self._time_limit, memory=MEMORY, disk=DISK)
            )
        except ChildError as error:
            raise LoadError(self._reason(error)) from error

    def _reason(self, error: ChildError) -> str:
        exceeds_time = isinstance(error, LimitError) and error.limit == "time"
        return f"the FMU {f'did not return within time_limit = {self._time_limit:g} s' if exceeds_time else error}"


def _simulator(folder: str, model: Model, manoeuvre: Manoeuvre) -> Simulator:
    return Simulator(folder, fmpy.read_model_description(folder, validate=False), model, manoeuvre)
