"""Run an FMU for Co-Simulation many times in one instance, calling its library with arrays that are allocated once."""

import ctypes
import os
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from fmpy.fmi1 import FMICallException

from rov_fmu.io.messages import RovError, brief, reason_of
from rov_fmu.prove.runs import (
    WARNING,
    Array,
    RunError,
    free_instance,
    last_message,
    new_instance,
    set_up,
    status_word,
)
from rov_fmu.study.plan.model import TYPES, Variable
from rov_fmu.study.plan.prepared import Job
from rov_fmu.study.run.run import LoadError

_Call = Callable[..., int]
"""A function of the FMU, which returns a status."""


@dataclass(frozen=True)
class _Group:
    """Variables of one type with a table of their values: one row, or a row for each point in time."""

    get: _Call
    set: _Call
    names: Sequence[str]
    references: Any
    table: npt.NDArray[Any]

    @property
    def call(self) -> tuple[int, int, int, int]:
        """The address of the references, their number, the address of the first row, and the bytes per row."""
        return self.references.ctypes.data, len(self.names), self.table.ctypes.data, self.table.strides[0]


class Simulator:
    """An instance of an unpacked FMU, in a process of its own. Raises LoadError."""

    def __init__(self, folder: str, description: Any, job: Job) -> None:
        self._folder, self._description, self._job = folder, description, job
        self._version, self._variables = job.model.version, job.model.variables
        self._logs = False
        self._fmu = self._instantiate()
        self._functions = _functions(self._fmu.dll, self._version)
        self._times: list[float] = job.plan.times.tolist()
        self._start = self._groups({**job.plan.set, **dict.fromkeys(job.varied, 0.0)}, 1)
        self._inputs = self._groups(job.inputs, job.plan.steps)
        self._reads = self._groups(dict.fromkeys(job.recorded, 0.0), len(self._times))
        self._columns = {name: (group, n) for group in self._start for n, name in enumerate(group.names)}
        self._changes = self._changing()

    def run(self, values: Sequence[float]) -> dict[str, npt.NDArray[Any]]:
        """Run once and return every recorded variable at every communication point.

        `values` are those of the varied variables. The next run overwrites the returned arrays. Raises RunError.
        """
        try:
            self._run(values)
        except _FailedError as failed:
            reason = self._with_message(values) or str(failed)
            self.renew()
            raise RunError(brief(reason, 240)) from failed
        return {name: group.table[:, n] for group in self._reads for n, name in enumerate(group.names)}

    def reset(self) -> None:
        """Make ready for the next run, with a new instance if the FMU cannot be reset."""
        try:
            self._fmu.terminate()
            self._fmu.reset()
        except FMICallException:
            self.renew()

    def renew(self) -> None:
        """Continue with a new instance."""
        self.free()
        self._fmu = self._instantiate()

    def free(self) -> None:
        """Free the instance."""
        free_instance(self._fmu)

    def _run(self, values: Sequence[float]) -> None:
        component, start = self._fmu.component, self._times[0]
        for name, value in zip(self._job.varied, values, strict=True):
            group, column = self._columns[name]
            group.table[0, column] = value
        for group in self._start:
            references, count, address, _ = group.call
            _check(group.set(component, references, count, address), "setting the start values")
        self._initialize()
        reads = [(group.get, *group.call) for group in self._reads]
        for get, references, count, address, _ in reads:
            _check(get(component, references, count, address), "reading", start)
        do_step, times, step = self._functions["DoStep"], self._times, self._job.plan.step
        for n in range(len(times) - 1):
            for put, references, count, address in self._changes.get(n, ()):
                if (status := put(component, references, count, address)) > WARNING:
                    _check(status, "setting the inputs", times[n])
            if (status := do_step(component, times[n], step, True)) > WARNING:
                _check(status, "the step", times[n])
            for get, references, count, address, row in reads:
                if (status := get(component, references, count, address + (n + 1) * row)) > WARNING:
                    _check(status, "reading", times[n + 1])

    def _initialize(self) -> None:
        fmu, tolerance, start, end = self._fmu, self._job.plan.tolerance, self._times[0], self._times[-1]
        try:
            set_up(fmu, start, end, tolerance)()
            for put, references, count, address in self._changes.get(0, ()):
                _check(put(fmu.component, references, count, address), "setting the inputs", start)
            fmu.exitInitializationMode()
        except FMICallException as error:
            _check(error.status, "initialization")

    def _changing(self) -> dict[int, list[tuple[_Call, int, int, int]]]:
        """Return, by step, the calls that set the inputs which change at the beginning of this step."""
        found = defaultdict(list)
        for group in self._inputs:
            references, count, address, row = group.call
            differs = np.any(group.table[1:] != group.table[:-1], axis=1)
            for n in [0, *(np.flatnonzero(differs) + 1).tolist()]:
                found[n].append((group.set, references, count, address + n * row))
        return dict(found)

    def _groups(self, values: Mapping[str, float | Array], rows: int) -> list[_Group]:
        """Return the variables with these names by type, with their values in all rows."""
        by_type: defaultdict[str, list[Variable]] = defaultdict(list)
        for name in values:
            by_type[self._variables[name].type].append(self._variables[name])
        groups = []
        for some in by_type.values():
            get, put = (self._functions[f"{verb}{some[0].function(self._version)}"] for verb in ("Get", "Set"))
            references = np.array([variable.reference for variable in some], np.uint32)
            table = np.empty((rows, len(some)), some[0].dtype(self._version))
            for column, variable in enumerate(some):
                table[:, column] = values[variable.name]
            groups.append(_Group(get, put, [variable.name for variable in some], references, table))
        return groups

    def _instantiate(self) -> Any:
        try:
            with _loading():
                return new_instance(self._folder, self._description, logging=self._logs)
        except Exception as error:  # FMPy raises that itself
            what = reason_of(error).replace(self._folder + os.sep, "").rstrip(".")
            raise LoadError(brief(f"{what}{last_message()}", 240)) from error

    def _with_message(self, values: Sequence[float]) -> str:
        """Repeat a failed run with logging on, and return the reason with the FMU's last warning."""
        self._logs = True
        self.renew()
        try:
            self._run(values)
        except _FailedError as failed:
            return f"{failed}{last_message()}"
        finally:
            self._logs = False
        return ""


@contextmanager
def _loading() -> Iterator[None]:
    """Restore the working directory, which FMPy changes and may not change back."""
    here = Path.cwd()
    try:
        yield
    finally:
        os.chdir(here)


class _FailedError(RovError):
    """A call of the FMU failed."""


def _check(status: int, what: str, time: float | None = None) -> None:
    if status > WARNING:
        raise _FailedError(f"{what}{'' if time is None else f' at {time:.6g} s'}: {status_word(status)}")


def _functions(library: Any, version: int) -> dict[str, _Call]:
    """Return the FMU's functions that are called at every step, by name without the version.

    Unlike with FMPy, arrays are passed by address.
    """
    pointer, number, size = ctypes.c_void_p, ctypes.c_double, ctypes.c_size_t

    def typed(name: str, *arguments: Any) -> Any:
        function = library[f"fmi{version}{name}"]  # each look-up gives a new object, so FMPy's prototype is not changed
        function.argtypes, function.restype = (pointer, *arguments), ctypes.c_int
        return function

    if version == 2:
        names = [f"{verb}{kind}" for verb in ("Get", "Set") for kind in ("Real", "Integer", "Boolean")]
        steps = {"DoStep": typed("DoStep", number, number, ctypes.c_int)}
        return steps | {name: typed(name, pointer, size, pointer) for name in names}
    names = [f"{verb}{kind}" for verb in ("Get", "Set") for kind in TYPES[3] if kind != "Enumeration"]
    steps = {"DoStep": _step_of_3(typed("DoStep", number, number, ctypes.c_bool, *[pointer] * 4))}
    return steps | {name: _sized(typed(name, pointer, size, pointer, size)) for name in names}


def _sized(function: _Call) -> _Call:
    """Wrap a function of FMI 3.0 for scalars, which have as many values as references."""
    return lambda component, references, count, values: function(component, references, count, values, count)


def _step_of_3(function: _Call) -> _Call:
    flags = (ctypes.c_bool * 3)()
    last = ctypes.c_double()
    event, ends, early = (ctypes.addressof(flags) + n for n in range(3))
    reached = ctypes.addressof(last)

    def step(component: int, time: float, length: float, no_return: bool) -> int:
        status = function(component, time, length, no_return, event, ends, early, reached)
        if flags[1]:
            raise _FailedError(f"the FMU ended the run at {last.value:.6g} s")
        return status

    return step
