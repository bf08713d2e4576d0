"""The Jacobians of a step against 50 digits, and against the slopes of exact steps."""

import random
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpmath import mp

from rov_fmu.bridges.jacobian import step_jacobian
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.vehicle import Vehicle
from tests.equation.thrust.test_thrust_effects import NOW, ROV
from tests.vehicles import SIX, VEHICLES, VIDEORAY, at_rest, random_inputs, random_state, still
from verification.references import reference

SWIFT = VEHICLES["lag without coupling"].with_(T_t200=0.001)
ALL = {**VEHICLES, "six_coupled": SIX, "a very short lag": SWIFT}
H = 0.5


Values = dict[str, Any]


def _of(rov: Vehicle, values: Values) -> tuple[Vehicle, Values, Values]:
    """Return a vehicle with coefficients of these values, its inputs and its states."""
    parts = (rov.coefficients, rov.layout.inputs, rov.layout.state)
    coefficients, inputs, state = ({name: values[name] for name in part} for part in parts)
    return replace(rov, coefficients=coefficients), inputs, state


def _exact(rov: Vehicle, values: Values, name: str, side: int) -> list[float]:
    """Return the slopes of the states after H along a number, to one side of it, from the motion to 50 digits."""
    with mp.workdps(50):
        apart = side * mp.mpf(10) ** -20
        here, there = (
            reference.step(*_of(rov, {**values, name: mp.mpf(values[name]) + d}), H).state for d in (0, apart)
        )
        return [float((there[one] - here[one]) / apart) for one in rov.layout.state]


def _found(rov: Vehicle, values: Values) -> dict[str, Array]:
    """Return the derivatives of the states after H by the names of the numbers."""
    found = step_jacobian(*_of(rov, values), H, [*rov.coefficients])
    names = [*rov.layout.state, *rov.layout.inputs, *rov.coefficients]
    return dict(zip(names, np.hstack((found.states, found.inputs, found.coefficients)).T, strict=True))


_SOME = ("Heavy", "six_coupled", "a very short lag")


@pytest.mark.parametrize("name", [pytest.param(name, marks=() if name in _SOME else pytest.mark.long) for name in ALL])
def test_the_derivatives_are_the_slopes_of_exact_steps_in_any_direction(name: str) -> None:
    """Numbers that are 0 stay, where the curve of a thruster may have a kink."""
    rov, rng, e = ALL[name], random.Random(name), 1e-5
    for has_arrived in (False, True):
        inputs, state = random_inputs(rng, rov), random_state(rng, rov)
        if has_arrived:
            thrust = {f"F_{name}": force for name, force in rov.commanded(inputs).items()}
            state |= {name: thrust[name] for name in rov.layout.lagging}
        values = {**rov.coefficients, **inputs, **state}
        along = {name: rng.uniform(-1.0, 1.0) * abs(x) for name, x in values.items()}
        low, high = (
            Vehicle.step(*_of(rov, {name: x + side * along[name] for name, x in values.items()}), H) for side in (-e, e)
        )
        slopes = [(high[name] - low[name]) / (2.0 * e) for name in state]
        found = _found(rov, values)
        assert sum(along[name] * column for name, column in found.items()) == pytest.approx(slopes, rel=1e-6, abs=1e-6)


def test_the_derivatives_have_an_error_near_rounding() -> None:
    values = {**VIDEORAY.coefficients, **still(VIDEORAY), **at_rest(VIDEORAY)}
    values |= {"u_l": 0.6, "u_r": 0.3, "u_t": -0.4, "X_ext": 0.3, "u": 0.3, "w": -0.1, "r": 0.2, "psi": 0.3}
    found = _found(VIDEORAY, values)
    for name in (*VIDEORAY.layout.state, *VIDEORAY.layout.inputs, "a_d_u", "m_rov"):
        assert found[name] == pytest.approx(_exact(VIDEORAY, values, name, 1), rel=2e-13, abs=2e-13), name


KINKED = VEHICLES["heave only"].with_(c_0_t200=0.004)
KINKS = {"u_5": (0.0, 0.004, -0.004, 1.0, -1.0), "w": (0.0,), "c_0_t200": (0.3, 0.0)}
"""The numbers at which this vehicle's thrust curve or drag has a kink. Its dead band is narrower than the differences
of a smooth motion."""


@pytest.mark.parametrize(("name", "kink"), [(name, kink) for name, kinks in KINKS.items() for kink in kinks])
def test_a_derivative_near_a_kink_is_that_of_one_side(name: str, kink: float) -> None:
    values = {**KINKED.coefficients, **still(KINKED), **at_rest(KINKED), "u_5": 0.3, "u_6": 0.3}
    for beyond in (0.0, 1e-4, -1e-4, 1e-3, -1e-3, 5e-3, -5e-3):
        values[name] = kink + beyond
        if values["c_0_t200"] >= 0.0:
            column = _found(KINKED, values)[name]
            error = min(np.abs(column - _exact(KINKED, values, name, side)).max() for side in (1, -1))
            assert error < 1e-9, beyond


def test_the_thrust_of_tables_is_differentiated_and_commands_act_at_once() -> None:
    """Also those of a vehicle with a dead time: its slopes are those of exact steps without one."""
    inputs = ROV.layout.usual_inputs | {"u_l": 0.47, "u_r": -0.43, "u_bow": 0.33, "u_top": 0.6, "u_rudder": 0.2}
    state = at_rest(ROV) | {"u": 0.5, "r": 0.2, "F_l": 3.0}
    found = step_jacobian(ROV, inputs, state, 0.2)
    for n, (name, x) in enumerate(inputs.items()):
        low, high = (NOW.step({**inputs, name: x + change}, state, 0.2) for change in (-1e-4, 1e-4))
        slopes = [(high[one] - low[one]) / 2e-4 for one in state]
        assert found.inputs[:, n] == pytest.approx(slopes, rel=1e-6, abs=1e-7), name


@pytest.mark.parametrize(
    ("h", "changes", "names", "said"),
    [
        *((h, {}, (), f"^h = {h}: must be a time above 0, s$") for h in (0.0, float("inf"), float("nan"))),
        (1.0, {"u": None, "w": None}, (), "^state: u and w must be given, too$"),
        (1.0, {}, ("a_d_u", "a_d_x"), "^coefficients: the vehicle has no 'a_d_x'"),
        (
            1.0,
            {"u": 1e200},
            (),
            "^the derivatives of the step cannot be computed: it overflows, is too fast",
        ),
    ],
)
def test_what_cannot_be_differentiated_is_told(h: float, changes: dict[str, Any], names: Any, said: str) -> None:
    state = {name: x for name, x in (at_rest(VIDEORAY) | changes).items() if x is not None}
    with pytest.raises(ValueError, match=said):
        step_jacobian(VIDEORAY, still(VIDEORAY), state, h, names)
