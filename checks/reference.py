"""The exact motion to 50 digits, from the textbook solutions of (18), not the formulas of rov_fmu/motion/ (mpmath).

While v keeps its sign, v' = C - B v - A v^2 is elementary: through its two equilibria where they are real, a tangent
where they are not, a hyperbola where they coincide, an exponential or a line without quadratic drag. Every formula
holds for complex times too, which is what the pose is integrated with.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Any

from mpmath import mp
from mpmath.calculus.quadrature import GaussLegendre

from rov_fmu.motion.rov import Coefficients, Inputs, State

DIGITS = 50
Number = Any  # of mpmath, real or complex
Function = Callable[[Number], Number]
Rest = Callable[[], Number]


class Leg:
    """A motion from v0 >= 0 at the time `start` that keeps its sign; `sign` mirrors it, `offset` is its distance."""

    def __init__(self, A: Number, B: Number, C: Number, v0: Number, start: Number, sign: int, offset: Number) -> None:
        self.start, self.sign, self.offset = start, sign, offset
        self._velocity, self._distance, self._room, self.rest = _elementary(A, B, C, v0)

    def velocity(self, time: Number) -> Number:
        return self.sign * self._velocity(time - self.start)

    def distance(self, time: Number) -> Number:
        """From the beginning of the motion."""
        return self.offset + self.sign * self._distance(time - self.start)

    def room(self, time: Number) -> Number:
        """How far from a complex time the nearest singularity is."""
        return self._room(time - self.start)


def _elementary(A: Number, B: Number, C: Number, v0: Number) -> tuple[Function, Function, Function, Rest]:
    """Velocity, distance and room at a time after v0, and when a force C < 0 brings the motion to rest."""
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
    """To the nearest of poles a period apart."""
    return abs(t - pole - mp.nint(mp.re((t - pole) / period)) * period)


class Motion:
    """One axis over h seconds: one leg, or two where the force turns the motion."""

    def __init__(self, A: Number, B: Number, C: Number, v0: Number, h: Number) -> None:
        A, B, C, v0, self.h = (mp.mpf(number) for number in (A, B, C, v0, h))
        sign = -1 if v0 < 0 or (v0 == 0 and C < 0) else 1
        self.legs = [Leg(A, B, sign * C, sign * v0, mp.mpf(0), sign, mp.mpf(0))]
        if sign * C < 0 and v0 != 0 and (turn := self.legs[0].rest()) < h:
            self.legs.append(Leg(A, B, -sign * C, mp.mpf(0), turn, -sign, self.legs[0].distance(turn)))

    def end(self) -> tuple[Number, Number, Number]:
        """Velocity, distance and length of the path, there and back."""
        last = self.legs[-1]
        distance = last.distance(self.h)
        return last.velocity(self.h), distance, abs(last.offset) + abs(distance - last.offset)


@dataclass(frozen=True)
class AxisEnd:
    velocity: Number
    distance: Number
    path: Number
    scale: Number
    """The largest velocity on the way."""
    digits: int
    """Digits to calculate with for a result of 50."""


def axis(A: Number, B: Number, C: Number, v0: Number, h: Number) -> AxisEnd:
    """One axis after h seconds: calculated with more and more digits until 50 of them stay."""
    # Terms cancel by as many digits as the numbers, or their squares, are apart.
    digits = DIGITS + sum(abs(mp.mag(number)) * 6 // 10 for number in (A, B, C, v0, h) if number != 0)
    before = None
    while True:
        with mp.workdps(digits):
            v, s, path = Motion(A, B, C, v0, h).end()
            scale = max(abs(v), abs(mp.mpf(v0)))
            limit = mp.mpf(10) ** -DIGITS
            if before and abs(v - before[0]) <= limit * scale and abs(s - before[1]) <= limit * path:
                return AxisEnd(v, s, path, scale, digits)
            digits, before = digits + DIGITS, (v, s)


@cache
def _nodes() -> list[tuple[Number, Number]]:
    """The Gauss-Legendre rule of 24 nodes on [-1, 1]."""
    with mp.workdps(2 * DIGITS):
        nodes: list[tuple[Number, Number]] = GaussLegendre(mp).calc_nodes(4, mp.prec)
    return nodes


class _Plane:
    """The integral of u e^(i angle) over a time in which surge and yaw keep their signs."""

    def __init__(self, surge: Leg, yaw: Leg) -> None:
        self.surge, self.yaw = surge, yaw

    def integral(self, a: Number, b: Number) -> Number:
        """Along the real axis where little is turned; over a long turn through complex times.

        There it dies out on the side where e^(i angle) does, and no singularity is between the ways there from a and b.
        """
        angles = self.yaw.distance(a), self.yaw.distance(b)
        if abs(angles[1] - angles[0]) < 60:
            return self.along(a, b)
        slowest = min(abs(self.yaw.velocity(t)) for t in (a, b))
        room = min(leg.room(t) for leg in (self.surge, self.yaw) for t in (a, b))
        if slowest * room > 80:  # up is shorter than room: no singularity on the way
            up = mp.mpc(0, 64 * self.yaw.sign) / slowest
            limit = 1e-25 * max(abs(self.surge.velocity(t)) for t in (a, b))
            near = all(abs(self.yaw.distance(t + up) - self.yaw.distance(t)) < 600 for t in (a, b))
            if near and all(abs(self.integrand(a + (b - a) * n / 8 + up)) <= limit for n in range(9)):
                return self.along(a, a + up) - self.along(b, b + up)
        middle = (a + b) / 2
        return self.integral(a, middle) + self.integral(middle, b)

    def integrand(self, t: Number) -> Number:
        return self.surge.velocity(t) * mp.expj(self.yaw.distance(t))

    def along(self, a: Number, b: Number) -> Number:
        """A straight line in panels that are short against the turn and the way to the next singularity."""
        total = mp.mpf(0)
        if a == b:
            return total
        way = (b - a) / abs(b - a)
        while a != b:
            length = min(self.surge.room(a), self.yaw.room(a)) * 2 / 3
            angle = self.yaw.distance(a)
            while abs(self.yaw.distance(a + min(length, abs(b - a)) * way) - angle) > 12:
                length = min(length, abs(b - a)) / 2
            end = a + length * way if length < abs(b - a) else b
            half, middle = (end - a) / 2, (end + a) / 2
            total += half * mp.fsum(weight * self.integrand(middle + half * node) for node, weight in _nodes())
            a = end
        return total


def planar(surge: Motion, yaw: Motion) -> Number:
    """Distance ahead + i distance to starboard of the first heading; its quadrature leaves some 25 digits."""
    cuts = sorted([mp.mpf(0), *(motion.legs[-1].start for motion in (surge, yaw) if len(motion.legs) > 1), surge.h])
    total = mp.mpc(0)
    for a, b in pairwise(cuts):
        legs = [next(leg for leg in reversed(motion.legs) if leg.start <= a) for motion in (surge, yaw)]
        total += _Plane(*legs).integral(a, b)
    return total


@dataclass(frozen=True)
class Step:
    """State after a step by name, and what its errors are measured by."""

    state: dict[str, Number]
    scale: dict[str, Number]
    """The largest velocity on the way, the length of the path, the angle turned there and back."""


def coefficients_of(k: Coefficients, i: Inputs) -> tuple[tuple[Number, Number, Number], ...]:
    """A, B and C of surge, heave and yaw: (2), (4), (9), (10) and (18) as the paper prints them, without rounding."""
    limited = (min(1, max(-1, mp.mpf(command))) for command in (i.u_l, i.u_r, i.u_t))
    curves = ((k.a_t_rear, k.b_t_rear, 2), (k.a_t_rear, k.b_t_rear, 2), (k.a_t_top, k.b_t_top, 1))
    F_l, F_r, F_t = ((a * abs(c) * c + b * c) / share for c, (a, b, share) in zip(limited, curves, strict=True))
    torque = F_l * k.R * mp.sin(k.gamma) + F_r * k.R * mp.sin(-k.gamma)
    forces = (k.alpha_u * (F_r + F_l) + i.X_ext, k.alpha_w * F_t + i.Z_ext, k.alpha_r * torque + i.N_ext)
    return tuple(
        (mp.mpf(beta) * a_d / m, mp.mpf(beta) * b_d / m, beta * force / m)
        for m, beta, a_d, b_d, force in (
            (k.m_rov, k.beta_u, k.a_d_u, k.b_d_u, forces[0]),
            (k.m_rov, k.beta_w, k.a_d_w, k.b_d_w, forces[1]),
            (k.I_r, k.beta_r, k.a_d_r, k.b_d_r, forces[2]),
        )
    )


def step(k: Coefficients, i: Inputs, s: State, h: float) -> Step:
    """The ROV after h seconds with the inputs held."""
    with mp.workdps(4 * DIGITS):
        surge, heave, yaw = coefficients_of(k, i)
    u, w, r = axis(*surge, s.u, h), axis(*heave, s.w, h), axis(*yaw, s.r, h)
    with mp.workdps(max(u.digits, r.digits)):
        way = planar(Motion(*surge, s.u, h), Motion(*yaw, s.r, h)) * mp.expj(s.psi)
        drift = mp.mpc(i.V_N, i.V_E) * h
        path = u.path + abs(drift)
        return Step(
            {"u": u.velocity, "w": w.velocity, "r": r.velocity, "x": s.x + way.real + drift.real,
             "y": s.y + way.imag + drift.imag, "z": s.z + w.distance, "psi": s.psi + r.distance},
            {"u": u.scale, "w": w.scale, "r": r.scale, "x": path, "y": path, "z": w.path, "psi": r.path},
        )  # fmt: skip
