"""The declarations of a vehicle's variables (rov_fmu/equation/catalogue.py and layout.py)."""

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
    Declaration,
    cross_declaration,
    cross_name,
    cross_of,
)
from rov_fmu.equation.parts import arm, effect_along
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.vehicles import EVERYTHING, SIX, THRUST_EFFECTS, VIDEORAY, fin, pulsed, thruster, with_axes

# ---- Declarations ----

DECLARED = """
u_bow [1] -1 … 1, 1: Command u_bow: thruster bow, positive to starboard; saturates at ±1
u_rudder [1] -1 … 1, 1: Command u_rudder: rudder, positive to starboard; saturates at ±1
u_c [1] -1 … 1, 1: Command u_c: thruster c, positive to starboard and up; saturates at ±1
u_yaw [1] -1 … 1, 1: Command u_yaw of thrusters 1, 2, 3 and 4; saturates at ±1
u_heave [1] -1 … 1, 1: Command u_heave of thruster 5; saturates at ±1
u_t [us] 1100 … 1900, 1500: Command u_t: top thruster, positive down; pulse width, 1500 is neutral, saturates at 1100 \
and 1900; 0 is no signal: neutral
delayed_u_l [1] -inf … inf, 1: Command u_l that acts after the dead time
X_ext [N] -inf … inf, 10: Load from outside in surge (tether, contact), positive forward
Z_ext [N] -inf … inf, 10: Load from outside in heave (tether, ballast), positive down
M_ext [N.m] -inf … inf, 1: Load from outside in pitch (tether, contact), positive bow up
V_D [m/s] -inf … inf, 1: Velocity of a steady current, downward
voltage [V] 12 … 16, 10: Voltage of the battery
v [m/s] -inf … inf, 1: Sway velocity v through the water, positive to starboard
p [rad/s] -inf … inf, 1: Roll velocity p, positive starboard side down
z [m] -inf … inf, 10: Depth z, positive down
F_4 [N] -inf … inf, 1: Thrust F_4: thruster 4, positive astern and to starboard, the maker's table
F_bow [N] -inf … inf, 1: Thrust F_bow: thruster bow, in water at rest, positive to starboard
F_l [N] -inf … inf, 1: Thrust F_l: left booster, half of the pair's, positive forward
F_r [N] -inf … inf, 1: Thrust F_r: right thruster, half of the pair's, positive forward, equation (9) of Enevoldsen et \
al. 2018
tau_main [N.m] -inf … inf, 1: Torque τ_main of the thrusters with the curve of the main pair, positive bow to starboard
tau_bow [N.m] -inf … inf, 1: Torque τ_bow of the thrusters with the curve bow, positive bow to starboard
phi [rad] -3.14159 … 3.14159, 1: Roll angle φ, positive starboard side down
theta [rad] -1.5708 … 1.5708, 1: Pitch angle θ, positive bow up
beta_u [1] 0 … 1000, 1: Tuning β_u: scales acceleration in surge; at 0 the velocity never changes
beta_v [1] 0.001 … 1000, 1: Tuning β_v: scales acceleration in sway
beta_w [1] 0 … 1000, 1: Tuning β_w: scales acceleration in heave; at 0 the velocity never changes
beta_w [1] 0.001 … 1000, 1: Tuning β_w: scales acceleration in heave
health_l [1] 0 … 10, 1: Health h of the left booster: its force relative to that of a whole one, so 1 is whole \
and 0 is dead
health_bow [1] 0 … 10, 1: Health h of the thruster bow: its force relative to that of a whole one, so 1 is whole \
and 0 is dead
Y_ur [N.s2/(m.rad)] -1e+06 … 1e+06, 1: Lift in sway by surge and yaw
"""
"""What is said of variables: the unit, the bounds, the nominal value and the description."""
BETWEEN = """
m_a_uv [kg] -1e+06 … 1e+06, 1: Added mass m_a of surge and sway
m_a_wq [kg.m] -1e+06 … 1e+06, 1: Added mass m_a of heave and pitch
m_a_pr [kg.m2] -1e+06 … 1e+06, 1: Added mass m_a of roll and yaw
b_d_qw [N.m.s/m] -1e+06 … 1e+06, 1: Linear damping b_d in pitch by heave
a_d_vp [N.s2/rad2] -1e+06 … 1e+06, 1: Quadratic damping a_d in sway by roll
Z_uu [N.s2/m2] -1e+06 … 1e+06, 1: Lift in heave by surge and surge
K_qr [N.m.s2/rad2] -1e+06 … 1e+06, 1: Lift in roll by pitch and yaw
"""
"""The same for coefficients of several axes."""
TUNABLE = "m_rov W B x_G y_G z_G x_B y_B z_B k_t_main k_t_bow"


def said(name: str, of: Declaration) -> str:
    return f"{name} [{of.unit}] {of.minimum:g} … {of.maximum:g}, {of.nominal:g}: {of.description}"


def test_every_kind_of_variable_is_declared_as_people_read_it() -> None:
    in_pulses = pulsed(VIDEORAY, (1100.0, 1500.0, 1900.0))
    rovs = VIDEORAY, in_pulses, SIX, load_vehicle(THRUST_EFFECTS), load_vehicle(EVERYTHING)
    declared = [
        (name, declaration)
        for layout in (rov.layout for rov in rovs)
        for of in (layout.inputs, layout.state, layout.calculated, layout.delayed, layout.coefficients)
        for name, declaration in of.items()
    ]
    assert {*DECLARED.strip().splitlines()} <= {said(*one) for one in declared}
    factors = {name for rov in rovs for name in (*rov.layout.tuning, *rov.layout.health.values())}
    assert {name for name, of in declared if of.tunable} == {*TUNABLE.split(), *factors}
    assert {of.start for name, of in in_pulses.layout.commands.items()} == {1500.0}
    assert [[*with_axes(axes).layout.pose][:-4] for axes in ("pr", "wq")] == [[], ["x", "y", "z"]]
    voltage = replace(VIDEORAY.layout, voltage=14.8).inputs["voltage"]
    assert (said("voltage", voltage), voltage.start) == ("voltage [V] 0 … inf, 10: Voltage of the battery", 14.8)


def test_a_coefficient_of_several_axes_has_the_unit_of_its_axes() -> None:
    for line in BETWEEN.strip().splitlines():
        name = line.split()[0]
        row = cross_of(name)
        assert row
        assert (said(name, cross_declaration(*row)), cross_name(*row)) == (line, name)
    assert [cross_of(name) for name in ("m_a_u", "a_d_uu_reverse", "T_ur", "alpha_u")] == [None] * 4


# ---- Effects and commands ----


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
