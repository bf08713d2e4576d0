"""Who sent a channel: frames, setpoints, vehicles, parts of a vehicle, cores of a filter, and barometers."""

import struct
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rov_fmu.io.csv_table import DataFileError
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.catalogue import QUANTITIES
from rov_fmu.tank.channels import of_scalar
from rov_fmu.tank.columns import names_of
from rov_fmu.tank.commands import LogKeys
from rov_fmu.tank.description import RovTables
from rov_fmu.tank.findings import SENTENCES, sentences
from rov_fmu.tank.log import Log, Source
from rov_fmu.tank.quality import checked
from rov_fmu.tank.read_log import read_logs
from tests.tank.logs import commanded, used
from tests.tank.readers import motion, test_mavlink, writers
from tests.tank.readers.motion import BLUEROV2, DIVE, TIME
from tests.tank.readers.test_mavlink import N
from tests.tank.readers.writers import BOOT, ENU, FLU, Ros, ULogWriter, dataflash, packed, rcou, write_tlog

ROS = Ros(2)


def one(path: Path, keys: LogKeys = LogKeys(), topics: dict[str, str] | None = None) -> Log:  # noqa: B008 (frozen)
    names, mistakes = names_of(BLUEROV2, RovTables(topics=topics or {}, logs=keys))
    assert not mistakes
    (log,) = map(checked, read_logs(path, BLUEROV2, names))
    return log


def told(log: Log) -> str:
    return "\n".join(sentences(log.findings, SENTENCES))


def reason(log: Log, quantity: str, topic: str) -> str:
    (found,) = {c.unused for c in log.channels if c.quantity.name == quantity and c.source.topic == topic}
    return found


def values(log: Log, quantity: str) -> Array:
    return used(log, quantity).values


def pulses(topic: str = "/rc/out") -> Iterator[tuple[str, float, Any]]:
    for n, time in enumerate(TIME):
        yield topic, time, writers.outputs(ROS, DIVE, n)


def numbers(topic: str, values: Iterable[float]) -> Iterator[tuple[str, float, Any]]:
    for time, value in zip(TIME, values, strict=True):
        yield topic, time, ROS.store.types["std_msgs/msg/Float64"](data=float(value))


# ---- Frames ----------------------------------------------------------------------------------------------------------


def twists(topic: str, frame: str, velocities: Array) -> Iterator[tuple[str, float, Any]]:
    for time, velocity in zip(TIME, velocities, strict=True):
        twist = ROS.message("geometry_msgs/msg/Twist", linear=ROS.vector("Vector3", velocity))
        yield topic, time, ROS.message("geometry_msgs/msg/TwistStamped", header=ROS.header(time, frame), twist=twist)


def imu(topic: str = "/imu") -> Iterator[tuple[str, float, Any]]:
    for time, R in zip(TIME, DIVE.rotation, strict=True):
        orientation = ROS.quaternion(ENU @ R @ FLU)
        header = ROS.header(time, "imu_link")
        yield topic, time, ROS.message("sensor_msgs/msg/Imu", header=header, orientation=orientation)


@pytest.mark.parametrize("frame", ["map", "world_ned"])
def test_a_twist_in_a_frame_of_the_earth_is_rotated_by_the_attitude(frame: str, tmp_path: Path) -> None:
    earth = DIVE.over_ground @ (np.eye(3) if "ned" in frame else ENU)
    messages = [*pulses(), *twists("/velocity_local", frame, earth), *imu()]
    log = one(ROS.write(tmp_path, messages))
    assert values(log, "surge velocity") == pytest.approx(motion.U, abs=1e-6)
    assert values(log, "sway velocity") == pytest.approx(motion.V, abs=1e-6)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda n, _: ENU @ DIVE.over_ground[n], "unless it is in a frame of the earth, not of the body"),
        (lambda _, v: 2.0 * v, "by its scale, signs or axes"),
        (lambda _, v: v * [1.0, -1.0, -1.0], "by its scale, signs or axes"),
    ],
    ids=["of the earth", "scale", "signs"],
)
def test_a_twist_that_contradicts_the_positions_is_a_finding(change: Any, words: str, tmp_path: Path) -> None:
    messages = [*writers.messages_of(ROS, DIVE)]
    for n, (_, _, odometry) in enumerate(m for m in messages if m[0] == "/odom"):
        velocity = FLU @ [motion.U[n], motion.V[n], motion.W[n]]
        odometry.twist.twist.linear = ROS.vector("Vector3", change(n, velocity))
    log = one(ROS.write(tmp_path, messages))
    assert words in reason(log, "surge velocity", "/odom")
    assert "/odom is left out for surge velocity, sway velocity" in told(log)


# ---- What is no measurement, and what is no command ------------------------------------------------------------------


@pytest.mark.parametrize("word", ["duty", "rpm", "force"])
def test_telemetry_of_motor_controllers_is_no_command(word: str, tmp_path: Path) -> None:
    messages = [*pulses(), *numbers("/bar30/depth", motion.DEPTH)]
    messages += [m for n in range(1, 7) for m in numbers(f"/esc/motor_{n}/{word}", np.full(len(TIME), 35.0))]
    log = one(ROS.write(tmp_path, messages))
    assert log.commands is not None
    assert log.commands.source.topic == "/rc/out"
    assert commanded(log, "6", TIME + writers.START) == pytest.approx(motion.THRUSTERS["6"])
    assert "the commands of the thrusters are those of /rc/out" in told(log)


def test_newtons_are_no_fractions_and_have_a_unit(tmp_path: Path) -> None:
    """Small forces look like fractions, so only rov.toml can say what a topic of forces is."""
    kind = "std_msgs/msg/Float64MultiArray"
    forces = [ROS.message(kind, data=np.array([10.0 * c[n] for c in motion.THRUSTERS.values()])) for n in range(100)]
    messages = [("/thruster_forces", time, force) for time, force in zip(TIME, forces, strict=True)]
    path = ROS.write(tmp_path, [*messages, *numbers("/bar30/depth", motion.DEPTH)])
    log = one(path)
    assert log.commands is None
    assert log.unread["/thruster_forces"] == f"{kind}, 100 messages"
    assert log.unread["/thruster_forces.data[0]"] == "0 to 2.5"
    log = one(path, topics={f"/thruster_forces.data[{n}]": f"u_{n + 1} [N 10]" for n in range(6)})
    assert commanded(log, "2") == pytest.approx(motion.THRUSTERS["2"])
    _, (line,) = names_of(BLUEROV2, RovTables(topics={"/f.data": "u_1 [N]"}))
    assert "must be a unit of force with the force at full command, such as [N 50]" in line


# ---- Vehicles and parts of a vehicle ---------------------------------------------------------------------------------


def test_of_two_vehicles_one_is_used_and_rov_toml_can_name_the_other(tmp_path: Path) -> None:
    messages = [*pulses("/rov_a/rc/out"), *pulses("/rov_b/rc/out")]
    messages += [*numbers("/rov_b/depth", 5.0 + TIME), *numbers("/rov_a/depth", motion.DEPTH)]
    path = ROS.write(tmp_path, messages)
    log = one(path)
    assert values(log, "depth") == pytest.approx(motion.DEPTH)
    assert "the log has the vehicles rov_a and rov_b. rov_a is used; [logs] of rov.toml can name another" in told(log)
    assert values(one(path, LogKeys(vehicle="rov_b")), "depth") == pytest.approx(5.0 + TIME)
    with pytest.raises(DataFileError, match=r"\[logs\] names the vehicle 'rov_c', but the log has 'rov_a' and 'rov_b'"):
        one(path, LogKeys(vehicle="rov_c"))


def test_the_attitude_of_a_gimbal_is_not_that_of_the_vehicle(tmp_path: Path) -> None:
    path = write_tlog(tmp_path / "a.tlog", test_mavlink.dive())
    writer = mavlink.MAVLink(None, srcSystem=1, srcComponent=154)
    with path.open("ab") as file:
        for n in range(N):
            _, message = writers.attitude(100.0 + 0.1 * n, 2.0 + 0.01 * n)
            file.write(struct.pack(">Q", round((BOOT + 100.0 + 0.1 * n) * 1e6)) + message.pack(writer))
    log = one(path)
    assert values(log, "heading") == pytest.approx(np.ones(N))
    (other,) = (c for c in log.channels if c.quantity.name == "heading" and c.source.part == "component 154")
    assert other.unused == "component 1, which sent the commands, sent it too"


def test_the_primary_core_of_the_filter_is_used_while_it_is_primary(tmp_path: Path) -> None:
    FORMATS = writers.FORMATS | {"XKF4": (157, "QBHB", "TimeUS,C,SS,PI")}
    messages = []
    for n in range(N):
        time = 0.1 * n
        messages += [rcou(time, *[1500] * 4, 1700, 1700)]
        for core in (0, 1):
            north = [1.0 + core, *[0.0] * 10]
            messages += [packed("XKF1", round(time * 1e6), core, 0.0, 0.0, 0.0, *north)]
            stamp = struct.pack("<QBHB", round(time * 1e6), core, 831, int(n >= 30))
            messages += [b"\xa3\x95" + bytes([157]) + stamp]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(writers, "FORMATS", FORMATS)
        path = dataflash(tmp_path / "a.bin", messages)
    log = one(path)
    assert values(log, "surge velocity") == pytest.approx(np.where(np.arange(N) < 30, 1.0, 2.0))
    assert used(log, "surge velocity").source.part == "core 0 and 1, the primary one"
    assert "the autopilot used core 0 and 1" in {c.unused for c in log.channels if c.source.part == "core 0"}
    assert "XKF4" not in dict(log.unread)


# ---- PX4 -------------------------------------------------------------------------------------------------------------


def two_modules(folder: Path, **functions: int) -> Path:
    """Write instance 0 with eight sweeping lights and servos, and instance 1 with the six motors."""
    log = ULogWriter()
    kept = log.content
    for name, value in functions.items():
        key = f"int32_t {name}".encode()
        log._add(b"P", bytes([len(key)]) + key + struct.pack("<i", value))
    parameters = log.content[len(kept) :]
    start = kept.index(b"A", 16)
    first = kept.index(struct.pack("<H", 3 + len(b"actuator_motors")) + b"A" + struct.pack("<BH", 0, 0))
    assert start
    log.content = kept[:first] + parameters + kept[first:]
    log._add(b"A", struct.pack("<BH", 1, 50) + b"actuator_outputs")
    for n, time in enumerate(TIME):
        lights = [1500.0 + 400.0 * np.sin(time + k) for k in range(8)]
        motors = [1500.0 + 400.0 * c[n] for c in motion.THRUSTERS.values()]
        log.message("actuator_outputs", time, 8, *[0] * 4, *lights, *[0.0] * 8)
        packed_motors = struct.pack("<QI4B16f", round((100.0 + time) * 1e6), 6, *[0] * 4, *motors, *[0.0] * 10)
        log._add(b"D", struct.pack("<H", 50) + packed_motors)
        log.message("vehicle_local_position", time, 0.0, 0.0, motion.DEPTH[n], 0.0, 0.0, 0.1, True)
    return log.write(folder / "a.ulg")


@pytest.mark.parametrize(
    ("functions", "instance"),
    [
        ({}, 1),
        ({"PWM_MAIN_FUNC1": 420, "PWM_AUX_FUNC1": 101, "PWM_AUX_FUNC2": 102}, 1),
        ({"PWM_MAIN_FUNC1": 0, "PWM_AUX_FUNC1": 101}, 0),
        ({f"PWM_MAIN_FUNC{n}": 100 + n for n in range(1, 7)} | {"PWM_AUX_FUNC1": 420}, 0),
    ],
    ids=["as many outputs as thrusters", "AUX", "AUX alone", "MAIN"],
)
def test_the_module_that_drives_the_motors(functions: dict[str, int], instance: int, tmp_path: Path) -> None:
    log = one(two_modules(tmp_path, **functions))
    assert log.commands is not None
    assert log.commands.source.part == f"instance {instance}"
    assert f"(instance {instance}); not used: actuator_outputs" in told(log)
    keys = LogKeys(outputs="actuator_outputs")
    chosen = one(two_modules(tmp_path, **functions), keys)
    assert chosen.commands is not None
    assert chosen.commands.source.part == "instance 0"


# ---- Pressures -------------------------------------------------------------------------------------------------------


def pressures(topic: str, pascals: Array, per_pascal: float = 1.0) -> Iterator[tuple[str, float, Any]]:
    for time, value in zip(TIME, pascals, strict=True):
        kind = "sensor_msgs/msg/FluidPressure"
        yield topic, time, ROS.message(kind, header=ROS.header(time), fluid_pressure=float(value) * per_pascal)


WATER = 101325.0 + 9806.65 * motion.DEPTH
HULL = 100900.0 + 15.0 * np.sin(7.0 * TIME)


def test_a_column_of_pressures(tmp_path: Path) -> None:
    rows = [f"{n / 10},{30 * (n > 9)},{WATER[n] * 0.01}" for n in range(len(TIME))]
    path = tmp_path / "log_heave.csv"
    path.write_text("\n".join(["time [s],u_5 [%],pressure [mbar]", *rows]), encoding="utf-8")
    assert values(one(path), "depth") == pytest.approx(motion.DEPTH)


def test_a_barometer_inside_the_hull(tmp_path: Path) -> None:
    log = one(ROS.write(tmp_path, [*pulses(), *pressures("/hull", HULL)]))
    assert log.used("depth") is None
    assert "its pressure changes by only 3 mm of water and is that of the air, so the barometer seems to be" in (
        told(log)
    )
    both = one(ROS.write(tmp_path / "b", [*pulses(), *pressures("/hull", HULL), *pressures("/bar30", WATER)]))
    assert values(both, "depth") == pytest.approx(motion.DEPTH)
    assert (
        "dive.db3: pressure from /bar30, 10 Hz; also in /hull, not used\ndive.db3: depth from /bar30, 10 Hz; also in "
        in (told(both))
    )
    assert "the depth is computed from the pressure, for fresh water" in told(both)


AIR = 101325.0


@pytest.mark.parametrize(
    ("low", "high", "reason"),
    [
        (100.0, 0.0099 * AIR, "its pressures of 100 ... 1003 are below 1 % of an atmosphere, so they are not in Pa"),
        (100.0, 0.0101 * AIR, ""),
        (1.049 * AIR - 195.0, 1.049 * AIR, "its pressure changes by only 20 mm of water and is that of the air"),
        (0.951 * AIR - 195.0, 0.951 * AIR, "its pressure changes by only 20 mm of water and is that of the air"),
        (1.051 * AIR - 195.0, 1.051 * AIR, ""),
        (AIR - 197.0, AIR, ""),
    ],
)
def test_pressures_that_tell_no_depth(low: float, high: float, reason: str) -> None:
    pressure, depth = of_scalar(QUANTITIES["pressure"], Source("p"), np.arange(2.0), np.array([low, high]))
    assert not pressure.unused
    assert depth.unused.startswith(reason)
    assert bool(depth.unused) == bool(reason)


@pytest.mark.parametrize("outputs", [[799.0, 1500.0], [2201.0, 0.0], [1.01, 0.2]])
def test_outputs_that_are_neither_pulses_nor_fractions_are_refused(outputs: list[float], tmp_path: Path) -> None:
    message = ROS.message("std_msgs/msg/Float64MultiArray", data=np.array(3 * outputs))
    path = ROS.write(tmp_path, [("/thrusters", time, message) for time in TIME])
    with pytest.raises(DataFileError, match=r"are neither fractions within -1 \.\.\. 1 nor pulses in us: name their"):
        one(path)
