"""What units, messages and unknown headers mean, and the bounds of numbers, as somebody else would say."""

from collections.abc import Iterable, Mapping, Sequence
from math import nan, pi
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.equation.catalogue import HEAVE, YAW, Axis
from rov_fmu.io.columns import Column, read_columns
from rov_fmu.tank.catalogue import QUANTITIES, as_json
from rov_fmu.tank.channels import Topic, channels_of
from rov_fmu.tank.columns import TIME, columns_of
from rov_fmu.tank.inspection.headers import guessed
from rov_fmu.tank.log import Source
from rov_fmu.tank.readers.tables import rules_of_page

COLUMNS = {name: Column(one.units) for name, one in QUANTITIES.items()} | {"time": TIME} | columns_of("thrust")
EQUAL: Mapping[str, Mapping[str, float]] = {
    "depth": {"m": 3.048, "cm": 304.8, "mm": 3048, "ft": 10},
    "surge velocity": {"m/s": 0.9144, "cm/s": 91.44, "mm/s": 914.4, "ft/s": 3, "kn": 1.7774514038876894},
    "heading": {"rad": pi, "deg": 180, "°": 180},
    "yaw velocity": {"rad/s": pi, "deg/s": 180, "°/s": 180, "dps": 180},
    "time": {"s": 2, "ms": 2e3, "us": 2e6, "µs": 2e6, "ns": 2e9},
    "voltage": {"V": 16, "mV": 16000},
    "pressure": {"Pa": 120000, "hPa": 1200, "mbar": 1200, "kPa": 120, "bar": 1.2},
    "force": {"N": 9.80665, "kgf": 1, "lbf": 2.2046226218487757},
    "command": {"1": -0.5, "%": -50, "us": 1300, "µs": 1300, "us 1500 -400": 1700, "us 1600 500": 1350},
}
"""The same number in all units of a column; the first is the one in which it is used."""


@pytest.mark.parametrize("name", EQUAL)
def test_all_units_of_a_column(name: str, tmp_path: Path) -> None:
    path, (expected, *_) = tmp_path / "a.csv", EQUAL[name].values()
    for unit, number in EQUAL[name].items():
        path.write_text(f"{name} [{unit}]\n{number}\n", encoding="utf-8")
        (value,) = read_columns(path, {name: COLUMNS[name]}).values[name]
        assert value == pytest.approx(expected, rel=1e-12), unit


# The columns of each kind of file, a header, and for each limit a number within and one beyond.
@pytest.mark.parametrize(
    ("kind", "field", "number", "quantity", "expected"),
    [
        ("VFR_HUD", "alt", -2.0, "depth", 2.0),
        ("CTUN", "Alt", -2.0, "depth", 2.0),
        ("BARO", "Alt", -2.0, "depth", 2.0),
        ("GLOBAL_POSITION_INT", "relative_alt", -2000.0, "depth", 2.0),
        ("SCALED_PRESSURE3", "press_abs", 1111.3165, "depth", 1.0),
        ("SYS_STATUS", "voltage_battery", 65535.0, "voltage", nan),
        ("battery_status", "voltage_v", 0.0, "voltage", nan),
    ],
)
def test_signs_and_units_of_messages(kind: str, field: str, number: float, quantity: str, expected: float) -> None:
    topic = Topic(Source(kind, kind), np.arange(2.0), {field: np.full(2, number)})
    *_, last = channels_of([topic], None)
    assert last.quantity.name == quantity
    assert last.values[-1] == pytest.approx(expected, nan_ok=True)


def test_the_page_that_flies_gets_the_quantities_of_an_axis() -> None:
    keys = "name", "short", "isPressure", "isPosition", "largest", "wraps"
    quantities = (one | {"short": "/".join(one["short"])} for axis in (HEAVE, YAW) for one in as_json(axis))
    rows = (" ".join(str(one[key]) for key in keys) for one in quantities)
    assert [*rows] == [
        "depth depth/position False True 10000000.0 False",
        "pressure pressure True True 1000000000.0 False",
        "heave velocity velocity False False 1000.0 False",
        "heading heading/position False True 10000000.0 True",
        "yaw velocity velocity False False 1000.0 False",
    ]
    assert rules_of_page()["pressures"]["least"] == pytest.approx(1013.25)


LARGEST: Mapping[str, Mapping[float, str]] = {
    "Depth": {100: "depth [m]", 101: "depth [cm]", 10001: "depth [mm]"},
    "yaw": {6.597: "heading [rad]", 6.6: "heading [deg]"},
    "roll": {3.141: "roll angle [rad]", 3.2: "roll angle [deg]"},
    "pitch": {1.57: "pitch angle [rad]", 1.6: "pitch angle [deg]"},
    "battery": {1000: "voltage [V]", 1001: "voltage [mV]"},
    "t": {1e11: "time [s]", 2e11: "time [ms]", 2e14: "time [us]", 2e17: "time [ns]"},
    "thr_1": {
        1: "u_1 [1]",
        1.5: "u_1 [%]",
        100: "u_1 [%]",
        101: "",
        799: "",
        800: "u_1 [us]",
        2200: "u_1 [us]",
        2201: "",
    },
    "fore(%)": {100: "u_fore [%]", 101: ""},
    "Leg1": {1479: "", 1480: "u_1 [us]", 1520: "u_1 [us]", 1521: ""},
    "pos_z": {1: "depth [m]"},
    "dvl_y": {2000: "sway velocity [m/s]"},
    "rates_x": {2000: "roll velocity [rad/s]"},
    "surge_speed": {1: ""},
    "force.x": {2000: "X_ext [N]"},
    "torque.z": {2000: "N_ext [N.m]"},
}
"""What an unknown header seems to mean, by the largest of the numbers below it."""
TOGETHER: Sequence[tuple[Mapping[str, Iterable[float]], list[str]]] = [
    ({"Leg1": [1000, 1500, 1500, 2000]}, ["u_1 [us]"]),
    ({"Leg1": [999, 1500, 1500]}, []),
    ({"Leg1": [2001, 1500, 1500]}, []),
    ({"ch1": [1500, 1500, 1600], "ch2": [1700, 1640, 1420]}, ["u_1 [us]", "u_2 [us]"]),
    ({"ch1": [1500, 1500, 1600], "ch2": [17, 16, 14]}, ["u_1 [us]"]),
    ({"ch1": [1500, 1500, 1600], "ch2[mbar]": [1700, 1640, 1420]}, ["u_1 [us]"]),
    ({"ch1": [1500, 1500, 1600], "ch2": [1500, 1500, 1500], "ch3": [1100, 1100, 1100]}, ["u_1 [us]"]),
    ({"ch1": [1500, 1500, 1500], "ch2": [1500, 1500, 1600], "ch3": [0, 0, 0]}, ["u_1 [us]", "u_2 [us]"]),
    (
        {"RCOU.C1": [1380, 1520, 1601], "RCOU.C2": [1450, 1633, 1560], "RCOU.C3": [1321, 1650, 1700]},
        ["u_1 [us]", "u_2 [us]", "u_3 [us]"],
    ),
    ({"RCIN.C1": [1380, 1520, 1601], "RCIN.C2": [1450, 1633, 1560], "RCIN.C3": [1321, 1650, 1700]}, []),
    ({"p1": [1380.2, 1520, 1601], "p2": [1450, 1633, 1560], "p3": [1321, 1650, 1700]}, []),
    ({"out1": [0, 1], "out2": [1, -1]}, ["u_1 [1]", "u_2 [1]"]),
    (
        {"u_cmd_1": [0, 1], "u_cmd_2": [1, 0], "u_ref": [0, 1], "u_max": [1, 1], "u_desired": [0, 1], "u_cmd": [0, 1]},
        ["u_1 [1]", "u_2 [1]"],
    ),
    ({"thr_1": [0, 1], "thr_2": [1, 0], "thr_ref_1": [1, 0], "thr_max": [1, 1]}, ["u_1 [1]", "u_2 [1]"]),
    ({"thr_1_target": [0, 1], "thr_2_target": [1, 0]}, ["u_1 [1]", "u_2 [1]"]),
    ({"thrust_1": [0, 0.5], "thruster2_N": [0, 0.5], "thr3[N]": [0, 0.5]}, []),
    ({"thrust_2[%]": [0, 50], "thrust_1[%]": [0, 50]}, ["u_2 [%]", "u_1 [%]"]),
    ({"m1[%]": [0, 50], "m0[%]": [0, 50]}, ["u_2 [%]", "u_1 [%]"]),
    ({"depth[%]": [0, 50], "voltage[%]": [0, 50]}, []),
    ({"pos_z": [-1, -2, 0.5], "vel_y": [1], "depth[m]": [1]}, ["-depth [m]", "-sway velocity [m/s]"]),
    ({"X_ext": [1], "u": [1], "r": [9]}, ["X_ext [N]", "surge velocity [m/s]", "yaw velocity [rad/s]"]),
    ({"a": range(50), "b": range(1, 50), "c": range(50)}, ["time [s]"]),
    ({"a": range(49)}, []),
    ({"a": [*range(50), 49]}, []),
    ({"a[m]": range(50), "b[ms]": range(50)}, ["time [ms]"]),
    ({"t": [0, 5, 10]}, ["time [s]"]),
    ({"t": [0, 6, 12]}, ["time [ms]"]),
    ({"t": [0, 2e9]}, ["time [s]"]),
    ({"orientation.x": [1], "orientation.y": [1], "orientation.z": [1], "orientation.w": [1]}, []),
    (
        {"orientation.x": [1], "orientation.y": [1], "orientation.z": [1]},
        ["roll angle [rad]", "pitch angle [rad]", "heading [rad]"],
    ),
]
"""Unknown headers with the numbers below them, and what they seem to mean."""


def guessed_of(columns: Mapping[str, Iterable[float]], axis: Axis | None = None) -> dict[str, str]:
    numbers = {title: np.array([*values], float) for title, values in columns.items()}
    return guessed(numbers, axis, [])[1]


@pytest.mark.parametrize("header", LARGEST)
def test_the_size_of_numbers_tells_their_unit(header: str) -> None:
    for largest, meaning in LARGEST[header].items():
        assert guessed_of({header: [largest]}).get(header, "") == meaning


@pytest.mark.parametrize(("columns", "meanings"), TOGETHER)
def test_headers_and_their_numbers_tell_their_likely_meaning(
    columns: Mapping[str, Iterable[float]], meanings: list[str]
) -> None:
    assert [*guessed_of(columns).values()] == meanings


def test_at_most_32_columns_are_commands() -> None:
    assert guessed_of({f"thr{n}": [1] for n in range(1, 34)}) == {f"thr{n}": f"u_{n} [1]" for n in range(1, 33)}


# ---- Headers of loggers ----------------------------------------------------------------------------------------------

SI: Mapping[str, Mapping[str, float]] = {
    "m/s": {"mps": 1, "ms": 1, "m_s": 1, "m_per_s": 1, "[m/s]": 1, "(m/sec)": 1, "[cm/s]": 0.01, "kn": 1852 / 3600},
    "rad/s": {"rad_s": 1, "radps": 1, "(rad/s)": 1, "[°/s]": pi / 180, "dps": pi / 180, "degps": pi / 180},
    "rad": {"rad": 1, "deg": pi / 180, "[°]": pi / 180, "(degrees)": pi / 180, "[Deg]": pi / 180},
    "m": {"m": 1, "cm": 0.01, "[m]": 1, "(meters)": 1, "ft": 0.3048},
    "V": {"V": 1, "mV": 1e-3, "[V]": 1, "volts": 1},
    "Pa": {"hPa": 100, "mbar": 100, "[kPa]": 1e3, "[Pa]": 1},
}
"""The ends of headers that tell a unit, by the SI unit, and how many of these each is."""
NAMED: Mapping[str, tuple[str, Sequence[str]]] = {
    "surge velocity": ("m/s", ("dvl_vx", "vel_x", "DvlVx", "velocity x", "v_x", "Vitesse x", "Geschwindigkeit (x)")),
    "sway velocity": ("m/s", ("dvl_vy", "nav/vel.y", "speed_y", "velocidad y", "lateral speed")),
    "heave velocity": ("m/s", ("dvl_vz", "a50.vz", "snelheid z", "heave_rate")),
    "roll velocity": ("rad/s", ("gyro_x", "imu_wx", "GYROSCOPE X", "rollRate", "motionRotationRateX")),
    "pitch velocity": ("rad/s", ("imu.gyr_y", "Gyroscope (y)", "pitchspeed", "angular_velocity_y")),
    "yaw velocity": (
        "rad/s",
        ("gyro_z", "ahrs gyroZ", "imu gz", "Gyroscope (z)", "yaw_rate", "turn rate"),
    ),
    "depth": ("m", ("bar30_depth", "Tiefe", "PROFONDEUR", "profondità", "profundidad", "diepte", "Djup", "pos_z")),
    "heading": ("rad", ("compass", "Kompass", "boussole", "brújula", "ahrs_heading", "imuYaw", "rumbo", "cap", "HDG")),
    "roll angle": ("rad", ("imu_roll", "rollwinkel", "attitude.x", "roulis")),
    "pitch angle": ("rad", ("ahrs pitch", "Nickwinkel", "tangage")),
    "voltage": (
        "V",
        (
            "batt",
            "main battery",
            "Batteriespannung",
            "vbat",
            "Spannung",
            "tension",
            "batterie",
            "pack voltage",
            "tensión",
        ),
    ),
    "pressure": ("Pa", ("baro", "Druck", "abs_pressure", "presión", "press")),
}
"""What loggers, apps of phones and other languages call a quantity, with its SI unit."""
HEADERS = [
    (f"{name}{'_' * end[0].isalnum() or ' '}{end}", quantity, factor)
    for quantity, (unit, names) in NAMED.items()
    for name in names
    for end, factor in SI[unit].items()
]


def test_a_header_splits_into_its_sensor_its_quantity_its_axis_and_its_unit() -> None:
    """Each name of each quantity with each end that tells a unit: the column has the name and the factor."""
    for header, quantity, factor in HEADERS:
        ((_, meant),) = guessed_of({header: [1.0]}).items() or [("", "")]
        name, _, unit = meant.rstrip("]").partition(" [")
        assert (name, header) == (quantity, header)
        assert 1.0 / QUANTITIES[name].units[unit] == pytest.approx(factor), header


def test_a_unit_may_stand_before_the_axis_and_a_plural_is_a_rate_only_behind_one() -> None:
    assert guessed_of({"gyro_dps_z": [1.0], "vel_mps_x": [1.0], "rads_y": [1], "yaw_rads": [1], "w_mps": [1]}) == {
        "gyro_dps_z": "yaw velocity [dps]",
        "vel_mps_x": "surge velocity [m/s]",
        "rads_y": "pitch velocity [rad/s]",
        "yaw_rads": "heading [rad]",
        "w_mps": "heave velocity [m/s]",
    }


@pytest.mark.parametrize(
    "header",
    [
        *("Battery_A", "batt_mAh", "battery_temp [°C]", "Batterie_Temperatur", "cell_1_V", "servo_voltage", "batt_pct"),
        *("acc_x", "az", "Linear Acceleration x (m/s^2)", "Magnetic field z (µT)", "gyro_temp", "Depth (fathoms)"),
        *("tether_tension", "battery_cap", "Velocity_mps", "hull pressure [mbar]", "pressure", "locationHeadingX(µT)"),
        *("depth_rate", "cmd_vel_x_mps", "desired_yaw_deg", "yaw_setpoint_deg", "surge [m/s2]", "gyro_z (m/s)"),
    ],
)
def test_a_header_of_something_else_means_nothing(header: str) -> None:
    assert guessed_of({header: [1.0]}) == {}


@pytest.mark.parametrize(
    ("header", "meaning"), [("position", "depth [m]"), ("Distance", "depth [m]"), ("position [fathom]", "")]
)
def test_the_position_in_a_log_of_one_axis_needs_no_other_word(header: str, meaning: str) -> None:
    assert guessed_of({header: [1.0]}, HEAVE) == ({header: meaning} if meaning else {})
