"""Whether the velocity and the position of a log agree, and by what the velocity is off where they do not."""

from dataclasses import dataclass

import numpy as np

from rov_fmu.tank.arrays import Array, Flags
from rov_fmu.tank.clocks import first_in_each

_LEAST = 20
"""The least number of changes of a position."""
_APART = 2.0
"""The time over which changes of a position are compared with a velocity, s."""
_SAME_SCALE, _SAME_SPEED, _CLEAR = 0.01, 0.01, 4.0
"""A velocity disagrees with a position if its scale differs by more than this share, or the velocity by more than this
offset, m/s or rad/s, and if the difference exceeds this number of standard errors."""
_PRIOR_SCALE, _PRIOR_OFFSET, _PRIOR_LAG = 1.0, 0.3, 0.5
"""The deviations of the scale, of the offset (m/s or rad/s) and of the lag of a position (s), which count
if no motion tells them."""
_MOST_LAG = 2.0
"""The longest lag of a position that is taken into account exactly, s."""
_LEAST_REST = 1e-4
"""The least error of a change of a position that counts, m or rad."""
_ROUNDS = 8
"""The number of fits in turn whose weights follow from the errors of the one before."""


@dataclass(frozen=True, eq=False)
class Disagreement:
    """How the velocity along k axes differs from the changes of a position: p' = scale v + offset."""

    scale: Array
    scale_errors: Array
    offset: Array
    """m/s or rad/s."""
    offset_errors: Array

    @property
    def scaled(self) -> Flags:
        """k: True where the scale is clearly another one than 1."""
        return np.abs(self.scale - 1.0) >= np.maximum(_SAME_SCALE, _CLEAR * self.scale_errors)

    @property
    def moved(self) -> Flags:
        """k: True where the offset is clearly not 0."""
        return np.abs(self.offset) >= np.maximum(_SAME_SPEED, _CLEAR * self.offset_errors)


def disagreement(time: Array, position: Array, velocity: Array, axes: Array | None = None) -> Disagreement | None:
    """Return how a velocity (n x k, at n times) differs from a position (n x k); None if too little is known.

    The velocity is along k axes of the frame of the position, or along those in `axes` (n x k x k: its columns).

    The means of the position over 2 s change by scale * (those of the integral of v) + offset * time - lag * (those of
    v). The lag is that of the position's sensor. Noise, outliers and jumps of the position hardly count (weights of a
    Cauchy distribution), and errors of neighbouring changes may be correlated. Offset, scale and lag have weak priors,
    for motion that does not determine them.

    A position that a vehicle computes from its velocity agrees with it. Any other position is the better one over long
    times: its errors do not grow, while those of an integrated velocity do. So the offset is that of the velocity.
    """
    from scipy.integrate import cumulative_trapezoid  # imported here because it is slow

    known = np.isfinite(position).all(axis=1) & np.isfinite(velocity).all(axis=1)
    time, position, velocity = time[known], position[known], velocity[known]
    k = velocity.shape[1]
    axes = np.broadcast_to(np.eye(k), (len(time), k, k)) if axes is None else axes[known]
    rows = first_in_each(time, 1.0 / _APART)
    whole = np.diff(time[rows]) < 1.5 * _APART
    if whole.sum() < _LEAST:
        return None
    along = axes * velocity[:, None, :]
    paths = cumulative_trapezoid(np.concatenate([along, axes], axis=2), time, axis=0, initial=0.0)
    columns = np.concatenate([paths, -along.sum(axis=2, keepdims=True)], axis=2)
    count = np.diff(rows, append=len(time))

    def changes(values: Array) -> Array:
        means = np.add.reduceat(values, rows, axis=0) / count.reshape(-1, *[1] * (values.ndim - 1))
        return np.asarray(np.diff(means, axis=0)[whole])

    A, lag = changes(columns), 0.0
    prior = np.diag(1.0 / np.array([_PRIOR_SCALE] * k + [_PRIOR_OFFSET] * k + [_PRIOR_LAG]))
    mean, x = np.array([1.0] * k + [0.0] * (k + 1)), np.zeros(2 * k + 1)
    x[:k] = 1.0
    for _ in range(_ROUNDS):
        y = changes(np.column_stack([np.interp(time + lag, time, column) for column in position.T])) + A[:, :, -1] * lag
        rest = y - A @ x
        size = np.maximum(1.4826 * np.median(np.abs(rest), axis=0), _LEAST_REST)
        weights = 1.0 / (size * np.sqrt(1.0 + (rest / (2.0 * size)) ** 2))
        M = np.concatenate([(A * weights[:, :, None]).reshape(-1, 2 * k + 1), prior])
        x = np.linalg.lstsq(M, np.append(weights * y, prior @ mean), rcond=None)[0]
        lag = float(np.clip(x[-1], 0.0, _MOST_LAG))
    rest = weights * (y - A @ x)
    alike = max(0.0, min(float(np.sum(rest[1:] * rest[:-1]) / np.sum(rest**2 + 1e-12)), 0.9))
    variance = max(float(np.mean(rest**2)), 1.0) * (1.0 + alike) / (1.0 - alike)
    errors = np.sqrt(variance * np.diag(np.linalg.inv(M.T @ M)))
    return Disagreement(x[:k], errors[:k], x[k : 2 * k], errors[k : 2 * k])


def offset_in_words(offset: float, unit: str) -> str:
    """Return an offset of a velocity in m/s or rad/s in words, such as `+2 cm/s`."""
    factor, shown = (np.degrees(1.0), "deg/s") if unit == "rad/s" else (100.0, "cm/s")
    return f"{factor * offset:+.2g} {shown}"
