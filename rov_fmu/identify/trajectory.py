"""The exact motion of one axis under commands held one after the other, at many times at once (NumPy).

The closed form is that of riccati.py, which carries the motion from piece to piece. A piece is so short that its
fractions, plain arithmetic and so good for arrays too, give what happens within it.
"""

from collections.abc import Iterable
from itertools import pairwise
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from rov_fmu.motion.riccati import Riccati, mean_velocity, tanh_fraction

Array = NDArray[np.float64]

_REACH = 3.2  # of b^2 + |k|, up to which the fractions hold


def trajectory(axes: Iterable[Riccati], starts: Array, v0: float, times: Array) -> tuple[Array, Array]:
    """Velocity and distance covered at the given times (ascending, from starts[0] on), in SI units.

    `axes` are the axis under each held command, `starts` the times (s) from which each is held, ascending; v0 is the
    velocity at starts[0]. Errors stay below 1e-12 of the largest velocity and distance.
    """
    pieces: list[tuple[float, float, float, float]] = []  # start, velocity, distance and C; the motion keeps its sign
    v, s, A, B = v0, 0.0, 0.0, 0.0
    ends, samples = [*starts.tolist(), float(times[-1])], [*times.searchsorted(starts), len(times)]
    for axis, (start, end), (first, last) in zip(axes, pairwise(ends), pairwise(samples), strict=True):
        A, B = axis.A, axis.B
        pieces.append((start, v, s, axis.C))
        if end <= start:
            continue
        rest = axis.reversal_time(v)
        if rest < end - start:
            pieces.append((start + rest, 0.0, s + axis.distance(v, rest), axis.C))
        rate = sqrt((0.25 * B * B + A * abs(axis.C)) / _REACH)
        if rate * (end - start) > 1.0:
            inside = times[first:last]
            number = np.floor(rate * (inside - start))
            for time in inside[np.diff(number, prepend=0.0) > 0.0].tolist():
                v_then, covered = axis.advance(v, time - start)
                pieces.append((time, v_then, s + covered, axis.C))
        v, covered = axis.advance(v, end - start)
        s += covered
    start_of, v_of, s_of, C_of = np.array(sorted(pieces, key=lambda piece: piece[0])).T
    at = np.searchsorted(start_of, times, side="right") - 1
    v_at, covered_at = _within(A, B, C_of[at], v_of[at], times - start_of[at])
    return v_at, s_of[at] + covered_at


def _within(A: float, B: float, C: Array, v0: Array, h: Array) -> tuple[Array, Array]:
    """v(h) and its integral in a piece; see riccati.py, whose branches and last digits are not needed here."""
    sign = np.where((v0 < 0.0) | ((v0 == 0.0) & (C < 0.0)), -1.0, 1.0)
    C, v0 = sign * C, sign * v0
    a, b, c = A * h, 0.5 * B * h, C * h
    x = 0.25 * (b * b + a * c)
    n, m = tanh_fraction(x)
    N, M = n * m, m * m + x * n * n
    v = (v0 * (M - b * N) + c * N) / (M + (b + a * v0) * N)
    mean = mean_velocity(b, c, x, v0, n, m)
    p = np.maximum(a * mean, 1e-300)
    return sign * v, sign * h * mean * np.log1p(p) / p
