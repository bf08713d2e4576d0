"""The refit of the VideoRay that ships: the result of the command from the paper's measurements, and its errors."""

import re
from math import sqrt
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from rov_fmu.identify.beginning import load_tests
from rov_fmu.identify.result import Identification, MeasuredPoint, relative_error
from rov_fmu.vehicle.uncertainty import LEVEL
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from rov_fmu.vehicle.writer import write_vehicle
from tests.commands import REFIT, TESTS
from tests.identify.conftest import Identified

pytestmark = pytest.mark.long

HELD_OUT = {
    ("surge", "V_ss"): 0.0828,
    ("heave", "V_ss"): 0.0709,
    ("heave", "Tau"): 0.0665,
    ("yaw", "V_ss"): 0.1940,
    ("yaw", "Tau"): 0.1595,
}
"""The largest RMS relative errors of predictions by a fit without the rows of the same thrust: as measured, plus 3 %.

Promised were 0.097 in surge, 0.108 and 0.170 in heave, and 0.127 and 0.094 in yaw: both of yaw miss that.
"""


@pytest.fixture(scope="module")
def refit(identified: Identified) -> Identification:
    return identified("refit", lambda _: load_tests(TESTS))


def points(refit: Identification, axis: str, quantity: str) -> list[MeasuredPoint]:
    """Return the measured rows of an axis that count."""
    (result,) = (result for result in refit.axes if result.axis.name == axis)
    return [p for p in result.points if p.quantity == quantity and p.counts]


def by_paper(vehicle: Vehicle, some: list[MeasuredPoint]) -> float:
    """Return the RMS relative error of the paper's scaled model for some rows."""
    axis = next(form.axis for form in vehicle.layout.axes if form.axis.name == some[0].subject)
    responses = [vehicle.response(axis, p.command)[p.quantity == "Tau"] for p in some]
    errors = [value / p.measured - 1.0 for value, p in zip(responses, some, strict=True)]
    return sqrt(sum(error**2 for error in errors) / len(errors))


def test_the_shipped_file_is_one_that_its_tests_allow(refit: Identification, tmp_path: Path) -> None:
    """The files say the same but for their numbers, the shipped answers are in the intervals, and the coefficients,
    which share what is unknown of the thrust, together in the region that has 95 % of the vehicles (χ² 8.6 of 12).

    An earlier version made the file that ships, and this file stays: its curves are the nearest quadratic ones to
    curves of free shapes, and today's are fitted. Its ranges are in words, because its FMU keeps its variables, and its
    verdicts do not say for which commands they hold.
    """
    path = tmp_path / "refit.toml"
    write_vehicle(refit.vehicle, path)
    ranges = r"^\[validity\.(?:identified|tested)\]\n(.+\n)+\n|^(?:tested|verdicts) = \[\n(    .+\n)+\]\n"
    numbers = rf"{ranges}|, correlation = .*(?= }}$)|^# rov-fmu identify .*$|-?\d[\d.]*|^tool = .*$"
    made, shipped = (re.sub(numbers, "", p.read_text(encoding="utf-8"), flags=re.M) for p in (path, REFIT))
    assert made == shipped
    own, other = load_vehicle(path), load_vehicle(REFIT)
    known = own.uncertainty
    off = (np.array([other[name] for name in known.names]) - known.values) / known.errors
    assert off @ np.linalg.solve(known.correlation, off) < chi2(len(off)).ppf(LEVEL)
    for result in refit.axes:
        for answer in result.answers:
            V, Tau = other.response(result.axis, answer.command)
            for number, (_, (low, high)) in ((V, answer.steady), (Tau, answer.rise)):
                assert low <= number <= high, (result.axis.name, answer.command)
    assert own.provenance
    assert other.provenance
    assert own.provenance.inputs == other.provenance.inputs
    assert set(other.provenance.inputs) == {path.name for path in TESTS.iterdir()} - {"README.md"}


def test_what_is_left_out_is_predicted_and_the_refit_is_better_than_the_scaled_model(
    refit: Identification, vehicle: Vehicle
) -> None:
    """V_ss of surge and heave and Tau of yaw improve clearly; no other column becomes worse by more than 2 %."""
    for (axis, quantity), most in HELD_OUT.items():
        some = points(refit, axis, quantity)
        assert 0.94 * most < relative_error(some, "held_out") <= most, (axis, quantity)
        ours, paper = relative_error(some, "model"), by_paper(vehicle, some)
        asked = (axis, quantity) in (("surge", "V_ss"), ("heave", "V_ss"), ("yaw", "Tau"))
        assert ours < (0.9 if asked else 1.02) * paper, (axis, quantity)
