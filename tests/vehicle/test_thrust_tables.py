"""Tables of thrust, the battery, the dead time and fins in a vehicle file, and their mistakes."""

import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rov_fmu.equation.parts import CommandTable
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.thrust_table import read_current, read_thrust
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from rov_fmu.vehicle.writer import write_tuned, write_vehicle
from tests.vehicle.test_checks import GONE, changed, check_mistakes, quantity
from tests.vehicles import THRUST_EFFECTS, carried, sources_of

TEXT = THRUST_EFFECTS.read_text(encoding="utf-8")
_FILES = ("thrust_12_v.csv", "thrust_16_v.csv")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with the tables of thrust."""
    for name in _FILES:
        shutil.copy(THRUST_EFFECTS.with_name(name), tmp_path)
    (tmp_path / "current.csv").write_text("command [1],current [A]\n-1,9\n0,0\n1,10\n", encoding="utf-8")
    return tmp_path


# ---- The tables ------------------------------------------------------------------------------------------------------


def table(folder: Path, text: str) -> Path:
    path = folder / "t.csv"
    path.write_text(text, encoding="utf-8")
    return path


def currents_of(vehicle: Vehicle) -> list[CommandTable]:
    """The electric current of each curve. All curves of these vehicles have one."""
    return [current for curve in vehicle.layout.curves if (current := curve.electric_current)]


def test_pulses_and_kilograms_become_commands_and_newtons(tmp_path: Path) -> None:
    found = read_thrust(table(tmp_path, "pulse [us];thrust [kgf]\n1100;-4\n1500;0,0\n1900;5\n1900;5,2\n"))
    assert found.commands == (-1.0, 0.0, 1.0)
    assert found.values == pytest.approx((-4.0 * 9.80665, 0.0, 5.1 * 9.80665), rel=1e-15)
    with_numbers = read_thrust(table(tmp_path, "pwm [us 1500 300],force [lbf]\n1200,-9\n1500,0\n1800,11\n"))
    assert with_numbers.values == pytest.approx((-9.0 * 4.4482216152605, 0.0, 11.0 * 4.4482216152605), rel=1e-15)


@pytest.mark.parametrize("unit", ["us 0 40", "us -10 40", "N 40", "kgf 40"])
def test_pulses_relative_to_neutral_and_forces_are_commands(unit: str, tmp_path: Path) -> None:
    """The rows at rest need not be in order."""
    neutral = -10 if "-10" in unit else 0
    rows = "".join(f"{9 * c},{40 * c + neutral}\n" for c in (-1, -0.5, 1, 0, 0.5))
    found = read_thrust(table(tmp_path, f"thrust [N],command [{unit}]\n{rows}"))
    assert found.commands == (-1.0, -0.5, 0.0, 0.5, 1.0)
    assert found.values == (-9.0, -4.5, 0.0, 4.5, 9.0)


def test_thrust_goes_on_with_its_slope_to_full_command(tmp_path: Path) -> None:
    found = read_thrust(table(tmp_path, "command [%],thrust [N]\n-95,-190\n-50,-100\n0,0\n50,60\n95,114\n"))
    assert found.commands == (-1.0, -0.95, -0.5, 0.0, 0.5, 0.95, 1.0)
    assert found.values == pytest.approx((-200.0, -190.0, -100.0, 0.0, 60.0, 114.0, 120.0), rel=1e-14)


def test_the_limits_of_a_table_are_allowed(tmp_path: Path) -> None:
    commands = np.linspace(-1.0, 1.0, 2000)
    rows = "\n".join(f"{c:.6f},{1e6 * c * (abs(c) > 0.1):.1f}" for c in commands)
    assert read_thrust(table(tmp_path, f"command [1],thrust [N]\n{rows}\n")).values[0] == -1e6
    for line, limit in (("-1,-1000000.5", "-1e+06"), ("1,1000000.5", "1e+06")):
        with pytest.raises(DataFileError, match=re.escape(limit)):
            read_thrust(table(tmp_path, f"command [1],thrust [N]\n-1,-1\n0,0\n1,1\n{line}\n"))
    assert read_current(table(tmp_path, "command [1],current [A]\n-1,10000\n0,0\n1,1\n")).value(-1.0) == 1e4


def test_the_electric_current_is_linear_between_the_points_and_constant_beyond_them(tmp_path: Path) -> None:
    found = read_current(table(tmp_path, "pulse [us],current [A]\n1104,24.3\n1500,0\n1896,23\n1896,25\n"))
    commands = (-1.0, -0.99, -0.5, 0.0, 0.25, 0.99, 1.0)
    assert [found.value(c) for c in commands] == pytest.approx(
        [24.3, 24.3, 24.3 * 0.5 / 0.99, 0.0, 24.0 * 0.25 / 0.99, 24.0, 24.0]
    )


@pytest.mark.parametrize(
    ("text", "wanted"),
    {
        "a command beyond full thrust": ("command [%],thrust [N]\n-120,-1\n0,0\n100,1\n", "must be at least -100"),
        "a force against its command": (
            "command [1],thrust [N]\n-1,1\n0,0\n1,1\n",
            "must have the sign of its command",
        ),
        "no zero": ("command [1],thrust [N]\n-1,-1\n-0.1,-0.1\n0.1,0\n1,1\n", "must give 0 N at the command 0"),
        "a force at no command": ("command [1],thrust [N]\n-1,-1\n0,0.1\n1,1\n", "must give 0 N at the command 0"),
        "no force in reverse": ("command [1],thrust [N]\n-1,0\n0,0\n1,1\n", "must give a force in reverse below 0 N"),
        "no force ahead": ("command [1],thrust [N]\n-1,-1\n0,0\n1,0\n", "and one ahead above 0 N"),
        "a pulse beyond full thrust": (
            "pulse [us],thrust [N]\n1099,-1\n1500,0\n1900,1\n",
            "is beyond full thrust; [us NEUTRAL SPAN] states another range",
        ),
        "one half": ("command [1],thrust [N]\n0,0\n0.5,1\n1,2\n", "must cover the commands from -1 to 1"),
        "too little ahead": ("command [1],thrust [N]\n-1,-1\n0,0\n0.94,1\n", "side, not only -1 ... 0.94"),
        "two points": ("command [1],thrust [N]\n-1,-1\n0,0\n", "must have 3 to 2000 different commands, not 2"),
        "many points": (
            "command [1],thrust [N]\n" + "".join(f"{n / 1000.5 - 1:.6f},{n - 1000.5}\n" for n in range(2001)),
            "must have 3 to 2000 different commands, not 2001",
        ),
    }.values(),
)
def test_a_table_that_is_no_thrust_curve_is_refused(text: str, wanted: str, tmp_path: Path) -> None:
    with pytest.raises(DataFileError) as error:
        read_thrust(table(tmp_path, text))
    assert wanted in str(error.value)
    assert str(error.value).startswith(str(tmp_path / "t.csv"))


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("command [1],current [A]\n-1,5\n0,0\n1,-0.5\n", "must be at least 0"),
        ("command [1],current [A]\n-1,5\n0,0\n1,10000.5\n", "must be at most 10000"),
        ("command [1],current [A]\n0,0\n0.5,1\n1,2\n", "must cover the commands from -1 to 1"),
        ("command [1],thrust [N]\n-1,-5\n0,0\n1,1\n", "there is no such column, but command [1], current [A]"),
    ],
)
def test_a_table_that_is_no_current_is_refused(text: str, wanted: str, tmp_path: Path) -> None:
    with pytest.raises(DataFileError, match=re.escape(wanted)):
        read_current(table(tmp_path, text))


# ---- The vehicle file ------------------------------------------------------------------------------------------------


def test_a_written_file_is_the_same_vehicle(folder: Path) -> None:
    vehicle = load_vehicle(THRUST_EFFECTS)
    here = folder / "here.toml"
    here.write_text(TEXT, encoding="utf-8")
    write_vehicle(load_vehicle(here), folder / "written.toml")
    write_tuned(here, folder / "tuned.toml", {"lift_rudder": 10.0, "T_d": 0.2, "k_t_main": 1.1}, "by hand")
    written, tuned = (load_vehicle(folder / f"{name}.toml") for name in ("written", "tuned"))
    assert (written.layout, written.coefficients) == (vehicle.layout, dict(vehicle.coefficients))
    assert written.sources == vehicle.sources
    assert carried(written) == carried(load_vehicle(here))
    main, bow, lift = (
        [(table.name, table.voltage, table.path and table.path.name) for table in curve.tables]
        for curve in written.layout.curves
    )
    assert main == [("1_main", 12.0, "thrust_12_v.csv"), ("2_main", 16.0, "thrust_16_v.csv")]
    assert (bow, lift) == ([("0_bow", 0.0, "thrust_16_v.csv")], [])
    assert [sources_of(fin).keys() for fin in written.layout.fins] == [{"direction", "position"}] * len(
        written.layout.fins
    )
    assert {path.name for path in written.files} == {*_FILES}
    assert written.layout.voltage_source == "a battery of four cells"
    assert {name: tuned[name] for name in ("lift_rudder", "T_d", "k_t_main")} == {
        "lift_rudder": 10.0,
        "T_d": 0.2,
        "k_t_main": 1.1,
    }


def test_the_current_is_read_written_and_moved(folder: Path) -> None:
    shipped = load_vehicle(SHIPPED["bluerov2_heavy"])
    write_vehicle(shipped, folder / "written.toml")
    write_tuned(SHIPPED["bluerov2"], folder / "tuned.toml", {"a_d_u": 20.0}, "by hand")
    for name in ("written", "tuned"):
        assert currents_of(load_vehicle(folder / f"{name}.toml")) == currents_of(shipped)
    (current,) = currents_of(shipped)
    assert current.voltage == 16.0


def test_a_file_with_pulse_widths_is_read_and_written(folder: Path) -> None:
    """Beside a dead time, and in a table of their own."""
    T_d = 'T_d = { value = 0.1, unit = "s", source = "a speed controller" }'
    assert T_d in TEXT
    for text in (f"pulse = [1100, 1480.5, 1900]\n{T_d}", "pulse = [1100, 1480.5, 1900]"):
        here = folder / "here.toml"
        here.write_text(TEXT.replace(T_d, text), encoding="utf-8")
        vehicle = load_vehicle(here)
        write_vehicle(vehicle, folder / "written.toml")
        assert vehicle.layout.pulse == (1100.0, 1480.5, 1900.0)
        assert load_vehicle(folder / "written.toml").layout == vehicle.layout
        assert vehicle.layout.has_dead_time == (T_d in text)


def test_a_voltage_far_above_that_of_the_curves_gives_a_warning(folder: Path) -> None:
    path = folder / "rov.toml"
    higher = {"curves.main.tables": GONE, "curves.main.table": _FILES[0], "curves.lift.V_0": quantity(16.5, "V")}
    for voltage in (24.0, 24.5):
        text = changed({**higher, "battery.voltage": quantity(voltage, "V")}, TEXT)
        path.write_text(text, encoding="utf-8")
        if voltage == 24.0:
            load_vehicle(path)
    expected = "battery.voltage.value = 24.5: is 1.53 times V_0 = 16 V of curves.bow: one of the two is probably wrong"
    with pytest.warns(UserWarning, match=re.escape(expected)) as caught:
        load_vehicle(path)
    assert len(caught) == 1


@pytest.mark.parametrize("end", ["100,", "-100,"])
def test_thrust_that_does_not_rise_with_the_voltage_gives_a_warning(end: str, folder: Path) -> None:
    """In one direction, full thrust at the higher voltage is that at the other one."""
    low, high = ((folder / name).read_text(encoding="utf-8").splitlines(keepends=True) for name in _FILES)
    (kept,) = (line for line in low if line.startswith(end))
    copied = [kept if line.startswith(end) else line for line in high]
    (folder / _FILES[1]).write_text("".join(copied), encoding="utf-8")
    path = folder / "rov.toml"
    path.write_text(TEXT, encoding="utf-8")
    expected = (
        "curves.main.tables: at 16 V, full thrust is not stronger than at 12 V: is one table a copy of the other?"
    )
    with pytest.warns(UserWarning, match=re.escape(expected)) as caught:
        load_vehicle(path)
    assert len(caught) == 1


_PULSES = (
    "must be three rising numbers within 500 ... 2500 us and at least 10 us apart: full reverse, neutral, full thrust "
    "ahead"
)
_DRAWN = {"voltage": 16.0, "table": "current.csv"}
MISTAKES: dict[str, tuple[dict[str, Any], str]] = {
    "currents at several voltages": (
        {f"curves.{n}.electric_current": {**_DRAWN, "voltage": V} for n, V in (("main", 12.0), ("bow", 16.0))},
        "curves.bow.electric_current.voltage = 16.0: must be 12 V, as for curves.main\n"
        "curves.lift.electric_current: this key is missing, and curves.main has it: the vehicle draws the sum",
    ),
    "thrust for a current": (
        {"curves.bow.electric_current": {**_DRAWN, "table": _FILES[0]}},
        "curves.bow.electric_current.table = 'thrust_12_v.csv'",
    ),
    "voltages beside tables": (
        {"curves.main.V_0": quantity(12.0, "V"), "curves.main.n_V": quantity(1.2, "1")},
        "curves.main.V_0: must not be given together with tables\n"
        "curves.main.n_V: must not be given together with tables",
    ),
    "a scale without a table": (
        {"curves.lift.k_t": quantity(1.0, "1")},
        "curves.lift.k_t: scales a table, and this curve has none: give table, or leave k_t out",
    ),
    "coefficients beside a table": (
        {"curves.bow.a_t": quantity(1.0, "N")},
        "curves.bow.a_t: must not be given together with table",
    ),
    "no thrust at all": ({"curves.lift.b_t": GONE}, "curves.lift.b_t: this key is missing"),
    "a table and tables": (
        {"curves.main.table": _FILES[0]},
        "curves.main.tables: must not be given together with table",
    ),
    "a rotor that lags beside a table": (
        {"curves.bow.lag": "speed", "curves.bow.T": quantity(0.1, "s"), "curves.main.lag": "speed"},
        "curves.main.lag = 'speed': must be 'force' with a table, whose thrust is no quadratic of the speed\n"
        "curves.bow.lag = 'speed': must be 'force' with a table, whose thrust is no quadratic of the speed",
    ),
    "a lag without a time constant": ({"curves.lift.T": GONE}, "curves.lift.T: this key is missing, and lag is there"),
    "a lag of something else": (
        {"curves.lift.lag": "rotor"},
        "curves.lift.lag = 'rotor': must be 'force' or 'speed'",
    ),
    "a rotor with the name of a coefficient": (
        {"thruster.top.name": "V_lift"},
        "curves.lift.n_V: has the name n_V_lift in the FMU, which thruster.V_lift has too: rename one of them",
    ),
    "no exponent": ({"curves.bow.n_V": GONE}, "curves.bow.n_V: this key is missing, and V_0 is there"),
    "falling voltages": (
        {"curves.main.tables": [{"voltage": 16.0, "table": _FILES[1]}, {"voltage": 12.0, "table": _FILES[0]}]},
        "curves.main.tables = … must be at least two tables with rising voltages",
    ),
    "no battery": ({"battery": GONE}, "battery: this table with the voltage is missing, and the thrust of a curve"),
    "a battery beyond the tables": (
        {"battery.voltage": quantity(18.0, "V")},
        "battery.voltage.value = 18.0: must be within the 12 ... 16 V of the tables of curves.main",
    ),
    "reversed pulses": ({"commands.pulse": [1900, 1500, 1100]}, f"commands.pulse = [1900, 1500, 1100]: {_PULSES}"),
    "pulses that are too close": ({"commands.pulse": [1490.5, 1500, 1900]}, f"commands.pulse = … {_PULSES}"),
    "a fin with a thruster's name": (
        {"fin.rudder.name": "top"},
        "fin.top: a thruster or a fin before it has this name",
    ),
    "a fin without surge": (
        {"axes.surge": GONE, "body.coupling": False},
        "fin.rudder: its force depends on the velocity in surge",
    ),
    "a fin that does nothing": (
        {"fin.rudder.direction": {"value": [0, 0, 1], "source": "x"}, "axes.heave": GONE, "thruster.top": GONE},
        "curves.lift: no thruster has this curve\n"
        "fin.rudder: its lift acts on no axis of the vehicle, which are surge, sway, yaw",
    ),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_a_clear_line(name: str, folder: Path) -> None:
    changes, wanted = MISTAKES[name]
    path = folder / "rov.toml"
    path.write_text(changed(changes, TEXT), encoding="utf-8")
    check_mistakes(path, wanted)


def test_thrusters_draw_the_current_of_their_tables_and_its_power_at_the_voltage_of_the_battery(folder: Path) -> None:
    """The maker's sheet of a T200 at 16 V: 23.90 A at 1896 us, 4.40 A at 1300 us. The dead time comes before."""
    heavy = load_vehicle(SHIPPED["bluerov2_heavy"])
    found = heavy.calculated(heavy.layout.usual_inputs | {"u_1": 0.99, "u_2": -0.5}, heavy.layout.at_rest)
    assert [found[f"electric_current_{n}"] for n in (1, 2, 3)] == pytest.approx([23.9, 4.4, 0.0], abs=0.1)
    assert found["electric_current"] == pytest.approx(found["electric_current_1"] + found["electric_current_2"])
    assert found["electric_power"] == pytest.approx(16.0 * found["electric_current"])
    path = folder / "rov.toml"
    drawn = {f"curves.{name}.electric_current": _DRAWN for name in ("main", "bow", "lift")}
    path.write_text(changed(drawn, TEXT), encoding="utf-8")
    rov = load_vehicle(path)
    drawing = dict.fromkeys(rov.layout.delayed, -1.0) | dict.fromkeys(rov.layout.commands, 0.5) | {"voltage": 14.0}
    found = rov.calculated(rov.layout.usual_inputs | drawing, rov.layout.at_rest)
    count = len(rov.layout.thrusters)
    assert (found["electric_current"], found["electric_power"]) == pytest.approx((9.0 * count, 14.0 * 9.0 * count))
