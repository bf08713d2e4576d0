"""The declarations of a vehicle's variables (rov_fmu/equation/catalogue.py and layout.py)."""

import re
from dataclasses import replace
from math import inf, sin

import pytest

import rov_fmu
from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.equation.catalogue import (
    AXES,
    HEAVE,
    PITCH,
    ROLL,
    SURGE,
    SWAY,
    YAW,
    cited,
    cross_declaration,
    cross_name,
    cross_of,
)
from rov_fmu.equation.layout import Curve, Layout, Thruster, ThrustTable, VehicleAxis, arm, effect_along
from rov_fmu.fmu.variables import variables
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle
from tests.vehicles import SIX, VIDEORAY, fin, thruster

WORDS = {
    "videoray": {
        "u_l": "Command u_l: left thruster, positive forward; saturates at ±1",
        "Z_ext": "Load from outside in heave (tether, ballast), positive down",
        "u": "Surge velocity u through the water, positive forward",
        "r": "Yaw velocity r, positive bow to starboard",
        "F_l": "Thrust F_l: left thruster, half of the pair's, positive forward, "
        "equation (9) of Enevoldsen et al. 2018",
        "m_rov": "Mass m_rov",
        "a_d_u": "Quadratic drag coefficient a_d of surge",
        "a_t_rear": "Quadratic thrust coefficient a_t of the rear pair, equation (9) of Enevoldsen et al. 2018",
        "alpha_r": "Tuning α_r: scales torque in yaw",
        "beta_u": "Tuning β_u: scales acceleration in surge; at 0 the velocity never changes",
        "tau_rear": "Torque τ_rear of the thrusters with the curve of the rear pair, positive bow to starboard",
    },
    "bluerov2_heavy": {
        "u_1": "Command u_1: thruster 1 (front starboard), positive astern and to starboard; saturates at ±1",
        "Y_ext": "Load from outside in sway (tether, contact), positive to starboard",
        "V_E": "Velocity of a steady horizontal current, eastward",
        "beta_u": "Tuning β_u: scales acceleration in surge",
        "m_a_w": "Added mass m_a of heave",
        "m_a_r": "Added moment of inertia m_a of yaw",
        "T_t200": "Time constant T of the lag of the T200 at 16 V, T dF/dt = F(c) - F",
        "tau_t200": "Torque τ_t200 of the thrusters with the curve of the T200 at 16 V, positive bow to starboard",
    },
}


@pytest.mark.parametrize("name", WORDS)
def test_variables_are_described_in_the_terms_of_the_vehicle(name: str) -> None:
    layout = rov_fmu.load(SHIPPED[name]).layout
    declared = layout.inputs | layout.state | layout.calculated | layout.coefficients
    assert {key: declared[key].description for key in WORDS[name]} == WORDS[name]


@pytest.mark.parametrize("name", SHIPPED)
def test_only_the_vehicle_of_the_paper_cites_the_paper(name: str) -> None:
    described = [v.description for v in variables(rov_fmu.load(name))]
    assert all(re.findall(r"(?<=, )\(\d+\w?\)", text) == [] for text in described)
    with_number = [text for text in described if re.search(r"equations? \(\d", text)]
    assert all("of Enevoldsen et al. 2018" in text for text in with_number)
    assert bool(with_number) == name.startswith("videoray")
    assert any("Enevoldsen" in text for text in described) == name.startswith("videoray")


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


def test_another_source_of_a_curve_is_kept() -> None:
    assert [cited("(9)"), cited("(18a)"), cited("the maker's table"), cited("")] == [
        ", equation (9) of Enevoldsen et al. 2018",
        ", equation (18a) of Enevoldsen et al. 2018",
        ", the maker's table",
        "",
    ]


def test_loads_and_velocities_have_the_units_and_sizes_of_their_axes() -> None:
    layout = rov_fmu.load("bluerov2_heavy").layout
    assert {n: (d.unit, d.nominal) for n, d in layout.inputs.items() if n.endswith("_ext")} == {
        "X_ext": ("N", 10.0),
        "Y_ext": ("N", 10.0),
        "Z_ext": ("N", 10.0),
        **dict.fromkeys(("K_ext", "M_ext", "N_ext"), ("N.m", 1.0)),
    }
    units = dict.fromkeys("uvw", "m/s") | dict.fromkeys("pqr", "rad/s")
    assert {n: d.unit for n, d in layout.velocities.items()} == units


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


@pytest.mark.parametrize("name", ["m_a_ux", "F_0_uv", "Y_u", "A_ur", "m_a_uqr"])
def test_other_names_are_of_no_coefficient_of_several_axes(name: str) -> None:
    assert cross_of(name) is None


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


@pytest.mark.parametrize(
    ("pulse", "fraction"), [(1000.0, -1.0), (1200.0, -0.5), (1400.0, 0.0), (1650.0, 0.5), (1900.0, 1.0)]
)
def test_a_pulse_width_stands_for_a_fraction_on_each_side_of_neutral(pulse: float, fraction: float) -> None:
    layout = replace(_layout(*PAIR), pulse=(1000.0, 1400.0, 1900.0))
    assert layout.command_of(fraction) == pulse
    assert layout.fraction_of(pulse) == fraction
    assert (layout.fraction_of(900.0), layout.fraction_of(2000.0)) == (-1.0, 1.0)
    assert _layout(*PAIR).command_of(fraction) == _layout(*PAIR).fraction_of(fraction) == fraction
    declared = layout.commands["u_l"]
    assert (declared.unit, declared.minimum, declared.maximum, declared.start) == ("us", 1000.0, 1900.0, 1400.0)
    assert layout.usual_inputs["u_l"] == declared.nominal == 1400.0


def test_a_voltage_is_bounded_by_the_tables_and_otherwise_only_below() -> None:
    tables = tuple(ThrustTable("t", (-1.0, 1.0), (-1.0, 1.0), (1.0, 1.0), voltage) for voltage in (12.0, 14.0, 16.0))
    with_tables = replace(_layout(*PAIR), curves=(Curve("c", ("k_t",), tables=tables),), voltage=15.0)
    declared = with_tables.inputs["voltage"]
    assert (declared.minimum, declared.maximum, declared.nominal, declared.start) == (12.0, 16.0, 10.0, 15.0)
    without = replace(_layout(*PAIR), voltage=15.0).inputs["voltage"]
    assert (without.minimum, without.maximum) == (0.0, inf)
    assert "voltage" not in _layout(*PAIR).inputs


def test_a_thrust_table_is_a_cubic_with_the_forces_and_slopes_of_its_points() -> None:
    """Between -1 and 1 it is c^3 + c, and beyond that a straight line to 2 c + 2."""
    table = ThrustTable("t", (-1.0, 1.0, 3.0), (-2.0, 2.0, 8.0), (4.0, 4.0, 2.0))
    for c in (-1.0, -0.5, 0.0, 0.25, 1.0):
        assert table.force(c) == pytest.approx(c**3 + c, abs=1e-15)
    assert table.force(3.0) == 8.0
    assert table.force(2.0) == 5.0 + (4.0 - 2.0) * 2.0 / 8.0  # the mean, and the slopes' difference by an eighth of 2


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


def test_the_rates_stand_between_the_states_and_the_thrust() -> None:
    layout = SIX.layout
    places = [*layout.places.values()]
    n = len(layout.inputs) + len(layout.state)
    assert places[:n] == [*range(n)]
    assert places[n:] == [*range(n + len(layout.state), n + len(layout.state) + len(places) - n)]
    assert [*layout.pose] == ["x", "y", "z", "eta", "epsilon_1", "epsilon_2", "epsilon_3"]
    assert [declaration.nominal for declaration in layout.pose.values()] == [10.0] * 3 + [1.0] * 4
    assert {name: (declaration.minimum, declaration.maximum) for name, declaration in layout.angles.items()} == {
        "phi": pytest.approx((-3.141592653589793, 3.141592653589793)),
        "theta": pytest.approx((-1.5707963267948966, 1.5707963267948966)),
        "psi": (-inf, inf),
    }
    assert {name for name, value in layout.at_rest.items() if value} == {"eta"}
