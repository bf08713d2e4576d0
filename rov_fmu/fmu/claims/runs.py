"""Runs of any FMU for Co-Simulation in a child process: of experiments, of their cost, and of impossible values."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt

from rov_fmu.io.messages import brief

Array = npt.NDArray[np.float64]
_WARNING = 1
"""The status `warning` in every version of FMI; more serious ones are greater."""
_STATUS = ("OK", "warning", "discard", "error", "fatal", "pending")
"""The name of each status, in every version of FMI."""
_REAL = ("Real", "Float64", "Float32")
_WHOLE = ("Integer", "Boolean", "Enumeration", *(f"{u}Int{size}" for u in ("", "U") for size in (8, 16, 32, 64)))
NUMBERS = (*_REAL, *_WHOLE)
"""The types of variables that are numbers, in FMI 2.0 and 3.0."""
_MESSAGE = [""]
"""The FMU's last warning. It is global, because FMPy passes all messages to the latest logger."""


@dataclass(frozen=True)
class Plan:
    """A simulation in pieces, in each of which the inputs are held."""

    start: float
    pieces: Sequence[tuple[float, Mapping[str, float]]]
    """The end of each piece (s), and the inputs within it."""
    parameters: Mapping[str, str]
    """The start values that are set before the initialization, as texts."""
    outputs: Sequence[str]
    """The variables that are read."""

    @property
    def stop(self) -> float:
        """The time at the end, s."""
        return self.pieces[-1][0]


@dataclass(frozen=True)
class Answer:
    """How an FMU answered when something impossible was asked of it."""

    tried: int
    """The number of times, such as one for each variable."""
    refused: int
    kept: int
    """How often the values were as before, after a refusal."""
    words: str
    """The status of the last refusal, or of the last call, with the FMU's message."""


class RunError(Exception):
    """A run that the FMU did not do; the text is the reason in one line."""


class Runs:
    """An unpacked FMU. A child process has it, because an FMU may end its process."""

    def __init__(self, folder: str) -> None:
        import fmpy

        self._folder = folder
        self._description = fmpy.read_model_description(folder, validate=False)
        self._variables = {v.name: v for v in self._description.modelVariables}
        self._version = self._description.fmiVersion[:1]

    def run(self, plan: Plan, steps: int) -> Array:
        """Return the outputs before the first step and after each one, a row for each; `steps` are those of a piece.

        Every run has an instance of its own. Raises RunError.
        """
        with self._instance(plan) as fmu:
            read = self._reader(fmu, plan.outputs)
            rows = [read()]
            for t, h in self._steps(fmu, plan, steps):
                self._step(fmu, t, h)
                rows.append(read())
        return np.array(rows, dtype=np.float64)

    def durations(self, plan: Plan, steps: int, most: float) -> list[float]:
        """Return the duration of each step of a run, s. The run begins anew until `most` seconds have passed."""
        found: list[float] = []
        began = perf_counter()
        while perf_counter() - began < most:
            with self._instance(plan) as fmu:
                for t, h in self._steps(fmu, plan, steps):
                    begin = perf_counter()
                    self._step(fmu, t, h)
                    found.append(perf_counter() - begin)
                    if perf_counter() - began > most:
                        break
        return found

    def _steps(self, fmu: Any, plan: Plan, steps: int) -> Iterator[tuple[float, float]]:
        """Yield the time and the length of each step of a plan, and set the inputs at the beginning of each piece."""
        start = plan.start
        for end, inputs in plan.pieces:
            self._set(fmu, inputs)
            for t, after in pairwise(np.linspace(start, end, steps + 1).tolist()):
                yield t, after - t
            start = end

    def values_tried(self, plan: Plan, values: Sequence[tuple[str, float]]) -> Answer:
        """Set impossible values of inputs after the initialization, or of parameters during it, one after another."""
        is_input = self._variables[values[0][0]].causality == "input"
        refused = kept = 0
        words = ""
        with self._instance(plan, initialized=is_input, logging=True) as fmu:
            for name, value in values:
                read = self._reader(fmu, [name])
                before = read()
                status, answer = self._answer(partial(self._set, fmu, {name: value}))
                if status > _WARNING:
                    refused += 1
                    kept += self._is_unchanged(read, before)
                if status > _WARNING or not refused:
                    words = answer
        return Answer(len(values), refused, kept, words)

    def step_tried(self, plan: Plan, length: float) -> Answer:
        """Take a step of an impossible length at the start."""
        with self._instance(plan, logging=True) as fmu:
            read = self._reader(fmu, plan.outputs)
            before = read()
            status, words = self._answer(partial(self._step, fmu, plan.start, length))
            refused = status > _WARNING
            return Answer(1, int(refused), int(refused and self._is_unchanged(read, before)), words)

    def _is_unchanged(self, read: Callable[[], list[float]], before: list[float]) -> bool:
        """Return True unless values can be read and differ from before. After an error, FMI lets an FMU refuse this."""
        now: list[float] = []
        status, _ = self._answer(lambda: now.extend(read()))
        return status > _WARNING or np.array_equal(now, before, equal_nan=True)

    @staticmethod
    def _answer(call: Callable[[], object]) -> tuple[int, str]:
        """Return the status of a call, and the status in words with the FMU's message."""
        from fmpy.fmi1 import FMICallException

        _MESSAGE[0], status = "", 0
        try:
            call()
        except FMICallException as error:
            status = int(error.status)
        except RunError as error:
            return 2, str(error)
        word = _STATUS[status] if status < len(_STATUS) else f"status {status}"
        return status, brief(f"{word}: {_MESSAGE[0]}" if _MESSAGE[0] and status > _WARNING else word, 200)

    @contextmanager
    def _instance(self, plan: Plan, *, initialized: bool = True, logging: bool = False) -> Iterator[Any]:
        """Yield an instance with the start values of a plan, initialized or in the initialization. Raises RunError."""
        from fmpy.fmi1 import FMICallException
        from fmpy.simulation import apply_start_values, instantiate_fmu

        _MESSAGE[0] = ""
        fmu = None
        try:
            fmu = instantiate_fmu(self._folder, self._description, "CoSimulation", debug_logging=logging, logger=_keep)
            if self._version == "2":
                fmu.setupExperiment(startTime=plan.start, stopTime=plan.stop)
            apply_start_values(fmu, self._description, dict(plan.parameters))
            times = {} if self._version == "2" else {"startTime": plan.start, "stopTime": plan.stop}
            fmu.enterInitializationMode(**times)
            self._set(fmu, plan.pieces[0][1])
            if initialized:
                fmu.exitInitializationMode()
            yield fmu
        except FMICallException as error:
            message = f"; the FMU: {_MESSAGE[0]}" if _MESSAGE[0] else ""
            raise RunError(brief(f"{str(error).rstrip('.')}{message}", 240)) from error
        except RunError:
            raise
        except Exception as error:  # FMPy raises that itself
            raise RunError(brief(str(error).replace(self._folder, "").rstrip("."), 240)) from error
        finally:
            if fmu is not None and fmu.component is not None:
                if initialized:
                    with suppress(Exception):
                        fmu.terminate()
                # The library stays loaded, because loading one again has crashed processes.
                getattr(fmu, f"fmi{self._version}FreeInstance")(fmu.component)

    def _set(self, fmu: Any, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            variable = self._variables[name]
            number = value if variable.type in _REAL else int(value)
            getattr(fmu, f"set{self._function(variable)}")([variable.valueReference], [number])

    def _reader(self, fmu: Any, names: Sequence[str]) -> Callable[[], list[float]]:
        """Return a function that reads variables."""
        groups: dict[str, list[Any]] = {}
        for name in names:
            groups.setdefault(self._function(self._variables[name]), []).append(self._variables[name])
        calls = [(getattr(fmu, f"get{key}"), [v.valueReference for v in some]) for key, some in groups.items()]
        order = [v.name for some in groups.values() for v in some]
        places = [order.index(name) for name in names]

        def read() -> list[float]:
            values = [float(value) for get, references in calls for value in get(references)]
            return [values[place] for place in places]

        return read

    def _function(self, variable: Any) -> str:
        """Return the end of the name of the functions that read and set a variable."""
        of_enumeration = {"2": "Integer", "3": "Int64"}[self._version]
        return of_enumeration if variable.type == "Enumeration" else str(variable.type)

    @staticmethod
    def _step(fmu: Any, t: float, h: float) -> None:
        returned = fmu.doStep(currentCommunicationPoint=t, communicationStepSize=h)
        if returned and returned[1]:
            raise RunError(f"the FMU ended the run at {returned[3]:.6g} s")


def _keep(*arguments: Any) -> None:
    """Keep a warning. The last three arguments of a logger are the same in every version of FMI."""
    status, _, text = arguments[-3:]
    if status >= _WARNING:
        _MESSAGE[0] = (text or b"").decode(errors="replace")
