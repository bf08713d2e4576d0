"""The mathematics of rov_fmu/vehicle/vehicle.py: thrust, signs, rates."""

import random
from dataclasses import replace
from math import copysign

import pytest
from mpmath import mp

from rov_fmu.equation.catalogue import HEAVE, PITCH, ROLL, SURGE, SWAY, YAW, Axis
from rov_fmu.vehicle.vehicle import Vehicle
from tests.often import often
from tests.vehicles import (
    HEAVY,
    SIX,
    VEHICLES,
    State,
    Values,
    at_rest,
    numbered,
    random_case,
    random_vehicle,
    still,
)
from verification.references.equations import equations, steady_forces


@pytest.fixture(scope="module")
def k(vehicle: Vehicle) -> Vehicle:
    return vehicle


def held(rov: Vehicle, **values: float) -> State:
    """Return all inputs: these values, and 0 for the others."""
    return {**still(rov), **values}


# ---- Thrust ----


@often("cases", 25, 100, 300)
def test_thrust_and_drag_of_any_vehicle_are_those_of_the_equations(cases: int) -> None:
    """They agree within the rounding of the largest term, also at rest and on the edges of the dead band."""
    rng = random.Random(6)
    for _ in range(cases):
        rov, inputs, state, _ = random_case(rng, random_vehicle(rng))
        with mp.workdps(50):
            exact = steady_forces(rov, inputs, mp)
            assert rov.commanded(inputs) == pytest.approx({n: float(F) for n, F in exact.items()}, rel=1e-13, abs=1e-13)
            rates = equations(rov, inputs, mp).rates({n: mp.mpf(x) for n, x in state.items()}, inputs, mp)
            size = 1.0 + sum(abs(float(rate)) for rate in rates.values())
            expected = {name: float(rate) for name, rate in rates.items()}
        assert rov.derivatives(inputs, state) == pytest.approx(expected, rel=1e-13, abs=1e-13 * size)


# ---- Signs ----


@pytest.mark.parametrize(
    ("inputs", "signs"),
    [
        ({"u_l": 0.3, "u_r": 0.3}, {"u": 1, "x": 1}),
        ({"u_l": 0.3, "u_r": -0.3}, {"r": 1, "psi": 1}),
        ({"u_l": 0.5, "u_r": 0.3}, {"u": 1, "x": 1, "y": 1, "r": 1, "psi": 1}),
        ({"u_t": 0.3}, {"w": 1, "z": 1}),
        ({"X_ext": 1.0, "V_E": 1.0}, {"u": 1, "x": 1, "y": 1}),
        ({"Z_ext": 1.0, "V_N": 1.0}, {"w": 1, "z": 1, "x": 1}),
    ],
)
def test_the_signs_are_those_of_the_body_and_earth_frames(k: Vehicle, inputs: Values, signs: dict[str, int]) -> None:
    after = k.step({**still(k), **inputs}, at_rest(k), 0.5)
    assert {name: copysign(1, value) for name, value in after.items() if value != 0.0} == signs


# ---- Rates and steps ----


def test_at_rest_only_a_net_weight_and_the_place_of_the_mass_matter_and_not_the_coupling() -> None:
    """The mass matrix has the centre of mass with the coupling and without it. A level vehicle sinks by W - B."""
    apart = Vehicle(replace(SIX.layout, coupled=False), SIX.coefficients)
    inputs = held(SIX, X_ext=8.0, Z_ext=-3.0, K_ext=0.6, N_ext=-2.0)
    assert apart.derivatives(inputs, at_rest(SIX)) == pytest.approx(SIX.derivatives(inputs, at_rest(SIX)), rel=1e-12)
    level = numbered(replace(VEHICLES["heave only"].layout, restoring=("W", "B")), W=132.6, B=130.1, m_rov=10.0)
    assert level.derivatives(still(level), at_rest(level))["w"] == pytest.approx(0.25, rel=1e-12)
    assert pytest.approx(0.25, rel=1e-12) == level.alone(HEAVE, still(level)).C


# ---- One axis alone ----


def _loss(rov: Vehicle, axis: Axis, inputs: dict[str, float]) -> float:
    """Return what an axis alone loses of its thrust per velocity, before α, from its damping."""
    more = rov.alone(axis, inputs).B - rov.alone(axis, held(rov)).B
    return more * rov.effective_inertia(axis) / rov[axis.coefficient("alpha")]


def test_the_loss_of_thrust_is_that_of_the_thrusters_parts_along_the_axis() -> None:
    inputs = held(SIX, u_a=0.5, u_b=-1.0)
    expected: dict[Axis, float] = {
        SURGE: 0.6**2 * 2.5,
        SWAY: 3.0,
        HEAVE: 0.8**2 * 2.5,
        ROLL: (0.1 * 0.8) ** 2 * 2.5 + 0.1**2 * 3.0,
        PITCH: (-0.05 * 0.6 - 0.2 * 0.8) ** 2 * 2.5,
        YAW: (-0.1 * 0.6) ** 2 * 2.5 + 0.3**2 * 3.0,
    }
    assert {axis: _loss(SIX, axis, inputs) for axis in expected} == pytest.approx(expected, rel=1e-12)
    assert _loss(HEAVY, SURGE, held(HEAVY, u_1=1.0)) == 0
