"""Types of NumPy arrays, and their ranges in words."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


def range_in_words(values: Array) -> str:
    """Return the range of the finite values, such as `-0.2 to 1.5`."""
    there = values[np.isfinite(values)]
    if not len(there):
        return "empty"
    low, high = (f"{end:g}" for end in (there.min(), there.max()))
    return f"{low} to {high}" if low != high else f"always {low}"


def spread(values: Array) -> float:
    """Return the distance between the smallest and the largest finite value, or 0."""
    there = values[np.isfinite(values)]
    return float(np.ptp(there)) if len(there) else 0.0
