"""What an identification tells while it works: its stages, and first answers."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from math import inf, nan

import numpy as np

from rov_fmu.equation.catalogue import Axis
from rov_fmu.equation.units import in_degrees
from rov_fmu.identify.assess import tested_commands
from rov_fmu.identify.likelihood.filter import DivergedError
from rov_fmu.identify.likelihood.objective import Objective
from rov_fmu.identify.likelihood.records import AHEAD
from rov_fmu.identify.likelihood.search import usual
from rov_fmu.identify.likelihood.solve import Minimum
from rov_fmu.identify.result import LEAST_TESTED
from rov_fmu.io.messages import Progress, silent
from rov_fmu.tank.arrays import Array, rms
from rov_fmu.tank.catalogue import MeasuredQuantity

OnAnswer = Callable[[str, str], None]
"""A function that is called with the name of an axis, and with what is known about it so far."""

HYPOTHESES, REFINED = "hypotheses", "exact derivatives"
_USUAL = 0.5
"""The command of which the speed is told, or the strongest tested one if that is weaker."""


class ProgressReport:
    """What an identification tells of its work."""

    def __init__(self, on_progress: Progress = silent, on_answer: OnAnswer | None = None) -> None:
        self._on_progress, self._on_answer = on_progress, on_answer
        self._told: dict[str, str] = {}

    def steps(self, stage: str) -> Callable[[float], None]:
        """Return a function to call at each step of a stage. Nothing tells how many steps there will be."""
        return lambda _: self._on_progress(stage, nan)

    def fits(self, objective: Objective, minimum: Minimum) -> None:
        """Tell the answers of a fit, where they are others than before."""
        for axis, words in so_far(objective, minimum) if self._on_answer else ():
            if self._on_answer and self._told.get(axis.name) != words:
                self._told[axis.name] = words
                self._on_answer(axis.name, words)


def so_far(objective: Objective, minimum: Minimum) -> Iterator[tuple[Axis, str]]:
    """Yield what a fit tells of each axis, such as `heave 0.46 m/s at 50%, fits the depth to 2 cm`.

    The speed is that at half the full command, or at the strongest tested one if that is weaker. The fit is judged by
    the errors of predictions over 10 s.
    """
    with suppress(DivergedError):
        vehicle, shapes = objective.table.model(minimum.z)
        errors = _errors(objective, minimum)
        for axis, (astern, ahead) in tested_commands(objective, minimum.z).items():
            sign = 1.0 if ahead >= LEAST_TESTED else -1.0
            command = sign * min(ahead if sign > 0.0 else astern, _USUAL)
            speed = abs(float(shapes.motions(vehicle, axis, np.array([command])).response()[0][0]))
            if abs(command) >= LEAST_TESTED and 0.0 < speed < inf:
                fits = f", fits the {errors[axis]}" if axis in errors else ""
                yield axis, f"{axis.name} {speed:.2g} {axis.unit} at {command:.0%}{fits}"


def _errors(objective: Objective, minimum: Minimum) -> dict[Axis, str]:
    """Return by how much predictions over 10 s are wrong (RMS), in words, with the first quantity of each axis."""
    errors = dict[Axis, dict[MeasuredQuantity, list[Array]]]()
    for n, (sampled, record) in enumerate(zip(objective.logs, objective.records, strict=True)):
        begin, counts = usual(minimum, n, record)
        off = objective.run(minimum.z, n, begin=begin, span=AHEAD).innovations
        for number, m in enumerate(sampled.measured):
            if len(own := off[counts & (record.sensor == number)]):
                errors.setdefault(m.axis, {}).setdefault(m.quantity, []).append(own)
    return {axis: _in_words(*next(iter(own.items()))) for axis, own in errors.items()}


def _in_words(quantity: MeasuredQuantity, errors: Sequence[Array]) -> str:
    """Return the errors of a quantity, such as `depth to 2 cm`."""
    error, unit = rms(np.concatenate(errors)), quantity.unit
    factor, unit = (100.0, "cm") if unit == "m" and error < 1.0 else in_degrees(unit)
    return f"{quantity.name} to {factor * error:.2g} {unit}"
