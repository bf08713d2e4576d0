"""A curve fitted to measured points, whatever its form: how well it fits, and how well it predicts."""

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
    """W_k of (7)."""
    estimate: Estimate
    leave_one_out: Array
    """Leave-one-thrust-out: a fit of the same form without the points of its thrust; NaN where too few are left."""

    @abstractmethod
    def value(self, x: Array) -> Array:
        """The curve."""

    @abstractmethod
    def slopes(self, x: Array) -> Array:
        """n x p: of the curve by what was fitted."""

    @property
    def counts(self) -> Flags:
        """Whether a point has weight."""
        return self.weights > 0.0

    def band(self, x: Array) -> tuple[Array, Array]:
        """95 % confidence band of the curve; infinite where there are too few points."""
        reach = self.estimate.half_band(self.slopes(x))
        return self.value(x) - reach, self.value(x) + reach

    @cached_property
    def residuals(self) -> Array:
        """Measured less fitted."""
        return self.y - self.value(self.x)

    @property
    def residual_rms(self) -> float:
        """Over the points that count."""
        return rms(self.residuals[self.counts])

    @property
    def r_squared(self) -> float:
        """Share of the weighted variance about the mean that the curve explains."""
        if not self.weights.any():
            return nan
        total = float(self.weights @ (self.y - np.average(self.y, weights=self.weights)) ** 2)
        return 1.0 - float(self.weights @ self.residuals**2) / total if total > 0.0 else nan

    @property
    def leave_one_out_error(self) -> float:
        """Leave-one-thrust-out: RMS of measured less predicted, over the points that count and have a prediction."""
        errors = (self.y - self.leave_one_out)[self.counts]
        return rms(errors[np.isfinite(errors)])
