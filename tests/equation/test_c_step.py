"""A step of the FMU is right also for the smallest and the largest numbers."""

from functools import partial

import pytest

from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.equation.steps import Step, in_fmu, in_python
from tests.fmi2 import Fmu
from tests.vehicles import EVERYTHING, VIDEORAY, at_rest, still


@pytest.fixture(scope="module", params=["videoray", "everything"])
def vehicle(request: pytest.FixtureRequest) -> tuple[Vehicle, Step]:
    """A vehicle, and the step of its FMU."""
    rov = {"videoray": VIDEORAY, "everything": load_vehicle(EVERYTHING)}[request.param]
    return rov, partial(in_fmu, Fmu(request.getfixturevalue(f"{request.param}_dir")))


def test_the_smallest_velocity_is_turned_back(vehicle: tuple[Vehicle, Step]) -> None:
    """The product of such a velocity and the force against it underflows to 0, but the velocity reverses at once."""
    rov, in_c = vehicle
    inputs = still(rov) | {"X_ext": -5.0}
    for step in (in_c, in_python):
        found = step(rov, inputs, at_rest(rov) | {"u": 5e-324}, 0.1)
        assert found == pytest.approx(step(rov, inputs, at_rest(rov), 0.1), rel=1e-13)


def test_a_tiny_force_carries_a_vehicle_no_further_than_its_steady_velocity(vehicle: tuple[Vehicle, Step]) -> None:
    """The coefficients of such a series differ by more than the range of a double."""
    rov, step = vehicle
    steady = 1e-250 / 3.0
    for h in (1e20, 1e28, 1e35):
        found = step(rov.with_(b_d_u=3.0), still(rov) | {"X_ext": 1e-250}, at_rest(rov), h)
        assert (found["u"], found["x"]) == pytest.approx((steady, steady * h), rel=1e-13, abs=0.0)


def test_a_step_of_too_many_pieces_is_refused(steps: list[Step]) -> None:
    (step,) = steps
    rov = VIDEORAY
    frictionless = rov.with_(a_d_r=0.0, b_d_r=0.0)
    with pytest.raises(AssertionError):
        step(frictionless, still(rov), at_rest(rov) | {"u": 1.0, "r": 1e30}, 1.0)
