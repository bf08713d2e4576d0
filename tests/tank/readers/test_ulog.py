"""Logs of PX4, which the tests write in the ULog format."""

import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from tests.tank.logs import commanded, measured, read_log
from tests.tank.readers import motion
from tests.tank.readers.motion import BLUEROV2, TIME

BOOT = 100.0  # s, at the beginning of the log
FORMATS = {
    "actuator_motors": "float[12] control",
    "actuator_outputs": "uint32_t noutputs;uint8_t[4] _padding0;float[16] output",
    "vehicle_attitude": "uint64_t timestamp_sample;float[4] q",
    "vehicle_odometry": "float[3] position;float[3] velocity;float[3] angular_velocity;uint8_t velocity_frame",
    "vehicle_local_position": "float x;float y;float z;float vx;float vy;float vz;bool v_xy_valid",
    "vehicle_angular_velocity": "float[3] xyz",
    "battery_status": "float voltage_v",
    "cpuload": "float load",
}
CODES = {"float": "f", "uint64_t": "Q", "uint32_t": "I", "uint8_t": "B", "bool": "?"}


class ULogWriter:
    """Collects messages."""

    def __init__(self) -> None:
        self.content = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", round(BOOT * 1e6))
        for name, fields in FORMATS.items():
            self._add(b"F", f"{name}:uint64_t timestamp;{fields};".encode())
        for n, name in enumerate(FORMATS):
            self._add(b"A", struct.pack("<BH", 0, n) + name.encode())

    def _add(self, kind: bytes, payload: bytes) -> None:
        self.content += struct.pack("<H", len(payload)) + kind + payload

    def message(self, name: str, time: float, *values: float) -> None:
        form = ""
        for field in FORMATS[name].split(";"):
            kind, _, count = field.split(" ")[0].partition("[")
            form += f"{int(count.rstrip(']')) if count else 1}{CODES[kind]}"
        stamp = round((BOOT + time) * 1e6)
        packed = struct.pack(f"<Q{form}", stamp, *values)
        self._add(b"D", struct.pack("<H", [*FORMATS].index(name)) + packed)

    def write(self, path: Path) -> Path:
        path.write_bytes(self.content)
        return path


def dive(*, velocity: str = "vehicle_local_position", pulses: bool = False) -> ULogWriter:
    """Return the messages of a dive. The attitude is published 2 ms after it was sampled."""
    log = ULogWriter()
    for n, (time, R) in enumerate(zip(TIME, motion.rotations(), strict=True)):
        commands = [c[n] for c in motion.THRUSTERS.values()]
        if pulses:
            log.message("actuator_outputs", time, 6, *[0] * 4, *(1500.0 + 400.0 * c for c in commands), *[0.0] * 10)
        else:
            log.message("actuator_motors", time, *commands, *[np.nan] * 6)
        log.message("vehicle_attitude", time + 0.002, round((BOOT + time) * 1e6), *motion.quaternion(R))
        place = motion.NORTH[n], motion.EAST[n], motion.DEPTH[n]
        over_ground = motion.OVER_GROUND[n]
        if velocity == "vehicle_local_position":
            log.message(velocity, time, *place, *over_ground, True)
        elif velocity == "body":
            log.message("vehicle_odometry", time, *place, motion.U[n], motion.V[n], motion.W[n], 0.0, 0.0, 0.3, 3)
        else:
            log.message("vehicle_odometry", time, *place, *over_ground, 0.0, 0.0, 0.3, 1)
        if n % 10 == 0 or n == len(TIME) - 1:
            log.message("battery_status", time, motion.VOLTAGE[n])
            log.message("cpuload", time, 0.5)
    return log


@pytest.mark.parametrize("velocity", ["vehicle_local_position", "body", "earth"])
@pytest.mark.parametrize("pulses", [False, True])
def test_a_ulog_is_read_in_si_units(velocity: str, pulses: bool, tmp_path: Path) -> None:
    log = read_log(dive(velocity=velocity, pulses=pulses).write(tmp_path / "dive.ulg"), BLUEROV2)
    motion.check(log, within=1e-5)
    assert not [finding for finding in log.findings if finding.kind != "unknown direction"]


def test_velocities_that_the_filter_does_not_know_are_left_out(tmp_path: Path) -> None:
    log = dive(velocity="earth")
    for n, time in enumerate(TIME):
        log.message("vehicle_local_position", time, 0.0, 0.0, 0.5 * motion.DEPTH[n], 9.0, 9.0, 9.0, n >= 90)
    found = read_log(log.write(tmp_path / "a.ulg"), BLUEROV2).log
    assert measured(found, "depth") == pytest.approx(0.5 * motion.DEPTH)
    assert measured(found, "surge velocity") == pytest.approx(motion.U, abs=1e-5)


def test_disarmed_thrusters_have_the_command_0(tmp_path: Path) -> None:
    log = ULogWriter()
    for n, time in enumerate(TIME):
        values: Sequence[float] = [np.nan] * 6 if n < 50 else [0.0] * 4 + [0.5, 0.5]
        log.message("actuator_motors", time, *values, *[np.nan] * 6)
        log.message("vehicle_odometry", time, 0.0, 0.0, motion.DEPTH[n], *[0.0] * 6, 3)
    found = read_log(log.write(tmp_path / "a.ulg"), BLUEROV2).log
    assert commanded(found, "5") == pytest.approx(np.where(np.arange(100) < 50, 0.0, 0.5))
    assert not commanded(found, "1").any()
