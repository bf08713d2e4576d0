"""Logs of autopilots: ArduSub's, which the tests write with pymavlink (.tlog) and in the DataFlash format (.bin), and
ULogs of PX4."""

import struct
import sys
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rov_fmu.io.csv_table import DataFileError
from rov_fmu.tank.findings import Finding, sentences
from rov_fmu.tank.log import Source
from rov_fmu.tank.readers import parsers
from rov_fmu.tank.readers.mavlink import MavlinkMessage, read_messages
from rov_fmu.tank.readers.parsers import read_topics
from tests.tank.logs import commanded, measured, read_log, used
from tests.tank.readers import motion
from tests.tank.readers.motion import BLUEROV2, DIVE, TIME
from tests.tank.readers.writers import (
    altitude,
    attitude,
    dataflash,
    flash,
    packed,
    parameter,
    servos,
    ulog_of,
    write_tlog,
)

N = 60
EKF, LOCAL = "EKF_STATUS_REPORT", "LOCAL_POSITION_NED"


# ---- .tlog -----------------------------------------------------------------------------------------------------------


def dive(start: float = 100.0, down: int = 1700) -> list[tuple[float, Any]]:
    """Return messages of a dive: from 1 s on, the vertical thrusters push down and the depth grows at 0.2 m/s."""
    found = []
    for n in range(N):
        time = start + 0.1 * n
        found += [servos(time, *[1500] * 4, *[down if n >= 10 else 1500] * 2)]
        found += [altitude(time + 0.03, -1.0 - 0.02 * max(n - 10, 0)), attitude(time + 0.05, 1.0)]
    return found


def test_a_clock_of_servos_that_begins_anew(tmp_path: Path) -> None:
    start = 2.0**32 * 1e-6 - 3.0
    log = read_log(write_tlog(tmp_path / "dive.tlog", dive(start)), BLUEROV2).log
    assert log.commands is not None
    since = log.commands.rows - log.commands.rows[0]
    assert used(log, "depth").time[-1] - log.commands.rows[0] == pytest.approx(0.1 * (N - 1) + 0.03, abs=2e-3)
    assert since[np.flatnonzero(commanded(log, "5"))[0]] == pytest.approx(1.0, abs=2e-3)


def test_the_filter_tells_which_velocities_it_knows() -> None:
    """Of its flags, 2 means that it knows the horizontal velocity, and 128 that it assumes that the vehicle rests."""
    messages = []
    for n, flags in enumerate((0, 253, 255, 126)):
        local = {"time_boot_ms": 1000.0 * n + 500.0, "vx": 1.0, "vy": 2.0, "vz": 3.0}
        messages += [MavlinkMessage(Source(EKF, EKF, "1"), 9.0 + n, {"flags": flags, "time_boot_ms": 1000.0 * n})]
        messages += [MavlinkMessage(Source(LOCAL, LOCAL, vehicle), 9.5 + n, local) for vehicle in "12"]
    content = read_messages(Path("a.tlog"), messages, ())
    own, other = content.pieces[0].topics
    np.testing.assert_equal([own.fields["vx"], own.fields["vy"]], [[nan] * 3 + [1.0], [nan] * 3 + [2.0]])
    assert (own.fields["vz"].tolist(), other.fields["vx"].tolist()) == ([3.0] * 4, [1.0] * 4)
    assert content.findings == [Finding("unknown velocity", file="a.tlog", words={"count": 3})]


def test_the_primary_core_of_the_filter_is_used_while_it_is_primary() -> None:
    messages = []
    for n in range(4):
        for core in (0, 1, 2):
            told = {"XKF1": {"VN": 1.0 + core, "VE": 0.0}, "XKF4": {"SS": 831.0, "PI": float(n > 1)}}
            for kind, numbers in told.items():
                source = Source(kind, kind, part=f"core {core}")
                messages += [MavlinkMessage(source, float(n), {"TimeUS": 1e6 * n, **numbers})]
    content = read_messages(Path("a.bin"), messages, ())
    primary, *cores = content.pieces[0].topics
    assert primary.source.part == "core 0 and 1, the primary one"
    assert primary.fields["VN"].tolist() == [1.0, 1.0, 2.0, 2.0]
    assert {core.source.part: core.unused for core in cores} == dict.fromkeys(
        ("core 0", "core 1", "core 2"), "the autopilot used core 0 and 1"
    )
    assert not content.findings


def test_another_vehicle_another_port_and_outputs_that_are_none(tmp_path: Path) -> None:
    path = write_tlog(tmp_path / "dive.tlog", [servos(99.0, *[0] * 5, 65535), *dive()])
    write_tlog(path, [servos(100.0 + n, *[1900] * 6) for n in range(5)], system=2)
    write_tlog(path, [servos(100.0 + n, *[1900] * 6, port=1) for n in range(5)])
    log = read_log(path, BLUEROV2)
    assert not commanded(log.log, "1").any()
    assert commanded(log.log, "5")[0] == 0.0
    names = {"vehicles": "1 and 2", "vehicle": "1"}
    assert Finding("several vehicles", file="dive.tlog", words=names) in log.findings
    assert log.log.commands
    assert log.log.commands.source.part == "component 1"
    assert Finding("no servo pulse", file="dive.tlog", words={"count": 6}) in log.findings


# ---- .bin ------------------------------------------------------------------------------------------------------------


def test_a_log_that_ends_amid_a_message_is_read_so_far(tmp_path: Path) -> None:
    path = flash(tmp_path, DIVE)
    path.write_bytes(path.read_bytes()[:-500])
    assert 90 < len(measured(read_log(path, BLUEROV2).log, "heading")) <= 100


def test_motors_on_servos_beyond_the_first_message(tmp_path: Path) -> None:
    """They are in other messages of the vehicle's log, and on the second port of a .tlog."""
    assigned = {servo: 33 + motor for motor, servo in enumerate((13, 14, 15, 18, 19, 32))}
    messages = [packed("PARM", 10**6, f"SERVO{servo}_FUNCTION".encode(), of, 0.0) for servo, of in assigned.items()]
    sent = [parameter(f"SERVO{servo}_FUNCTION", of) for servo, of in assigned.items()]
    for n, time in enumerate(TIME):
        pulses = dict.fromkeys(range(1, 33), 1500) | dict(
            zip(assigned, DIVE.pulses[n].astype(int).tolist(), strict=True)
        )
        outputs, stamp = [*pulses.values()], round((50.0 + time) * 1e6)
        messages += [packed("RCOU", stamp, *outputs[:14]), packed("RCO2", stamp + 70, *outputs[14:18])]
        messages += [packed("RCO3", stamp + 90, *outputs[18:])]
        sent += [servos(50.0 + time, *outputs[:16]), servos(50.01 + time, *outputs[16:], port=1)]
        sent += [altitude(50.0 + time, -motion.DEPTH[n])]
    for path in (dataflash(tmp_path / "a.bin", messages), write_tlog(tmp_path / "a.tlog", sent)):
        log = read_log(path, BLUEROV2).log
        for thruster, values in motion.THRUSTERS.items():
            assert commanded(log, thruster) == pytest.approx(values)


@pytest.mark.parametrize(
    ("gravity", "water"), [(1.024, "water of 1024 kg/m3"), (None, "fresh water"), (0.0, "fresh water")]
)
def test_the_water_that_ardusub_was_told_gives_the_depth(gravity: float | None, water: str, tmp_path: Path) -> None:
    """Its altitude is computed for it, and the pressure is not."""
    told = gravity or 1.0
    sent = [parameter("BARO_SPEC_GRAV", gravity)] if gravity is not None else []
    for n, time in enumerate(TIME):
        pressure = 1013.25 + 98.0665 * told * motion.DEPTH[n]
        scaled = mavlink.MAVLink_scaled_pressure2_message(round((50.0 + time) * 1e3), pressure, 0.0, 2000)
        sent += [servos(50.0 + time, *DIVE.pulses[n].astype(int).tolist()), (50.0 + time, scaled)]
    path = write_tlog(tmp_path / "a.tlog", sent)
    log = read_log(path, BLUEROV2)
    assert measured(log.log, "depth") == pytest.approx(motion.DEPTH, abs=1e-3)
    (line,) = (line for line in sentences(log.findings) if "depth is computed" in line)
    assert line.startswith(f"a.tlog: the depth is computed from the pressure, for {water}")
    altitudes = [(time, message) for time, message in sent if message.get_type() != "SCALED_PRESSURE2"]
    altitudes += [altitude(50.0 + time, -motion.DEPTH[n]) for n, time in enumerate(TIME)]
    both = read_log(write_tlog(tmp_path / "b.tlog", sorted(altitudes, key=lambda one: one[0])), BLUEROV2).log
    assert measured(both, "depth") == pytest.approx(motion.DEPTH, abs=1e-3)


# ---- Neither ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("a.bin", None, "cannot be read: Is a directory"),
        ("a.bin", b"", "the file is empty"),
        ("a.bin", b"time [s],command [%]\n" * 50, "line 1: column 'command \\[%\\]' is the command of one axis"),
        ("a.bin", b"\xa3\x95\x80" + b"\xff" * 2000, "no commands of thrusters|damaged or was cut short"),
        ("a.tlog", b"nonsense\n" * 50, "none of these headers is known"),
        (
            "a.tlog",
            bytes(range(256)) * 20,
            "its first bytes are those of none of the formats that are read",
        ),
        (
            "a.db3",
            b"SQLite format 3\0" + bytes(99),
            "begins as a bag of ROS 2, but is damaged .*; `sqlite3 .recover` may rep",
        ),
        (
            "a.ulg",
            b"ULog\1\x12\x35",
            "begins as a ULog, but is damaged or was cut short, and cannot be r[^;]*$",
        ),
    ],
)
def test_what_is_no_log_is_one_clear_line(
    name: str, content: bytes | None, told: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / name
    path.mkdir() if content is None else path.write_bytes(content)
    with pytest.raises(DataFileError, match=told) as error:
        read_log(path, BLUEROV2)
    assert str(error.value).startswith(f"{path}")
    assert len(str(error.value).splitlines()) == 1
    assert capfd.readouterr() == ("", "")


def test_without_pymavlink_the_line_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pymavlink", None)
    path = write_tlog(tmp_path / "a.tlog", [attitude(0.0, 0.0)])
    monkeypatch.setattr(parsers._PARSER, "is_child", True)
    with pytest.raises(DataFileError, match=r"a telemetry log needs pymavlink: pip install 'rov-fmu\[mavlink\]'"):
        read_topics(path, ())


# ---- .ulg ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("velocity", ["vehicle_local_position", "body", "earth"])
@pytest.mark.parametrize("pulses", [False, True])
def test_a_ulog_is_read_in_si_units(velocity: str, pulses: bool, tmp_path: Path) -> None:
    log = read_log(ulog_of(DIVE, velocity, pulses=pulses).write(tmp_path / "dive.ulg"), BLUEROV2)
    motion.check(log.log)
    assert {channel.source.part for channel in log.log.channels} == {""}
    assert not [finding for finding in log.findings if finding.kind != "unknown direction"]


def test_parameters_tell_the_motors_of_outputs_and_may_change(tmp_path: Path) -> None:
    log = ulog_of(DIVE, PWM_MAIN_FUNC1=101, PWM_MAIN_FUNC2=106, PWM_MAIN_FUNC5=105, PWM_MAIN_FUNC6=102)
    log.parameter("PWM_MAIN_FUNC1", 105)
    log.parameter("PWM_MAIN_FUNC5", 101)
    found = read_log(log.write(tmp_path / "a.ulg"), BLUEROV2).log
    for motor, output in {"1": "5", "2": "6", "3": "3", "5": "1", "6": "2"}.items():
        assert commanded(found, motor) == pytest.approx(motion.THRUSTERS[output])


def test_velocities_that_the_filter_does_not_know_are_left_out(tmp_path: Path) -> None:
    log = ulog_of(DIVE, "earth")
    for n, time in enumerate(TIME):
        log.message("vehicle_local_position", time, 0.0, 0.0, 0.5 * motion.DEPTH[n], 9.0, 9.0, 9.0, n >= 90)
    for milliseconds in (200, 1500, 300):
        log._add(b"O", struct.pack("<H", milliseconds))
    read = read_log(log.write(tmp_path / "a.ulg"), BLUEROV2)
    assert measured(read.log, "depth") == pytest.approx(0.5 * motion.DEPTH)
    assert measured(read.log, "surge velocity")[:100] == pytest.approx(motion.U, abs=1e-5)
    assert Finding("dropouts", file="a.ulg", words={"count": 3, "longest": 1.5}) in read.findings
