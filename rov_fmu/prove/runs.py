"""Runs of any FMU for Co-Simulation in a child process: of experiments, of their cost, and of impossible values."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from time import perf_counter

import numpy as np

from rov_fmu.fmus.instance import (
    Array,
    CallError,
    Instance,
    LoadError,
    RunError,
    Unpacked,
    forget_message,
    last_message,
    status_word,
)
from rov_fmu.io.messages import brief


@dataclass(frozen=True)
class PlannedRun:
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
class Reaction:
    """How an FMU answered when something impossible was asked of it."""

    tried: int
    """The number of times, such as one for each variable."""
    refused: int
    kept: int
    """How often the values were as before, after a refusal."""
    words: str
    """The status of the last refusal, or of the last call, with the FMU's message."""


class Runs(Unpacked):
    """An unpacked FMU. A child process has it, because an FMU may end its process."""

    def run(self, plan: PlannedRun, steps: int) -> Array:
        """Return the outputs before the first step and after each one, a row for each; `steps` are those of a piece.

        Every run has an instance of its own. Raises RunError.
        """
        with self._instance(plan) as fmu:
            rows = [fmu.read(plan.outputs)]
            rows += (fmu.read(plan.outputs) for _ in self._durations(fmu, plan, steps))
        return np.array(rows, dtype=np.float64)

    def durations(self, plan: PlannedRun, steps: int, most: float) -> list[float]:
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

    def _durations(self, fmu: Instance, plan: PlannedRun, steps: int) -> Iterator[float]:
        """Take the steps of a plan, with the inputs of each piece, and yield the duration of each step, s."""
        start = plan.start
        for end, inputs in plan.pieces:
            fmu.set(inputs)
            for t, after in pairwise(np.linspace(start, end, steps + 1).tolist()):
                begin = perf_counter()
                fmu.step(t, after - t)
                yield perf_counter() - begin
            start = end

    def values_tried(self, plan: PlannedRun, values: Sequence[tuple[str, float]]) -> Reaction:
        """Set impossible values of inputs after the initialization, or of parameters during it, one after another."""
        is_input = self.variables[values[0][0]].causality == "input"
        with self._instance(plan, initialized=is_input, logging=True) as fmu:
            answers = [self._asked(fmu, [name], partial(fmu.set, {name: value})) for name, value in values]
        refusals = [answer for answer in answers if answer.refused]
        kept = sum(answer.kept for answer in refusals)
        return Reaction(len(values), len(refusals), kept, (refusals or answers)[-1].words)

    def step_tried(self, plan: PlannedRun, length: float) -> Reaction:
        """Take a step of an impossible length at the start."""
        with self._instance(plan, logging=True) as fmu:
            return self._asked(fmu, plan.outputs, partial(fmu.step, plan.start, length))

    def _asked(self, fmu: Instance, names: Sequence[str], call: Callable[[], object]) -> Reaction:
        """Return the answer to a call that should change none of these variables.

        After an error, FMI lets an FMU refuse to be read.
        """
        before = now = fmu.read(names)
        forget_message()
        words = ""
        try:
            call()
        except CallError as error:
            words = brief(status_word(error.status) + last_message(": "), 200) if error.status else str(error)
        if not words:
            return Reaction(1, 0, 0, status_word(0))
        forget_message()
        with suppress(CallError):
            now = fmu.read(names)
        return Reaction(1, 1, int(np.array_equal(now, before, equal_nan=True)), words)

    @contextmanager
    def _instance(self, plan: PlannedRun, *, initialized: bool = True, logging: bool = False) -> Iterator[Instance]:
        """Yield an instance with the start values of a plan, initialized or in the initialization. Raises RunError."""
        from fmpy.fmi1 import FMICallException
        from fmpy.simulation import apply_start_values

        instance = None
        try:
            instance = Instance(self, logging=logging)
            begin_initialization = instance.set_up(plan.start, plan.stop)
            apply_start_values(instance.fmu, self.description, dict(plan.parameters))
            begin_initialization()
            instance.set(plan.pieces[0][1])
            if initialized:
                instance.fmu.exitInitializationMode()
            yield instance
        except LoadError as error:
            raise RunError(str(error)) from error
        except Exception as error:  # FMPy raises that itself
            message = last_message() if isinstance(error, (FMICallException, CallError)) else ""
            raise RunError(brief(f"{self.without_folder(error)}{message}", 240)) from error
        finally:
            if instance is not None:
                instance.end() if initialized else instance.free()
