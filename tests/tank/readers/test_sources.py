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
from tests.tank.readers.writers import BOOT, Ros, dataflash, packed, rcou, write_tlog

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
