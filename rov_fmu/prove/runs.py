"""Runs of any FMU for Co-Simulation in a child process: of experiments, of their cost, and of impossible values."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache, partial
from itertools import pairwise
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt

from rov_fmu.io.messages import RovError, brief, reason_of

Array = npt.NDArray[np.float64]
WARNING = 1
"""The status `warning` in every version of FMI; more serious ones are greater."""
_STATUS = ("OK", "warning", "discard", "error", "fatal", "pending")
"""The name of each status, in every version of FMI."""
REAL = ("Real", "Float64", "Float32")
NUMBERS = (
    *REAL,
    "Integer",
    "Boolean",
    "Enumeration",
    *(f"{u}Int{size}" for u in ("", "U") for size in (8, 16, 32, 64)),
)
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

    @property
    def length(self) -> float:
        """The time from the start to the end, s."""
        return self.stop - self.start


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


class RunError(RovError):
    """A run that the FMU did not do; the text is the reason in one line."""


class Runs:
    """An unpacked FMU. A child process has it, because an FMU may end its process."""

    def __init__(self, folder: str) -> None:
        import fmpy

        self._folder = folder
        self._description = fmpy.read_model_description(folder, validate=False)
        self._variables = {v.name: v for v in self._description.modelVariables}

    def run(self, plan: Plan, steps: int) -> Array:
        """Return the outputs before the first step and after each one, a row for each; `steps` are those of a piece.

        Every run has an instance of its own. Raises RunError.
        """
        with self._instance(plan) as fmu:
            rows = [self._read(fmu, plan.outputs)]
            rows += (self._read(fmu, plan.outputs) for _ in self._durations(fmu, plan, steps))
        return np.array(rows, dtype=np.float64)

    def durations(self, plan: Plan, steps: int, most: float) -> list[float]:
        """Return the duration of each step of a run, s. The run begins anew until `most` seconds have passed."""
        durations = list[float]()
        began = perf_counter()
        while perf_counter() - began < most:
            with self._instance(plan) as fmu:
                for duration in self._durations(fmu, plan, steps):
                    durations.append(duration)
                    if perf_counter() - began > most:
                        break
        return durations

    def _durations(self, fmu: Any, plan: Plan, steps: int) -> Iterator[float]:
        """Take the steps of a plan, with the inputs of each piece, and yield the duration of each step, s."""
        start = plan.start
        for end, inputs in plan.pieces:
            self._set(fmu, inputs)
            for t, after in pairwise(np.linspace(start, end, steps + 1).tolist()):
                begin = perf_counter()
                self._step(fmu, t, after - t)
                yield perf_counter() - begin
            start = end

    def values_tried(self, plan: Plan, values: Sequence[tuple[str, float]]) -> Answer:
        """Set impossible values of inputs after the initialization, or of parameters during it, one after another."""
        is_input = self._variables[values[0][0]].causality == "input"
        with self._instance(plan, initialized=is_input, logging=True) as fmu:
            answers = [self._asked(fmu, [name], partial(self._set, fmu, {name: value})) for name, value in values]
        refusals = [answer for answer in answers if answer.refused]
        kept = sum(answer.kept for answer in refusals)
        return Answer(len(values), len(refusals), kept, (refusals or answers)[-1].words)

    def step_tried(self, plan: Plan, length: float) -> Answer:
        """Take a step of an impossible length at the start."""
        with self._instance(plan, logging=True) as fmu:
            return self._asked(fmu, plan.outputs, partial(self._step, fmu, plan.start, length))

    def _asked(self, fmu: Any, names: Sequence[str], call: Callable[[], object]) -> Answer:
        """Return the answer to a call that should change none of these variables.

        After an error, FMI lets an FMU refuse to be read.
        """
        from fmpy.fmi1 import FMICallException

        before = now = self._read(fmu, names)
        forget_message()
        words = ""
        try:
            call()
        except FMICallException as error:
            words = brief(status_word(int(error.status)) + last_message(": "), 200)
        except RunError as error:
            words = str(error)
        if not words:
            return Answer(1, 0, 0, _STATUS[0])
        forget_message()
        with suppress(FMICallException):
            now = self._read(fmu, names)
        return Answer(1, 1, int(np.array_equal(now, before, equal_nan=True)), words)

    @contextmanager
    def _instance(self, plan: Plan, *, initialized: bool = True, logging: bool = False) -> Iterator[Any]:
        """Yield an instance with the start values of a plan, initialized or in the initialization. Raises RunError."""
        from fmpy.fmi1 import FMICallException
        from fmpy.simulation import apply_start_values

        fmu = None
        try:
            fmu = new_instance(self._folder, self._description, logging=logging)
            begin_initialization = set_up(fmu, plan.start, plan.stop)
            apply_start_values(fmu, self._description, dict(plan.parameters))
            begin_initialization()
            self._set(fmu, plan.pieces[0][1])
            if initialized:
                fmu.exitInitializationMode()
            yield fmu
        except Exception as error:  # FMPy raises that itself
            message = last_message() if isinstance(error, FMICallException) else ""
            raise RunError(brief(f"{reason_of(error).replace(self._folder, '').rstrip('.')}{message}", 240)) from error
        finally:
            if fmu is not None:
                if initialized:
                    with suppress(Exception):
                        fmu.terminate()
                free_instance(fmu)

    def _read(self, fmu: Any, names: Sequence[str]) -> list[float]:
        return [float(self._function(fmu, "get", name)()[0]) for name in names]

    def _set(self, fmu: Any, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            number = value if self._variables[name].type in REAL else int(value)
            self._function(fmu, "set", name)([number])

    def _function(self, fmu: Any, verb: str, name: str) -> Callable[..., Any]:
        """Return the function that gets or sets a variable, which may be called with its value."""
        variable = self._variables[name]
        return partial(function_of(fmu, verb, variable.type), [variable.valueReference])

    @staticmethod
    def _step(fmu: Any, t: float, h: float) -> None:
        returned = fmu.doStep(currentCommunicationPoint=t, communicationStepSize=h)
        if returned and returned[1]:
            raise RunError(f"the FMU ended the run at {returned[3]:.6g} s")


def new_instance(folder: str, description: Any, *, logging: bool = False) -> Any:
    """Return FMPy's instance of an unpacked FMU, whose warnings are kept. It raises what FMPy raises."""
    from fmpy.simulation import instantiate_fmu

    forget_message()
    return instantiate_fmu(folder, description, "CoSimulation", debug_logging=logging, logger=keep_message)


def set_up(fmu: Any, start: float, stop: float, tolerance: float | None = None) -> Callable[[], object]:
    """Tell an instance the times of a run, s, and return the function with which its initialization begins.

    FMI 2.0 has the times before the start values, and 3.0 as the initialization begins.
    """
    times = {"tolerance": tolerance, "startTime": start, "stopTime": stop}
    if _version(fmu) == "3":
        return partial(fmu.enterInitializationMode, **times)
    fmu.setupExperiment(**times)
    begin: Callable[[], object] = fmu.enterInitializationMode
    return begin


def free_instance(fmu: Any) -> None:
    """Free an instance. The library stays loaded, because loading one again has crashed processes."""
    if fmu.component is not None:
        getattr(fmu, f"fmi{_version(fmu)}FreeInstance")(fmu.component)
        fmu.component = None


def function_of(fmu: Any, verb: str, kind: str) -> Callable[..., Any]:
    """Return FMPy's function that gets or sets variables of a type, which enumerations share with another type."""
    if kind == "Enumeration":
        kind = {"2": "Integer", "3": "Int64"}[_version(fmu)]
    function: Callable[..., Any] = getattr(fmu, f"{verb}{kind}")
    return function


def _version(fmu: Any) -> str:
    """Return the version of FMI of an instance. In 3.0, the initialization itself takes the times."""
    return "2" if hasattr(fmu, "setupExperiment") else "3"


def status_word(status: int) -> str:
    """Return the name of a status."""
    return _STATUS[status] if status < len(_STATUS) else f"status {status}"


def keep_message(*arguments: Any) -> None:
    """Keep a warning. The last three arguments of a logger are the same in every version of FMI."""
    status, _, text = arguments[-3:]
    if status >= WARNING:
        _MESSAGE[0] = (text or b"").decode(errors="replace")


@cache
def _lasting_logger() -> Any:
    """Return FMPy's usual logger of FMI 2.0, which is never freed."""
    from fmpy.fmi2 import fmi2CallbackFunctions, fmi2CallbackLoggerTYPE, printLogMessage

    callbacks = fmi2CallbackFunctions()
    callbacks.logger = fmi2CallbackLoggerTYPE(printLogMessage)
    return callbacks.logger


def restore_logger() -> None:
    """Let FMPy print messages again, after a run with a logger of ours.

    FMPy 0.3 passes the messages of all instances without a logger to the one that it was given last in the process.
    Once that is freed, a message of an FMU that a user runs later would end the process.
    """
    from ctypes import byref

    from fmpy.fmi2 import fmi2CallbackFunctions
    from fmpy.logging import addLoggerProxy

    callbacks = fmi2CallbackFunctions()
    callbacks.logger = _lasting_logger()
    addLoggerProxy(byref(callbacks))


def forget_message() -> None:
    """Forget the last warning, before a call that may give one."""
    _MESSAGE[0] = ""


def last_message(before: str = "; the FMU: ") -> str:
    """Return the last warning as the end of a message, or an empty text."""
    return f"{before}{_MESSAGE[0]}" if _MESSAGE[0] else ""
