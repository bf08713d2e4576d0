"""Smoothed velocity from the measurements of a sensor, and their noise, section 4.1.

The filters are SciPy's: a local cubic (Savitzky-Golay) or the paper's moving average.
"""

from math import sqrt
from typing import Literal

import numpy as np

from rov_fmu.tank.arrays import Array

Method = Literal["savitzky-golay", "moving average"]

WINDOW = 0.5
"""The default length of the smoothing window, s. It holds until a time constant is known."""
_MOST_SAMPLES = 1_000_000
_MOST_PRODUCTS = 2e8
"""The most products of a sample and a weight. Rows in bursts have a short usual interval, and thus a wide window."""
_ORDER = 3
"""The order of the local polynomials. A quadratic would flatten the bend at Tau."""


def velocity(
    time: Array, values: Array, *, is_position: bool, window: float = WINDOW, method: Method = "savitzky-golay"
) -> tuple[Array, Array]:
    """Return evenly spaced times (s) and the smoothed velocity, from position or velocity; the window is in s."""
    from scipy.ndimage import uniform_filter1d  # imported here because it is slow, and tables do not need it
    from scipy.signal import savgol_filter

    span = float(time[-1] - time[0])
    step = max(float(np.median(np.diff(time))), span / _MOST_SAMPLES, sqrt(span * min(window, span) / _MOST_PRODUCTS))
    even = time[0] + step * np.arange(round(span / step) + 1)
    samples = np.interp(even, time, values)
    n = _odd(window / step, len(samples))
    if method == "moving average":
        smooth = uniform_filter1d(samples, n, mode="nearest")
        return even, np.gradient(smooth, step) if is_position else smooth
    return even, savgol_filter(samples, n, min(_ORDER, n - 1), deriv=int(is_position), delta=step, mode="interp")


def kernel(even: Array, window: float, *, is_position: bool) -> Array:
    """Return the weights of the local cubic on these evenly spaced times (s)."""
    from scipy.signal import savgol_coeffs

    interval = float(even[1] - even[0])
    n = _odd(window / interval, len(even))
    return np.asarray(savgol_coeffs(n, min(_ORDER, n - 1), deriv=int(is_position), delta=interval))


def without_spikes(values: Array) -> Array:
    """Return the values with outliers replaced by the median of five neighbours."""
    from scipy.ndimage import median_filter

    median = median_filter(values, 5, mode="nearest")
    return np.asarray(np.where(np.abs(values - median) > 8.0 * white_noise(values), median, values))


def white_noise(values: Array) -> float:
    """Estimate the standard deviation of the sensor's noise from second differences, in which smooth motion nearly
    vanishes."""
    return robust_deviation(np.diff(values, 2)) / sqrt(6.0)


def sensor_noise(values: Array) -> float:
    """Estimate the standard deviation of a sensor's noise. It is not less than the error of rounding to the
    resolution."""
    changes = np.abs(np.diff(values))
    resolution = float(changes[changes > 1e-9 * np.ptp(values)].min(initial=np.inf))
    return max(white_noise(values), resolution / sqrt(12.0) if np.isfinite(resolution) else 0.0)


def robust_deviation(values: Array) -> float:
    """Return a robust standard deviation, from the median absolute deviation."""
    return float(1.4826 * np.median(np.abs(values - np.median(values))))


def _odd(samples: float, most: int) -> int:
    """Return an odd number of samples, at least five unless there are fewer."""
    n = min(max(round(samples), 5), most)
    return n if n % 2 else n - 1
