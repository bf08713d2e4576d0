"""Fit thrust over command and drag over velocity by (weighted) least squares, (6)-(16)."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from rov_fmu.identify.least_squares import Solution, bounds, estimate_alike, leave_one_out
from rov_fmu.identify.points.curve_fit import CurveFit
from rov_fmu.tank.arrays import Array, Flags


@dataclass(frozen=True, eq=False)
class QuadraticFit(CurveFit):
    """y = a |x| x + b x: force (N) over command, or force (N, N.m) over velocity."""

    unbounded: tuple[float, float]
    """a and b without bounds."""

    @property
    def a(self) -> float:
        """The quadratic coefficient."""
        return float(self.estimate.values[0])

    @property
    def b(self) -> float:
        """The linear coefficient."""
        return float(self.estimate.values[1])

    def value(self, x: Array) -> Array:
        """Return the curve at x."""
        return np.asarray(quadratic(x) @ self.estimate.values)

    def slopes(self, x: Array) -> Array:
        """Return the derivatives of the curve by a and b, n x 2."""
        return quadratic(x)


def fit_quadratic(
    names: tuple[str, str], x: Array, y: Array, weights: Array | None = None, groups: Array | None = None
) -> QuadraticFit:
    """Fit two coefficients within their bounds, (6), (7); leave-one-out leaves out one group at a time."""
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
    return QuadraticFit(x, y, weights, found, leave_one_out(groups, without), (float(free[0]), float(free[1])))


def quadratic(x: Array) -> Array:
    """Return |x| x and x, n x 2."""
    return np.column_stack([np.abs(x) * x, x])


def _linear(M: Array, y: Array, low: Array, high: Array) -> Array:
    return np.asarray(lsq_linear(M, y, bounds=(low, high), method="bvls").x)
