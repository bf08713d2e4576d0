"""The shape of thrust curves, and the motion of one axis with it.

A curve is a scale times a shape. The shape may deviate smoothly from that of the prior curve: a command c beyond the
dead band d acts like the command d + (c - d) (1 + eta(c)) of the prior curve with this dead band. eta is a natural
cubic spline, constant below its first knot, and 0 at full command, which the scale describes. (Lines between the knots
would be off by 1 % of the thrust for published curves.) eta has a Gaussian prior with a correlation length, and the
deviations ahead and astern are correlated by one half.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, lru_cache
from math import exp, inf, isfinite

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from rov_fmu.equation.alone import RISE, AxisAlone
from rov_fmu.equation.catalogue import REVERSE, Axis, delayed_name
from rov_fmu.equation.layout import Curve, Layout
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.vehicle import Vehicle

KNOTS = (0.1, 0.25, 0.45, 0.7)
"""The commands at which eta is a parameter."""
_LENGTH = 0.3
"""The correlation length of the deviations, in commands."""
_POWER = 1.5
"""Thrust grows about with this power of the command: a deviation of the force is as many times that of the command."""
_ROUNDING = 1e-12
"""One of a_t and b_t is 0 where it is so small relative to the other one."""
_WEAKEST = 0.1
"""The least of 1 + eta: beyond the dead band there is always some thrust."""
COUNT = 2 * len(KNOTS)


@cache
def _root() -> Array:
    """Return the root of the correlation of eta at the knots ahead and then astern, given that it is 0 at 1."""
    c = np.array([*KNOTS, 1.0])
    K = np.exp(-0.5 * ((c[:, None] - c) / _LENGTH) ** 2)
    conditional = K[:-1, :-1] - np.outer(K[:-1, -1], K[-1, :-1])
    both = np.kron([[1.0, 0.5], [0.5, 1.0]], conditional)
    return np.asarray(np.linalg.cholesky(both + 1e-9 * np.eye(COUNT)), np.float64)


@cache
def _spline() -> CubicSpline:
    """Return the spline whose values are the weights of eta at the knots."""
    return CubicSpline([*KNOTS, 1.0], np.eye(len(KNOTS) + 1)[:, :-1], bc_type="natural")


def _weights(commands: Array) -> Array:
    """Return the derivatives of eta at some commands with respect to the coordinates of a curve: n x COUNT."""
    own, is_astern = _spline()(np.maximum(np.abs(commands), KNOTS[0])), (commands < 0.0)[:, None]
    knots = np.hstack([np.where(is_astern, 0.0, own), np.where(is_astern, own, 0.0)])
    return np.asarray(knots @ _root() / _POWER)


@lru_cache(4096)
def _weights_of_one(command: float) -> Array:
    """Return the derivatives at one command. A fit asks for those of the rows of its tables again and again."""
    return _weights(np.array([command]))


@dataclass(frozen=True, eq=False)
class Shapes:
    """The deviations of the shapes of some curves."""

    of: Mapping[str, Array]
    """By curve: COUNT independent coordinates times the relative deviation of the force."""
    dead_bands: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """By curve: the commands at which thrust begins, ahead and astern; 0 where there is none."""
    exact_astern: frozenset[str] = frozenset()
    """The curves that do not deviate astern."""

    def commands(self, curve: str, commands: Array) -> Array:
        """Return the commands of the prior curve that act like some commands of a curve."""
        if curve not in self.of:
            return commands
        size, is_astern = np.abs(commands), commands < 0.0
        weights = _weights_of_one(float(commands[0])) if len(commands) == 1 else _weights(commands)
        eta = weights @ self.of[curve]
        if curve in self.exact_astern:
            eta = np.where(is_astern, 0.0, eta)
        band = np.where(is_astern, *reversed(self.dead_bands.get(curve, (0.0, 0.0))))
        bent = np.maximum(eta, _WEAKEST - 1.0) * np.maximum(size - band, 0.0)
        return np.asarray(np.sign(commands) * np.clip(size + bent, 0.0, 1.0))

    def inputs(self, layout: Layout, inputs: Array) -> Array:
        """Return rows of inputs with the commands of the prior curves. The inputs of the layout are its thrusters'."""
        if not self.of:
            return inputs
        found, names = inputs.copy(), [*layout.inputs]
        for name, curve in layout.curve_of.items():
            place = names.index(f"u_{name}")
            found[:, place] = self.commands(curve.name, inputs[:, place])
        return found

    def forces(self, vehicle: Vehicle, curve: Curve, commands: Array) -> Array:
        """Return the steady thrust of all thrusters that a curve describes together, for some commands, N."""
        acting = self.commands(curve.name, commands).tolist()
        return curve.together * np.array([vehicle.curve_force(curve, command) for command in acting])

    def motion(self, vehicle: Vehicle, axis: Axis, command: float) -> AxisAlone:
        """Return the equation of an axis alone under a held command, once the thrust is steady."""
        layout = vehicle.layout
        inputs = dict(layout.usual_inputs)
        for name, value in layout.driving(axis, command).items():
            curve = layout.curve_of.get(name.removeprefix("u_"))
            acting = self.commands(curve.name, np.array([value])) if curve else [value]
            inputs[name] = inputs[delayed_name(name)] = float(acting[0])
        return vehicle.alone(axis, inputs)


NO_SHAPES = Shapes({})


def measured_time_constant(motion: AxisAlone, load: float, T: float) -> float:
    """Return the time from rest to (1 - 1/e) V_ss, s, if all acceleration by C but a constant load lags by T, s.

    There is no closed form: the motion takes Runge-Kutta steps whose length is proportional to Tau + T. The result is
    infinite if V_ss is not reached.
    """
    Tau, goal = motion.time_constant(), RISE * motion.steady_velocity()
    if not isfinite(Tau):
        return Tau
    h, v = (Tau + T) / 50.0, 0.0

    def rate(t: float, v: float) -> float:
        return motion.acceleration(v) - (motion.C - load) * exp(-t / T)

    for n in range(1000):
        t = n * h
        k_1 = rate(t, v)
        k_2 = rate(t + 0.5 * h, v + 0.5 * h * k_1)
        k_3 = rate(t + 0.5 * h, v + 0.5 * h * k_2)
        after = v + h / 6.0 * (k_1 + 2.0 * (k_2 + k_3) + rate(t + h, v + h * k_3))
        if abs(after) >= abs(goal) and after * goal > 0.0:
            between = CubicHermiteSpline([t, t + h], [v, after], [k_1, rate(t + h, after)])
            return float(between.solve(goal, extrapolate=False)[0])
        v = after
    return inf


@dataclass(frozen=True, eq=False)
class Quadratic:
    """The a_t and b_t of one direction that are nearest to a thrust curve over n commands."""

    curve: Curve
    coefficients: Mapping[str, float]
    """By the names of a_t and b_t."""
    misfit: Array
    """Of the forces at the commands, relatively."""
    terms: Array
    """n x 2: the forces for a coefficient of 1, relative to the curve."""

    def covariance(self, variance: float) -> Array:
        """Return the covariance of a_t and b_t with which the relative forces at the commands have a mean variance."""
        mean_squares = self.terms.T @ self.terms / len(self.terms)
        return np.asarray(variance / len(self.coefficients) * np.linalg.inv(mean_squares))


def nearest(
    curve: Curve, forces: Callable[[Array], Array], dead_bands: tuple[float, float], low: float, high: float
) -> Iterator[Quadratic]:
    """Yield the quadratic curves that are nearest to a curve ahead and astern.

    `forces` gives the thrust for some commands (N); the relative errors have equal weights over low to high.
    """
    for end, sign, c_0 in (("", 1.0, dead_bands[0]), (REVERSE, -1.0, dead_bands[1])):
        if f"a_t{end}" not in curve.keys:
            continue
        least = max(low, c_0 + 0.05)
        commands = np.linspace(least, max(high, least + 0.1), 40)
        F = sign * forces(sign * commands)
        beyond = commands - c_0
        terms, one = np.column_stack([beyond**2, beyond]) / F[:, None], np.ones(len(F))
        values = np.linalg.lstsq(terms, one, rcond=None)[0]
        values[np.abs(values) < _ROUNDING * np.abs(values).max()] = 0.0
        names = [curve.coefficient(f"{key}{end}") for key in ("a_t", "b_t")]
        yield Quadratic(curve, dict(zip(names, values.tolist(), strict=True)), terms @ values - one, terms)
