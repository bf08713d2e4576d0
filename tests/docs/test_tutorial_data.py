"""The data of the tutorials: made the same every time, small, and what a pool and a dive would give."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from pymavlink import mavutil

from examples import dive_log, tank_tests


def test_the_command_of_the_tutorial_writes_the_same_tank_tests_every_time(tmp_path: Path) -> None:
    folder, tmp_path = tmp_path / "by command", tmp_path / "by function"
    assert CliRunner().invoke(tank_tests.main, [str(folder)], catch_exceptions=False).exit_code == 0
    tmp_path.mkdir()
    tank_tests.write_tests(tmp_path)
    first, again = ({path.name: path.read_bytes() for path in each.iterdir()} for each in (folder, tmp_path))
    assert first == again
    assert len(first) == 12


def test_a_dive_is_logged_as_ardusub_does(tmp_path: Path) -> None:
    path, dived = tmp_path / "dive.tlog", dive_log.dive(20.0)
    dive_log.write_log(path, dived)
    log = mavutil.mavlink_connection(str(path))
    messages = []
    while (message := log.recv_match()) is not None:
        messages.append(message)
    log.close()
    servo, hud, local = (
        [m for m in messages if m.get_type() == kind] for kind in ("SERVO_OUTPUT_RAW", "VFR_HUD", "LOCAL_POSITION_NED")
    )
    assert [len(found) for found in (servo, hud, local)] == [200, 200, 200]
    assert [m.servo1_raw for m in servo] == dived.outputs["1"][::2].tolist()
    assert [m.time_usec for m in servo] == [100_000 * n for n in range(200)]
    depth = np.array([-m.alt for m in hud])
    assert np.abs(depth - dived.motion["z"][::2]).max() < 0.03
    attitude = [m for m in messages if m.get_type() == "ATTITUDE"]
    assert np.abs(np.sin(np.array([m.yaw for m in attitude]) - dived.motion["psi"])).max() < 0.03
    ground = np.array([(m.vx, m.vy, m.vz) for m in local])
    assert np.abs(ground - dived.over_ground[::2]).max() < 0.06
    assert ground[:20, :2].mean(axis=0) == pytest.approx(dive_log.CURRENT, abs=0.01), "the water carries it along"
