"""Where forces act, which inputs drive an axis, and which coefficients a vehicle has, by their names."""

from dataclasses import replace
from math import sin

import pytest

from rov_fmu.equation.catalogue import (
    AXES,
    HEAVE,
    PITCH,
    ROLL,
    SURGE,
    SWAY,
    YAW,
    cross_name,
    cross_of,
)
from rov_fmu.equation.parts import arm, effect_along
from tests.vehicles import SIX, VIDEORAY, fin, pulsed, thruster


def test_a_coefficient_of_several_axes_is_known_by_its_name() -> None:
    for name in ("m_a_uv", "m_a_wq", "b_d_qw", "a_d_vp", "Z_uu", "K_qr"):
        row = cross_of(name)
        assert row
        assert cross_name(*row) == name
    assert [cross_of(name) for name in ("m_a_u", "a_d_uu_reverse", "T_ur", "alpha_u")] == [None] * 4


def test_the_voltage_begins_at_that_of_the_file() -> None:
    assert replace(VIDEORAY.layout, voltage=14.8).inputs["voltage"].start == 14.8


def test_example_inputs_drive_an_axis_in_its_positive_direction() -> None:
    layout = VIDEORAY.layout
    assert [layout.example(axis) for axis in (SURGE, HEAVE, YAW)] == [
        {"u_l": 0.3, "u_r": 0.3},
        {"u_t": 0.3},
        {"u_l": 0.3, "u_r": -0.3},
    ]
    assert replace(layout, thrusters=()).example(HEAVE) == {"Z_ext": 5.0}
    of_pulses = pulsed(VIDEORAY, (1100.0, 1500.0, 2000.0)).layout
    assert of_pulses.example(YAW) == pytest.approx({"u_l": 1650.0, "u_r": 1380.0})


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
