"""The exact motion of one axis under commands held one after the other, at many times at once (NumPy).

The same mathematics as in riccati.py, which also carries the motion from one hold to the next; only the evaluation
within a hold is written for arrays.
"""

from collections.abc import Iterable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rov_fmu.motion.riccati import Riccati

Array = NDArray[np.float64]


def trajectory(axes: Iterable[Riccati], starts: Array, v0: float, times: Array) -> tuple[Array, Array]:
    """Velocity and distance covered at the given times (ascending, from starts[0] on), in SI units.

    `axes` are the axis under each held command, `starts` the times (s) from which each is held, ascending; v0 is the
    velocity at starts[0]. Errors stay below 1e-10 of the largest velocity and distance.
    """
    legs: list[
        tuple[float, float, float, float]
    ] = []  # start, velocity, distance and C of motions that keep their sign
    v, s, A, B = v0, 0.0, 0.0, 0.0
    for axis, (start, end) in zip(axes, pairwise([*starts.tolist(), float(times[-1])]), strict=True):
        A, B = axis.A, axis.B
        legs.append((start, v, s, axis.C))
        if end <= start:
            continue
        turn = axis.turning_time(v)
        if turn < end - start:
            legs.append((start + turn, 0.0, s + axis.distance(v, turn), axis.C))
        v, covered = axis.advance(v, end - start)
        s += covered
    start_of, v_of, s_of, C_of = np.array(legs).T
    leg = np.searchsorted(start_of, times, side="right") - 1
    v_at, covered_at = _within(A, B, C_of[leg], v_of[leg], times - start_of[leg])
    return v_at, s_of[leg] + covered_at


def _within(A: float, B: float, C: Array, v0: Array, h: Array) -> tuple[Array, Array]:
    """v(h) and its integral where v keeps its sign: with b = B h/2, q = b^2 + A C h^2, r = sqrt(q), k = r - b,

    v = (v0 (1 - b f) + C h f) / (1 + (b + A h v0) f) with f = tanh(r)/r, and the distance is ln(y)/A with
    y = exp(k) (1 + (A h v0 - k) (1 - exp(-2 r))/(2 r)). Where q < 0, r is imaginary and both stay real.
    """
    sign = np.where((v0 < 0.0) | ((v0 == 0.0) & (C < 0.0)), -1.0, 1.0)
    C, v0, A = sign * C, sign * v0, max(A, 1e-12)
    a, b, c = A * h, 0.5 * B * h, C * h
    q = b * b + a * c
    r = np.emath.sqrt(np.where(np.abs(q) < 1e-30, 1e-30, q))
    gain = -np.expm1(-2.0 * r)
    k = a * c / (r + b)  # r - b without cancellation
    x, y = r * (2.0 - gain), b * gain
    v = (v0 * (x - y) + c * gain) / (x + y + a * v0 * gain)
    distance = (k + np.log1p((a * v0 - k) * gain / (2.0 * r))) / A
    return sign * v.real, sign * distance.real
