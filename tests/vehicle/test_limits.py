"""The limits of the checks of a vehicle: each is allowed itself, and what is just beyond it is not."""

from collections.abc import Callable
from dataclasses import replace
from decimal import Decimal
from math import cos, inf, nextafter, sin, sqrt
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rov_fmu.equation.catalogue import HEAVE, SURGE, SWAY, YAW, Declaration
from rov_fmu.equation.layout import CurrentTable, Curve, Layout, Thruster, VehicleAxis, _near, _unit_vector
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.vehicle.checks import no_thrust
from rov_fmu.vehicle.description import _identifier
from rov_fmu.vehicle.geometry import check_axes, check_inputs, check_mass, check_thruster_places, doubts
from rov_fmu.vehicle.published import Cell
from rov_fmu.vehicle.quantity import derivative_hint, within
from rov_fmu.vehicle.schema import Estimated, _pulses, _rising
from rov_fmu.vehicle.thrust_table import read_thrust, thrust_table
from rov_fmu.vehicle.uncertainty import (
    Uncertainty,
    _half_width,
    is_factor,
    least_eigenvalue,
    quantile,
    with_interval,
)
from rov_fmu.vehicle.vehicle import Vehicle, VehicleFileError
from rov_fmu.vehicle.writer import write_vehicle
from tests.vehicles import SIX, numbered, thruster

MASS = 13.5


def lines(of: Any) -> list[str]:
    """Return the places and reasons of some mistakes as text."""
    return [str(line) for line in of]


# ---- Numbers and names ----


@pytest.mark.parametrize(
    ("check", "allowed", "refused"),
    [
        (_pulses, [500, 510, 2500], [499.9, 1500, 1900]),
        (_pulses, [500.0, 1500.0, 2500.0], [1100, 1500, 2500.1]),
        (_pulses, [1490, 1500, 1510], [1490.1, 1500, 1510]),
        (_pulses, [1490, 1500, 1510], [1490, 1500, 1509.9]),
        (_pulses, [1100, 1500, 1900], [1100, 1500, True]),
        (_pulses, [1100, 1500, 1900], [1100, 1500]),
        (_pulses, [1100, 1500, 1900], [1100, 1500, 1900, 2000]),
        (_pulses, [1100, 1500, 1900], (1100, 1500, 1900)),
        (_near, (100.0, -100.0, 0.0), (0.0, 0.0, -100.1)),
        (_identifier, "a" * 100, "a" * 101),
        (_identifier, "COM10", "COM9"),
        (_identifier, "_1", "1_"),
    ],
)
def test_a_value_at_its_limit_is_allowed_and_beyond_it_refused(
    check: Callable[[Any], Any], allowed: object, refused: object
) -> None:
    assert check(allowed) in (allowed, tuple(allowed) if isinstance(allowed, list) else None)
    with pytest.raises(ValueError, match="must"):
        check(refused)


def test_voltages_of_tables_rise() -> None:
    def rows(*voltages: float) -> list[Any]:
        return [SimpleNamespace(voltage=voltage) for voltage in voltages]

    assert len(_rising(rows(12.0, 14.0, 16.0))) == 3
    for wrong in (rows(12.0), rows(12.0, 12.0), rows(14.0, 12.0)):
        with pytest.raises(ValueError, match="at least two tables with rising voltages"):
            _rising(wrong)


@pytest.mark.parametrize(("unit", "shown"), [("1", ""), ("m", " m")])
def test_the_bounds_of_a_coefficient_are_included_and_told(unit: str, shown: str) -> None:
    declared = Declaration(unit, "", -0.5, 2.0)
    assert (within(-0.5, declared), within(2.0, declared)) == (-0.5, 2.0)
    for beyond in (nextafter(-0.5, -inf), nextafter(2.0, inf), float("nan")):
        with pytest.raises(ValueError, match=f"^must be within -0.5 ... 2{shown}$"):
            within(beyond, declared)


def test_a_direction_becomes_a_unit_vector_unless_it_is_one() -> None:
    assert _unit_vector((0.0, 3.0, -4.0)) == (0.0, 0.6, -0.8)
    nearly = (sqrt(0.5), sqrt(0.5), 1e-7)
    assert _unit_vector(nearly) == nearly
    assert _unit_vector((1.0 + 2e-12, 0.0, 0.0)) == (1.0, 0.0, 0.0)
    assert _unit_vector((1e-6, 0.0, 0.0)) == (1.0, 0.0, 0.0)
    assert _unit_vector((0.0, -1e6, 0.0)) == (0.0, -1.0, 0.0)
    for beyond in ((0.9e-6, 0.0, 0.0), (0.0, -1.1e6, 0.0)):
        with pytest.raises(ValueError, match="must have a length"):
            _unit_vector(beyond)


@pytest.mark.parametrize(
    ("key", "hint"),
    {
        "I_x": "; write I_p in [body]",
        "Izz": "; write I_r in [body]",
        "X_udot": "; give -X_udot, which is positive, as m_a of [axes.surge]",
        "Zdotw": "; give -Z_wdot, which is positive, as m_a of [axes.heave]",
        "N_r|r|": "; give -N_r|r|, which is positive, as a_d of [axes.yaw]",
        "K_|p|p": "; give -K_p|p|, which is positive, as a_d of [axes.roll]",
        "Xuu": "; give -X_u|u|, which is positive, as a_d of [axes.surge]",
        "M_q": "; give -M_q, which is positive, as b_d of [axes.pitch]",
        "Y_rdot": "; give its negative as m_a_vr in [cross]",
        "N_vdot": "; give its negative as m_a_vr in [cross]",
        "N_v|v|": "; give its negative as a_d_rv in [cross]",
        "Y_r": "; give its negative as b_d_vr in [cross]",
        "Y_|u|r": "",
        "Q_u": "",
    }.items(),
)
def test_what_replaces_a_derivative_is_told(key: str, hint: str) -> None:
    assert derivative_hint(key) == hint


# ---- Thrusters and axes ----


def _driven(*thrusters: Thruster, mix: dict[str, dict[str, float]] | None = None, keys: str = "a_t b_t") -> Layout:
    axes = (VehicleAxis(SURGE), VehicleAxis(SWAY))
    return Layout(axes, (Curve("c", tuple(keys.split())),), thrusters, mix or {})


@pytest.mark.parametrize(("angle", "independent"), [(2e-6, True), (0.9e-6, False), (-2e-6, True), (0.0, False)])
def test_two_axes_are_driven_apart_when_their_effects_differ_by_a_millionth(angle: float, independent: bool) -> None:
    one = thruster("a", "c", (sqrt(0.5), sqrt(0.5), 0.0))
    other = thruster("b", "c", (sqrt(0.5) * (cos(angle) - sin(angle)), sqrt(0.5) * (cos(angle) + sin(angle)), 0.0))
    found = lines(check_axes(_driven(one, other)))
    assert (found == []) == independent
    assert all("axes.sway: the thrusters cancel: they drive it only together with surge" in line for line in found)


def test_inputs_whose_gains_cancel_are_named() -> None:
    pair = (
        thruster("a", "c", (1.0, 0.0, 0.0)),
        thruster("b", "c", (0.0, 1.0, 0.0)),
        thruster("d", "c", (1.0, 0.0, 0.0)),
    )
    idle = _driven(*pair, mix={"x": {"a": 1.0, "d": -1.0}, "y": {"b": 1.0}})
    assert lines(check_inputs(idle)) == ["inputs.x: drives no axis of the vehicle: its gains cancel"]
    assert lines(check_inputs(_driven(*pair, mix={"x": {"a": 1.0, "d": 0.5}, "y": {"b": 1.0}}))) == []


def test_a_thruster_needs_a_place_where_the_vehicle_turns() -> None:
    def places(thruster: Thruster, axis: Any = YAW, keys: str = "a_t b_t") -> list[str]:
        layout = replace(_driven(thruster, keys=keys), axes=(VehicleAxis(HEAVE), VehicleAxis(axis)))
        return lines(check_thruster_places(layout))

    assert places(thruster("a", "c", (0.0, 0.0, 1.0))) == []
    assert places(thruster("a", "c", (0.0, 0.9e-6, 1.0))) == []
    assert "and the vehicle has yaw" in places(thruster("a", "c", (0.0, 2e-6, 1.0)))[0]
    assert places(thruster("a", "c", (1.0, 0.0, 0.0)), SURGE) == []
    assert "pushes ahead" in places(thruster("a", "c", (0.0, 1.0, 0.0), arm="port"))[0]
    assert places(thruster("a", "c", (1.0, 0.0, 0.0), arm="port")) == []
    assert (
        "d of the curve c needs a place" in places(thruster("a", "c", (1.0, 0.0, 0.0), arm="port"), YAW, "a_t b_t d")[0]
    )


@pytest.mark.parametrize(
    ("values", "directions"),
    [
        ({"a_t_c": 1.0, "b_t_c": 0.0}, []),
        ({"a_t_c": 1.0, "b_t_c": -1.0}, ["a_t_c"]),
        ({"a_t_c": 1.0, "b_t_c": -0.4, "c_0_c": 0.5}, []),
        ({"a_t_c": 1.0, "b_t_c": -0.5, "c_0_c": 0.5}, ["a_t_c"]),
        ({"a_t_c": 1.0, "b_t_c": 1.0, "a_t_c_reverse": -2.0, "b_t_c_reverse": 1.0}, ["a_t_c_reverse"]),
    ],
)
def test_full_command_must_give_a_force_in_each_direction(values: dict[str, float], directions: list[str]) -> None:
    keys = tuple(name.replace("_c", "", 1) if not name.startswith("c_0") else "c_0" for name in values)
    found = lines(no_thrust(Curve("c", keys), values, "curves.c"))
    assert len(found) == len(directions)
    for line, name in zip(found, directions, strict=True):
        assert f"{name} and b_" in line
        assert ("in reverse" in line) == name.endswith("reverse")


# ---- Mass, damping, weight ----


@pytest.mark.parametrize(("share", "possible"), [(0.999, True), (-0.999, True), (1.001, False), (-1.001, False)])
def test_an_entry_of_the_mass_matrix_is_less_than_the_mean_of_the_masses(share: float, possible: bool) -> None:
    axes = tuple(VehicleAxis(axis, ("m_a", "a_d", "b_d")) for axis in (SURGE, SWAY))
    rov = numbered(Layout(axes, (), (), cross=(("m_a", "u", "v"),)))
    most = sqrt((MASS + 6.3567) * (MASS + 7.1206))
    values = {**rov.coefficients, "m_a_uv": share * most, "beta_u": 0.5}
    found = lines(check_mass(rov.layout, values))
    assert (found == []) == possible
    assert all(f"within ±{most:.4g} for a positive definite matrix, but it is {share * most:.4g}" in x for x in found)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"W": 9.81 * MASS * 1.0299}, None),
        ({"W": 9.81 * MASS * 1.0301}, "m_rov = 13.5 kg weighs 132.4 N"),
        ({"W": 9.81 * MASS * 0.9701}, None),
        ({"W": 9.81 * MASS * 0.9699}, "m_rov = 13.5 kg weighs 132.4 N"),
        ({"W": 132.0, "B": 132.0, "z_G": 0.02, "z_B": 0.02}, None),
        ({"W": 132.0, "B": 132.0, "z_G": 0.02, "z_B": 0.0201}, "buoyancy acts below the centre of mass, z_G = 0.02 m"),
        ({"b_d_qw": 2.0 * sqrt(0.5 * 20.0)}, None),
        ({"b_d_qw": 2.0 * sqrt(0.5 * 20.0) + 1e-6}, "b_d_qw should be within ±6.325"),
        ({"b_d_qw": -2.0 * sqrt(0.5 * 20.0) - 1e-6}, "b_d_qw should be within ±6.325"),
    ],
)
def test_numbers_are_doubted_beyond_a_limit(values: dict[str, float], words: str | None) -> None:
    found = lines(doubts(SIX.layout, {**SIX.coefficients, **values}))
    assert len(found) == (words is not None)
    assert words is None or words in found[0]


@pytest.mark.parametrize(("voltage", "is_doubted"), [(15.0, False), (15.1, True)])
def test_a_voltage_of_more_than_one_and_a_half_times_that_of_the_curve_is_doubted(
    voltage: float, is_doubted: bool
) -> None:
    layout = Layout((VehicleAxis(SURGE),), (Curve("c", ("V_0", "n_V", "a_t", "b_t")),), (), voltage=voltage)
    found = lines(doubts(layout, {**numbered(layout, V_0=10.0).coefficients, "V_0_c": 10.0}))
    assert len(found) == is_doubted
    assert all("is 1.51 times V_0 = 10 V of curves.c" in line for line in found)


# ---- Tables ----


def _file(tmp_path: Path, rows: list[tuple[float, float]]) -> Path:
    path = tmp_path / "t.csv"
    path.write_text("command [1],thrust [N]\n" + "".join(f"{c},{F}\n" for c, F in rows), encoding="utf-8")
    return path


def test_a_table_may_leave_out_a_twentieth_of_the_commands_on_each_side(tmp_path: Path) -> None:
    found = read_thrust(_file(tmp_path, [(-0.95, -1.0), (0.0, 0.0), (0.95, 2.0)]))
    assert found.commands == (-1.0, -0.95, 0.0, 0.95, 1.0)
    for low, high in ((-0.949, 1.0), (-1.0, 0.949)):
        with pytest.raises(DataFileError, match=r"but for 0\.05 on each side"):
            read_thrust(_file(tmp_path, [(low, -1.0), (0.0, 0.0), (high, 2.0)]))


@pytest.mark.parametrize(("points", "is_read"), [(2000, True), (2001, False)])
def test_a_table_has_at_most_two_thousand_points(points: int, is_read: bool, tmp_path: Path) -> None:
    commands = [-1.0 + n / (points - 2) for n in range(points - 2)] + [0.0, 1.0]
    path = _file(tmp_path, [(c, c) for c in commands])
    if is_read:
        assert len(read_thrust(path).commands) == 2000
    else:
        with pytest.raises(DataFileError, match="must have 3 to 2000 different commands, not 2001"):
            read_thrust(path)


def test_a_table_continues_with_its_last_slope_to_full_thrust() -> None:
    table = thrust_table((-0.96, 0.0, 0.98), (-2.0, 0.0, 3.0))
    assert table.commands == (-1.0, -0.96, 0.0, 0.98, 1.0)
    assert table.forces[0] == pytest.approx(-2.0 - 0.04 * table.slopes[1], rel=1e-15)
    assert table.forces[-1] == pytest.approx(3.0 + 0.02 * table.slopes[-2], rel=1e-15)
    assert (table.slopes[0], table.slopes[-1]) == (table.slopes[1], table.slopes[-2])
    whole = thrust_table((-1.0, 0.0, 1.0), (-2.0, 0.0, 3.0))
    assert (whole.commands, whole.forces) == ((-1.0, 0.0, 1.0), (-2.0, 0.0, 3.0))
    current = CurrentTable(Path("t"), (-0.9, 0.0, 0.5), (9.0, 1.0, 3.0))
    expected = {-1.0: 9.0, -0.9: 9.0, -0.45: 5.0, 0.0: 1.0, 0.125: 1.5, 0.5: 3.0, 1.0: 3.0}
    assert {command: current.current(command) for command in expected} == pytest.approx(expected, rel=1e-15)


@pytest.mark.parametrize(
    ("printed", "computed", "rounds"),
    [
        ("0.25", 0.2549, True),
        ("0.25", 0.2551, False),
        ("0.25", 0.2451, True),
        ("0.25", 0.2449, False),
        ("3", 3.5, True),
    ],
)
def test_a_computed_value_rounds_to_the_digits_that_are_printed(printed: str, computed: float, rounds: bool) -> None:
    cell = Cell(Decimal(printed), computed, None)
    assert cell.rounds_to_printed == rounds
    assert cell.from_printed == pytest.approx(computed / float(printed) - 1.0)
    assert cell.from_measured is None
    assert Cell(None, computed, Decimal(0)).rounds_to_printed
    assert Cell(None, computed, Decimal(0)).from_measured is None


# ---- Uncertainty ----


def test_draws_at_the_ends_of_the_uniform_numbers_are_seven_errors_away() -> None:
    """The normal score of 1e-12 is -7.0345."""
    one = Uncertainty(("a_d_u",), np.array([50.0]), np.array([2.0]), np.eye(1), np.array([[-inf, inf]]))
    assert one.drawn(np.array([[0.0], [0.5], [1.0]]))[:, 0] == pytest.approx([50 - 14.069, 50.0, 50 + 14.069], abs=1e-3)
    factor = replace(one, names=("beta_u",))
    assert factor.drawn(np.array([[norm_1 := 0.8413447460685429], [1.0 - norm_1]]))[:, 0] == pytest.approx(
        [50.0 * np.exp(0.04), 50.0 * np.exp(-0.04)]
    )
    assert (is_factor("alpha_u"), is_factor("beta_r"), is_factor("a_d_u"), is_factor("alphabet")) == (
        True,
        True,
        False,
        False,
    )


def test_parts_and_groups_keep_what_belongs_together() -> None:
    correlation = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.0], [0.5, 0.0, 1.0]])
    bounds = np.array([[0.0, 1.0], [2.0, 3.0], [4.0, 5.0]])
    whole = Uncertainty(("a", "b", "c"), np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.2, 0.3]), correlation, bounds)
    assert whole.groups == (("a", "c"), ("b",))
    part = whole.part(["c", "a"])
    assert (part.names, part.values.tolist(), part.errors.tolist()) == (("c", "a"), [3.0, 1.0], [0.3, 0.1])
    assert (part.correlation.tolist(), part.bounds.tolist()) == ([[1.0, 0.5], [0.5, 1.0]], [[4.0, 5.0], [0.0, 1.0]])
    estimates = {"a": Estimated(error=1.0), "b": Estimated(error=1.0, correlation={"a": -0.25})}
    assert least_eigenvalue(estimates) == pytest.approx(0.75)
    assert [quantile(inf), quantile(10.0)] == pytest.approx([1.959964, 2.228139], abs=1e-6)


@pytest.mark.parametrize(
    ("name", "value", "interval", "width"),
    [
        ("a_d_u", 5.0, (4.0, 8.0), 2.0),
        ("a_d_u", 5.0, (0.0, 8.0), 3.0),
        ("a_d_u", 5.0, (4.0, 10.0), 1.0),
        ("a_d_u", 4.0, (0.0, 10.0), 6.0),
        ("a_d_u", 7.0, (0.0, 10.0), 7.0),
        ("beta_u", 5.0, (2.5, 10.0), 5.0 * np.log(2.0)),
        ("beta_u", 4.0, (1.0, 8.0), 4.0 * (np.log(2.0) + np.log(4.0)) / 2.0),
        ("beta_u", 0.0, (0.0, 3.0), 3.0),
    ],
)
def test_half_of_an_interval_leaves_out_a_side_that_ends_at_a_bound(
    name: str, value: float, interval: tuple[float, float], width: float
) -> None:
    assert _half_width(name, value, interval, Declaration("1", "", 0.0, 10.0)) == pytest.approx(width)


@pytest.mark.parametrize(
    ("value", "interval", "texts"),
    [
        (1.0, (0.985, 1.0149), ("1.000", "0.985", "1.015")),  # 3 thousandths are 29.9 thousandths by ten
        (1.0, (0.985, 1.0151), ("1.00", "0.98", "1.02")),
        (2e-6, (-0.5, 0.5), ("2.0e-6", "-0.50", "0.50")),
        (0.9e-6, (-0.5, 0.5), ("0", "-0.50", "0.50")),
        (123456.0, None, ("123500", "", "")),
        (1234567.0, None, ("1.235e+6", "", "")),
        (0.0000123456, None, ("0.00001235", "", "")),
        (0.00000123456, None, ("1.235e-6", "", "")),
    ],
)
def test_numbers_have_the_digits_of_their_interval_at_its_limits(
    value: float, interval: tuple[float, float] | None, texts: tuple[str, str, str]
) -> None:
    assert with_interval(value, interval) == texts


def test_text_that_is_not_unicode_is_shown_with_the_twenty_letters_before_it(vehicle: Vehicle, tmp_path: Path) -> None:
    wrong = replace(vehicle, description=f"{'a' * 9}{'b' * 20}\udcff and more")
    with pytest.raises(VehicleFileError) as caught:
        write_vehicle(wrong, tmp_path / "v.toml")
    assert f"{tmp_path / 'v.toml'}: '{'b' * 20}\\udcff': the name of a file that is not Unicode" in str(caught.value)
