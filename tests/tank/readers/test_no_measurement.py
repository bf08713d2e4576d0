"""Numbers of logs that are no measurements: marks, and flags of validity, in tables, bags and .mat files."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.io import savemat

from rov_fmu.io.csv_table import DataFileError
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.catalogue import EARTH, EULER, QUANTITIES, RATES, VECTORS
from rov_fmu.tank.channels import Topic, channels_of
from rov_fmu.tank.columns import names_of
from rov_fmu.tank.description import RovTables
from rov_fmu.tank.findings import Finding, sentences
from rov_fmu.tank.log import Log, Source
from rov_fmu.tank.quality import checked_log
from rov_fmu.tank.read_log import read_logs
from rov_fmu.tank.readers.no_measurement import flag_of, marks, measured_only
from tests.tank.logs import measured
from tests.tank.readers.motion import BLUEROV2, PLACES
from tests.tank.readers.writers import Ros, table

N = 600
TIME: Array = np.linspace(0.0, 59.9, N)
NOISE: Array = np.random.default_rng(1).standard_normal(N)
SPEED = np.round(np.sin(0.3 * TIME) + 0.01 * NOISE, 3)
DEPTH = np.round(3.0 + 2.0 * np.sin(0.2 * TIME) + 0.01 * NOISE, 3)
HEADING = np.round((40.0 * TIME + NOISE) % 360.0, 2)
STEPS: Array = np.where(TIME % 20.0 < 10.0, 0.0, 1.0)
BURSTS = (np.arange(N) % 97) < 9
ONCE = np.arange(N) == 300

MARKED: dict[str, tuple[str, Array, list[float]]] = {
    **{
        f"{mark} in bursts of a {name}": (name, np.where(BURSTS, mark, values), [mark])
        for name, values in {"surge velocity": SPEED, "depth": DEPTH, "voltage": 15.0 + 0.1 * SPEED}.items()
        for mark in (-32.768, 32.767, 999.999, -9999.0, 65.535)
    },
    "one -9999 of a depth": ("depth", np.where(ONCE, -9999.0, DEPTH), [-9999.0]),
    "zeros in a dive": ("depth", np.where(BURSTS, 0.0, 30.0 + SPEED), [0.0]),
    "marks on both sides": (
        "surge velocity",
        np.where(BURSTS, -32.768, np.where(np.roll(BURSTS, 20), 32.767, SPEED)),
        [-32.768, 32.767],
    ),
    "two marks of different size": (
        "depth",
        np.where(BURSTS, -9999.0, np.where(np.roll(BURSTS, 20), -32.768, DEPTH)),
        [-9999.0, -32.768],
    ),
    "two marks that are near each other": (
        "depth",
        np.where(BURSTS, -9999.0, np.where(np.roll(BURSTS, 20), -9998.0, DEPTH)),
        [-9999.0, -9998.0],
    ),
    "most numbers are marks": ("surge velocity", np.where(np.arange(N) % 10 < 8, -32.768, SPEED), [-32.768]),
    "marks of a coarse depth": ("depth", np.where(BURSTS, -9999.0, np.round(DEPTH)), [-9999.0]),
    "marks of a depth that never changes": ("depth", np.where(BURSTS, -9999.0, 3.0), [-9999.0]),
    "999.999 degrees": ("heading", np.radians(np.where(BURSTS, 999.999, HEADING)), [np.radians(999.999)]),
    "one -9999 of a heading": ("heading", np.radians(np.where(ONCE, -9999.0, HEADING)), [np.radians(-9999.0)]),
}
"""A quantity, numbers in SI units, and the marks among them."""
HONEST: dict[str, tuple[str, Array]] = {
    "a speed": ("surge velocity", SPEED),
    "a speed that saturates": ("surge velocity", np.clip(SPEED, -0.6, 0.4)),
    "a speed at rest": ("surge velocity", np.where(BURSTS, SPEED, 0.0)),
    "a speed of two levels": ("surge velocity", STEPS),
    "a coarse speed": ("surge velocity", np.round(SPEED, 1)),
    "a speed that is steady without noise": (
        "surge velocity",
        np.where(STEPS > 0.0, 0.8 + 0.2 * (TIME % 10.0 > 2), 0.0),
    ),
    "a short motion": ("yaw velocity", np.where(ONCE, 0.05, 0.001 * NOISE)),
    "a depth": ("depth", DEPTH),
    "a depth that never changes": ("depth", np.full(N, 3.0)),
    "a depth far below at three levels": ("depth", np.where(BURSTS, 100.0 + np.arange(N) % 3, DEPTH)),
    "a depth of two levels": ("depth", 3.0 + 0.1 * STEPS),
    "a coarse depth": ("depth", np.round(DEPTH)),
    "a depth at the surface": ("depth", np.maximum(DEPTH - 3.0, 0.0)),
    "a depth with an outlier": ("depth", np.where(ONCE, DEPTH + 3.0, DEPTH)),
    "a depth after a long gap": ("depth", np.where(TIME < 20.0, 0.0, 30.0 + SPEED)),
    "a heading that wraps": ("heading", np.radians(HEADING)),
    "a heading about north": ("heading", np.radians(np.round(3.0 * SPEED) % 360.0)),
    "a heading over several turns": ("heading", 0.5 * TIME),
    "no numbers": ("depth", np.full(N, np.nan)),
    "one number": ("depth", np.where(ONCE, 1.0, np.nan)),
}


@pytest.mark.parametrize("name", MARKED)
def test_marks_are_found(name: str) -> None:
    quantity, values, expected = MARKED[name]
    assert sorted(marks(TIME, values, QUANTITIES[quantity])) == sorted(expected)


@pytest.mark.parametrize("name", HONEST)
def test_measurements_are_no_marks(name: str) -> None:
    quantity, values = HONEST[name]
    time = TIME + 100.0 * (TIME >= 20.0) if "gap" in name else TIME
    assert marks(time, values, QUANTITIES[quantity]) == {}


_AXES = ("surge velocity", "sway velocity", "heave velocity")
_IMU = ("roll angle", "pitch angle", "heading", "roll velocity", "pitch velocity", "yaw velocity")


@pytest.mark.parametrize(
    ("name", "valid", "invalid"),
    [
        ("dvl_valid", (*_AXES, *EARTH), ()),
        ("velocity_valid", (*_AXES, *EARTH), ()),
        ("north velocity valid", EARTH[:1], ()),
        ("surge velocity valid", _AXES[:1], ()),
        ("DepthValid [-]", ("depth", "pressure"), ()),
        ("heading_invalid (0/1)", (), ("heading",)),
        ("imu.valid", _IMU, ()),
        ("yaw_rate_valid", ("yaw velocity",), ()),
        ("surge speed valid", _AXES[:1], ()),
        ("is_valid", QUANTITIES, ()),
        ("altitude_valid", (), ()),
        ("dvl", (), ()),
        ("lock", _AXES[:1], ("depth",)),
    ],
)
def test_the_name_of_a_flag_tells_what_it_is_about(name: str, valid: Iterable[str], invalid: Iterable[str]) -> None:
    """A true flag marks what is valid, or what is invalid."""
    flags = flag_of(name, {"lock": ("surge velocity", "-depth")})
    assert flags == dict.fromkeys(valid, True) | dict.fromkeys(invalid, False)


def read(path: Path, **tables: object) -> Log:
    names, mistakes = names_of(BLUEROV2, RovTables.model_validate(tables))
    assert not mistakes
    (log,) = map(checked_log, read_logs(path, BLUEROV2, names))
    return log


def told(log: Log) -> list[str]:
    return [one for one in sentences(log.findings) if " left out, because " in one]


HELD = np.where(BURSTS, np.roll(SPEED, 9), SPEED)
COUNT = int(BURSTS.sum())


@pytest.mark.parametrize("instead", [0.0, 999.999, HELD], ids=["zeros", "marks", "old values"])
@pytest.mark.parametrize("kind", ["by its name", "by rov.toml", "the other way round", "texts", "rows of its own"])
def test_a_flag_of_a_table_says_which_rows_are_no_measurements(kind: str, instead: Array, tmp_path: Path) -> None:
    flag = {"by rov.toml": "lock", "the other way round": "bad"}.get(kind, "dvl_valid")
    meant = {"lock": {"lock": ["surge velocity"]}, "bad": {"bad": "-surge velocity"}}.get(flag, {})
    is_true = BURSTS if flag == "bad" else ~BURSTS
    rows = [
        f"{t:.2f},{c:g},{d},{v},{'TF'[not ok] if kind == 'texts' else int(ok)}"
        for t, c, d, v, ok in zip(TIME, STEPS, DEPTH, np.where(BURSTS, instead, SPEED), is_true, strict=True)
    ]
    if kind == "rows of its own":
        rows = [part for row in rows for part in (f"{row.split(',')[0]},,,,{row[-1]}", row[:-1])]
    path = tmp_path / "dive.csv"
    path.write_text("\n".join([f"time [s],u_5 [1],depth [m],surge velocity [m/s],{flag}", *rows]), encoding="utf-8")
    log = read(path, valid=meant)
    assert measured(log, "surge velocity") == pytest.approx(SPEED[~BURSTS])
    assert measured(log, "depth") == pytest.approx(DEPTH)
    assert told(log) == [
        f"dive.csv: {COUNT} values of surge velocity [m/s] left out, because {flag} says that they are invalid"
    ]


def test_a_mark_is_told_with_its_columns_and_its_value(tmp_path: Path) -> None:
    speeds = [np.where(BURSTS, 32768.0, 1000.0 * sign * SPEED) for sign in (1.0, -1.0)]
    titles = "time [s],u_5 [1],heading [deg],-surge velocity [mm/s],sway velocity [mm/s]"
    log = read(table(tmp_path / "dive.csv", titles, TIME, STEPS, np.where(BURSTS, 999.999, HEADING), *speeds))
    end = "is far from all others: a mark that nothing was measured"
    assert told(log) == [
        f"dive.csv: {COUNT} values of heading [deg] left out, because 999.999 deg {end}",
        f"dive.csv: {COUNT} values of -surge velocity [mm/s] left out, because -32.768 m/s {end}",
        f"dive.csv: {COUNT} values of sway velocity [mm/s] left out, because 32.768 m/s {end}",
    ]
    assert measured(log, "sway velocity") == pytest.approx(-SPEED[~BURSTS])


NOTHING: dict[str, tuple[str, Array, str]] = {
    **{
        f"a voltage of {mark}": ("voltage [V]", np.full(N, mark), "because no measurement is below 1 V")
        for mark in (0.0, -1.0, 0.02)
    },
    "a voltage of noise": ("voltage [mV]", np.abs(np.round(NOISE, 1)), "because no measurement is below 1 V"),
    "a voltage of 0 and 65.535": ("voltage [V]", np.where(BURSTS, 65.535, 0.0), "because all numbers are 65.535 V"),
    "a voltage of 65535 mV": ("voltage [mV]", np.full(N, 65535.0), "because all numbers are 65.535 V"),
    "a voltage of 32767 V": ("voltage [V]", np.full(N, 32767.0), "because all numbers are 32767 V"),
    "a velocity of 65535": ("surge velocity [m/s]", np.full(N, 65535.0), "because all numbers are 65535 m/s"),
    "a turn rate of -32768": ("yaw velocity [deg/s]", np.full(N, -6e4), "because all numbers are -60000 deg/s"),
    "a pressure of -1": ("pressure [hPa]", np.full(N, -1.0), "because all numbers are -100 Pa"),
    "no number": ("voltage [V]", np.full(N, np.nan), ""),
}
"""Columns that hold nothing but their mark of no measurement, with what is told."""


@pytest.mark.parametrize("name", NOTHING)
def test_a_column_of_nothing_but_a_mark_measures_nothing(name: str, tmp_path: Path) -> None:
    title, values, words = NOTHING[name]
    log = read(table(tmp_path / "dive.csv", f"time [s],u_5 [1],depth [m],{title}", TIME, STEPS, DEPTH, values))
    assert not log.used(title.partition(" [")[0])
    assert measured(log, "depth") == pytest.approx(DEPTH)
    assert words in " ".join(told(log))
    assert bool(told(log)) == bool(words)


@pytest.mark.parametrize(
    ("title", "value"), [("voltage [V]", 14.8), ("heave velocity [m/s]", 0.0), ("heading [deg]", 0)]
)
def test_a_number_that_never_changes_may_be_measured(title: str, value: float, tmp_path: Path) -> None:
    log = read(
        table(tmp_path / "dive.csv", f"time [s],u_5 [1],depth [m],{title}", TIME, STEPS, DEPTH, 0 * TIME + value)
    )
    assert log.used(title.partition(" [")[0])
    assert not told(log)


@pytest.mark.parametrize("rock", [0.0, 1.0])
def test_roll_and_pitch_that_never_change_are_not_measured(rock: float, tmp_path: Path) -> None:
    titles = "time [s],u_5 [1],depth [m],roll angle [deg],pitch angle [deg]"
    log = read(table(tmp_path / "dive.csv", titles, TIME, STEPS, DEPTH, 0.0 * TIME, rock * NOISE))
    assert bool(log.tilt) == bool(rock)


def test_a_mark_may_be_beyond_the_bounds_of_a_quantity_and_other_numbers_may_not(tmp_path: Path) -> None:
    path, titles = tmp_path / "dive.csv", "time [s],u_5 [1],depth [m],surge velocity [m/s]"
    log = read(table(path, titles, TIME, STEPS, DEPTH, np.where(BURSTS, -9999.0, SPEED)))
    assert measured(log, "surge velocity") == pytest.approx(SPEED[~BURSTS])
    with pytest.raises(DataFileError) as error:
        read(table(path, titles, TIME, STEPS, DEPTH, 2000.0 * SPEED))
    assert re.fullmatch(
        rf"{path}, column 'surge velocity \[m/s\]' = \S+ m/s, as in \d+ rows: must be within -1000 ... 1000 m/s",
        str(error.value),
    )


def test_marks_and_flags_of_matlab_and_of_a_bag(tmp_path: Path) -> None:
    """A vector in a frame of the earth is rotated after its marks were left out."""
    speed = np.where(BURSTS, -32.768, SPEED)
    savemat(tmp_path / "a.mat", {"t": TIME, "u5": STEPS, "z": DEPTH, "v": HELD, "vel_valid": ~BURSTS})
    columns = {"t": "time [s]", "u5": "u_5 [1]", "z": "depth [m]", "v": "surge velocity [m/s]"}
    assert measured(read(tmp_path / "a.mat", columns=columns), "surge velocity") == pytest.approx(SPEED[~BURSTS])
    ros = Ros(2)
    types = ros.store.types
    number, twist = types["std_msgs/msg/Float64"], types["geometry_msgs/msg/Twist"]
    vector = types["geometry_msgs/msg/Vector3"]
    messages = []
    for time, command, depth, v, ok in zip(TIME, STEPS, DEPTH, speed, ~BURSTS, strict=True):
        messages += [("/out", time, number(data=command)), ("/depth", time, number(data=depth))]
        linear = vector(x=float(v), y=float(v), z=0.0)
        messages += [("/twist", time, twist(linear=linear, angular=vector(x=0.0, y=0.0, z=0.0)))]
        messages += [("/ok", time, number(data=float(ok)))]
    bag = ros.write(tmp_path / "bag", messages)
    topics = {"/out.data": "u_5 [1]"}
    marked = read(bag, topics=topics)
    assert measured(marked, "surge velocity") == pytest.approx(SPEED[~BURSTS])
    assert "/twist.linear.x and /twist.linear.y left out, because -32.768 m/s is far" in told(marked)[0]
    flagged = read(bag, topics=topics, valid={"/ok.data": ["depth"]})
    assert measured(flagged, "depth") == pytest.approx(DEPTH[~BURSTS])


Numbers = NDArray[np.floating[Any]] | float
IMU, ODOMETRY, TWIST = "sensor_msgs/msg/Imu", "nav_msgs/msg/Odometry", "geometry_msgs/msg/TwistWithCovarianceStamped"
DVL, BLUEYE = "marine_acoustic_msgs/msg/Dvl", "blueye.protocol.PositionEstimateTel"
ANGLES, SPIN, HALF = VECTORS[EULER], VECTORS[RATES], 0.1 * SPEED
UNIT: Mapping[str, Numbers] = dict(zip("wxyz", (np.cos(HALF), np.sin(HALF), 0.0, 0.0), strict=True))
ORIENTED = {f"orientation.{letter}": own for letter, own in UNIT.items()}
MOVED = {f"twist.twist.{part}.{letter}": SPEED for part in ("linear", "angular") for letter in "xyz"}
POSED = {f"pose.pose.{key}": own for key, own in ORIENTED.items()}
MESSAGES_OF: Mapping[str, Mapping[str, Numbers]] = {
    IMU: {**ORIENTED, **{f"angular_velocity.{letter}": 0.3 for letter in "xyz"}},
    ODOMETRY: {**{f"pose.pose.position.{letter}": TIME for letter in "xyz"}, **POSED, **MOVED},
    TWIST: MOVED,
    "vehicle_local_position": dict.fromkeys(("x", "y", "z"), TIME) | dict.fromkeys(("vx", "vy", "vz"), SPEED),
    "vehicle_attitude": {f"q[{n}]": own for n, own in enumerate(UNIT.values())},
    "battery_status": {"voltage_v": 15.0 + SPEED},
    "sensor_msgs/msg/BatteryState": {"voltage": 15.0 + SPEED},
    DVL: {f"velocity.{letter}": SPEED for letter in "xyz"},
    "dvl_msgs/msg/DVL": {f"velocity.{letter}": SPEED for letter in "xyz"},
    "BARO": {"Alt": TIME},
    BLUEYE: {f"position_estimate.{axis}_rate": SPEED for axis in ("surge", "sway", "yaw")},
}
"""The numbers of each type of messages, all measured."""
NO_TURN = dict.fromkeys(ORIENTED, 0.0)
LATER = TIME >= 30.0
UNKNOWN: dict[str, tuple[str, Mapping[str, Numbers], Iterable[str]]] = {
    "orientation of an IMU": (IMU, {"orientation_covariance[0]": -1.0}, ANGLES),
    "rates of an IMU": (IMU, {"angular_velocity_covariance[0]": -1.0}, SPIN),
    "an IMU that knows later": (IMU, {"orientation_covariance[0]": np.where(LATER, 0.0, -1.0)}, ANGLES),
    "pose of odometry": (ODOMETRY, {"pose.covariance[0]": -1.0}, ("depth", *PLACES, *ANGLES)),
    "twist of odometry": (ODOMETRY, {"twist.covariance[0]": -1.0}, (*_AXES, *SPIN)),
    "depth of odometry": (ODOMETRY, {"pose.covariance[14]": 1e6}, ("depth",)),
    "heading of odometry": (ODOMETRY, {"pose.covariance[35]": 99999.0}, ANGLES),
    "sway of a twist": (TWIST, {"twist.covariance[7]": 1e6}, ("sway velocity",)),
    "rates of a twist": (TWIST, {"twist.covariance[21]": 1e3}, ("roll velocity",)),
    "a quaternion of zeros": (IMU, NO_TURN, ANGLES),
    "a quaternion of ones": (IMU, dict.fromkeys(ORIENTED, 1.0), ANGLES),
    "a quaternion of PX4": ("vehicle_attitude", {"q[0]": 5.0}, ANGLES),
    "place of PX4": ("vehicle_local_position", {"xy_valid": 0.0}, PLACES),
    "depth of PX4": ("vehicle_local_position", {"z_valid": 0.0}, ("depth",)),
    "speeds of PX4": ("vehicle_local_position", {"v_xy_valid": 1.0 * LATER}, _AXES[:2]),
    "heave of PX4": ("vehicle_local_position", {"v_z_valid": 0.0}, ("heave velocity",)),
    "battery of PX4": ("battery_status", {"connected": 1.0 * LATER}, ("voltage",)),
    "a battery that was taken out": ("sensor_msgs/msg/BatteryState", {"present": 1.0 * LATER}, ("voltage",)),
    "velocity through the water": (DVL, {"velocity_mode": 2.0}, _AXES),
    "few beams": (DVL, {"num_good_beams": np.where(LATER, 4.0, 2.0)}, _AXES),
    "a flag of a DVL": ("dvl_msgs/msg/DVL", {"velocity_valid": 0.0}, _AXES),
    "a barometer that is not healthy": ("BARO", {"Health": 0.0}, ("depth",)),
    "an estimate of a Blueye": (BLUEYE, {"position_estimate.is_valid": 0.0}, (*_AXES[:2], SPIN[2])),
}
"""A type of messages, what is other in them, and the quantities that this says are unknown, always or at first."""
KNOWN: dict[str, tuple[str, Mapping[str, Numbers]]] = {
    "covariances of 0, which are unknown": (IMU, {"orientation_covariance[0]": 0.0}),
    "an unknown covariance of a DVL": (DVL, {"velocity_covar[0]": -1.0, "velocity_mode": 1.0}),
    "beams that are not reported": (DVL, {"beam_velocities_valid": 0.0, "num_good_beams": 0.0}),
    "large variances": (ODOMETRY, {"pose.covariance[0]": 100.0, "twist.covariance[0]": 1.0}),
    "a battery that is not said to be there": ("sensor_msgs/msg/BatteryState", {"present": 0.0}),
}
"""Numbers that say no such thing."""


def counts_of(kind: str, others: Mapping[str, Numbers]) -> tuple[dict[str, int], list[Finding]]:
    """Return how often each quantity is measured, and the findings about what is no measurement."""
    numbers = {**MESSAGES_OF[kind], **others}
    fields = {name: np.broadcast_to(np.asarray(own, float), N).copy() for name, own in numbers.items()}
    (topic,), found = measured_only("a", [Topic(Source("/a", kind), TIME, fields)], {}, {})
    return {one.quantity.name: one.count for one in channels_of([topic], None)}, found


@pytest.mark.parametrize("name", UNKNOWN)
def test_messages_say_themselves_what_they_did_not_measure(name: str) -> None:
    kind, others, unknown = UNKNOWN[name]
    counts, told = counts_of(kind, others)
    whole, _ = counts_of(kind, {})
    left = int(LATER.sum()) if any(np.ndim(own) for own in others.values()) else 0
    assert {key: counts.get(key, 0) for key in whole} == whole | dict.fromkeys(unknown, left)
    assert {one.kind for one in told} == {"invalid"}


@pytest.mark.parametrize("name", KNOWN)
def test_numbers_that_say_no_such_thing(name: str) -> None:
    kind, others = KNOWN[name]
    assert counts_of(kind, others) == counts_of(kind, {})


def test_an_attitude_that_stands_still_while_the_vehicle_turns_is_none() -> None:
    """Velocities in a frame of the earth are left out then, because no attitude is known."""
    turning = {key: own for key, own in MESSAGES_OF[IMU].items() if key not in ORIENTED}
    still = {key: float(key == "orientation.w") for key in ORIENTED} | turning
    imu = Topic(Source("/imu", IMU), TIME, {key: np.full(N, own) for key, own in still.items()})
    moved = {f"twist.linear.{letter}": SPEED for letter in "xyz"}
    over_ground = Topic(Source("/v", "geometry_msgs/msg/TwistStamped", frames=("", "map")), TIME, moved)
    channels = channels_of([imu, over_ground], None)
    assert {one.quantity.name for one in channels if not one.unused} == {*SPIN}
    reasons = {one.quantity.name: one.unused for one in channels}
    assert reasons["heading"] == "it never changes, although /imu tells turns of 17.2 deg in a second"
    assert reasons["surge velocity"].endswith("the log has no attitude to rotate it into that of the body")
    at_rest = replace(imu, fields={**imu.fields, **dict.fromkeys(turning, np.zeros(N))})
    assert {*ANGLES} < {one.quantity.name for one in channels_of([at_rest, over_ground], None) if not one.unused}
