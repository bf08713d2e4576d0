"""Types of NumPy arrays, and their ranges in words."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.intp]


def range_in_words(values: Array) -> str:
    """Return the range of the finite values, such as `-0.2 to 1.5`. Its ends have so many digits that they differ."""
    there = values[np.isfinite(values)]
    if not len(there):
        return "empty"
    ends = there.min(), there.max()
    if ends[0] == ends[1]:
        return f"always {ends[0]:g}"
    texts = ([f"{end:.{digits}g}" for end in ends] for digits in (6, 10, 17))
    return " to ".join(next(pair for pair in texts if pair[0] != pair[1]))


def spread(values: Array) -> float:
    """Return the distance between the smallest and the largest finite value, or 0."""
    there = values[np.isfinite(values)]
    return float(np.ptp(there)) if len(there) else 0.0


def usual_range(values: Array) -> tuple[float, float]:
    """Return between which two values nine tenths of all are: noise and short dips hardly change these."""
    low, high = np.quantile(values, (0.05, 0.95)).tolist()
    return low, high


def rms(values: Array) -> float:
    """Return the root of the mean of the squares of values."""
    return float(np.sqrt(np.mean(np.square(values))))


def true_runs(flags: Flags) -> list[tuple[int, int]]:
    """Return the first and the last index of each run of true values."""
    edges = np.flatnonzero(np.diff(flags, prepend=False, append=False))
    return [(int(start), int(end) - 1) for start, end in edges.reshape(-1, 2)]
