"""What an identification yields: per thruster and axis the data, the fits, the warnings, and the vehicle they make."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from rov_fmu.identify.least_squares import Estimate
from rov_fmu.identify.next_test import NextTest
from rov_fmu.identify.points.drag_forms import Point
from rov_fmu.identify.points.quadratic_fit import QuadraticFit
from rov_fmu.identify.points.response_fit import ResponseFit, predict, relative_rms
from rov_fmu.identify.points.step_responses import StepResponse
from rov_fmu.identify.points.thrust_fit import ThrustFit
from rov_fmu.identify.recordings.held_out import HeldOut
from rov_fmu.identify.recordings.recordings_fit import RecordingsFit
from rov_fmu.identify.recordings.trajectory import MotionError
from rov_fmu.model.layout import Axis
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.tank_tests import TankTests
from rov_fmu.vehicle.vehicle import Vehicle


@dataclass(frozen=True, eq=False)
class AxisResult:
    """One axis: what was measured, what was fitted, what is taken."""

    axis: Axis
    points: tuple[Point, ...]
    """Of the tables and of the recordings."""
    steps: tuple[StepResponse, ...]
    """Held commands of the recordings."""
    drag: QuadraticFit | None
    """Force over measured V_ss as in (11)-(16), for comparison."""
    response: ResponseFit | None
    """By the points."""
    recordings: RecordingsFit | None
    """By the recordings."""
    assumed: Mapping[str, str]
    """Coefficients that are not identifiable, and what is assumed instead."""
    warnings: tuple[str, ...]
    next_test: NextTest | None = None
    """What would narrow the widest interval."""

    @property
    def held_out(self) -> HeldOut | None:
        """Each recording predicted by the others; None where that cannot be computed."""
        try:
            return self.recordings.held_out if self.recordings else None
        except MotionError:
            return None

    @property
    def chosen(self) -> Literal["recordings", "points", "known"]:
        """Which fit the vehicle takes."""
        return "recordings" if self.recordings else "points" if self.response else "known"

    @property
    def estimate(self) -> Estimate | None:
        """The chosen one."""
        fit = self.recordings or self.response
        return fit.estimate if fit else None

    @property
    def method(self) -> str:
        """The chosen one in words."""
        if self.recordings:
            return self.recordings.method
        if self.response:
            used = [p.quantity for p in self.response.points if p.weight > 0.0]
            counts = " and ".join(f"{n} {q}" for q in ("V_ss", "Tau") if (n := used.count(q)))
            return f"least squares of the relative errors of {counts}"
        return "given"


@dataclass(frozen=True, eq=False)
class Identification:
    """A vehicle, and all that it was made of."""

    tests: TankTests
    vehicle: Vehicle
    thrust: Mapping[str, ThrustFit]
    """By thruster, where it was tested; force (N) over command."""
    axes: tuple[AxisResult, ...]
    against: Vehicle | None
    """A vehicle to set beside."""

    @property
    def next_tests(self) -> tuple[NextTest, ...]:
        """What to measure next, the axis with the widest relative interval first."""
        found = (test for result in self.axes if (test := result.next_test))
        return tuple(sorted(found, key=lambda test: -test.width))

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is not identifiable from the data, and what speaks against the model."""
        assert self.vehicle.provenance
        return self.vehicle.provenance.warnings


@dataclass(frozen=True, eq=False)
class Comparison:
    """The measured points of one quantity of an axis beside models; n points, NaN where there is no number."""

    result: AxisResult
    quantity: str
    """V_ss or Tau."""
    points: tuple[Point, ...]
    model: Array
    leave_one_out: Array
    """Leave-one-thrust-out: by the fit to the points without those of the same thrust."""
    against: Array | None

    @property
    def columns(self) -> list[Array]:
        """Of the vehicle, leave-one-thrust-out, and of the vehicle to compare with where there is one."""
        return [self.model, self.leave_one_out, *([] if self.against is None else [self.against])]

    def rms(self, model: Array) -> float:
        """RMS relative error over the points that count."""
        return relative_rms(self.points, model, self.quantity)


def compare(identification: Identification) -> tuple[Comparison, ...]:
    """Every measured V_ss and Tau beside the vehicle, the leave-one-thrust-out fit, and the vehicle to compare with."""
    found, against = [], identification.against
    for result in identification.axes:
        for quantity in ("V_ss", "Tau"):
            if place := [n for n, p in enumerate(result.points) if p.quantity == quantity]:
                points = tuple(result.points[n] for n in place)
                model, none = predict(result.axis, identification.vehicle.rov, points), np.full(len(points), np.nan)
                out = result.response.leave_one_out[place] if result.response else none
                other = None
                if against:
                    other = predict(result.axis, against.rov, points) if against.layout.has(result.axis) else none
                found.append(Comparison(result, quantity, points, model, out, other))
    return tuple(found)
