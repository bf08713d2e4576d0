"""The base class of curves that are fitted to measured points, with the errors of fit and prediction."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from math import nan

import numpy as np

from rov_fmu.identify.least_squares import Estimate, rms
from rov_fmu.tank.arrays import Array, Flags


@dataclass(frozen=True, eq=False)
class CurveFit(ABC):
    """A curve over n points: force (N) over command, or force (N, N.m) over velocity."""

    x: Array
    y: Array
    weights: Array
    """The weights W_k of (7)."""
    estimate: Estimate
    leave_one_out: Array
    """Leave-one-thrust-out: the prediction by a fit without the points of the same thrust; NaN where too few remain."""

    @abstractmethod
    def value(self, x: Array) -> Array:
        """Return the curve at x."""

    @abstractmethod
    def slopes(self, x: Array) -> Array:
        """Return the derivatives of the curve by the fitted coefficients, n x p."""

    @property
    def counts(self) -> Flags:
        """True for each point that has a weight."""
        return self.weights > 0.0

    def band(self, x: Array) -> tuple[Array, Array]:
        """Return the 95 % confidence band of the curve; infinite where there are too few points."""
        reach = self.estimate.half_band(self.slopes(x))
        return self.value(x) - reach, self.value(x) + reach

    @cached_property
    def residuals(self) -> Array:
        """The measured less the fitted values."""
        return self.y - self.value(self.x)

    @property
    def residual_rms(self) -> float:
        """The RMS of the residuals over the points that count."""
        return rms(self.residuals[self.counts])

    @property
    def r_squared(self) -> float:
        """The share of the weighted variance about the mean that the curve explains."""
        if not self.weights.any():
            return nan
        total = float(self.weights @ (self.y - np.average(self.y, weights=self.weights)) ** 2)
        return 1.0 - float(self.weights @ self.residuals**2) / total if total > 0.0 else nan

    @property
    def leave_one_out_error(self) -> float:
        """The RMS error of leave-one-thrust-out over the points that count and have a prediction."""
        errors = (self.y - self.leave_one_out)[self.counts]
        return rms(errors[np.isfinite(errors)])
