"""The steady motion along one axis: what command, thrust and electric power a speed takes."""

from collections.abc import Iterator, Mapping
from itertools import pairwise
from math import copysign, floor, isclose, isfinite, log10
from types import MappingProxyType
from typing import NamedTuple

from rov_fmu.equation.catalogue import AXES, Axis
from rov_fmu.io.messages import InputError
from rov_fmu.vehicle.vehicle import Vehicle

_GRID = 20
"""The number of intervals of the commands from 0 to full command in which a speed is looked for."""
_CLOSE, _MOST_TRIES = 1e-10, 200
"""The relative error of a speed at which the search ends, and the most commands that it tries."""
_STATED = 0.1
"""How far a top speed may differ from the one that is stated, relative to the larger one."""
_MOST_ROWS = 6
"""The most speeds of a motion in the table."""
_NONE: Mapping[str, float] = MappingProxyType({})


class Steady(NamedTuple):
    """An axis alone that moves at a steady velocity, level and with the other axes at rest."""

    axis: Axis
    velocity: float
    """The velocity through the water, m/s or rad/s."""
    command: float
    """The fraction of the full command of all thrusters along the axis."""
    thrust: float
    """The thrust (N) or torque (N.m) along the axis that holds this velocity, against drag and constant loads."""
    power: float | None
    """The electric power of these thrusters, W; None where the vehicle file has no electric current."""


def steady_at(vehicle: Vehicle, axis: Axis, command: float, inputs: Mapping[str, float] = _NONE) -> Steady:
    """Return the steady motion under a command of an axis; `inputs` has loads and other inputs that differ from usual.

    While nothing pushes, drag and loads would change the velocity: the thrust is what prevents it. So it is that at
    this speed, less than at rest where thrust falls with the speed of advance.
    """
    held = {**vehicle.held_inputs(axis, command), **inputs}
    velocity = vehicle.alone(axis, held).steady_velocity()
    coasting = vehicle.alone(axis, {**vehicle.held_inputs(axis, 0.0), **inputs})
    inertia = vehicle.effective_inertia(axis)
    thrust = -inertia * coasting.acceleration(velocity) if isfinite(velocity) else velocity
    layout = vehicle.layout
    power = vehicle.calculated(held, layout.at_rest)["electric_power"] if layout.electric else None
    return Steady(axis, velocity, command, thrust, power)


def beyond_stated(vehicle: Vehicle) -> Iterator[str]:
    """Yield a sentence for each top speed that differs from the one that somebody states of the real vehicle, with the
    velocities at which the coefficients were measured."""
    for name, stated in vehicle.stated.items():
        axis = AXES[name]
        if not vehicle.layout.signs(axis):
            continue
        velocity, unit = steady_at(vehicle, axis, 1.0).velocity, axis.unit
        if isclose(velocity, stated.value, rel_tol=_STATED):
            continue
        measured = "it is not known up to which speed its coefficients were measured"
        if stated.measured:
            low, high = stated.measured
            measured = f"its coefficients were measured between {low:g} and {high:g} {unit}"
        yield (
            f"At full command, {axis.name} {axis.positive} reaches {velocity:.2f} {unit}, and {stated.source} states "
            f"{stated.value:g} {unit}; {measured}."
        )


class _Search:
    """The commands of one axis that give its steady velocities."""

    def __init__(self, vehicle: Vehicle, axis: Axis, inputs: Mapping[str, float] = _NONE) -> None:
        self._vehicle, self._axis, self._inputs = vehicle, axis, inputs
        commands = [n / _GRID for n in range(_GRID + 1)]
        self._branches = [[(c, self._velocity(c)) for c in (sign * c for c in commands)] for sign in (1.0, -1.0)]

    def _velocity(self, command: float) -> float:
        held = {**self._vehicle.held_inputs(self._axis, command), **self._inputs}
        return self._vehicle.alone(self._axis, held).steady_velocity()

    @property
    def is_mirrored(self) -> bool:
        """True if a negative command gives the mirror image of the motion under a positive one."""
        pairs = zip(*self._branches, strict=True)
        return all(isclose(ahead, -astern, rel_tol=1e-9) for (_, ahead), (_, astern) in pairs)

    def best(self, sign: float) -> tuple[float, float]:
        """Return the command that gives the largest velocity in a direction, and this velocity."""
        return max((point for branch in self._branches for point in branch), key=lambda point: sign * point[1])

    def command(self, velocity: float) -> float | None:
        """Return the weakest command that gives a velocity, or None."""
        around = [
            (low, high)
            for branch in self._branches
            for low, high in pairwise(branch)
            if (low[1] - velocity) * (high[1] - velocity) <= 0.0
        ]
        if not around:
            return None
        (low, below), (high, above) = min(around, key=lambda ends: abs(ends[0][0]))
        below, above = below - velocity, above - velocity
        for _ in range(_MOST_TRIES):
            if below == 0.0:
                return low
            middle = 0.5 * (low + high)
            if isfinite(below) and isfinite(above):  # false position, in which an end that stays counts half (Illinois)
                middle = (low * above - high * below) / (above - below)
            error = self._velocity(middle) - velocity
            if abs(error) <= _CLOSE * max(abs(velocity), _CLOSE):
                return middle
            if error * above < 0.0:
                low, below = high, above
            else:
                below *= 0.5
            high, above = middle, error
        return None


def steady_with(vehicle: Vehicle, axis: Axis, velocity: float, inputs: Mapping[str, float] = _NONE) -> Steady:
    """Return the steady motion at a velocity under the weakest command that gives it.

    Raises InputError if no command does, with the largest velocity in this direction.
    """
    if not vehicle.layout.signs(axis):
        raise InputError(f"no thruster drives {axis.name}")
    search = _Search(vehicle, axis, inputs)
    command = search.command(velocity)
    if command is None:
        at, best = search.best(1.0 if velocity >= 0.0 else -1.0)
        raise InputError(f"no command gives this. In this direction, {_reach(axis, best)} at {at:.0%}")
    return steady_at(vehicle, axis, command, inputs)


def _reach(axis: Axis, velocity: float) -> str:
    return f"{axis.name} reaches {velocity:.3f} {axis.unit}" if isfinite(velocity) else "nothing limits the velocity"


def speed_table(vehicle: Vehicle) -> Iterator[tuple[str, list[Steady]]]:
    """Yield each motion of an axis that was identified, in words, with round speeds up to that of the strongest tested
    command, and with this one."""
    for axis in vehicle.layout.bare_axes:
        if axis in vehicle.unidentified or not vehicle.layout.signs(axis):
            continue
        search = _Search(vehicle, axis)
        low, high = vehicle.tested_along(axis)
        both = search.is_mirrored and low == -high
        for end, words in ((high, axis.positive), (low, axis.negative)):
            last = steady_at(vehicle, axis, end)
            if not isfinite(last.velocity) or last.velocity * end <= 0.0 or (both and end < 0.0):
                continue
            speeds = (copysign(speed, end) for speed in _round_speeds(abs(last.velocity)))
            commands = [command for speed in speeds if (command := search.command(speed)) is not None]
            words = f"{axis.positive} or {axis.negative}" if both else words  # noqa: PLW2901
            yield f"{axis.name} {words}", [*(steady_at(vehicle, axis, one) for one in commands), last]


def _round_speeds(largest: float) -> list[float]:
    """Return round speeds below a largest one: multiples of 1, 2 or 5 times a power of ten."""
    ten = 10.0 ** floor(log10(largest / _MOST_ROWS))
    step = next(factor * ten for factor in (1.0, 2.0, 5.0, 10.0) if largest <= _MOST_ROWS * factor * ten)
    return [speed for n in range(1, _MOST_ROWS) if (speed := round(n * step, 12)) < 0.95 * largest]
