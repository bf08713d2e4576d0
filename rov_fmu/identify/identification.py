"""The results of an identification: the data, fits and findings of each thrust curve and axis, and the vehicle."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from rov_fmu.identify.adapter.tank_tests import TankTests
from rov_fmu.identify.findings import facts, warnings
from rov_fmu.identify.least_squares import Estimate
from rov_fmu.identify.next_test import NextTest
from rov_fmu.identify.points.drag_forms import Point
from rov_fmu.identify.points.quadratic_fit import QuadraticFit
from rov_fmu.identify.points.response_fit import ResponseFit, predict, relative_rms
from rov_fmu.identify.points.step_responses import StepResponse
from rov_fmu.identify.points.thrust_fit import ThrustFit
from rov_fmu.identify.recordings.held_out import HeldOut
from rov_fmu.identify.recordings.recordings_fit import RecordingsFit
from rov_fmu.model.layout import Axis
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.findings import Finding
from rov_fmu.vehicle.vehicle import Vehicle


@dataclass(frozen=True, eq=False)
class AxisResult:
    """The measurements and fits of one axis, and the fit that the vehicle takes."""

    axis: Axis
    points: tuple[Point, ...]
    """The points of the tables, and those read off the recordings. The latter have weight 0 if the recordings are
    fitted."""
    steps: tuple[StepResponse, ...]
    """The held commands of the recordings."""
    drag: QuadraticFit | None
    """The fit of force over measured V_ss as in (11)-(16), for comparison."""
    response: ResponseFit | None
    """The fit to the points."""
    recordings: RecordingsFit | None
    """The fit to the recordings."""
    assumed: Mapping[str, str]
    """Coefficients that are not identifiable, and the assumption about each."""
    findings: tuple[Finding, ...]
    next_test: NextTest | None = None
    """The test that would narrow the widest interval most."""

    @property
    def held_out(self) -> HeldOut | None:
        """The prediction of each recording by a fit to the others; None where none can be computed."""
        return self.recordings.held_out if self.recordings and self.recordings.held_out.predictions else None

    @property
    def chosen(self) -> Literal["recordings", "points", "known"]:
        """The fit that the vehicle takes."""
        return "recordings" if self.recordings else "points" if self.response else "known"

    @property
    def estimate(self) -> Estimate | None:
        """The estimate of the chosen fit."""
        fit = self.recordings or self.response
        return fit.estimate if fit else None

    @property
    def method(self) -> str:
        """A phrase about the chosen fit."""
        if self.recordings:
            return self.recordings.method
        if self.response:
            used = [p.quantity for p in self.response.points if p.weight > 0.0]
            counts = " and ".join(f"{n} {q}" for q in ("V_ss", "Tau") if (n := used.count(q)))
            return f"least squares of the relative errors of {counts}"
        return "given"


@dataclass(frozen=True, eq=False)
class Identification:
    """A vehicle, with the tests and fits that it comes from."""

    tests: TankTests
    vehicle: Vehicle
    thrust: Mapping[str, ThrustFit]
    """The fits of force (N) over command, by thrust curve, where it was tested."""
    axes: tuple[AxisResult, ...]
    against: Vehicle | None
    """The vehicle to compare with."""
    findings: tuple[Finding, ...]
    """What was left out, what is not identifiable, and what contradicts the model."""

    @property
    def next_tests(self) -> tuple[NextTest, ...]:
        """The tests that would help most; the axis with the widest relative interval comes first."""
        found = (test for result in self.axes if (test := result.next_test))
        return tuple(sorted(found, key=lambda test: -test.width))

    @property
    def warnings(self) -> tuple[str, ...]:
        """The sentences of the findings that ask for something, as warnings and doubts do."""
        return warnings(self.findings)

    @property
    def facts(self) -> tuple[str, ...]:
        """The sentences of the findings that only say what was found or done."""
        return facts(self.findings)


@dataclass(frozen=True, eq=False)
class Comparison:
    """The n measured points of one quantity of an axis, with the values of models. NaN stands for a missing value."""

    result: AxisResult
    quantity: str
    """V_ss or Tau."""
    points: tuple[Point, ...]
    model: Array
    leave_one_out: Array
    """Leave-one-thrust-out: the prediction by a fit without the points of the same thrust."""
    against: Array | None

    @property
    def counts(self) -> int:
        """The number of points that count."""
        return sum(p.weight > 0.0 for p in self.points)

    @property
    def columns(self) -> list[Array]:
        """The numbers of the vehicle, of leave-one-thrust-out, and of the vehicle to compare with, if any."""
        return [self.model, self.leave_one_out, *([] if self.against is None else [self.against])]

    def rms(self, model: Array) -> float:
        """Return the RMS relative error over the points that count."""
        return relative_rms(self.points, model, self.quantity)


def compare(identification: Identification) -> tuple[Comparison, ...]:
    """Compare each measured V_ss and Tau with the vehicle, leave-one-thrust-out, and the vehicle to compare with."""
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
