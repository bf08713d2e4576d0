"""A textbook extended Kalman filter for continuous motion and samples at discrete times (Jazwinski 1970, chapter 8).

Between two samples, the mean and the covariance are integrated together by SciPy's DOP853:

    x' = f(t, x)      P' = F P + P F^T + Q      F = df/dx

All derivatives are central differences. Nothing here knows the vehicle or the filter of the identification.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]
Rates = Callable[[float, Array], Array]
"""The rates of n states at a time and a state."""

_PRECISION = {"method": "DOP853", "rtol": 1e-9, "atol": 1e-12}


@dataclass(frozen=True)
class Sample:
    """One sample of a sensor."""

    time: float
    value: float
    measure: Callable[[Array], float]
    """What the sensor measures without white noise, by the state."""
    white: float
    """The standard deviation of its white noise."""


@dataclass(frozen=True, eq=False)
class Belief:
    """A normal distribution of n states at a time."""

    time: float
    mean: Array
    covariance: Array

    def at(self, time: float, rates: Rates, diffusion: Array, switches: Sequence[float] = ()) -> "Belief":
        """Return the belief at a later time. The rates may jump at the switches."""
        n, state = len(self.mean), np.concatenate([self.mean, self.covariance.ravel()])

        def moments(t: float, y: Array) -> Array:
            x, P = y[:n], y[n:].reshape(n, n)
            F = derivatives(lambda x: rates(t, x), x)
            return np.concatenate([rates(t, x), (F @ P + P @ F.T + diffusion).ravel()])

        ends = [*(s for s in sorted(switches) if self.time < s < time), time]
        for begin, end in zip([self.time, *ends], ends, strict=False):
            inside = np.nextafter(begin, end), np.nextafter(end, begin)
            if inside[0] < inside[1]:
                state = solve_ivp(moments, inside, state, **_PRECISION).y[:, -1]
        return Belief(time, state[:n], state[n:].reshape(n, n))

    def predicted(self, sample: Sample) -> tuple[float, float, Array]:
        """Return the innovation of a sample at the time of the belief, its variance, and the gradient of the sensor."""
        H = derivatives(lambda x: np.array([sample.measure(x)]), self.mean)[0]
        return sample.value - sample.measure(self.mean), float(H @ self.covariance @ H) + sample.white**2, H

    def updated(self, sample: Sample) -> "Belief":
        """Return the belief after a sample, by the form of Joseph."""
        off, variance, H = self.predicted(sample)
        K = self.covariance @ H / variance
        keep = np.eye(len(K)) - np.outer(K, H)
        P = keep @ self.covariance @ keep.T + sample.white**2 * np.outer(K, K)
        return Belief(self.time, self.mean + K * off, P)


def derivatives(function: Callable[[Array], Array], x: Array) -> Array:
    """Return the matrix of derivatives of m numbers by n numbers, m x n."""
    columns = []
    for n in range(len(x)):
        step = np.zeros(len(x))
        step[n] = 1e-5 * max(abs(x[n]), 1e-2)
        columns.append((function(x + step) - function(x - step)) / (2.0 * step[n]))
    return np.column_stack(columns)


def run(
    belief: Belief, samples: Iterable[Sample], rates: Rates, diffusion: Array, switches: Sequence[float] = ()
) -> tuple[Array, Array]:
    """Return the innovations of all samples and their variances."""
    found = []
    for sample in samples:
        belief = belief.at(sample.time, rates, diffusion, switches)
        found.append(belief.predicted(sample)[:2])
        belief = belief.updated(sample)
    off, variance = zip(*found, strict=True)
    return np.array(off), np.array(variance)
