"""The steady thrust of curves, and the motion of one axis alone."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from math import inf
from typing import Any

import numpy as np

from rov_fmu.equation.alone import RISE, alone_formulas, closed_form, stopping_formula
from rov_fmu.equation.catalogue import REVERSE, Axis, delayed_name
from rov_fmu.equation.expression import ARRAYS, array_functions, compiled
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import CommandTable, Curve
from rov_fmu.equation.terms import equation_of
from rov_fmu.equation.thrust import curve_formulas
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.vehicle import Vehicle

_LEAST_SPEED = 0.15
"""The speed, relative to the largest tested one, from which on drag has the nearest linear and quadratic terms."""


@dataclass(frozen=True, eq=False)
class Drags:
    """The powers of the drag along the axes."""

    powers: Mapping[str, tuple[Any, Any, float]] = field(default_factory=dict)
    """By axis: q ahead and astern, and V, of the drag a |v| v |v/V|^q in place of the quadratic one."""

    def motions(self, vehicle: Vehicle, axis: Axis, commands: Array) -> "Motions":
        """Return the equation of an axis alone under each of m held commands, once the thrust is steady."""
        layout = vehicle.layout
        inputs: dict[str, Any] = dict(layout.usual_inputs)
        driving = [layout.commands_along(axis, command) for command in commands.tolist()]
        inputs |= {name: _column(np.array([one[name] for one in driving]), vehicle) for name in driving[0]}
        if layout.has_dead_time:
            inputs |= {delayed_name(name): inputs[name] for name in layout.commands}
        numbers = _alone_of(layout, axis)({**vehicle.coefficients, **inputs})
        shape = np.broadcast_shapes(np.shape(_column(commands, vehicle)), *map(np.shape, vehicle.coefficients.values()))
        of = {key: np.broadcast_to(numbers[key], shape) for key in ("A", "B", "A_reverse", "B_reverse", "C")}
        return Motions(of, *self.powers.get(axis.name, ()))


def forces_of_curve(vehicle: Vehicle, curve: Curve, commands: Array) -> Array:
    """Return the steady thrust of all thrusters that a curve describes together, for m commands, N.

    It is m x n if the coefficients of the vehicle are arrays of n values.
    """
    values: dict[str, Any] = {**vehicle.coefficients, **vehicle.layout.usual_inputs}
    *_, force = _thrust_of(curve)(values | {"u_one": _column(commands, vehicle)}).values()
    return np.asarray(curve.n_thrusters * force)


def _column(commands: Array, vehicle: Vehicle) -> Array:
    """Return m commands as a column if the coefficients of a vehicle are arrays."""
    is_many = commands.ndim == 1 and any(np.ndim(value) for value in vehicle.coefficients.values())
    return commands[:, None] if is_many else commands


_IN_ARRAYS = array_functions(np)
_closed_form = compiled({**closed_form(), "distance": stopping_formula()}, _IN_ARRAYS, ARRAYS)


def _tables(tables: Iterable[CommandTable]) -> dict[str, Callable[..., Any]]:
    return _IN_ARRAYS | {table.function: np.vectorize(table.value, otypes=[float]) for table in tables}


@lru_cache
def _thrust_of(curve: Curve) -> Callable[[Mapping[str, Any]], dict[str, Any]]:
    return compiled(curve_formulas(curve), _tables(curve.tables), ARRAYS)


@lru_cache
def _alone_of(layout: Layout, axis: Axis) -> Callable[[Mapping[str, Any]], dict[str, Any]]:
    equation = equation_of(layout)
    formulas = {**equation.parameters, **equation.thrust, **alone_formulas(layout, axis.velocity)}
    return compiled(formulas, _tables(equation.tables.values()), ARRAYS)


QUADRATIC_DRAG = Drags()
_SLOWEST = 1e-12
"""A lower speed has the factor |v/V|^q of this one, m/s or rad/s."""
_NODES = np.polynomial.legendre.leggauss(24)
"""Where Gauss and Legendre evaluate an integral from -1 to 1, and the weights."""


def _integral(of: Callable[[Array], Array], low: Array, high: Array) -> Array:
    """Return the integral of a function between arrays of ends."""
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    return half * sum(weight * of(middle + half * node) for node, weight in zip(*_NODES, strict=True))


@dataclass(frozen=True, eq=False)
class Motions:
    """The motion of one axis alone, as `AxisAlone`, for many commands and vehicles at once: arrays of one shape.

    The drag is (B + A |v| |v/V|^q) v, as that of the filter.
    """

    of: Mapping[str, Array]
    """By the keys of `alone_formulas`."""
    power: Any = 0.0
    """q ahead, or those of the vehicles."""
    power_astern: Any = 0.0
    typical: float = 1.0
    """V, m/s or rad/s."""

    def drag(self, v: Array) -> tuple[Array, Array]:
        """Return A and B for velocities."""
        A, B = (np.where(v < 0.0, self.of[key + REVERSE], self.of[key]) for key in "AB")
        return A, B

    def acceleration(self, v: Array) -> Array:
        """Return v', (18)."""
        return self.of["C"] - np.sign(v) * self._slowing(v, np.abs(v))

    def _slowing(self, side: Array, speed: Array) -> Array:
        """Return the deceleration by the drag at some speeds, ahead or astern as the sign of `side`."""
        A, B = self.drag(side)
        return (B + A * speed * (np.maximum(speed, _SLOWEST) / self.typical) ** self._power(side)) * speed

    @property
    def is_quadratic(self) -> bool:
        """True if the drag has no other power."""
        return not (np.any(self.power) or np.any(self.power_astern))

    def _power(self, side: Array) -> Array:
        return np.asarray(np.where(side < 0.0, self.power_astern, self.power))

    def response(self) -> tuple[Array, Array]:
        """Return V_ss, and Tau of (17), from rest."""
        C = self.of["C"]
        numbers = self._closed_form(C)
        if self.is_quadratic:
            return numbers["V_ss"], numbers["Tau"]
        with np.errstate(all="ignore"):
            V = self._steady(C, np.abs(numbers["V_ss"]))
            Tau = _integral(lambda v: 1.0 / (np.abs(C) - self._slowing(C, v)), 0.0 * V, RISE * V)
        return np.sign(C) * V, np.where(C == 0.0, numbers["Tau"], Tau)

    def _steady(self, C: Array, near: Array) -> Array:
        """Return the speeds at which the drag is |C| (Newton's method for ln v), from those of quadratic drag."""
        v = np.where((near > 0.0) & np.isfinite(near), near, self.typical)
        (A, B), power = self.drag(C), self._power(C)
        for _ in range(30):
            quadratic = A * v * (v / self.typical) ** power
            slope = B + (2.0 + power) * quadratic  # of the drag, which is (B + quadratic) v
            v = v * np.exp(np.clip((np.abs(C) / v - B - quadratic) / slope, -1.0, 1.0))
        return np.where(C == 0.0, 0.0, v)

    def stopping_distance(self, v: Array, share: float) -> Array:
        """Return the distance from v until `share` of it without any force, m or rad."""
        if self.is_quadratic:
            return self._closed_form(v, share)["distance"]
        speed = np.abs(v)
        with np.errstate(all="ignore"):
            return _integral(lambda w: w / self._slowing(v, w), share * speed, speed)

    def _closed_form(self, v: Array, share: float = 1.0) -> dict[str, Array]:
        A, B = self.drag(v)
        with np.errstate(all="ignore"):  # both alternatives of a choice are computed
            return _closed_form({"A": A, "B": B, "C": self.of["C"], "v": v, "share": share})


def measured_time_constant(motions: Motions, load: Array, T: Array, linear: Array | float) -> Array:
    """Return the times from rest to (1 - 1/e) V_ss, s, if all acceleration by C but a constant load lags by T, s.

    `linear` is its share that is linear in what lags. It is 1 where the force lags. Where the speed of the rotor does,
    the rest of the thrust is quadratic in the speed, and the thrust lacks (2 - linear) e - (1 - linear) e^2 of itself,
    e = exp(-t/T).

    There is no closed form: the motions take Runge-Kutta steps whose length is proportional to Tau + T. The steps are
    those of w = v - ahead, where ahead is the velocity that the lag still withholds, the integral of what the thrust
    lacks. w' is the acceleration without a lag, so that a lag much shorter than a step does not spoil the steps, nor
    derivatives for T. The result is infinite if V_ss is not reached.
    """
    V_ss, Tau = motions.response()
    goal, h, lagging = RISE * V_ss, (Tau + T) / 50.0, motions.of["C"] - load

    def ahead(t: Array) -> Array:
        e = np.exp(-t / T)
        return lagging * T * ((2.0 - linear) * e - 0.5 * (1.0 - linear) * e**2)

    def lacking(t: Array) -> Array:
        e = np.exp(-t / T)
        return lagging * ((2.0 - linear) * e - (1.0 - linear) * e**2)

    def rate(t: Array, w: Array) -> Array:
        return motions.acceleration(w + ahead(t))

    def slope(t: Array, w: Array) -> Array:
        return h * (rate(t, w) - lacking(t))

    w, times, waits = -ahead(0.0 * h), np.full(goal.shape, inf), np.isfinite(Tau)
    for n in range(1000):
        t = n * h
        k_1 = rate(t, w)
        k_2 = rate(t + 0.5 * h, w + 0.5 * h * k_1)
        k_3 = rate(t + 0.5 * h, w + 0.5 * h * k_2)
        after = w + h / 6.0 * (k_1 + 2.0 * (k_2 + k_3) + rate(t + h, w + h * k_3))
        v = after + ahead(t + h)
        reached = waits & (np.abs(v) >= np.abs(goal)) & (v * goal > 0.0)
        if reached.any():
            ends = w + ahead(t), v, slope(t, w), slope(t + h, after), goal
            times[reached] = t[reached] + h[reached] * _crossing(*(x[reached] for x in ends))
        waits &= ~reached
        w = after
        if not waits.any():
            break
    return times


def _crossing(low: Array, high: Array, before: Array, after: Array, goal: Array) -> Array:
    """Return where, from 0 to 1, cubics with these values and slopes at the ends pass a goal (Newton's method)."""
    rise = high - low
    square, cube = 3.0 * rise - 2.0 * before - after, before + after - 2.0 * rise
    t = (goal - low) / rise
    for _ in range(8):
        t = t - (low + t * (before + t * (square + t * cube)) - goal) / (before + t * (2.0 * square + t * 3.0 * cube))
    return t


@dataclass(frozen=True, eq=False)
class Quadratic:
    """The quadratic and linear terms nearest to a curve of thrust or drag at m points; or those of n vehicles."""

    of: str
    """The name of the curve or of the axis."""
    coefficients: Mapping[str, Any]
    """By the names of a_t and b_t, or a_d and b_d."""
    terms: Array
    """The forces for a coefficient of 1, relative to the curve: m x 2, or n x m x 2."""

    @property
    def misfit(self) -> Array:
        """Of the forces at the points, relatively: m, or m x n."""
        values = np.array([*self.coefficients.values()])
        return np.asarray((self.terms @ values.T[..., None])[..., 0].T - 1.0)

    def covariance(self, variance: float) -> Array:
        """Return the covariance of both with which the relative forces at the commands have a mean variance."""
        terms = self.terms.reshape(-1, self.terms.shape[-1])
        return np.asarray(variance / len(self.coefficients) * np.linalg.inv(terms.T @ terms / len(terms)))


def nearest_drag(axis: str, drag: Mapping[str, Any], power: Any, typical: float, top: float) -> Quadratic:
    """Return the linear and quadratic drag that is nearest to one with another power.

    `drag` has the coefficients a and b of a |v| v |v/V|^q + b v by their names, `typical` is V, and `top` the largest
    tested speed. The relative errors have equal weights from _LEAST_SPEED of it on. Neither coefficient is negative.
    """
    (a, b), v = drag.values(), np.linspace(_LEAST_SPEED, 1.0, 40) * top
    speed = v[:, None] if np.ndim(a) or np.ndim(power) else v
    force = ((a * speed * (speed / typical) ** power + b) * speed).T
    terms = np.stack(np.broadcast_arrays(v**2, v), axis=-1) / force[..., None]
    both = np.linalg.pinv(terms).sum(axis=-1).T  # least squares of terms @ values = 1
    first, second = (terms.sum(axis=-2) / (terms**2).sum(axis=-2)).T  # each without the other one
    alone = np.where(both[0] < both[1], [0.0 * first, second], [first, 0.0 * second])
    values = np.where(both.min(axis=0) >= 0.0, both, alone)
    values = np.where(np.equal(power, 0.0), np.broadcast_arrays(a, b), values)
    return Quadratic(axis, dict(zip(drag, values, strict=True)), terms)
