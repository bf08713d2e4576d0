"""Step the FMUs of a system together: all pass on their outputs, then all take a step with what they got (Jacobi).

So an input gets the output that another FMU had at the beginning of the step. The error is of first order in the step,
and the result does not depend on the order of the FMUs. Ecos and libcosim do the same.
"""

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from math import isinf, isnan
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from rov_fmu.bridges.system.connections import Connection
from rov_fmu.fmus.instance import Array, Instance, RunError, Unpacked, forget_message, last_message
from rov_fmu.fmus.variable import Value
from rov_fmu.io.groups import grouped
from rov_fmu.io.messages import brief

Name = tuple[str, str]
"""A component and a variable."""
_MOST_WARNINGS = 20
"""The most warnings of a run that are kept: an FMU may give another one at every step."""
_BUSY = "busy"
"""The file with the number of the component that is called, for the case that it does not return."""


def folders_of(folder: str | Path, components: Iterable[str]) -> dict[str, Path]:
    """Return the folder of each component, which has a number: a stranger's name could lead out of the folder."""
    return {name: Path(folder, str(n)) for n, name in enumerate(components)}


def busy(folder: str | Path, components: Iterable[str]) -> str:
    """Return the component that a master in another process called last; the whole system if it called none."""
    path = Path(folder, _BUSY)
    number = int(np.fromfile(path, np.int32)[0]) if path.exists() else -1
    return "the system" if number < 0 else [*components][number]


class Master:
    """The instances of a system, which are stepped together."""

    def __init__(
        self, folder: str, components: Sequence[str], connections: Sequence[Connection], read: Sequence[Name]
    ) -> None:
        """`folder` has the unpacked FMU of each component, and `read` names the variables that are returned."""
        self._sources, self._read = {c.end: (c.start, c.factor, c.offset) for c in connections}, read
        self._parts = {name: Unpacked(str(path)) for name, path in folders_of(folder, components).items()}
        self._numbers = {name: n for n, name in enumerate(components)}
        self._busy = np.memmap(Path(folder, _BUSY), np.int32, "w+", shape=1)
        self._busy[0] = -1
        self._guard = os.open(Path(folder, _BUSY), os.O_RDONLY)
        self._wanted = grouped({*read, *(c.start for c in connections)})
        self._fmus: dict[str, Instance] = {}
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
        inputs: Mapping[Name, Array] = MappingProxyType({}),
    ) -> list[float]:
        """Make and initialize the instances, and return the variables at the start. Raises RunError.

        Outputs are passed on during the initialization, so that those which follow an input are right at the start: a
        velocity over ground has the current. Ecos and libcosim do the same.

        `inputs` has the values of inputs that are not connected, one for each step.
        """
        self.end()
        self._start, self._step, self._done, self._warnings = start, step, 0, {}
        self._inputs, self._sets = inputs, grouped([*inputs, *self._sources])
        for name, unpacked in self._parts.items():
            with self._calling(name):
                fmu = self._fmus[name] = Instance(unpacked, logging=True)
                fmu.enter(start, stop, values=partial(fmu.set, values.get(name, {})))
        for _ in self._fmus:  # an output may follow an input through as many components
            self._now = self._outputs()
            self._pass_on()
        for name, fmu in self._fmus.items():
            with self._calling(name):
                fmu.leave()
        self._now = self._outputs()
        return self._row()

    def step(self, count: int) -> list[list[float]]:
        """Take some steps, and return the variables after each one. Raises RunError."""
        rows = []
        for _ in range(count):
            self._pass_on()
            for name, fmu in self._fmus.items():
                with self._calling(name):
                    fmu.step(self._time, self._step)
            self._done += 1
            self._now = self._outputs()
            rows.append(self._row())
        return rows

    def end(self) -> None:
        """End the instances. Raises RunError."""
        ending, self._fmus = self._fmus, {}
        for name, fmu in ending.items():
            with self._calling(name):
                fmu.end()

    def _pass_on(self) -> None:
        """Set all inputs that are connected or given."""
        for component, names in self._sets.items():
            with self._calling(component):
                self._fmus[component].set({name: self._passed((component, name)) for name in names})

    def _passed(self, end: Name) -> Any:
        """Return what an input gets: a given value, or that of the connected output in the unit of the input."""
        if end not in self._sources:
            return self._inputs[end][self._done]
        start, factor, offset = self._sources[end]
        is_plain = (factor, offset) == (1.0, 0.0)
        return self._now[start] if is_plain else factor * self._now[start] + offset

    def _outputs(self) -> dict[Name, Any]:
        now: dict[Name, Any] = {}
        for component, names in self._wanted.items():
            with self._calling(component):
                values = self._fmus[component].read(names)
                for name, value in zip(names, values, strict=True):
                    if isinstance(value, float) and isnan(value):
                        raise RunError(f"reading values at {self._time:.6g} s: {name} is no number (NaN)")
                    if isinstance(value, float) and isinf(value):
                        self._warn(f"{component}: {name} is infinite")
                    now[component, name] = value
        return now

    def _row(self) -> list[float]:
        return [float(self._now[name]) for name in self._read]

    @property
    def _time(self) -> float:
        return self._start + self._done * self._step

    @contextmanager
    def _calling(self, name: str) -> Iterator[None]:
        """Raise RunError, with the component and its own reason, in place of what its call raises.

        Keep what the component warned of if it did not fail.
        """
        self._busy[0] = self._numbers[name]
        forget_message()
        try:
            yield
            os.fstat(self._guard)  # a component that closes it is told, and not the next one
        except Exception as error:  # FMPy raises that itself
            reason = brief(self._parts[name].without_folder(error), 240)
            told = "" if (message := last_message()) in reason else brief(message, 240)
            raise RunError(f"{name}: {reason}{told}") from error
        if text := last_message(f"{name}: "):
            self._warn(text)

    def _warn(self, text: str) -> None:
        if len(self._warnings) < _MOST_WARNINGS:
            self._warnings.setdefault(brief(text, 240), self._time)
