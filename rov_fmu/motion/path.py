"""The track of a step in which the vehicle turns: the integral of u e^(i heading), exact up to rounding."""

from itertools import pairwise
from math import cos, inf, isfinite, nan, remainder, sin, sqrt, tau

from .riccati import Riccati

_Rule = tuple[tuple[float, float], ...]

# Gauss-Legendre rules on [-1, 1], positive nodes: the short one for panels over which little changes.
_GAUSS_4 = (
    (0.33998104358485626, 0.6521451548625461),
    (0.8611363115940526, 0.34785484513745385),
)
_GAUSS_8 = (
    (0.18343464249564980, 0.36268378337836198),
    (0.52553240991632899, 0.31370664587788729),
    (0.79666647741362674, 0.22238103445337447),
    (0.96028985649753623, 0.10122853629037626),
)
_EPS = 2.0**-52
_MOST_PIECES = 100_000  # of a part of a turn: 12,900 seen on the way from 1e30 rad/s to 1e-28 rad/s
_ORDER = 8  # terms of the expansion at the ends of a fast turn


_Motion = tuple[float, float, float, float, float]  # distance ahead and aside, u, r, angle turned


def turning_step(surge: Riccati, yaw: Riccati, u: float, r: float, h: float) -> _Motion:
    """Distance covered in h seconds ahead and to starboard of the first heading, then u, r and the angle turned.

    The distance is the integral of u e^(i turn). It is cut where surge or yaw come to rest, and each part into
    Gauss-Legendre panels on the exact velocity and turn, short against the time constants and the turn rate. Where the
    vehicle turns fast against the changes of velocity (in a steady turn at the latest) the two ends of the part are
    enough, by parts over the heading. What cannot be computed, for it overflows, is NaN.
    """
    ahead = aside = turn = 0.0
    surge_turns, yaw_turns = surge.turning_time(u), yaw.turning_time(r)
    cuts = sorted(t for t in (surge_turns, yaw_turns) if t < h)
    for start, end in pairwise([0.0, *cuts, h]):
        if end > start:
            ahead, aside, u, r, turn = _planar_leg(surge, yaw, (ahead, aside, u, r, turn), end - start)
        # At rest to the last digit, or what follows would take the branch of before the turn.
        u = 0.0 if end == surge_turns else u
        r = 0.0 if end == yaw_turns else r
    return ahead, aside, u, r, turn


def _planar_leg(surge: Riccati, yaw: Riccati, motion: _Motion, rest: float) -> _Motion:
    """The part of a turning step in which surge and yaw keep their signs."""
    ahead, aside, u, r, turned = motion
    u_end, left = surge.advance(u, rest)
    r_end, angle = yaw.advance(r, rest)
    turn = turned + angle
    for _ in range(_MOST_PIECES):
        if not (isfinite(left) and isfinite(angle)):
            break
        if abs(angle) < _EPS / 4 or abs(left) <= _EPS / 16 * (abs(ahead) + abs(aside)):
            length, (a, b) = rest, (left, 0.0)
        else:
            length, (a, b) = _longest_piece(surge, yaw, u, r, rest)
        c, d = cos(turned), sin(turned)
        ahead, aside = ahead + (a * c - b * d), aside + (a * d + b * c)
        if length == rest:
            return ahead, aside, u_end, r_end, turn
        rest -= length
        u = surge.velocity(u, length)
        r, gone = yaw.advance(r, length)
        turned = remainder(turned + gone, tau)  # rounded as a small angle
        left, angle = surge.distance(u, rest), yaw.distance(r, rest)
    return nan, nan, u_end, r_end, nan


def _longest_piece(surge: Riccati, yaw: Riccati, u: float, r: float, rest: float) -> tuple[float, tuple[float, float]]:
    """The start of the remaining time that one formula covers, and the integral of u e^(i turn) over it.

    Two good ends vouch for what lies between them only if the turn does not slow down much.
    """
    bending = max(_rate(surge, u), _rate(yaw, r))
    turning = _turning_rate(yaw, r)
    # a time over which eight nodes give the integral to rounding
    panel = min(1.0 / bending if bending > 0.0 else inf, 2.0 / turning if turning > 0.0 else inf)
    drag = _drag(surge, u), _drag(yaw, r)
    if panel < rest and (at_start := _radius_derivatives(surge, yaw, drag, u, r)):
        length = min(rest, _slowing_time(yaw, r))
        while length > panel:
            u_end, r_end = surge.velocity(u, length), yaw.velocity(r, length)
            if at_end := _radius_derivatives(surge, yaw, drag, u_end, r_end):
                (a, b), (c, d) = _by_parts(at_start, 0.0), _by_parts(at_end, yaw.distance(r, length))
                return length, (c - a, d - b)
            length *= 0.25
    length = min(rest, panel)
    is_short = length * bending < 0.08 and length * turning < 0.14
    return length, _panel(surge, yaw, u, r, length, _GAUSS_4 if is_short else _GAUSS_8)


def _settled(axis: Riccati, v: float) -> bool:
    """Whether v is the steady velocity, up to rounding; that of a subnormal v is told at 2^1000 times its size."""
    rate = abs(axis.acceleration(v))
    slope = axis.B + 2.0 * axis.A * abs(v)
    return rate <= 16.0 * _EPS * abs(axis.C) or 2.0**1000 * rate <= 2.0**-72 * (1.0 + slope)


def _rate(axis: Riccati, v: float) -> float:
    """How fast the velocity bends (1/s): its solution is analytic within 2/rate."""
    return 0.0 if _settled(axis, v) else axis.B + 2.0 * axis.A * abs(v) + 2.0 * sqrt(axis.A * abs(axis.C))


def _turning_rate(yaw: Riccati, r: float) -> float:
    """How fast the direction changes (rad/s): by the turn rate, and by its growth from rest, turn ~ r' t^2/2."""
    return abs(r) + (0.0 if _settled(yaw, r) else 2.0 * sqrt(abs(yaw.acceleration(r))))


def _slowing_time(yaw: Riccati, r: float) -> float:
    """A time (s) in which the turn rate keeps half of its size: what slows it down is strongest at the start."""
    rate = yaw.acceleration(r)
    return inf if _settled(yaw, r) or (r > 0.0) == (rate > 0.0) else 0.5 * abs(r / rate)


def _panel(surge: Riccati, yaw: Riccati, u: float, r: float, h: float, rule: _Rule) -> tuple[float, float]:
    """The integral of u e^(i turn) over one panel by Gauss-Legendre quadrature."""
    half = 0.5 * h
    ahead = aside = 0.0
    for node, weight in rule:
        for t in (half - half * node, half + half * node):
            distance = half * weight * surge.velocity(u, t)
            angle = yaw.distance(r, t)
            ahead += distance * cos(angle)
            aside += distance * sin(angle)
    return ahead, aside


def _by_parts(g: list[float], turn: float) -> tuple[float, float]:
    """The antiderivative of u e^(i turn) by parts over the heading: e^(i turn) (-i g + g' + i g'' - g(3) - ...)."""
    real = sum((1.0, -1.0)[n // 2 % 2] * g[n] for n in range(1, _ORDER, 2))
    imag = sum((-1.0, 1.0)[n // 2 % 2] * g[n] for n in range(0, _ORDER, 2))
    c, d = cos(turn), sin(turn)
    return real * c - imag * d, real * d + imag * c


def _radius_derivatives(
    surge: Riccati, yaw: Riccati, drag: tuple[float, float], u: float, r: float
) -> list[float] | None:
    """The radius of the turn g = u/r and its derivatives by the heading; None where they do not fall off.

    They come from the Taylor series of u and r in time: d/d(heading) = (1/r) d/dt. Time is counted in radians at the
    turn rate of the start, in which no coefficient overflows that matters.
    """
    if abs(r) <= max(_rate(surge, u), _rate(yaw, r)):
        return None
    series, turning = _taylor(surge, drag[0], u, r), [c / r for c in _taylor(yaw, drag[1], r, r)]
    g: list[float] = []
    for _ in range(_ORDER + 1):
        quotient: list[float] = []
        for n, c in enumerate(series):
            quotient.append(c - sum(quotient[j] * turning[n - j] for j in range(n)))
        g.append(quotient[0] / r)
        series = [n * c for n, c in enumerate(quotient)][1:]
    # Two orders are looked at, for at rest every other one vanishes.
    largest = max(map(abs, g))
    return g if isfinite(largest) and all(abs(last) <= _EPS * largest for last in g[-2:]) else None


def _drag(axis: Riccati, v: float) -> float:
    """Quadratic drag with the sign that it has in the direction of v, or of the start from rest."""
    return axis.A if v > 0.0 or (v == 0.0 and axis.C >= 0.0) else -axis.A


def _taylor(axis: Riccati, A: float, v: float, rate: float) -> list[float]:
    """Taylor coefficients of v by rate t from v' = C - B v - A v^2; a settled axis is constant."""
    if _settled(axis, v):
        return [v] + [0.0] * _ORDER
    c, a, b = [v], A / rate, axis.B / rate
    for n in range(_ORDER):
        square = sum(a * c[j] * c[n - j] for j in range(n + 1))
        c.append(((axis.C / rate if n == 0 else 0.0) - b * c[n] - square) / (n + 1))
    return c
