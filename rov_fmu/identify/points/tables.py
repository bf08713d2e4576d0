"""Tables of points and of forces as residuals of the fit to recordings."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from typing_extensions import Self

from rov_fmu.identify.least_squares import Estimate
from rov_fmu.identify.points.drag_forms import Point
from rov_fmu.identify.points.response_fit import ResponseFit, predict
from rov_fmu.identify.points.thrust_fit import ThrustFit, forces
from rov_fmu.model.layout import Axis
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array

_LEAST = 0.01
"""The least relative error of a point. The points of a table share errors that their scatter does not show."""
_FAR = 10.0
"""The ratio of a modelled to a measured value beyond which a residual does not grow."""


class Table(Protocol):
    """Measurements that are independent of the recordings, whose residuals follow from the coefficients of a
    vehicle."""

    def __len__(self) -> int:
        """Return the number of measurements."""

    def residuals(self, rov: Rov) -> Array:
        """Return the residuals of all measurements, in standard errors."""


@dataclass(frozen=True, eq=False)
class TablePoints:
    """Measured V_ss and Tau of one axis that are independent of its recordings: n points."""

    axis: Axis
    points: tuple[Point, ...]
    error: float
    """The relative standard error of each point."""

    @classmethod
    def of(cls, fit: ResponseFit) -> Self | None:
        """Return the points of a fit. Their error is their scatter about the fit. None if the scatter is unknown."""
        own = fit.given_thrust
        if not own.degrees_of_freedom > 0.0:
            return None
        points = tuple(p for p in fit.points if p.weight > 0.0)
        return cls(fit.axis, points, max(own.noise * own.student, _LEAST))

    def __len__(self) -> int:
        return len(self.points)

    def residuals(self, rov: Rov) -> Array:
        """Return the relative errors of a vehicle's V_ss and Tau, in standard errors, n."""
        measured = np.array([p.value for p in self.points])
        with np.errstate(all="ignore"):  # without any drag both are infinite
            ratios = predict(self.axis, rov, self.points) / measured
        return np.asarray((np.clip(np.nan_to_num(ratios, nan=_FAR), -_FAR, _FAR) - 1.0) / self.error)


@dataclass(frozen=True, eq=False)
class TableForces:
    """Measured forces of a thrust curve: n forces."""

    curve: str
    x: Array
    """The commands."""
    y: Array
    """The forces of all thrusters of the curve together, N."""
    error: float
    """The standard error of each force, N."""
    fitted: Estimate
    """The coefficients of the curve that are fitted, with their values from the forces only."""

    @classmethod
    def of(cls, fit: ThrustFit) -> Self | None:
        """Return the forces of a fit, as uncertain as they scatter about it; None where they do not scatter."""
        if not fit.is_uncertain:
            return None
        own, counts = fit.estimate, fit.counts
        return cls(fit.curve.name, fit.x[counts], fit.y[counts], own.noise * own.student, own)

    def __len__(self) -> int:
        return len(self.x)

    def residuals(self, rov: Rov) -> Array:
        """Return the modelled less the measured forces, in standard errors, n."""
        curve = rov.layout.curves_by_name[self.curve]
        return np.asarray((forces(curve, rov.coefficients, self.x) - self.y) / self.error)
