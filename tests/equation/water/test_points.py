"""Forces at points: the motion of the vehicle and of the points, against rigid_body.py, in Python and in C."""

import random

import numpy as np
import pytest
from numpy.typing import NDArray

from rov_fmu.c.simulation import simulate
from rov_fmu.equation.catalogue import SURGE
from rov_fmu.equation.parts import Vector
from tests.equation.steps import in_engine, in_python
from tests.vehicles import SIX, VEHICLES, random_inputs, random_state, tied, with_axes
from verification.references import rigid_vehicle
from verification.references.rigid_vehicle import calculated, compared, places

POINTS: dict[str, Vector] = {"tether": (-0.3, 0.1, -0.2), "hook": (0.2, -0.1, 0.4)}
UNTIED = {
    "level": VEHICLES["lag without coupling"],
    "coupled": VEHICLES["drag by direction, coupled, late"],
    "without yaw": VEHICLES["surge and sway without yaw"],
    "yaw only": VEHICLES["yaw only"],
    "upr": with_axes("upr"),
    "six": SIX,
}
ROVS = {name: tied(rov, **POINTS) for name, rov in UNTIED.items()}
LENGTHS = (1e-3, 0.1, 10.0)
_SOME = ("coupled",)


def _of(y: object) -> NDArray[np.float64]:
    return np.array(y, float)


@pytest.mark.parametrize("name", [pytest.param(name, marks=() if name in _SOME else pytest.mark.long) for name in ROVS])
def test_a_step_of_any_length_is_that_of_the_rigid_body(name: str) -> None:
    """Forces in the earth frame act at two points while the vehicle turns in a current."""
    rov, rng = ROVS[name], random.Random(name)
    for h in LENGTHS:
        inputs, state = random_inputs(rng, rov), random_state(rng, rov)
        exact = _of(compared(rov, rigid_vehicle.integrate(rov, inputs, places(rov, state), h).tolist()))
        for step in (in_python, in_engine):
            found = _of(compared(rov, places(rov, step(rov, inputs, state, h))))
            assert np.abs(found - exact).max() <= 1e-12 * np.abs(exact).max(), (h, step)


@pytest.mark.parametrize("name", ROVS)
def test_a_point_is_where_the_attitude_turns_it_and_moves_over_ground(name: str) -> None:
    rov, rng = ROVS[name], random.Random(name)
    inputs, state = random_inputs(rng, rov), random_state(rng, rov)
    exact = calculated(rov, {**rov.coefficients, **inputs, **state}, float)
    found = rov.calculated(inputs, state)
    of_points = [f"{name}_{point}" for point in POINTS for name in (*"xyz", "vg_N", "vg_E", "vg_D")]
    assert [*rov.layout.motion_of_points] == of_points
    assert [found[name] for name in of_points] == pytest.approx(
        [float(exact[x]) for x in of_points], rel=1e-13, abs=1e-13
    )


@pytest.mark.parametrize("name", ["level", "six"])
def test_without_a_force_a_vehicle_moves_as_without_the_point(name: str) -> None:
    """The motion is equal to the last bit, also over hours of a turn, which end in closed form."""
    rov, untied, rng = ROVS[name], UNTIED[name], random.Random(name)
    inputs = {name: 0.0 if name in rov.layout.forces_at_points else x for name, x in random_inputs(rng, rov).items()}
    state = random_state(rng, rov)
    for h in (*LENGTHS, 1e4):
        of_untied = {name: inputs[name] for name in untied.layout.inputs}
        assert in_engine(rov, inputs, state, h) == in_engine(untied, of_untied, state, h), h


def test_a_pull_ahead_of_the_centre_turns_the_vehicle_into_its_direction() -> None:
    """With a long tow, the tow point is ahead of the vehicle, which heads east, and moves as fast as it."""
    rov = tied(UNTIED["level"], bow=(0.4, 0.0, 0.0)).with_(F_0_u=0.0, F_0_r=0.0)
    inputs = rov.layout.usual_inputs | {"F_E_bow": 20.0}
    run = simulate(rov, [0.0, 600.0], inputs, ["psi", "x_bow", "x", "y_bow", "y", "vg_E_bow", "vg_E", "u"], workers=1)
    psi, x_bow, x, y_bow, y, *speeds = run.values[:, 0, -1]
    assert psi == pytest.approx(np.pi / 2.0, abs=1e-9)
    assert (x_bow - x, y_bow - y) == pytest.approx((0.0, 0.4), abs=1e-9)
    assert speeds == pytest.approx([speeds[-1]] * 3, abs=1e-9)
    ahead = rov.alone(SURGE, rov.layout.usual_inputs | {"X_ext": 20.0})
    assert speeds[-1] == pytest.approx(ahead.steady_velocity(), rel=1e-9)
