"""What units, messages and unknown headers mean, each with numbers that somebody else would compute, too."""

from collections.abc import Iterable, Mapping
from math import pi
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.equation.catalogue import HEAVE, YAW
from rov_fmu.io.csv_table import read_columns
from rov_fmu.tank.catalogue import QUANTITIES, as_json
from rov_fmu.tank.channels import Topic, channels_of
from rov_fmu.tank.columns import TIME, columns_of
from rov_fmu.tank.inspection.headers import guessed
from rov_fmu.tank.log import Source
from rov_fmu.tank.readers.tables import rules_of_page

COLUMNS = {name: quantity.column for name, quantity in QUANTITIES.items()} | {"time": TIME} | columns_of("thrust")
EQUAL = {
    "depth": "2 m, 200 cm, 2000 mm",
    "surge velocity": "2 m/s, 200 cm/s, 2000 mm/s",
    "heading": "3.141592653589793 rad, 180 deg",
    "yaw velocity": "3.141592653589793 rad/s, 180 deg/s",
    "time": "2 s, 2e3 ms, 2e6 us, 2e6 µs, 2e9 ns",
    "voltage": "16 V, 16000 mV",
    "pressure": "120000 Pa, 1200 hPa, 1200 mbar, 120 kPa, 1.2 bar",
    "force": "9.80665 N, 1 kgf, 2.2046226218487757 lbf",
    "command": "-0.5 1, -50 %, 1300 us, 1300 µs, 1700 us 1500 -400, 1350 us 1600 500",
}
"""The same number in all units of a column; the first is the one in which it is used."""


@pytest.mark.parametrize("name", EQUAL)
def test_all_units_of_a_column(name: str, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    numbers = [text.partition(" ") for text in EQUAL[name].split(", ")]
    for number, _, unit in numbers:
        path.write_text(f"{name} [{unit}]\n{number}\n", encoding="utf-8")
        (value,) = read_columns(path, {name: COLUMNS[name]}).values[name]
        assert value == pytest.approx(float(numbers[0][0]), rel=1e-12), unit


@pytest.mark.parametrize(
    ("kind", "field", "number", "quantity", "expected"),
    [
        *((kind, field, -2.0, "depth", 2.0) for kind, field in (("VFR_HUD", "alt"), ("CTUN", "Alt"), ("BARO", "Alt"))),
        ("GLOBAL_POSITION_INT", "relative_alt", -2000.0, "depth", 2.0),
        ("SCALED_PRESSURE3", "press_abs", 1111.3165, "depth", 1.0),
        ("SYS_STATUS", "voltage_battery", 65535.0, "voltage", np.nan),
        ("battery_status", "voltage_v", 0.0, "voltage", np.nan),
    ],
)
def test_signs_and_units_of_messages(kind: str, field: str, number: float, quantity: str, expected: float) -> None:
    topic = Topic(Source(kind, kind), np.arange(2.0), {field: np.full(2, number)})
    *_, found = channels_of([topic], None)
    assert found.quantity.name == quantity
    assert found.values[-1] == pytest.approx(expected, nan_ok=True)


def test_the_page_that_flies_gets_the_quantities_of_an_axis() -> None:
    keys = "name", "short", "isPressure", "isPosition", "largest", "wraps"
    assert [tuple(one[key] for key in keys) for axis in (HEAVE, YAW) for one in as_json(axis)] == [
        ("depth", "depth", False, True, 1e7, False),
        ("pressure", "pressure", True, True, 1e9, False),
        ("heave velocity", "velocity", False, False, 1e3, False),
        ("heading", "heading", False, True, 1e7, True),
        ("yaw velocity", "velocity", False, False, 1e3, False),
    ]
    assert rules_of_page()["pressures"]["least"] == pytest.approx(1013.25)


LARGEST: dict[str, dict[float, str | None]] = {
    "Depth": {100.0: "depth [m]", 101.0: "depth [cm]", 10_001.0: "depth [mm]"},
    "yaw": {2.1 * pi: "heading [rad]", 6.6: "heading [deg]"},
    "roll": {pi: "roll angle [rad]", 3.2: "roll angle [deg]"},
    "pitch": {0.5 * pi: "pitch angle [rad]", 1.6: "pitch angle [deg]"},
    "battery": {1000.0: "voltage [V]", 1001.0: "voltage [mV]"},
    "t": {1e11: "time [s]", 2e11: "time [ms]", 2e14: "time [us]", 2e17: "time [ns]"},
    "thr_1": dict.fromkeys((101.0, 799.0, 2201.0))
    | {1.0: "u_1 [1]", 1.5: "u_1 [%]", 100.0: "u_1 [%]", 800.0: "u_1 [us]", 2200.0: "u_1 [us]"},
    "fore (%)": {100.0: "u_fore [%]", 101.0: None},
    "Leg1": dict.fromkeys((1521.0, 1479.0)) | dict.fromkeys((1480.0, 1520.0), "u_1 [us]"),
    "pos z": {1.0: "depth [m]", -1.0: "-depth [m]"},
    "dvl_y": {2000.0: "sway velocity [m/s]"},
    "rates x": {2000.0: "roll velocity [rad/s]"},
    "surge speed": {1.0: None},
    "force.x": {2000.0: "X_ext [N]"},
    "torque.z": {2000.0: "N_ext [N.m]"},
}
"""Unknown headers of columns with one number alone, and what it makes of each."""


@pytest.mark.parametrize("title", LARGEST)
def test_the_numbers_tell_the_likely_unit_of_a_header(title: str) -> None:
    for number, meant in LARGEST[title].items():
        _, columns = guessed([title], {title: np.full(3, number)}, None, [])
        assert columns.get(title) == meant, number


GUESSED: dict[str, tuple[Mapping[str, Iterable[float]], Mapping[str, str]]] = {
    "at most 32 thrusters": (
        {f"thr{n}": [0.0, 1.0] for n in range(1, 34)},
        {f"thr{n}": f"u_{n} [1]" for n in range(1, 33)},
    ),
    "rests at 1500": ({"a": [1000.0, 1500.0, 1500.0, 2000.0]}, {"a": "u_a [us]"}),
    "below the usual pulses": ({"a": [999.0, 1500.0, 1500.0]}, {}),
    "above the usual pulses": ({"a": [2001.0, 1500.0, 1500.0]}, {}),
    "the first that rises for 50 rows": ({"a": range(50), "b": [1.0] * 50, "c": range(50)}, {"a": "time [s]"}),
    "49 rows": ({"a": range(49)}, {}),
    "repeated": ({"a": [*range(49), 48]}, {}),
    "with a unit": ({"a [m]": range(50), "b [ms]": range(50)}, {"b [ms]": "time [ms]"}),
    "5 s": ({"t": np.arange(9) * 5.0}, {"t": "time [s]"}),
    "6 ms": ({"t": np.arange(9) * 6.0}, {"t": "time [ms]"}),
    "many seconds": ({"t": [0.0, 2e9]}, {"t": "time [s]"}),
    "a quaternion": ({f"orientation.{letter}": [0.5] for letter in "xyzw"}, {}),
    "angles": (
        {f"orientation.{letter}": [0.5] for letter in "xyz"},
        {
            "orientation.x": "roll angle [rad]",
            "orientation.y": "pitch angle [rad]",
            "orientation.z": "heading [rad]",
        },
    ),
    "an upward position": (
        {"pos z": [-1.0, -2.0, 0.5], "vel y [m/s]": [1.0], "depth": [1.0]},
        {"pos z": "-depth [m]", "vel y [m/s]": "-sway velocity [m/s]"},
    ),
    "symbols beside forces": (
        {"X_ext": [1.0], "u": [1.0], "r": [9.0]},
        {"X_ext": "X_ext [N]", "u": "surge velocity [m/s]", "r": "yaw velocity [rad/s]"},
    ),
}
"""Unknown headers with their numbers, and what they seem to mean."""


@pytest.mark.parametrize("case", GUESSED)
def test_headers_of_several_columns(case: str) -> None:
    given, meant = GUESSED[case]
    numbers = {title: np.array([*values], float) for title, values in given.items()}
    _, columns = guessed([*numbers], numbers, None, [])
    assert columns == meant
