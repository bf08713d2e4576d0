"""What each output of a log moves, by regression, and the thrusters that would do so: a guess for a draft of rov.toml.

Each axis is taken alone, without what the others do to it: v' = sum b_i f(u_i) - d v + c, where f is the usual thrust
at a command. Both sides are integrated with a smooth window w that vanishes at its ends together with two derivatives,
so that no measurement is differentiated: the integral of w v' is that of -w' v, or of w'' z for a position z
(modulating functions, Shinbrot 1957, Trans. ASME 79, 547).
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rov_fmu.equation.catalogue import HEAVE, SURGE, SWAY, YAW, Axis
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import SourcedVector, Thruster, VehicleAxis
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.clocks import first_in_each
from rov_fmu.tank.log import Channel, Log
from rov_fmu.tank.rest import without_rests
from rov_fmu.vehicle.full_thrust import usual_thrust
from rov_fmu.vehicle.geometry import undriven_axes

LINEAR = (SURGE, SWAY, HEAVE)
GUESSED = (*LINEAR, YAW)
"""The axes of which a draft guesses what moves the vehicle along them."""
RADIUS = 0.14
"""The usual radius of gyration about the vertical axis, m: 0.12 to 0.17 in the vehicles that ship."""
_ARM, _LONGEST = 0.15, 0.4
"""The arm of a thruster that turns the vehicle where nothing tells it, and the longest one, m."""
_SPANS, _POINTS, _STEP, _GAP = (1.0, 2.0, 4.0), 41, 0.5, 1.0
"""The lengths of the windows that are tried, s: a long one suits a slow axis and a noisy sensor. The number of their
points, the time between two of them, s, and the longest time without a sample in one, s."""
_MOST_WINDOWS, _LEAST_WINDOWS = 3000, 24
"""The most windows of a log, and the least of all logs that tell anything."""
_ALIKE = 0.1
"""The least singular value, relative to the largest one, of combinations of commands that are told apart."""
_CLEAR, _LEAST_PART = 3.0, 0.2
"""An output moves an axis if its effect is so many standard errors, and this part of the largest one on this axis."""


@dataclass(frozen=True)
class Moved:
    """The acceleration along each axis that the full command of an output causes, m/s² or rad/s²."""

    shown: frozenset[Axis]
    """The axes that the logs show."""
    by_output: Mapping[str, Mapping[Axis, float]]
    """The axes that each output clearly moves, with the accelerations."""

    @cached_property
    def thrusters(self) -> dict[str, Thruster]:
        """The thrusters that would do so, without those of which no log shows what they move."""
        found = ((name, self._thruster(name, effects)) for name, effects in self.by_output.items())
        return {name: thruster for name, thruster in found if thruster}

    @cached_property
    def pushed(self) -> frozenset[Axis]:
        """The axes along which the guessed thrusters push alone."""
        if not self.thrusters:
            return frozenset()
        layout = Layout(tuple(VehicleAxis(axis) for axis in GUESSED), (), tuple(self.thrusters.values()))
        return frozenset(GUESSED) - dict(undriven_axes(layout)).keys()

    @property
    def undriven(self) -> list[Axis]:
        """The axes along which no output pushes alone; none where the outputs do not tell."""
        if len(self.thrusters) < max(len(self.by_output), 1):
            return []
        driven = {axis for effects in self.by_output.values() for axis in effects}
        return [axis for axis in GUESSED if axis not in self.pushed or (axis in self.shown and axis not in driven)]

    def _thruster(self, name: str, effects: Mapping[Axis, float]) -> Thruster | None:
        """Return a thruster with the direction of its push, and beside the centre of mass if it turns the vehicle."""
        push = np.array([effects.get(axis, 0.0) for axis in LINEAR])
        turn, size = effects.get(YAW, 0.0), float(np.max(np.abs(push)))
        if not (size or turn):
            return None
        arm = float(np.clip(RADIUS**2 * turn / size, -_LONGEST, _LONGEST)) if size else np.sign(turn) * _ARM
        if not size:  # what pushes along an axis that a log shows would be seen there
            push = np.array([0.0, 1.0, 0.0] if SURGE in self.shown and SWAY not in self.shown else [1.0, 0.0, 0.0])
        along = np.round(push / np.max(np.abs(push)), 1)
        at = np.round(np.cross(along / np.linalg.norm(along), [0.0, 0.0, arm]), 2) + 0.0
        told = ", ".join(f"{axis.name} {by:+.2g} {axis.unit}2" for axis, by in effects.items())
        source = f"A guess: its full command accelerates {told}"
        x, y, z = along.tolist()
        return Thruster(
            name=name,
            description="",
            direction=SourcedVector((x, y, z), source),
            position=SourcedVector((*at.tolist(),), source),
            curve="",
        )


NOTHING_MOVED = Moved(frozenset(), {})


def moved(logs: Sequence[Log]) -> Moved:
    """Return what the outputs of logs of several axes move, where the logs show it."""
    outputs = [name for log in logs if log.commands and not log.follows_axis for name in log.commands.thrusters]
    effects: dict[str, dict[Axis, float]] = {name: {} for name in outputs}
    logs, shown = _without_rests(logs, [*effects]), []
    for axis in GUESSED:
        if fit := regression(logs, axis, [*effects]):
            shown.append(axis)
            for name, by in fit.clear(effects):
                effects[name][axis] = by
    return Moved(frozenset(shown), effects)


def _without_rests(logs: Sequence[Log], outputs: Sequence[str]) -> Sequence[Log]:
    """Return the logs without the times at which the vehicle rests against something.

    Which output pushes along heave is not known: each one is tried, and that counts beside whose rests the effects on
    the depth are clearest.
    """
    heave, nothing = VehicleAxis(HEAVE), frozenset[Axis]()
    vertical = (Moved(nothing, {name: {HEAVE: 1.0}}).thrusters[name] for name in outputs)
    layouts = (Layout((heave,), (), (thruster,)) for thruster in vertical)
    tried = ([piece for log in logs for piece in without_rests(log, layout)] for layout in layouts)
    possible = [[*logs], *(pieces for pieces in tried if pieces != [*logs])]
    return max(possible, key=lambda own: fit.most if (fit := regression(own, HEAVE, outputs)) else 0.0)


def regression(logs: Sequence[Log], axis: Axis, outputs: Sequence[str]) -> "Effects | None":
    """Return the clearest regression for an axis, or None where no log shows it."""
    fits = (fit for span in _SPANS for fit in _fits(logs, axis, outputs, span))
    return max(fits, key=lambda fit: fit.most, default=None)


def _fits(logs: Sequence[Log], axis: Axis, outputs: Sequence[str], span: float) -> Iterator["Effects"]:
    """Yield the regression for each quantity that shows an axis."""
    for is_rate in (True, False):
        rows = [
            sides
            for log in logs
            for channel in log.channels
            if channel.quantity.axis is axis and channel.quantity.is_velocity is is_rate and not channel.unused
            for sides in _windows(log, channel, outputs, span)
        ]
        if sum(len(left) for left, _ in rows) >= _LEAST_WINDOWS:
            left, right = (np.concatenate(side) for side in zip(*rows, strict=True))
            yield Effects.of(left, right, len(outputs), len(left) * _STEP / span)


def _windows(log: Log, channel: Channel, outputs: Sequence[str], span: float) -> Iterator[tuple[Array, Array]]:
    """Yield the sides of the equation for each window of a log: n, and n x outputs with a rate and a constant."""
    time, values = channel.samples
    if not log.commands or log.follows_axis or not len(time):
        return
    begins = time[first_in_each(time, 1.0 / _STEP)]
    begins = begins[:: 1 + len(begins) // _MOST_WINDOWS]
    begins = begins[begins + span <= min(time[-1], log.commands.end)]
    begins = begins[begins >= log.commands.rows[0]]
    gaps = np.append(0, np.cumsum(np.diff(time) > _GAP))
    at = [np.searchsorted(time, begins, side="right") - 1, np.searchsorted(time, begins + span)]
    begins = begins[gaps[at[0]] == gaps[at[1]]]
    if not len(begins):
        return
    part = np.linspace(0.0, 1.0, _POINTS)
    window = np.polynomial.Polynomial([0.0, 1.0, -1.0]) ** 3
    w, slope, bend = (window.deriv(n)(part) / span**n for n in range(3))
    points = begins[:, None] + span * part
    seen = np.interp(points, time, np.unwrap(values) if channel.quantity.wraps else values)
    seen = seen - seen.mean(axis=1, keepdims=True)
    commands = log.commands.at(points.ravel()).reshape(*points.shape, -1)
    pushes = np.einsum("wpt,p->wt", usual_thrust(commands), w)
    own = {name: pushes[:, n] for n, name in enumerate(log.commands.thrusters)}
    is_rate = channel.quantity.is_velocity
    rate = np.interp(points, time, values) @ w if is_rate else -(seen @ slope)
    nothing = np.zeros(len(begins))
    coupled = _coupling(log, channel.quantity.axis, points) @ w
    speed = np.interp(points, time, values) if is_rate else np.gradient(seen, span / (_POINTS - 1), axis=1)
    drag = (np.abs(speed) * speed) @ w
    sides = [*(own.get(name, nothing) for name in outputs), rate, drag, coupled, np.full(len(begins), w.sum())]
    yield -(seen @ slope) if is_rate else seen @ bend, np.column_stack(sides)


def _coupling(log: Log, axis: Axis | None, at: Array) -> Array:
    """Return what couples an axis to two others: for a velocity over ground, the turn rate times the velocity across,
    and for yaw, the product of the velocities (the Munk moment). It is 0 where no log shows it."""
    names = {SURGE: ("heading", "sway velocity"), SWAY: ("heading", "surge velocity")}
    others = names.get(axis, ("surge velocity", "sway velocity") if axis is YAW else ()) if axis else ()
    product = np.ones(at.shape)
    for channel in map(log.used, others or ("",)):
        time, values = channel.unwrapped if channel else (np.zeros(2), np.zeros(2))
        is_rate = channel and channel.quantity.is_velocity
        product *= np.interp(at, time, values if is_rate or not channel else np.gradient(values, time))
    return product


@dataclass(frozen=True)
class Effects:
    """The effects of outputs along an axis by a regression."""

    effects: Array
    """n: the acceleration that the full command of each output causes, m/s² or rad/s²."""
    clearness: Array
    """n: their sizes relative to their standard errors."""
    left: Array
    """The left side of the equation in each window."""
    right: Array
    """windows x (n + 2): the push of each output at full effect, the rate, and a constant."""
    independent: float
    """How many of the windows are independent, because the others overlap with them."""

    @property
    def most(self) -> float:
        """How clear the clearest effect is."""
        return float(self.clearness.max(initial=0.0))

    @classmethod
    def of(cls, left: Array, right: Array, outputs: int, independent: float) -> "Effects":
        """Fit n windows, of which so many are independent, because the others overlap with them.

        Outputs that always get the same command share their effect: combinations of commands that hardly occur have
        none.
        """
        scale = np.linalg.norm(right, axis=0)
        scale[scale == 0.0] = 1.0
        pushes, others = np.split(right / scale, [outputs], axis=1)
        _, sizes, rows = np.linalg.svd(pushes, full_matrices=False)
        occurring = rows[sizes > _ALIKE * sizes.max(initial=0.0)].T
        sides = np.column_stack([pushes @ occurring, others])
        inverse = np.linalg.pinv(sides)
        errors = left - sides @ (inverse @ left)
        of_row = float(errors @ errors) / max(min(independent, len(left)) - len(inverse), 1.0)
        back = occurring @ inverse[: occurring.shape[1]]
        deviation = np.sqrt(of_row * np.sum(back**2, axis=1))
        found = back @ left
        clearness = np.abs(found) / np.maximum(deviation, np.finfo(float).tiny)
        return cls(found / scale[:outputs], clearness, left, right, independent)

    def unexplained(self, effects: Array) -> float:
        """Return the sum of the squared errors where the outputs have effects of these ratios and signs, n.

        It has the errors of rounding, which are all that is left of an exact motion, and is 0 only for one that rests.
        """
        outputs = len(effects)
        sides = np.column_stack([self.right[:, :outputs] @ effects, self.right[:, outputs:]])
        found = np.linalg.lstsq(sides, self.left)[0]
        if found[0] < 0.0:  # the push would act backwards
            sides = sides[:, 1:]
            found = np.linalg.lstsq(sides, self.left)[0]
        rounding = np.finfo(float).eps * self.left @ self.left
        return float(np.sum((self.left - sides @ found) ** 2) + rounding)

    def clear(self, outputs: Iterable[str]) -> Iterator[tuple[str, float]]:
        """Yield the outputs that clearly move the axis, with the accelerations."""
        largest = float(np.max(np.abs(self.effects), initial=0.0))
        for name, effect, clearness in zip(outputs, self.effects.tolist(), self.clearness, strict=True):
            if clearness > _CLEAR and abs(effect) >= _LEAST_PART * largest:
                yield name, effect
