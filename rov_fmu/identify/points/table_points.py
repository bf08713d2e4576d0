"""Points of tables as residuals of the fit to recordings."""

from dataclasses import dataclass
from math import inf

import numpy as np
from typing_extensions import Self

from rov_fmu.identify.points.drag_forms import Point
from rov_fmu.identify.points.response_fit import ResponseFit, predict
from rov_fmu.model.layout import Axis
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.uncertainty import quantile

_LEAST = 0.01
"""The least relative error of a point. The points of a table share errors that their scatter does not show."""
_FAR = 10.0
"""The ratio of a modelled to a measured value beyond which a residual does not grow."""


@dataclass(frozen=True, eq=False)
class TablePoints:
    """Measured V_ss and Tau of one axis that are independent of its recordings: n points."""

    axis: Axis
    points: tuple[Point, ...]
    error: float
    """The relative standard error of each point."""

    @classmethod
    def of(cls, fit: ResponseFit) -> Self | None:
        """Return the points of a fit, as uncertain as they scatter about it; None where their scatter is unknown.

        The fit to few points underestimates the scatter by chance, so the error is increased as in Student's
        distribution.
        """
        own = fit.given_thrust
        if not own.degrees_of_freedom > 0.0:
            return None
        points = tuple(p for p in fit.points if p.weight > 0.0)
        scatter = own.noise * quantile(own.degrees_of_freedom) / quantile(inf)
        return cls(fit.axis, points, max(scatter, _LEAST))

    def residuals(self, rov: Rov) -> Array:
        """Return the relative errors of a vehicle's V_ss and Tau, in standard errors, n."""
        measured = np.array([p.value for p in self.points])
        with np.errstate(all="ignore"):  # without any drag both are infinite
            ratios = predict(self.axis, rov, self.points) / measured
        return np.asarray((np.clip(np.nan_to_num(ratios, nan=_FAR), -_FAR, _FAR) - 1.0) / self.error)
