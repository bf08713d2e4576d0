"""A step of the FMU is right also for the smallest and the largest numbers."""

from functools import partial

import pytest

from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.equation.steps import Step, in_engine, in_fmu, in_python
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


def test_velocities_that_are_rounding_errors_end_no_piece() -> None:
    """Forces that balance each other move a vehicle that turns on the spot by their rounding errors, ahead and back."""
    light = load_vehicle(SHIPPED["bluerov2"])
    masses = [name for name in light.coefficients if name in ("m_rov", "I_r") or name.startswith("m_a_")]
    rov = light.with_(T_t200=0.25, **{name: 25.0 / light["m_rov"] * light[name] for name in masses})
    commands = (0.13376067396440378, -0.14438975879007687, -0.14438975879007684, 0.13376067396440378)
    inputs = still(rov) | {f"u_{n}": u for n, u in enumerate((*commands, 0.11776245973202579, 0.11776245973202579), 1)}
    forces = (1.2350727047449537, -1.2349844606235059, -1.2349844606235059, 1.2350727047449537)
    lagging = {f"F_{n}": F for n, F in enumerate((*forces, 0.9874606525547448, 0.9874606525547448), 1)}
    moving = {"z": 11.0, "w": -0.0011534743904937595, "r": 0.04539919836761995, "psi": 0.0007070504401306937}
    for u, v in ((-7.667995353260742e-25, -1.4924776701225512e-21), (1e-24, 1e-21), (3e-27, -2e-26), (0.0, 1e-30)):
        state = at_rest(rov) | moving | lagging | {"u": u, "v": v}
        for h in (0.02, 0.5):
            moved, other = in_engine(rov, inputs, state, h), in_python(rov, inputs, state, h)
            assert moved == pytest.approx(other, rel=1e-12, abs=1e-15)
