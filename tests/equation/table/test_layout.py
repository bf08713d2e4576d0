"""The declarations of a vehicle's variables (rov_fmu/equation/catalogue.py and layout.py)."""

from math import sin

from rov_fmu.equation.catalogue import (
    AXES,
    HEAVE,
    PITCH,
    ROLL,
    SURGE,
    SWAY,
    YAW,
)
from rov_fmu.equation.layout import arm, effect_along
from tests.vehicles import SIX, VIDEORAY, fin, thruster

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


def test_a_layout_is_extended_by_the_names_of_its_further_coefficients() -> None:
    extended = VIDEORAY.layout.extended(["m_a_u", "b_d_r_reverse", "c_0_top", "T_rear"])
    assert {form.axis.name: form.keys for form in extended.axes} == {
        "surge": ("m_a", "a_d", "b_d"),
        "heave": ("a_d", "b_d"),
        "yaw": ("a_d", "b_d", "b_d_reverse"),
    }
    assert [curve.keys for curve in extended.curves] == [("a_t", "b_t", "T"), ("a_t", "b_t", "c_0")]
    assert (extended.has_arm, SIX.layout.has_arm) == (True, False)
    assert [curve.name for curve in VIDEORAY.layout.turning_curves] == ["rear"]
