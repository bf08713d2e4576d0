"""What a current that changes does: it carries a vehicle, or passes it (docs/model.md)."""

import random
from dataclasses import replace

import numpy as np
import pytest

from rov_fmu.c.simulation import simulate
from rov_fmu.equation.catalogue import before_name
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.equation.steps import in_engine
from tests.vehicles import HEAVY, SIX, VEHICLES, passed, random_case, random_inputs
from verification.references.rigid_body import integrate, rotation
from verification.references.rigid_vehicle import body, places

SIX_AXES = load_vehicle(SHIPPED["bluerov2_heavy"])
CONVENTIONS = {"carried": 2.5000, "passes": 2.2484, "M_RB ν + M_A ν_r": 2.2922}
"""The place north of a Heavy at rest, 5 s after the current has become 0.5 m/s, m."""


def north(convention: str) -> float:
    """Return this place by the equations of rigid_body.py and a change of the velocity through the water."""
    held = body(SIX_AXES, SIX_AXES.layout.usual_inputs)
    start, current = places(SIX_AXES, SIX_AXES.layout.at_rest), np.array([0.5, 0.0, 0.0])
    state = integrate(held, start, 5.0)
    added = np.diag([SIX_AXES[f"m_a_{v}"] for v in "uvwpqr"])
    share = {"carried": np.zeros((6, 6)), "passes": np.eye(6)}.get(convention, held.inverse @ (held.mass - added))
    state[:6] -= share[:, :3] @ (rotation(state[6:10]).T @ current)
    return float(integrate(replace(held, current=current), state.tolist(), 5.0)[10])


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_the_conventions_put_a_vehicle_at_these_places(convention: str) -> None:
    assert round(north(convention), 4) == CONVENTIONS[convention]


@pytest.mark.parametrize("convention", ["carried", "passes"])
def test_a_vehicle_is_where_its_convention_puts_it(convention: str) -> None:
    rov = passed(SIX_AXES) if convention == "passes" else SIX_AXES
    inputs, line, state = rov.layout.usual_inputs, rov.memory(), rov.layout.at_rest
    for n, V_N in enumerate((0.0, 0.5)):
        state = line.step(rov, inputs | {"V_N": V_N}, state, 5.0 * n, 5.0)
    assert state["x"] == pytest.approx(north(convention), abs=1e-11)


def turned(rov: Vehicle, state: dict[str, float], change: list[float]) -> dict[str, float]:
    """Return a state whose velocity over ground has stayed, along the axes that there are."""
    along = rotation(places(rov, state)[6:10]).T @ np.array([*change, 0.0][:3])
    return state | {v: state[v] - part for v, part in zip("uvw", along, strict=True) if v in rov.layout.velocities}


@pytest.mark.parametrize("name", ["Heavy", "six axes", "surge and sway without yaw"])
def test_the_velocity_over_ground_stays_at_the_beginning_of_a_step(name: str) -> None:
    rng, rov = random.Random(name), {**VEHICLES, "six axes": SIX}[name]
    for _ in range(3):
        _, inputs, state, h = random_case(rng, rov)
        before = random_inputs(rng, rov)
        currents = [current for current in ("V_N", "V_E", "V_D") if current in rov.layout.inputs]
        given = {before_name(current): before[current] for current in currents}
        expected = rov.step(inputs, turned(rov, state, [inputs[c] - before[c] for c in currents]), h)
        found = passed(rov).step(inputs | given, state, h)
        assert found == pytest.approx(expected, rel=1e-12, abs=1e-12)
        if name == "Heavy":
            assert in_engine(passed(rov), inputs | given, state, h) == pytest.approx(found, rel=1e-12, abs=1e-12)


def test_a_current_that_stays_does_nothing() -> None:
    """The current of the first step is no change, and the results have the bits of a vehicle that is carried."""
    times, inputs = np.linspace(0.0, 2.0, 21), {"V_N": 0.3, "V_E": -0.2, "u_1": 0.4}
    one, other = (simulate(rov, times, inputs).values for rov in (HEAVY, passed(HEAVY)))
    np.testing.assert_array_equal(one, other)


def test_only_a_vehicle_that_the_current_passes_keeps_it() -> None:
    assert not HEAVY.layout.memory
    assert [*passed(HEAVY).layout.memory] == ["V_N_before", "V_E_before"]
