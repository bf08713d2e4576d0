"""Step the FMUs of a system with FMPy: all pass on their outputs, then all take a step with what they got (Jacobi).

So an input gets the output that another FMU had at the beginning of the step. The error is of first order in the step,
and the result does not depend on the order of the FMUs. Ecos and libcosim do the same.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from math import isnan
from types import MappingProxyType
from typing import Any

from rov_fmu.bridges.system.connections import Connection
from rov_fmu.bridges.system.part import Value
from rov_fmu.io.groups import grouped
from rov_fmu.io.messages import brief, reason_of
from rov_fmu.prove.runs import (
    RunError,
    forget_message,
    free_instance,
    function_of,
    last_message,
    new_instance,
    set_up,
)

Name = tuple[str, str]
"""A component and a variable."""
_Values = dict[Name, Any]
_MOST_WARNINGS = 20
"""The most warnings of a run that are kept: an FMU may give another one at every step."""


class Master:
    """The instances of a system, which are stepped together."""

    def __init__(self, folders: Mapping[str, str], connections: Sequence[Connection], read: Sequence[Name]) -> None:
        """`folders` has the unpacked FMU of each component, and `read` names the variables that are returned."""
        import fmpy

        self._folders, self._sources, self._read = folders, {c.end: (c.start, c.factor) for c in connections}, read
        self._descriptions = {
            name: fmpy.read_model_description(folder, validate=False) for name, folder in folders.items()
        }
        self._variables = {
            (name, v.name): v for name, description in self._descriptions.items() for v in description.modelVariables
        }
        self._wanted = {*read, *(c.start for c in connections)}
        self._fmus: dict[str, Any] = {}
        self._warnings: dict[str, float] = {}

    def warnings(self) -> list[str]:
        """Return the different warnings that FMUs gave in a run, each with the start of the step that gave it first."""
        return [f"{text} (at {t:.6g} s)" for text, t in self._warnings.items()]

    def begin(
        self,
        values: Mapping[str, Mapping[str, Value]],
        step: float,
        stop: float,
        start: float = 0.0,
        inputs: Mapping[Name, Sequence[Any]] = MappingProxyType({}),
    ) -> list[float]:
        """Make and initialize the instances, and return the variables at the start. Raises RunError.

        `inputs` has the values of inputs that are not connected, one for each step.
        """
        self.end()
        self._start, self._step, self._done, self._warnings = start, step, 0, {}
        for name in self._folders:
            with self._reasons(name, "the initialization"):
                self._initialize(name, values.get(name, {}), start, stop)
        self._getters = self._calls("get", self._wanted)
        self._setters = self._calls("set", self._sources)
        self._inputs, self._given = inputs, self._calls("set", inputs)
        self._now = self._outputs()
        return self._row()

    def step(self, count: int) -> list[list[float]]:
        """Take some steps, and return the variables after each one. Raises RunError."""
        rows = []
        for _ in range(count):
            for name, names, put in self._given:
                with self._reasons(name, "setting the inputs"):
                    put([self._inputs[one][self._done] for one in names])
            for name, ends, put in self._setters:
                with self._reasons(name, "setting the inputs"):
                    put([self._passed(end) for end in ends])
            for name, fmu in self._fmus.items():
                with self._reasons(name, "the step"):
                    returned = fmu.doStep(currentCommunicationPoint=self._time, communicationStepSize=self._step)
                    if returned and returned[1]:
                        raise RunError("the FMU ended the run")
            self._done += 1
            self._now = self._outputs()
            rows.append(self._row())
        return rows

    def end(self) -> None:
        """End the instances."""
        for fmu in self._fmus.values():
            with suppress(Exception):
                fmu.terminate()
            free_instance(fmu)
        self._fmus = {}

    def _initialize(self, name: str, values: Mapping[str, Value], start: float, stop: float) -> None:
        fmu = self._fmus[name] = new_instance(self._folders[name], self._descriptions[name], logging=True)
        begin_initialization = set_up(fmu, start, stop)
        for _, names, put in self._calls("set", [(name, variable) for variable in values]):
            put([values[variable] for _, variable in names])
        begin_initialization()
        fmu.exitInitializationMode()

    def _calls(self, verb: str, names: Iterable[Name]) -> list[tuple[str, list[Name], Callable[..., Any]]]:
        """Return functions that get or set all variables of a type of a component, with what they get or set."""
        found: list[tuple[str, list[Name], Callable[..., Any]]] = []
        for (component, kind), some in grouped(((name[0], self._variables[name].type), name) for name in names).items():
            references = [self._variables[name].valueReference for name in some]
            found.append((component, some, partial(function_of(self._fmus[component], verb, kind), references)))
        return found

    def _passed(self, end: Name) -> Any:
        """Return what an input gets."""
        start, factor = self._sources[end]
        return self._now[start] if factor == 1.0 else factor * self._now[start]

    def _outputs(self) -> _Values:
        now: _Values = {}
        for name, names, get in self._getters:
            with self._reasons(name, "reading the outputs"):
                for key, value in zip(names, get(), strict=True):
                    if isinstance(value, float) and isnan(value):
                        raise RunError(f"{key[1]} is no number (NaN)")
                    now[key] = value
        return now

    def _row(self) -> list[float]:
        return [float(self._now[name]) for name in self._read]

    @property
    def _time(self) -> float:
        return self._start + self._done * self._step

    @contextmanager
    def _reasons(self, name: str, what: str) -> Iterator[None]:
        """Raise RunError, with the component, what it did and its own reason, in place of what FMPy raises.

        Keep what the component warned of if it did not fail.
        """
        forget_message()
        try:
            yield
        except Exception as error:  # FMPy raises that itself
            reason = brief(reason_of(error).replace(self._folders[name], "").rstrip("."), 240)
            raise RunError(f"{name}: {what} at {self._time:.6g} s: {reason}{brief(last_message(), 240)}") from error
        if (text := last_message(f"{name}: ")) and len(self._warnings) < _MOST_WARNINGS:
            self._warnings.setdefault(brief(text, 240), self._time)
