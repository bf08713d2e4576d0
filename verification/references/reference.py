"""The exact motion to 50 digits (mpmath), from the textbook solutions of (18), not the formulas of rov_fmu/equation/.

While v keeps its sign, v' = C - B v - A v^2 has an elementary solution. With quadratic drag it depends on the
equilibria: exponentials when they are real, a tangent when they are not, a hyperbola when they coincide. Without
quadratic drag it is an exponential or a line. Every formula also holds for complex times, which the integral of the
pose uses.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Any

from mpmath import mp
from mpmath.calculus.quadrature import GaussLegendre

from rov_fmu.vehicle.vehicle import Vehicle

from .equations import Axis, Equations, equations
from .extrapolation import Ended, integrate

DIGITS = 50
Number = Any  # a number of mpmath, real or complex
Function = Callable[[Number], Number]
Rest = Callable[[], Number]


class Leg:
    """A motion from v0 >= 0 at the time `start` that keeps its sign; `sign` mirrors it, `offset` is its distance."""

    def __init__(self, A: Number, B: Number, C: Number, v0: Number, start: Number, sign: int, offset: Number) -> None:
        self.start, self.sign, self.offset = start, sign, offset
        self._velocity, self._distance, self._room, self.rest = _elementary(A, B, C, v0)

    def velocity(self, time: Number) -> Number:
        """Return the velocity."""
        return self.sign * self._velocity(time - self.start)

    def distance(self, time: Number) -> Number:
        """Return the distance from the start of the motion."""
        return self.offset + self.sign * self._distance(time - self.start)

    def room(self, time: Number) -> Number:
        """Return the distance from a complex time to the nearest singularity."""
        return self._room(time - self.start)


def _elementary(A: Number, B: Number, C: Number, v0: Number) -> tuple[Function, Function, Function, Rest]:
    """Return functions for velocity, distance and room at a time after v0, and for the time to rest under C < 0."""
    D2 = B * B + 4 * A * C
    D = mp.sqrt(abs(D2))
    if A == 0 and B == 0:
        return lambda t: v0 + C * t, lambda t: v0 * t + C * t * t / 2, lambda _: mp.inf, lambda: -v0 / C
    if A == 0:
        return (
            lambda t: C / B + (v0 - C / B) * mp.exp(-B * t),
            lambda t: C / B * t - (v0 - C / B) * mp.expm1(-B * t) / B,
            lambda t: 8 / B + mp.re(t),
            lambda: mp.log1p(-B * v0 / C) / B,
        )
    if D2 > 0:  # two equilibria
        V1, V2 = (-B + D) / (2 * A), (-B - D) / (2 * A)
        k = (v0 - V1) / (v0 - V2)
        return (
            lambda t: (V1 - V2 * (kE := k * mp.exp(-D * t))) / (1 - kE),
            lambda t: V1 * t + mp.log((1 - k * mp.exp(-D * t)) / (1 - k)) / A,
            lambda t: _to_pole(t, mp.log(k) / D, 2j * mp.pi / D) if k != 0 else mp.inf,
            lambda: mp.log(k * V2 / V1) / D,
        )
    if D2 < 0:
        phase = mp.atan((2 * A * v0 + B) / D)
        return (
            lambda t: (D * mp.tan(phase - D * t / 2) - B) / (2 * A),
            lambda t: mp.log(mp.cos(phase - D * t / 2) / mp.cos(phase)) / A - B * t / (2 * A),
            lambda t: _to_pole(t, (2 * phase - mp.pi) / D, 2 * mp.pi / D),
            lambda: 2 * (phase - mp.atan(B / D)) / D,
        )
    p = v0 + B / (2 * A)
    return (
        lambda t: p / (1 + A * p * t) - B / (2 * A),
        lambda t: mp.log(1 + A * p * t) / A - B * t / (2 * A),
        lambda t: abs(t + 1 / (A * p)) if p != 0 else mp.inf,
        lambda: 2 / B - 1 / (A * p),
    )


def _to_pole(t: Number, pole: Number, period: Number) -> Number:
    """Return the distance to the nearest of the poles, which are one period apart."""
    return abs(t - pole - mp.nint(mp.re((t - pole) / period)) * period)


class Motion:
    """One axis over h seconds: one leg, or two where the force reverses the motion; `astern` is A and B for v < 0."""

    def __init__(
        self, A: Number, B: Number, C: Number, v0: Number, h: Number, astern: tuple[Number, Number] | None = None
    ) -> None:
        C, v0, self.h = (mp.mpf(number) for number in (C, v0, h))
        sign = -1 if v0 < 0 or (v0 == 0 and C < 0) else 1
        ahead, astern = ((mp.mpf(a), mp.mpf(b)) for a, b in ((A, B), astern or (A, B)))
        (A, B), back = (ahead, astern)[::sign]
        self.legs = [Leg(A, B, sign * C, sign * v0, mp.mpf(0), sign, mp.mpf(0))]
        if sign * C < 0 and v0 != 0 and (rest := self.legs[0].rest()) < h:
            self.legs.append(Leg(*back, -sign * C, mp.mpf(0), rest, -sign, self.legs[0].distance(rest)))

    def at(self, time: Number) -> tuple[Number, Number]:
        """Return the velocity and the distance at a time (s), from 0 to h."""
        leg = self.legs[-1] if time >= self.legs[-1].start else self.legs[0]
        return leg.velocity(time), leg.distance(time)

    def end(self) -> tuple[Number, Number, Number]:
        """Return the velocity, the distance and the length of the path, back and forth."""
        (velocity, distance), turned = self.at(self.h), self.legs[-1].offset
        return velocity, distance, abs(turned) + abs(distance - turned)


@dataclass(frozen=True)
class AxisEnd:
    """The end of the motion of one axis."""

    velocity: Number
    distance: Number
    path: Number
    scale: Number
    """The largest velocity of the motion."""
    digits: int
    """The digits of precision that a result of 50 digits needs."""


def axis(
    A: Number, B: Number, C: Number, v0: Number, h: Number, astern: tuple[Number, Number] | None = None
) -> AxisEnd:
    """Return the motion of one axis after h seconds, with as much precision as 50 stable digits need."""
    digits, before = _digits(A, B, C, v0, h, *(astern or ())), None
    while True:
        with mp.workdps(digits):
            v, s, path = Motion(A, B, C, v0, h, astern).end()
            scale = max(abs(v), abs(mp.mpf(v0)))
            limit = mp.mpf(10) ** -DIGITS
            if before and abs(v - before[0]) <= limit * scale and abs(s - before[1]) <= limit * path:
                return AxisEnd(v, s, path, scale, digits)
            digits, before = digits + DIGITS, (v, s)


def _digits(*numbers: Number) -> int:
    """Return a precision at which 50 digits may be stable.

    Terms cancel by as many digits as the magnitudes of the numbers, or of their squares, differ.
    """
    return int(DIGITS + sum(abs(mp.mag(number)) * 6 // 10 for number in numbers if number != 0))


def time_to_rest(A: float, B: float, C: float, v0: float) -> float:
    """Return the time (s) at which a force C < 0 stops a motion v0 > 0."""
    with mp.workdps(_digits(A, B, C, v0)):
        leg = Leg(mp.mpf(A), mp.mpf(B), mp.mpf(C), mp.mpf(v0), mp.zero, 1, mp.zero)
        return float(leg.rest())


@cache
def _nodes() -> list[tuple[Number, Number]]:
    """Return the Gauss-Legendre rule of 24 nodes on [-1, 1]."""
    with mp.workdps(2 * DIGITS):
        nodes: list[tuple[Number, Number]] = GaussLegendre(mp).calc_nodes(4, mp.prec)
    return nodes


class _Plane:
    """The integral of u e^(i angle) over a time in which surge and yaw keep their signs.

    The angle is the heading relative to the start.
    """

    def __init__(self, surge: Leg, yaw: Leg) -> None:
        self.surge, self.yaw = surge, yaw

    def integral(self, a: Number, b: Number) -> Number:
        """Return the integral from a to b.

        For a small turn the path of integration is the real axis. For a large turn it goes through complex times, to
        the side where e^(i angle) decays, if there is no singularity between the paths from a and from b.
        """
        angles = self.yaw.distance(a), self.yaw.distance(b)
        if abs(angles[1] - angles[0]) < 60:
            return self.along(a, b)
        slowest = min(abs(self.yaw.velocity(t)) for t in (a, b))
        room = min(leg.room(t) for leg in (self.surge, self.yaw) for t in (a, b))
        if slowest * room > 80:  # `up` is shorter than `room`, so the path meets no singularity
            up = mp.mpc(0, 64 * self.yaw.sign) / slowest
            limit = 1e-25 * max(abs(self.surge.velocity(t)) for t in (a, b))
            near = all(abs(self.yaw.distance(t + up) - self.yaw.distance(t)) < 600 for t in (a, b))
            if near and all(abs(self.integrand(a + (b - a) * n / 8 + up)) <= limit for n in range(9)):
                return self.along(a, a + up) - self.along(b, b + up)
        middle = (a + b) / 2
        return self.integral(a, middle) + self.integral(middle, b)

    def integrand(self, t: Number) -> Number:
        """Return u e^(i angle) at a complex time."""
        return self.surge.velocity(t) * mp.expj(self.yaw.distance(t))

    def along(self, a: Number, b: Number) -> Number:
        """Return the integral along a straight line.

        Its panels are short relative to the turn and to the distance of the next singularity.
        """
        total = mp.mpf(0)
        if a == b:
            return total
        direction = (b - a) / abs(b - a)
        while a != b:
            length = min(self.surge.room(a), self.yaw.room(a)) * 2 / 3
            angle = self.yaw.distance(a)
            while abs(self.yaw.distance(a + min(length, abs(b - a)) * direction) - angle) > 12:
                length = min(length, abs(b - a)) / 2
            end = a + length * direction if length < abs(b - a) else b
            half, middle = (end - a) / 2, (end + a) / 2
            total += half * mp.fsum(weight * self.integrand(middle + half * node) for node, weight in _nodes())
            a = end
        return total


def planar(surge: Motion, yaw: Motion) -> Number:
    """Return the distance ahead + i distance to starboard, relative to the first heading, to some 25 digits."""
    cuts = sorted([mp.mpf(0), *(motion.legs[-1].start for motion in (surge, yaw) if len(motion.legs) > 1), surge.h])
    total = mp.mpc(0)
    for a, b in pairwise(cuts):
        legs = [next(leg for leg in reversed(motion.legs) if leg.start <= a) for motion in (surge, yaw)]
        total += _Plane(*legs).integral(a, b)
    return total


@dataclass(frozen=True)
class Step:
    """The state after a step by name, and the scale of its errors."""

    state: dict[str, Number]
    scale: dict[str, Number]
    """The largest velocity, the length of the path, or the angle turned back and forth."""


def step(rov: Vehicle, inputs: Mapping[str, float], state: Mapping[str, float], h: float) -> Step:
    """Return the state of the vehicle after h seconds with the inputs held."""
    with mp.workdps(4 * DIGITS):
        equation = equations(rov, inputs, mp)
        if equation.lags or equation.coupled:
            found, fastest, paths = integrate(rov, inputs, state, h)
        else:
            found, fastest, paths = _uncoupled(equation, state, h)
        scale = fastest | {name: paths[name] for name in ("x", "y", "z", "psi")}
        for name in ("x", "y", "z", "psi"):
            found[name] += mp.mpf(state.get(name, 0))
        for name, current in (("x", "V_N"), ("y", "V_E")):
            drift = mp.mpf(inputs.get(current, 0)) * h
            found[name] += drift
            scale[name] += abs(drift)
        scale |= {f"F_{name}": max(abs(lag.target), abs(state[f"F_{name}"])) for name, lag in equation.lags.items()}
        return Step({name: found[name] for name in state}, {name: scale[name] for name in state})


def _uncoupled(equation: Equations, state: Mapping[str, float], h: float) -> Ended:
    """Return the end of the motion of a vehicle without coupling and lag."""
    still = Axis((0, 0), (0, 0), mp.zero, mp.zero, (), mp.inf)
    axes = {name: equation.axes.get(name, still) for name in ("u", "v", "w", "r")}
    forms = {name: (*form.ahead, form.constant, state.get(name, 0.0), h, form.astern) for name, form in axes.items()}
    ends = {name: axis(*form) for name, form in forms.items()}
    with mp.workdps(max(end.digits for end in ends.values())):
        u, v, r = (Motion(*forms[name]) for name in ("u", "v", "r"))
        track = planar(u, r) + 1j * planar(v, r)
        track *= mp.expj(mp.mpf(state.get("psi", 0)))
    planar_path = ends["u"].path + ends["v"].path
    return (
        {name: ends[name].velocity for name in equation.axes}
        | {"x": track.real, "y": track.imag, "z": ends["w"].distance, "psi": ends["r"].distance},
        {name: ends[name].scale for name in equation.axes},
        {"x": planar_path, "y": planar_path, "z": ends["w"].path, "psi": ends["r"].path},
    )
