"""Logs of PX4, which the tests write in the ULog format."""

import struct
from pathlib import Path

import pytest

from rov_fmu.tank.findings import Finding
from tests.tank.logs import commanded, measured, read_log
from tests.tank.readers import motion
from tests.tank.readers.motion import BLUEROV2, DIVE, TIME
from tests.tank.readers.writers import ulog_of


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
    assert Finding("dropouts", file="a.ulg", numbers={"count": 3, "longest": 1.5}) in read.findings
