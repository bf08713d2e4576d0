"""The exact motion of one axis in closed form: a reference for the steps by Taylor series.

The equation of an axis is v' = C - B v - A |v| v with A >= 0 and B >= 0 (rov_fmu/equation/alone.py). Its solution is
elementary and exact up to rounding for every step length.

Notation (b, k and q are pure numbers), for a motion that keeps its sign, v >= 0:

    b = B h/2    k = A C h^2    q = b^2 + k    l1, l2 = -b ± sqrt(q)

The linear equation y'' + B y' = A C y with y(0) = 1, y'(0) = A v0 gives v = y'/(A y) and the distance ln(y)/A.
"""

from collections.abc import Mapping
from math import atan, atanh, copysign, cos, exp, expm1, hypot, inf, log, log1p, sin, sqrt

from rov_fmu.equation.alone import AxisAlone
from rov_fmu.vehicle.vehicle import Vehicle

# Below this |q| a fraction in q replaces the hyperbolic and the circular functions, and it needs no branch on the sign.
# With half the argument it holds up to four times this |q|.
_MODERATE = 0.8


class Axis(AxisAlone):
    """One axis under a held force, which can move."""

    def advance(self, v: float, h: float) -> tuple[float, float]:
        """Return the velocity after h > 0 seconds and the distance (angle) covered."""
        return advance(self.A, self.B, self.C, v, h, self.reverse)

    def reversal_time(self, v: float) -> float:
        """Return the time (s) at which the force reverses the motion; infinite when it does not."""
        if (v <= 0.0 or self.C >= 0.0) and (v >= 0.0 or self.C <= 0.0):  # a product of them could underflow
            return inf
        return time_to_rest(*self.drag(v), -abs(self.C), abs(v))


def axis_of(equation: AxisAlone) -> Axis:
    """Return the motion of an axis from its equation."""
    return Axis(equation.A, equation.B, equation.C, equation.reverse)


def axes(rov: Vehicle, inputs: Mapping[str, float]) -> tuple[Axis, ...]:
    """Return the motion of every axis of a vehicle without lag and coupling under held inputs."""
    return tuple(map(axis_of, rov.motions(inputs)))


def advance(
    A: float, B: float, C: float, v0: float, h: float, reverse: tuple[float, float] | None = None
) -> tuple[float, float]:
    """Return the velocity after h > 0 seconds and the distance covered, both signed: v(h) and the integral of v.

    `reverse` is A and B for v < 0 where they differ.
    """
    sign = -1.0 if v0 < 0.0 or (v0 == 0.0 and C < 0.0) else 1.0
    ahead, behind = (A, B), reverse or (A, B)
    if sign < 0.0:
        C, v0, ahead, behind = -C, -v0, behind, ahead
    A, B = ahead
    # Deceleration is strongest at the start, so the left side bounds the velocity that the step can take away.
    if C < 0.0 and ((B + A * v0) * v0 - C) * h >= v0:
        rest = time_to_rest(A, B, C, v0)
        if rest < h:
            forth = _leg(A, B, C, v0, rest)[1]
            v, back = _leg(*behind, -C, 0.0, h - rest)
            return -sign * v, sign * (forth - back)
    v, s = _leg(A, B, C, v0, h)
    return sign * v, sign * s


def time_to_rest(A: float, B: float, C: float, v0: float) -> float:
    """Return the time (s) at which a force C < 0 stops a motion v0 > 0."""
    D = _signed_root(A, B, C)
    S = v0 / (B * v0 - 2.0 * C)
    x = D * S
    if x == 0.0:  # D = 0, or an underflow
        return 2.0 * S
    if x < 0.0:
        return 2.0 * S * (atan(x) / x)
    if x > 0.5:  # artanh would lose the distance of its argument from 1
        return log1p(D * v0 / (-C * (1.0 + 2.0 * A / (B + D) * v0))) / D
    return 2.0 * S * (atanh(x) / x)


def _signed_root(A: float, B: float, C: float) -> float:
    """Return the root of |D^2| with the sign of D^2, where D^2 = B^2 + 4 A C and C < 0."""
    D2 = B * B + 4.0 * A * C
    if 1e-290 < abs(D2) < 1e300:
        return copysign(sqrt(abs(D2)), D2)
    root = 2.0 * sqrt(A) * sqrt(-C)  # B^2 or A C may have underflowed or overflowed
    return copysign(sqrt(abs(B - root)) * sqrt(B + root), B - root)


def _leg(A: float, B: float, C: float, v0: float, h: float) -> tuple[float, float]:
    """Return v(h) and its integral for v0 >= 0 while v keeps its sign.

    `_end_velocity` gives v with f = tanh(r)/r and r^2 = q. The distance is ln(1 + A X)/A, where X = h (v0 Y + C h W).
    Y and W are the divided differences of exp(l) and of (exp(l) - 1)/l between l1 and l2. Neither formula cancels.
    """
    a, b, c = A * h, 0.5 * B * h, C * h
    q = b * b + a * c
    if -_MODERATE < q < 4.0 * _MODERATE:
        x = 0.25 * q
        n, m = _tanh_fraction(x)
        # f = g/(1 + x g^2), g = tanh(r/2)/(r/2) = n/m
        N, M = _tanh_fraction(q) if q < _MODERATE else (n * m, m * m + x * n * n)
        v = _end_velocity(a, b, c, v0, N, M, M - b * N)
        mean = _mean_velocity(b, c, x, v0, n, m)
    elif q < 0.0:
        root = sqrt(-q)
        x, y, fade = cos(root), sin(root) / root, exp(-b)
        v = _end_velocity(a, b, c, v0, y, x, x - b * y)
        mean = v0 * fade * y + (fade * (x + b * y) - 1.0) / a
    else:
        root = sqrt(q) if q < 1e300 else hypot(b, sqrt(a) * sqrt(c))
        l1, l2 = a * (c / (root + b)), -(root + b)  # root - b without cancellation, and -root - b
        is_settled = root > 20.0 and root - b > 2.0  # the initial velocity has no effect any more
        decay = 0.0 if is_settled else exp(-2.0 * root)
        gain, M = 1.0 - decay, root * (1.0 + decay)
        v = _end_velocity(a, b, c, v0, gain, M, l1 - decay * l2)
        if l1 > 1.0:  # exp(l1) may overflow
            return v, h * ((l1 + log(0.5 * (M + (b + a * v0) * gain) / root)) / a)
        rise = expm1(l1)  # exp - 1 at l1, and at l2
        fall = decay * (1.0 + rise) - 1.0
        mean = (v0 * (rise - fall) + c * ((rise / l1 if l1 != 0.0 else 1.0) - fall / l2)) / (2.0 * root)
    p = a * mean
    return v, h * mean * (log1p(p) / p if p > 0.0 else 1.0)


def _end_velocity(a: float, b: float, c: float, v0: float, N: float, M: float, keep: float) -> float:
    """Return v = (v0 (1 - b f) + c f) / (1 + (b + a v0) f), where f = N/M and keep = M - b N.

    The change is added to v0, unless it is most of v0. Rounding then never makes drag accelerate the vehicle, and a
    steady velocity stays the same.
    """
    drag = b + a * v0
    growth = M + drag * N
    change = (c - (b + drag) * v0) * N / growth
    return v0 + change if change > -0.5 * v0 else (v0 * keep + c * N) / growth


def _mean_velocity(b: float, c: float, x: float, v0: float, n: float, m: float) -> float:
    """Return X/h = v0 Y + c W for a moderate |q|, where x = q/4.

    With g = tanh(r/2)/(r/2) = n/m and t = r g/2, and with g_b and t_b for r = b,

        exp(-b) = (1 - t_b)/(1 + t_b),    cosh(r) = (1 + t^2)/(1 - t^2),    sinh(r)/r = g/(1 - t^2)
        Y = (1 - t_b) g / ((1 + t_b) (1 - t^2))
        W = (g^2 + b (2 + b g) dg) / (2 (1 + t_b) (1 - t^2)),   dg = (g - g_b)/(q - b^2)

    and dg follows from the divided differences of n and m, which need no subtraction of nearly equal numbers.
    """
    y, half = 0.25 * b * b, 0.5 * b
    n_b, m_b = _tanh_fraction(y)
    dn, dm = _tanh_difference(x, y)
    coasting = (m_b - half * n_b) * (n * m)
    pushed = 0.5 * (m_b * n * n + half * (m + half * n) * (dn * m_b - n_b * dm))
    return (v0 * coasting + c * pushed) / ((m_b + half * n_b) * (m * m - x * n * n))


def _tanh_fraction(x: float) -> tuple[float, float]:
    """Return n and m of tanh(sqrt(x))/sqrt(x) = n/m, a continued fraction that is exact to rounding for |x| < 0.9."""
    x2 = x * x
    n = (_N[0] + _N[1] * x) + x2 * ((_N[2] + _N[3] * x) + x2 * _N[4])
    m = (_M[0] + _M[1] * x) + x2 * ((_M[2] + _M[3] * x) + x2 * _M[4])
    return n, m


def _tanh_difference(x: float, y: float) -> tuple[float, float]:
    """Return the divided differences of n and m between x and y."""
    first, product = x + y, x * y
    second = first * first - product
    third = first * (second - product)
    dn = (_N[1] + _N[2] * first) + (_N[3] * second + _N[4] * third)
    dm = (_M[1] + _M[2] * first) + (_M[3] * second + _M[4] * third)
    return dn, dm


_N = [k / 34459425.0 for k in (34459425.0, 4729725.0, 135135.0, 990.0, 1.0)]
_M = [k / 34459425.0 for k in (34459425.0, 16216200.0, 945945.0, 13860.0, 45.0)]
