"""An instance of an unpacked FMU in this process, whose library is called with arrays that are allocated once.

FMPy loads the library, instantiates and initializes. What is called in each step is called by address: FMPy makes new
arrays for each call, so that a step of the VideoRay with three inputs and seven outputs takes 6.6 µs in place of 2.5.
"""

import ctypes
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, redirect_stdout, suppress
from dataclasses import dataclass
from functools import cache, partial
from io import StringIO
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rov_fmu.fmus.variable import Described
from rov_fmu.io.groups import grouped
from rov_fmu.io.messages import RovError, brief, reason_of

Array = npt.NDArray[np.float64]
WARNING = 1
"""The status `warning` in every version of FMI; more serious ones are greater."""
_ROUNDING = 1e-6
"""By what share of its length a step may pass the end of a run by rounding."""
_STATUS = ("OK", "warning", "discard", "error", "fatal", "pending")
"""The name of each status, in every version of FMI."""
_MESSAGE = [""]
"""The FMU's last warning. It is global, because FMPy passes all messages to the latest logger."""


class LoadError(RovError):
    """The FMU cannot be instantiated on this machine."""


class RunError(RovError):
    """A run that the FMU did not do; the text is the reason in one line."""


class CallError(RunError):
    """A call that the FMU did not do."""

    status = 0
    """What it returned, or 0 if it ended the run."""


@dataclass(frozen=True)
class VariableTable:
    """Variables of one type with their values, in one row or in a row for each point in time."""

    names: list[str]
    values: npt.NDArray[Any]
    get: Callable[[int], int]
    """Reads the variables of the FMU into a row, and returns the status."""
    set: Callable[[int], int]
    """Sets the variables of the FMU to a row, and returns the status."""


class Unpacked(Described):
    """An unpacked FMU in this process, with its variables."""

    def __init__(self, folder: str) -> None:
        import fmpy

        self.folder = folder
        self.description = fmpy.read_model_description(folder, validate=False)

    def simulated(self, **how: Any) -> Any:
        """Run the FMU by FMPy, whose solver Model Exchange needs, and return its table. It raises what FMPy raises."""
        import fmpy

        forget_message()
        with redirect_stdout(StringIO()):  # FMPy's warnings
            return fmpy.simulate_fmu(
                self.folder,
                validate=False,
                model_description=self.description,
                remote_platform=None,
                logger=keep_message,
                **how,
            )

    def without_folder(self, error: BaseException) -> str:
        """Return the reason of an exception, without the folder, which means nothing to a user."""
        reason = reason_of(error).replace(self.folder + os.sep, "").replace(self.folder, "")
        return reason.rstrip(".")


class Instance:
    """An instance of an FMU. Raises LoadError."""

    def __init__(self, unpacked: Unpacked, *, logging: bool = False) -> None:
        self._unpacked, self._version = unpacked, unpacked.description.fmiVersion[:1]
        self.fmu: Any = None
        self.renew(logging=logging)
        self._kept, self.time = cache(self.tables), 0.0
        self._stop = inf
        self.do_step: Callable[[float, float], int] = self._stepping()
        """Takes a step from a time over a length, s, and returns the status. Raises CallError if the run ends.

        Where rounding would carry it past the end of the run, which FMI forbids, it ends there."""

    def renew(self, *, logging: bool = False) -> None:
        """Make a new instance in place of one that was freed. Tables remain valid. Raises LoadError.

        FMPy loads the library once, which takes 2 ms, because it declares each function of FMI.
        """
        from fmpy.simulation import instantiate_fmu

        forget_message()
        here = Path.cwd()
        try:
            if self.fmu is None:
                folder, description = self._unpacked.folder, self._unpacked.description
                self.fmu = instantiate_fmu(
                    folder, description, "CoSimulation", debug_logging=logging, logger=keep_message
                )
            else:
                logger = {"callbacks": self.fmu.callbacks} if self._version == "2" else {"logMessage": keep_message}
                self.fmu.instantiate(loggingOn=logging, **logger)
        except Exception as error:  # FMPy raises that itself
            raise LoadError(brief(f"{self._unpacked.without_folder(error)}{last_message()}", 240)) from error
        finally:
            os.chdir(here)  # FMPy changes the folder, and may not change it back

    def read(self, names: Iterable[str]) -> list[Any]:
        """Return the values of variables. Raises CallError."""
        found: dict[str, Any] = {}
        for table in self._kept(tuple(names)):
            check_status(table.get(0), "reading values", self.time)
            found |= zip(table.names, table.values[0].tolist(), strict=True)
        return [found[name] for name in names]

    def set(self, values: Mapping[str, Any]) -> None:
        """Set variables. Raises CallError."""
        for table in self._kept(tuple(values)):
            table.values[0] = [values[name] for name in table.names]
            check_status(table.set(0), "setting values", self.time)

    def tables(self, names: Iterable[str], rows: int = 1) -> list[VariableTable]:
        """Return tables of variables, one for each of their types, whose values are 0 or None at first."""
        by_type = grouped((self._unpacked.variables[name].type, name) for name in names)
        return [self._table(kind, some, rows) for kind, some in by_type.items()]

    def _table(self, kind: str, names: list[str], rows: int) -> VariableTable:
        variables = [self._unpacked.variables[name] for name in names]
        references = np.array([v.reference for v in variables], np.uint32)
        values = np.zeros((rows, len(names)), variables[0].dtype)
        count, row_size, fmu = len(names), values.strides[0], self.fmu
        more = (count,) if self._version == "3" else ()  # as many values as references: all are scalars

        def call(verb: str) -> Callable[[int], int]:
            pointer = ctypes.c_void_p
            sizes = [ctypes.c_size_t] * len(more)
            function = self._function(f"{verb}{kind}", pointer, ctypes.c_size_t, pointer, *sizes)
            function.arrays = references, values  # they live as long as the function
            at, first = references.ctypes.data, values.ctypes.data

            def of_row(row: int) -> int:
                status: int = function(fmu.component, at, count, first + row * row_size, *more)
                return status

            return of_row

        if kind != "String":
            return VariableTable(names, values, call("Get"), call("Set"))

        def get(row: int) -> int:
            values[row] = fmu.getString(references.tolist())
            return 0

        def put(row: int) -> int:
            fmu.setString(references.tolist(), values[row].tolist())
            return 0

        return VariableTable(names, values, get, put)

    def begin(
        self,
        start: float,
        stop: float | None,
        tolerance: float | None = None,
        values: Callable[[], object] = lambda: None,
        inputs: Callable[[], object] = lambda: None,
    ) -> None:
        """Initialize the instance. Raises CallError.

        `values` is called before the initialization, and `inputs` in it.
        """
        self.enter(start, stop, tolerance, values)
        inputs()
        self.leave()

    def enter(
        self,
        start: float,
        stop: float | None,
        tolerance: float | None = None,
        values: Callable[[], object] = lambda: None,
    ) -> None:
        """Begin the initialization, before which `values` is called. Raises CallError."""
        with _initializing():
            enter = self.set_up(start, stop, tolerance)
            values()
            enter()

    def leave(self) -> None:
        """End the initialization. Raises CallError."""
        with _initializing():
            self.fmu.exitInitializationMode()

    def set_up(self, start: float, stop: float | None, tolerance: float | None = None) -> Callable[[], object]:
        """Tell the instance the times of a run, s, and return the function with which its initialization begins.

        FMI 2.0 has the times before the start values, and 3.0 as the initialization begins.
        """
        self.time, self._stop = start, inf if stop is None else stop
        times = {"tolerance": tolerance, "startTime": start, "stopTime": stop}
        if self._version == "3":
            return partial(self.fmu.enterInitializationMode, **times)
        self.fmu.setupExperiment(**times)
        enter: Callable[[], object] = self.fmu.enterInitializationMode
        return enter

    def step(self, time: float, length: float) -> None:
        """Take a step. Raises CallError."""
        check_status(self.do_step(time, length), "the step", time)
        self.time = time + length

    def free(self) -> None:
        """Free the instance. The library stays loaded, because loading one again has crashed processes."""
        if self.fmu.component is not None:
            getattr(self.fmu, f"fmi{self._version}FreeInstance")(self.fmu.component)
            self.fmu.component = None

    def end(self) -> None:
        """Terminate and free the instance."""
        with suppress(Exception):  # an FMU that has failed may refuse
            self.fmu.terminate()
        self.free()

    def _function(self, name: str, *arguments: Any) -> Any:
        """Return a function of the FMU, which returns a status. Unlike with FMPy, arrays are passed by address."""
        function = self.fmu.dll[f"fmi{self._version}{name}"]  # a new object each time: FMPy's prototype is not changed
        function.argtypes, function.restype = (ctypes.c_void_p, *arguments), ctypes.c_int
        return function

    def _stepping(self) -> Callable[[float, float], int]:
        number, pointer, fmu = ctypes.c_double, ctypes.c_void_p, self.fmu

        def within(time: float, length: float) -> float:
            last = self._stop - time
            return last if last < length < last + _ROUNDING * length else length

        if self._version == "2":
            two = self._function("DoStep", number, number, ctypes.c_int)
            return lambda time, length: two(fmu.component, time, within(time, length), True)
        three = self._function("DoStep", number, number, ctypes.c_bool, *[pointer] * 4)
        flags, last = (ctypes.c_bool * 3)(), number()
        told = [ctypes.addressof(flags) + n for n in range(3)], ctypes.addressof(last)

        def step(time: float, length: float) -> int:
            status: int = three(fmu.component, time, within(time, length), True, *told[0], told[1])
            if flags[1]:
                raise CallError(f"the FMU ended the run at {last.value:.6g} s")
            return status

        return step


@contextmanager
def _initializing() -> Iterator[None]:
    """Raise CallError in place of what FMPy raises."""
    from fmpy.fmi1 import FMICallException

    try:
        yield
    except FMICallException as error:
        check_status(error.status, "initialization")


def check_status(status: int, what: str, time: float | None = None) -> None:
    """Raise CallError if a status is worse than a warning."""
    if status > WARNING:
        error = CallError(f"{what}{'' if time is None else f' at {time:.6g} s'}: {status_word(status)}")
        error.status = status
        raise error


def status_word(status: int) -> str:
    """Return the name of a status."""
    return _STATUS[status] if status < len(_STATUS) else f"status {status}"


def keep_message(*arguments: Any) -> None:
    """Keep a warning. The last three arguments of a logger are the same in every version of FMI."""
    status, _, text = arguments[-3:]
    if status >= WARNING:
        _MESSAGE[0] = (text or b"").decode(errors="replace")


def forget_message() -> None:
    """Forget the last warning, before a call that may give one."""
    _MESSAGE[0] = ""


def last_message(before: str = "; the FMU: ") -> str:
    """Return the last warning as the end of a message, or an empty text."""
    return f"{before}{_MESSAGE[0]}" if _MESSAGE[0] else ""
