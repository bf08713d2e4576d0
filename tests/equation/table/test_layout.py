"""The declarations of a vehicle's variables (rov_fmu/equation/catalogue.py and layout.py)."""

from dataclasses import replace
from math import sin

import pytest

from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.equation.catalogue import (
    AXES,
    HEAVE,
    PITCH,
    ROLL,
    SURGE,
    SWAY,
    YAW,
    cross_declaration,
    cross_name,
    cross_of,
)
from rov_fmu.equation.layout import Curve, Layout, Thruster, VehicleAxis, arm, effect_along
from rov_fmu.fmu.variables import variables
from rov_fmu.vehicle.vehicle import Vehicle
from tests.vehicles import SIX, VIDEORAY, fin, thruster


def test_angles_are_shown_in_degrees_and_only_shares_in_percent() -> None:
    shown = {v.name: v.display_unit for v in variables(SIX)}
    expected: dict[str, str | None] = dict.fromkeys(("phi", "theta", "psi", "phi_0", "theta_0", "psi_0"), "deg")
    expected |= dict.fromkeys((*QUATERNION, "alpha_u", "c_0_t200", "x", "X_ext", "F_a", "a_d_u"))
    expected |= {"u_a": "%", "u": "knot", "V_N": "knot", "r": "deg/s", "der(x)": "knot"}
    assert {name: shown[name] for name in expected} == expected
    (late,) = (v for v in variables(_with_dead_time()) if v.name == "delayed_u_a")
    assert (late.unit, late.display_unit) == ("1", "%")


def _with_dead_time() -> Vehicle:
    """Return the vehicle SIX with a dead time."""
    return Vehicle(replace(SIX.layout, has_dead_time=True), {**SIX.coefficients, "T_d": 0.1})


CROSS = {
    "m_a_uv": ("kg", "Added mass m_a of surge and sway"),
    "m_a_uq": ("kg.m", "Added mass m_a of surge and pitch"),
    "m_a_pq": ("kg.m2", "Added mass m_a of roll and pitch"),
    "b_d_qw": ("N.m.s/m", "Linear damping b_d in pitch by heave"),
    "b_d_vp": ("N.s/rad", "Linear damping b_d in sway by roll"),
    "a_d_pv": ("N.m.s2/m2", "Quadratic damping a_d in roll by sway"),
    "Y_ur": ("N.s2/(m.rad)", "Lift in sway by surge and yaw"),
    "M_uw": ("N.m.s2/m2", "Lift in pitch by surge and heave"),
    "X_pq": ("N.s2/rad2", "Lift in surge by roll and pitch"),
}


@pytest.mark.parametrize("name", CROSS)
def test_a_coefficient_of_several_axes_is_declared_by_its_name(name: str) -> None:
    row = cross_of(name)
    assert row
    declared = cross_declaration(*row)
    assert (declared.unit, declared.description) == CROSS[name]
    assert (declared.minimum, declared.maximum) == (-1e6, 1e6)
    assert cross_name(*row) == name


# ---- Effects and commands ----


def test_a_force_acts_along_its_parts_and_about_the_axes_beside_it() -> None:
    force, place = (2.0, 3.0, 5.0), (7.0, 11.0, 13.0)
    expected = dict.fromkeys(AXES.values(), 0.0) | {SURGE: 2.0, SWAY: 3.0, HEAVE: 5.0}
    expected |= {ROLL: 11.0 * 5.0 - 13.0 * 3.0, PITCH: 13.0 * 2.0 - 7.0 * 5.0, YAW: 7.0 * 3.0 - 11.0 * 2.0}
    assert {axis: effect_along(axis, force, place) for axis in AXES.values()} == expected
    placed = thruster("a", "c", (1.0, 0.0, 0.0), (0.0, -0.25, 0.5))
    assert [placed.effect(axis) for axis in AXES.values()] == [1.0, 0.0, 0.0, 0.0, 0.5, 0.25]
    with_arm = thruster("a", "c", (1.0, 0.0, 0.0), arm="starboard")
    assert [with_arm.effect(axis) for axis in AXES.values()] == [1.0, 0.0, 0.0, 0.0, 0.0, -1.0]
    faint = fin("f", (1e-9, 1.0, 2e-9), (0.0, 0.0, 0.0))
    assert [faint.effect(axis) for axis in (SURGE, SWAY, HEAVE, YAW)] == [0.0, 1.0, 2e-9, 0.0]
    assert arm(2.0, 0.5) == 2.0 * sin(0.5)


def _layout(*thrusters: Thruster, mix: dict[str, dict[str, float]] | None = None) -> Layout:
    return Layout((VehicleAxis(SURGE), VehicleAxis(YAW)), (Curve("c"),), thrusters, mix or {})


PAIR = (thruster("l", "c", (1.0, 0.0, 0.0), (0.0, -0.2, 0.0)), thruster("r", "c", (1.0, 0.0, 0.0), (0.0, 0.2, 0.0)))


def test_commands_that_drive_an_axis_have_the_sign_of_their_effect() -> None:
    own = _layout(*PAIR)
    assert (own.signs(SURGE), own.signs(YAW)) == ({"u_l": 1.0, "u_r": 1.0}, {"u_l": 1.0, "u_r": -1.0})
    mixed = _layout(*PAIR, mix={"a": {"l": 0.5, "r": 0.5}, "b": {"l": 1.0, "r": -1.0}, "c": {"l": 0.0, "r": -1.0}})
    assert mixed.gains["l"] == {"u_a": 0.5, "u_b": 1.0}
    assert mixed.signs(SURGE) == {"u_a": 1.0, "u_c": -1.0}
    assert mixed.driving(YAW, 0.5) == {"u_b": 0.5, "u_c": 0.5}
    assert mixed.commands["u_a"].description == "Command u_a of thrusters l and r; saturates at ±1"


def test_a_layout_is_extended_by_the_names_of_its_further_coefficients() -> None:
    extended = VIDEORAY.layout.extended(["m_a_u", "b_d_r_reverse", "c_0_top", "T_rear"])
    assert {form.axis.name: form.keys for form in extended.axes} == {
        "surge": ("m_a", "a_d", "b_d"),
        "heave": ("a_d", "b_d"),
        "yaw": ("a_d", "b_d", "b_d_reverse"),
    }
    assert [curve.keys for curve in extended.curves] == [("a_t", "b_t", "T"), ("a_t", "b_t", "c_0")]
    assert (extended.has_arm, _layout(*PAIR).has_arm) == (True, False)
    assert [curve.name for curve in VIDEORAY.layout.turning_curves] == ["rear"]
