"""Exact motion of one axis under a held force (standard library only).

Thrust, quadratic and linear drag on a constant inertia, equation (18), make every axis a scalar Riccati equation

    v' = C - B v - A |v| v,        A >= 0, B >= 0,

whose solution is elementary. All functions take A in 1/m (1/rad for yaw), B in 1/s, C in m/s2 (rad/s2), times in s,
and are exact up to rounding for every step length, so one step of 10 s equals 1,000 steps of 10 ms.

Notation (b, k and q are pure numbers), for a motion that keeps its sign, v >= 0:

    b = B h/2    k = A C h^2    q = b^2 + k    l1, l2 = -b ± sqrt(q)

The linear equation y'' + B y' = A C y with y(0) = 1, y'(0) = A v0 gives v = y'/(A y) and the distance ln(y)/A.
"""

from math import atan, atanh, cos, e, exp, expm1, factorial, hypot, inf, isinf, log, log1p, sin, sqrt

# Below this |q| expansions in q stand for the hyperbolic functions; they need no branch on its sign.
_SMALL_Q = 0.2


def advance(A: float, B: float, C: float, v0: float, h: float) -> tuple[float, float]:
    """Return the velocity after h > 0 seconds and the distance covered, both signed: v(h) and the integral of v."""
    sign = -1.0 if v0 < 0.0 or (v0 == 0.0 and C < 0.0) else 1.0
    C, v0 = sign * C, sign * v0
    # Deceleration is strongest at the start, so the left side bounds the velocity that the step can take away.
    if C < 0.0 and ((B + A * v0) * v0 - C) * h >= v0:
        turn = time_to_rest(A, B, C, v0)
        if turn < h:
            forth = _leg(A, B, C, v0, turn)[1]
            v, back = _leg(A, B, -C, 0.0, h - turn)
            return -sign * v, sign * (forth - back)
    v, s = _leg(A, B, C, v0, h)
    return sign * v, sign * s


def time_to_rest(A: float, B: float, C: float, v0: float) -> float:
    """Return the time (s) at which a force C < 0 stops a motion v0 > 0."""
    D2 = B * B + 4.0 * A * C
    S = v0 / (B * v0 - 2.0 * C)
    D = sqrt(abs(D2))
    x = D * S
    if x == 0.0:  # D2 = 0, or an underflow
        return 2.0 * S
    if D2 < 0.0:
        return 2.0 * S * (atan(x) / x)
    if x > 0.5:  # artanh would lose the distance of its argument from 1
        return log1p(D * v0 / (-2.0 * A * C / (B + D) * v0 - C)) / D
    return 2.0 * S * (atanh(x) / x)


def steady_velocity(A: float, B: float, C: float) -> float:
    """Return the velocity V_ss at which drag balances the force, A |V| V + B V = C; infinite without drag."""
    if C < 0.0:
        return -steady_velocity(A, B, -C)
    if C == 0.0:
        return 0.0
    root = hypot(B, 2.0 * sqrt(A) * sqrt(C))
    return 2.0 * C / (B + root) if B + root > 0.0 else inf


def time_constant(A: float, B: float, C: float) -> float:
    """Return Tau of (17): the time in which a start from rest reaches (1 - 1/e) V_ss. Infinite without drag.

    With D = B + 2 A V_ss and p = 1 - 1/e, Tau = (2/D) artanh(p D / (D + (1 - p) B)).
    """
    V = steady_velocity(A, B, C)
    if isinf(V):
        return inf
    D = B + 2.0 * A * abs(V)
    if D == 0.0:
        return inf
    q = 1.0 / e
    return 2.0 * atanh((1.0 - q) * D / (D + q * B)) / D


def _leg(A: float, B: float, C: float, v0: float, h: float) -> tuple[float, float]:
    """v(h) and its integral for v0 >= 0 where v keeps its sign.

    v is that of `_end_velocity` with f = tanh(r)/r, r^2 = q, and the distance is ln(1 + A X)/A with
    X = h (v0 Y + C h W), both free of cancellation.
    """
    a, b, c = A * h, 0.5 * B * h, C * h
    q = b * b + a * c
    if abs(q) < _SMALL_Q:
        # f = N/M, its continued fraction in q: exact to the last digit here
        N = 1.0 + q * (17325.0 / 135135.0 + q * (378.0 / 135135.0 + q * (1.0 / 135135.0)))
        M = 1.0 + q * (62370.0 / 135135.0 + q * (3150.0 / 135135.0 + q * (28.0 / 135135.0)))
        v = _end_velocity(a, b, c, v0, N, M, M - b * N)
        Y, W = _means(b, a * c)
    elif q < 0.0:
        root = sqrt(-q)
        x, y, fade = cos(root), sin(root) / root, exp(-b)
        v = _end_velocity(a, b, c, v0, y, x, x - b * y)
        Y, W = fade * y, (fade * (x + b * y) - 1.0) / (a * c)
    else:
        root = sqrt(q) if q < 1e300 else hypot(b, sqrt(a) * sqrt(c))
        l1, l2 = a * (c / (root + b)), -(root + b)  # root - b without cancellation, and -root - b
        decay = exp(-2.0 * root)
        gain = 1.0 - decay
        M = root * (1.0 + decay)
        v = _end_velocity(a, b, c, v0, gain, M, l1 - decay * l2)
        if l1 > 1.0:  # exp(l1) may overflow
            return v, h * (l1 + log(0.5 * (M + (b + a * v0) * gain) / root)) / a
        Y = exp(l1) * gain / (2.0 * root)
        W = ((expm1(l1) / l1 if l1 != 0.0 else 1.0) - expm1(l2) / l2) / (2.0 * root)
    X = v0 * Y + c * W
    p = a * X
    return v, h * X * (log1p(p) / p if p > 0.0 else 1.0)


def _end_velocity(a: float, b: float, c: float, v0: float, N: float, M: float, keep: float) -> float:
    """v = (v0 (1 - b f) + c f) / (1 + (b + a v0) f), f = N/M, keep = M - b N.

    Taken as the change from v0, unless that is most of v0: rounding then never makes drag push, and what is steady
    stays.
    """
    growth = M + (b + a * v0) * N
    change = (c - (2.0 * b + a * v0) * v0) * N
    return v0 + change / growth if change > -0.5 * v0 * growth else (v0 * keep + c * N) / growth


def _means(b: float, k: float) -> tuple[float, float]:
    """Divided differences over l1, l2 of exp (Y) and of (exp(l) - 1)/l (W), for |l1|, |l2| <= 1.5.

    Y = sum H_n/(n+1)!, W = sum H_n/(n+2)! with H_n the complete homogeneous polynomial of l1, l2.
    """
    previous, current = 0.0, 1.0
    Y = W = 0.0
    for n in range(24):
        if (abs(current) + abs(previous)) * _INVERSE_FACTORIAL[n] <= 1e-17:
            break
        Y += current * _INVERSE_FACTORIAL[n]
        W += current * _INVERSE_FACTORIAL[n + 1]
        previous, current = current, k * previous - 2.0 * b * current
    return Y, W


_INVERSE_FACTORIAL = [1.0 / factorial(n + 1) for n in range(25)]
