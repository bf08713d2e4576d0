"""What units, messages and unknown headers mean, each with numbers that somebody else would compute, too."""

from collections.abc import Mapping
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
    "depth": "3.048 m, 304.8 cm, 3048 mm, 10 ft",
    "surge velocity": "0.9144 m/s, 91.44 cm/s, 914.4 mm/s, 3 ft/s, 1.7774514038876894 kn",
    "heading": "3.141592653589793 rad, 180 deg, 180 °",
    "yaw velocity": "3.141592653589793 rad/s, 180 deg/s, 180 °/s, 180 dps",
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


SIGNS = {
    "VFR_HUD alt -2": "depth 2",
    "CTUN Alt -2": "depth 2",
    "BARO Alt -2": "depth 2",
    "GLOBAL_POSITION_INT relative_alt -2000": "depth 2",
    "SCALED_PRESSURE3 press_abs 1111.3165": "depth 1",
    "SYS_STATUS voltage_battery 65535": "voltage nan",
    "battery_status voltage_v 0": "voltage nan",
}


@pytest.mark.parametrize("message", SIGNS)
def test_signs_and_units_of_messages(message: str) -> None:
    kind, field, number = message.split()
    topic = Topic(Source(kind, kind), np.arange(2.0), {field: np.full(2, float(number))})
    *_, found = channels_of([topic], None)
    assert f"{found.quantity.name} {found.values[-1]:g}" == SIGNS[message]


def test_the_page_that_flies_gets_the_quantities_of_an_axis() -> None:
    keys = "name", "short", "isPressure", "isPosition", "largest", "wraps"
    rows = (" ".join(str(one[key]) for key in keys) for axis in (HEAVE, YAW) for one in as_json(axis))
    assert [*rows] == [
        "depth depth False True 10000000.0 False",
        "pressure pressure True True 1000000000.0 False",
        "heave velocity velocity False False 1000.0 False",
        "heading heading False True 10000000.0 True",
        "yaw velocity velocity False False 1000.0 False",
    ]
    assert rules_of_page()["pressures"]["least"] == pytest.approx(1013.25)


MEANT = {
    "Depth=100": "depth [m]",
    "Depth=101": "depth [cm]",
    "Depth=10001": "depth [mm]",
    "yaw=6.597": "heading [rad]",
    "yaw=6.6": "heading [deg]",
    "roll=3.141": "roll angle [rad]",
    "roll=3.2": "roll angle [deg]",
    "pitch=1.57": "pitch angle [rad]",
    "pitch=1.6": "pitch angle [deg]",
    "battery=1000": "voltage [V]",
    "battery=1001": "voltage [mV]",
    "t=1e11": "time [s]",
    "t=2e11": "time [ms]",
    "t=2e14": "time [us]",
    "t=2e17": "time [ns]",
    "thr_1=1": "u_1 [1]",
    "thr_1=1.5": "u_1 [%]",
    "thr_1=100": "u_1 [%]",
    "thr_1=101": "",
    "thr_1=799": "",
    "thr_1=800": "u_1 [us]",
    "thr_1=2200": "u_1 [us]",
    "thr_1=2201": "",
    "fore(%)=100": "u_fore [%]",
    "fore(%)=101": "",
    "Leg1=1479": "",
    "Leg1=1480": "u_1 [us]",
    "Leg1=1520": "u_1 [us]",
    "Leg1=1521": "",
    "Leg1=1000,1500,1500,2000": "u_1 [us]",
    "Leg1=999,1500,1500": "",
    "Leg1=2001,1500,1500": "",
    "ch1=1500,1500,1600 ch2=1700,1640,1420": "u_1 [us], u_2 [us]",
    "ch1=1500,1500,1600 ch2=17,16,14": "u_1 [us]",
    "ch1=1500,1500,1600 ch2[mbar]=1700,1640,1420": "u_1 [us]",
    "ch1=1500,1500,1600 ch2=1500,1500,1500 ch3=1100,1100,1100": "u_1 [us]",
    "ch1=1500,1500,1500 ch2=1500,1500,1600 ch3=0,0,0": "u_1 [us], u_2 [us]",
    "RCOU.C1=1380,1520,1601 RCOU.C2=1450,1633,1560 RCOU.C3=1321,1650,1700": "u_1 [us], u_2 [us], u_3 [us]",
    "RCIN.C1=1380,1520,1601 RCIN.C2=1450,1633,1560 RCIN.C3=1321,1650,1700": "",
    "p1=1380.2,1520,1601 p2=1450,1633,1560 p3=1321,1650,1700": "",
    "out1=0,1 out2=1,-1": "u_1 [1], u_2 [1]",
    "u_cmd_1=0,1 u_cmd_2=1,0 u_ref=0,1 u_max=1,1 u_desired=0,1 u_cmd=0,1": "u_1 [1], u_2 [1]",
    "thr_1=0,1 thr_2=1,0 thr_ref_1=1,0 thr_max=1,1": "u_1 [1], u_2 [1]",
    "thr_1_target=0,1 thr_2_target=1,0": "u_1 [1], u_2 [1]",
    "thrust_1=0,0.5 thruster2_N=0,0.5 thr3[N]=0,0.5": "",
    "thrust_2[%]=0,50 thrust_1[%]=0,50": "u_2 [%], u_1 [%]",
    "m1[%]=0,50 m0[%]=0,50": "u_2 [%], u_1 [%]",
    "depth[%]=0,50 voltage[%]=0,50": "",
    "pos_z=1": "depth [m]",
    "pos_z=-1,-2,0.5 vel_y=1 depth[m]=1": "-depth [m], -sway velocity [m/s]",
    "dvl_y=2000": "sway velocity [m/s]",
    "rates_x=2000": "roll velocity [rad/s]",
    "surge_speed=1": "",
    "force.x=2000": "X_ext [N]",
    "torque.z=2000": "N_ext [N.m]",
    "X_ext=1 u=1 r=9": "X_ext [N], surge velocity [m/s], yaw velocity [rad/s]",
    "a=0...49 b=1...49 c=0...49": "time [s]",
    "a=0...48": "",
    "a=0...49,49": "",
    "a[m]=0...49 b[ms]=0...49": "time [ms]",
    "t=0,5,10": "time [s]",
    "t=0,6,12": "time [ms]",
    "t=0,2e9": "time [s]",
    "orientation.x=1 orientation.y=1 orientation.z=1 orientation.w=1": "",
    "orientation.x=1 orientation.y=1 orientation.z=1": "roll angle [rad], pitch angle [rad], heading [rad]",
}
"""Unknown headers with the numbers below them, and what they seem to mean."""


@pytest.mark.parametrize("given", MEANT)
def test_headers_and_their_numbers_tell_their_likely_meaning(given: str) -> None:
    columns = guessed_of(dict(pair.split("=") for pair in given.split()))
    assert ", ".join(columns.values()) == MEANT[given]


def guessed_of(texts: Mapping[str, str]) -> dict[str, str]:
    numbers = {}
    for title, text in texts.items():
        first, _, last = text.partition("...")
        values = [*range(int(first), int(last.partition(",")[0]) + 1)] if last else []
        numbers[title] = np.array([*values, *(last.split(",")[1:] if last else text.split(","))], float)
    _, columns = guessed([*numbers], numbers, None, [])
    return columns


def test_at_most_32_columns_are_commands() -> None:
    assert guessed_of({f"thr{n}": "1" for n in range(1, 34)}) == {f"thr{n}": f"u_{n} [1]" for n in range(1, 33)}
