"""What a file contains tells its format, not its name; tables of makers; and jumps of sensors."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from rov_fmu.identify.beginning import load_tests
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.findings import SENTENCES, sentences
from rov_fmu.tank.inspection.inspection import inspect
from rov_fmu.tank.quality import checked
from tests.folders import rows_of
from tests.tank.logs import axes, channel, commanded, commands, log, measured, read_log, used
from tests.tank.readers import motion, test_bags, test_mavlink, test_ulog
from tests.tank.readers.motion import BLUEROV2, TIME
from tests.tank.test_several_files import ROV, table

FOLDER = ROV.replace("Dive of May", "x")


def folder(path: Path, more: str = "") -> Path:
    path.mkdir(exist_ok=True)
    (path / "rov.toml").write_text(f"{FOLDER}{more}", encoding="utf-8")
    return path


def dive(path: Path) -> Path:
    names = ",".join(f"u_{name} [1]" for name in motion.THRUSTERS)
    table(path, f"time [s],{names},depth [m]", TIME, *motion.THRUSTERS.values(), motion.DEPTH)
    return path


# ---- Formats ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["tlog", "bin", "ulg", "bag", "mcap", "csv", "mat"])
def test_a_log_is_read_under_any_name(kind: str, tmp_path: Path) -> None:
    if kind == "tlog":
        path = test_mavlink.tlog(tmp_path / "a", test_mavlink.dive())
    elif kind == "bin":
        path = test_mavlink.dataflash(tmp_path / "a", test_mavlink.turn())
    elif kind == "ulg":
        path = test_ulog.dive().write(tmp_path / "a")
    elif kind in ("bag", "mcap"):
        ros = test_bags.Ros(1 if kind == "bag" else 2)
        (tmp_path / "ros").mkdir()
        path = ros.write(tmp_path / "ros", test_bags.dive(ros), f".{kind}")
    elif kind == "csv":
        path = dive(tmp_path / "a")
    else:
        path = tmp_path / "a.mat"
        titles = {f"u{n}": values for n, values in enumerate(motion.THRUSTERS.values())}
        savemat(path, {"time": TIME, "z": motion.DEPTH, **titles})
    other = tmp_path / "any.log"
    shutil.copy(path, other)
    (one,) = inspect(other, [BLUEROV2])
    assert one.commands or one.unread
    if kind == "mat":
        assert {"time", "z", "u0"} <= {*one.unread, *one.columns}
        assert one.columns["time"] == "time [s]"
    else:
        assert axes(read_log(other, BLUEROV2).log)


def test_variables_of_matlab(tmp_path: Path) -> None:
    """A structure of vectors with a matrix of pulses, as theses publish them."""
    pulses = np.column_stack([1500.0 + 400.0 * c for c in motion.THRUSTERS.values()])
    savemat(tmp_path / "dive.mat", {"log": {"t": TIME, "pwm": pulses, "z": motion.DEPTH, "note": "a dive"}})
    columns = '[columns]\n"log.t" = "time [s]"\n"log.z" = "depth [m]"\n'
    columns += "".join(f'"log.pwm({n})" = "u_{n} [us]"\n' for n in range(1, 7))
    (one,) = load_tests(folder(tmp_path, columns)).folder.logs
    assert measured(one, "depth") == pytest.approx(motion.DEPTH)
    assert commanded(one, "6") == pytest.approx(motion.THRUSTERS["6"])


@pytest.mark.parametrize("name", ["thrust_main.csv", "thrust_t200_dive.csv", "steady_surge.csv"])
def test_a_log_with_the_name_of_a_table_is_a_log(name: str, tmp_path: Path) -> None:
    if "surge" in name:  # a log of the axis in its name
        table(tmp_path / name, "time [s],command [1],distance [m]", TIME, motion.THRUSTERS["5"], TIME)
    else:
        dive(tmp_path / name)
    tests = load_tests(folder(tmp_path))
    assert [one.file for one in tests.folder.logs] == [name]
    assert not rows_of(tests, "thrust")


def test_messages_of_rostopic_are_columns(tmp_path: Path) -> None:
    """`rostopic echo -p` writes a row for each message, with `%time` in ns and the fields as columns."""
    stamps = [f"{1_669_909_208_877_428_140 + 100_000_000 * n}" for n in range(len(TIME))]
    titles = ",".join(["%time", "field.header.frame_id", *(f"field.data{n}" for n in range(6)), "field.position.z"])
    pulses = np.column_stack([1500.0 + 400.0 * c for c in motion.THRUSTERS.values()])
    rows = [
        ",".join([stamp, "map", *(f"{pulse:.0f}" for pulse in row), f"{-depth:.4f}"])
        for stamp, row, depth in zip(stamps, pulses, motion.DEPTH, strict=True)
    ]
    (tmp_path / "rov.csv").write_text("\n".join([titles, *rows]), encoding="utf-8")
    (one,) = inspect(tmp_path / "rov.csv", [BLUEROV2])
    assert "%time" not in one.unread
    columns = '[columns]\n"field.position.z" = "-depth [m]"\n'
    columns += "".join(f'"field.data{n}" = "u_{n + 1} [us]"\n' for n in range(6))
    (log_of,) = load_tests(folder(tmp_path, columns)).folder.logs
    depth = used(log_of, "depth")
    assert depth.values == pytest.approx(motion.DEPTH, abs=1e-4)
    assert depth.time[-1] - depth.time[0] == pytest.approx(9.9, abs=1e-5)


# ---- Tables and vehicles ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "titles", ["PWM (µs),RPM,Force (Kg f),Current (A)", "command [us],RPM,force [kgf],Current (A)"]
)
def test_a_table_of_thrust_in_pulses_as_a_maker_publishes_it(titles: str, tmp_path: Path) -> None:
    rows = [
        f"{1500 + 400 * c:.0f},{2000 * c:.0f},{5.0 * c * abs(c):.3f},{9 * c * c:.2f}" for c in np.linspace(-1, 1, 21)
    ]
    (tmp_path / "thrust_t200.csv").write_text("\n".join([titles, *rows]), encoding="utf-8")
    columns = '[columns]\n"PWM (µs)" = "command [us]"\n"Force (Kg f)" = "force [kgf]"\n' if "PWM" in titles else ""
    thrust = rows_of(load_tests(folder(tmp_path, columns)), "thrust")["t200"]
    assert [row.command for row in thrust] == pytest.approx(np.linspace(-1, 1, 21))
    assert thrust[-1].value == pytest.approx(5.0 * 9.80665)


# ---- Jumps -----------------------------------------------------------------------------------------------------------


def jumps(quantity: str, values: Array) -> list[str]:
    down = commands(TIME, {"t": np.where(TIME > 2.0, 0.5, 0.0)})
    found = checked(log(down, channel(quantity, TIME, values))).findings
    return [line for line in sentences(found, SENTENCES) if "jump" in line]


@pytest.mark.parametrize(
    "values",
    [
        motion.DEPTH + 0.7 * (np.arange(len(TIME)) == 50),
        10.0 * TIME,
        motion.DEPTH + 0.5 * np.random.default_rng(2).standard_normal(len(TIME)),
        0.25 * np.round(4.0 * motion.DEPTH),
        np.where(TIME < 5.0, motion.DEPTH, motion.DEPTH + 1.5 * (TIME - 5.0)),
    ],
    ids=["an outlier", "a fast motion", "noise", "a coarse sensor", "a dive that begins"],
)
def test_what_is_no_jump(values: Array) -> None:
    assert not jumps("depth", values)


TOE = """[vehicle]
name = "Toe"
identifier = "toe"
version = "1.0"
description = "Two thrusters with a toe-in"
source = "x"
[body]
m_rov = { value = 10.0, unit = "kg", source = "x" }
I_r = { value = 0.3, unit = "kg.m2", source = "x" }
[curves.t]
[[thruster]]
name = "l"
curve = "t"
direction = { value = [0.966, 0.259, 0.0], source = "x" }
position = { value = [-0.2, -0.15, 0.0], unit = "m", source = "x" }
[[thruster]]
name = "r"
curve = "t"
direction = { value = [0.966, -0.259, 0.0], source = "x" }
position = { value = [-0.2, 0.15, 0.0], unit = "m", source = "x" }
[known]
a_t_t = { value = 20.0, unit = "N", source = "x" }
b_t_t = { value = 5.0, unit = "N", source = "x" }
"""


@pytest.mark.parametrize("axes", ["", "[axes.surge]\n[axes.yaw]\n"])
def test_thrusters_with_a_toe_in_and_a_log_with_sway(axes: str, tmp_path: Path) -> None:
    """The thrusters drive sway only together with yaw, so the column must not make the vehicle impossible."""
    (tmp_path / "rov.toml").write_text(TOE + axes, encoding="utf-8")
    titles = "time [s],u_l [1],u_r [1],surge velocity [m/s],sway velocity [m/s],heading [rad]"
    left, right = np.where(TIME > 2.0, 0.5, 0.0), np.where(TIME > 5.0, 0.3, 0.0)
    table(tmp_path / "dive.csv", titles, TIME, left, right, motion.U, motion.V, motion.HEADING)
    tests = load_tests(tmp_path)
    assert [*tests.given.vehicle.layout.kinds] == tests.tested.logs == ["surge", "yaw"]
    assert "dive.csv: the motion in sway is left out, because the thrusters drive it only together with" in (
        "\n".join(sentences(tests.findings, SENTENCES))
    )
