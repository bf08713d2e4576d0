"""Thrust over command and drag over velocity by (weighted) least squares, (6)-(16)."""

from dataclasses import dataclass
from math import nan

import numpy as np
from scipy.optimize import lsq_linear

from rov_fmu.identify.least_squares import Estimate, Solution, bounds, estimate_alike, leave_one_out, rms
from rov_fmu.tank.arrays import Array, Flags


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
    leave_one_out: Array
    """Leave-one-thrust-out: a fit without the points of its thrust, at every point; NaN where too few are left."""

    @property
    def a(self) -> float:
        """Quadratic coefficient."""
        return float(self.estimate.values[0])

    @property
    def b(self) -> float:
        """Linear coefficient."""
        return float(self.estimate.values[1])

    @property
    def counts(self) -> Flags:
        """Whether a point has weight."""
        return self.weights > 0.0

    @property
    def residual_rms(self) -> float:
        """Over the points that count."""
        return rms(self.residuals[self.counts])

    def value(self, x: Array) -> Array:
        """The curve."""
        return np.asarray(quadratic(x) @ self.estimate.values)

    def band(self, x: Array) -> tuple[Array, Array]:
        """95 % confidence band of the curve; infinite where there are too few points."""
        reach = self.estimate.half_band(quadratic(x))
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
        total = float(self.weights @ (self.y - np.average(self.y, weights=self.weights)) ** 2)
        return 1.0 - float(self.weights @ self.residuals**2) / total if total > 0.0 else nan

    @property
    def leave_one_out_error(self) -> float:
        """Leave-one-thrust-out: RMS of measured less predicted, over the points that count."""
        return rms((self.y - self.leave_one_out)[self.counts])


def fit_quadratic(
    names: tuple[str, str], x: Array, y: Array, weights: Array | None = None, groups: Array | None = None
) -> QuadraticFit:
    """(Weighted) least squares (6), (7) of two coefficients within their bounds; a group is left out as a whole."""
    weights = np.ones_like(x) if weights is None else weights
    groups = np.abs(x) if groups is None else groups
    low, high = bounds(names)
    root, used = np.sqrt(weights), weights > 0.0
    M, weighted = quadratic(x) * root[:, None], root * y
    values = _linear(M, weighted, low, high)
    free = _linear(M, weighted, np.full(2, -np.inf), np.full(2, np.inf))

    def without(out: Flags) -> Array | None:
        enough = len(np.unique(groups[used & ~out])) >= 2
        return quadratic(x[out]) @ _linear(M[~out], weighted[~out], low, high) if enough else None

    found = estimate_alike(names, Solution(values, weighted - M @ values, M), int(used.sum()))
    return QuadraticFit(x, y, weights, found, (float(free[0]), float(free[1])), leave_one_out(groups, without))


def quadratic(x: Array) -> Array:
    """n x 2: |x| x and x, what a and b are the factors of."""
    return np.column_stack([np.abs(x) * x, x])


def _linear(M: Array, y: Array, low: Array, high: Array) -> Array:
    return np.asarray(lsq_linear(M, y, bounds=(low, high), method="bvls").x)
