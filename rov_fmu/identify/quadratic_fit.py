"""Thrust over command and drag over velocity by (weighted) least squares, (6)-(16)."""

from dataclasses import dataclass
from math import nan, sqrt

import numpy as np
from scipy.optimize import lsq_linear
from scipy.stats import t as student

from rov_fmu.identify.least_squares import LEVEL, Array, Estimate, bounds, covariance, estimate, rms
from rov_fmu.motion.rov import COEFFICIENTS


@dataclass(frozen=True, eq=False)
class QuadraticFit:
    """y = a |x| x + b x over n points: force (N) over command, or force (N, N.m) over velocity."""

    x: Array
    y: Array
    weights: Array
    """W_k of (7)."""
    estimate: Estimate
    unbounded: tuple[float, float]
    """a and b if they could take any value."""
    left_out: Array
    """Prediction of every point by a fit without the points of its thrust; NaN where too few are left."""

    @property
    def a(self) -> float:
        """Quadratic coefficient."""
        return float(self.estimate.values[0])

    @property
    def b(self) -> float:
        """Linear coefficient."""
        return float(self.estimate.values[1])

    def value(self, x: Array) -> Array:
        """The curve."""
        return np.asarray(_quadratic(x) @ self.estimate.values)

    def band(self, x: Array) -> tuple[Array, Array]:
        """95 % confidence band of the curve; infinite where there are too few points."""
        if self.estimate.freedom <= 0.0 or not np.isfinite(self.estimate.covariance).all():
            return np.full_like(x, -np.inf), np.full_like(x, np.inf)
        M = _quadratic(x)
        reach = student.ppf(0.5 + 0.5 * LEVEL, self.estimate.freedom) * np.sqrt(
            np.einsum("ij,jk,ik->i", M, self.estimate.covariance, M)
        )
        return self.value(x) - reach, self.value(x) + reach

    @property
    def residuals(self) -> Array:
        """Measured less fitted."""
        return self.y - self.value(self.x)

    @property
    def r_squared(self) -> float:
        """Share of the weighted variance about the mean that the curve explains."""
        if not self.weights.any():
            return nan
        spread = self.y - np.average(self.y, weights=self.weights)
        total = float(self.weights @ spread**2)
        return 1.0 - float(self.weights @ self.residuals**2) / total if total > 0.0 else nan

    @property
    def left_out_error(self) -> float:
        """RMS of measured less predicted without the point's own thrust, over the points that count."""
        return rms((self.y - self.left_out)[self.weights > 0.0])

    @property
    def at_bound(self) -> tuple[str, ...]:
        """Coefficients that stop at the edge of what is physical."""
        return tuple(
            name for name, value in self.estimate.named.items()
            if value in (COEFFICIENTS[name].minimum, COEFFICIENTS[name].maximum)
        )  # fmt: skip


def fit_quadratic(
    names: tuple[str, str], x: Array, y: Array, weights: Array | None = None, groups: Array | None = None
) -> QuadraticFit:
    """(Weighted) least squares (6), (7) of two coefficients within their bounds; a group is left out as a whole."""
    weights = np.ones_like(x) if weights is None else weights
    groups = np.abs(x) if groups is None else groups
    low, high = bounds(names)
    root = np.sqrt(weights)[:, None]
    M = _quadratic(x) * root
    values = _linear(M, y * root[:, 0], low, high)
    free = _linear(M, y * root[:, 0], np.full(2, -np.inf), np.full(2, np.inf))
    used = weights > 0.0
    freedom = float(used.sum() - 2)
    residuals = root[:, 0] * y - M @ values
    noise = sqrt(float(residuals @ residuals) / freedom) if freedom > 0.0 else nan
    spread = covariance(M.T @ M) * noise**2 if freedom > 0.0 else np.full((2, 2), np.inf)
    found = estimate(names, values, spread, freedom, noise)
    left_out = np.full_like(y, np.nan)
    for group in np.unique(groups):
        out = groups == group
        if len(np.unique(groups[used & ~out])) >= 2:
            left_out[out] = _quadratic(x[out]) @ _linear(M[~out], (root[:, 0] * y)[~out], low, high)
    return QuadraticFit(x, y, weights, found, (float(free[0]), float(free[1])), left_out)


def _quadratic(x: Array) -> Array:
    return np.column_stack([np.abs(x) * x, x])


def _linear(M: Array, y: Array, low: Array, high: Array) -> Array:
    return np.asarray(lsq_linear(M, y, bounds=(low, high), method="bvls").x)
