"""The data of the tutorials: made the same every time, small, and what a pool and a dive would give."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from pymavlink import mavutil

from examples import dive_log, tank_tests


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the tank tests, by the command of the tutorial."""
    path = tmp_path_factory.mktemp("tank") / "tests"
    assert CliRunner().invoke(tank_tests.main, [str(path)], catch_exceptions=False).exit_code == 0
    return path


def test_tank_tests_are_the_same_every_time(folder: Path, tmp_path: Path) -> None:
    tank_tests.write_tests(tmp_path)
    files = sorted(path.name for path in folder.iterdir())
    kinds = [f"log_{axis}_{n}.csv" for axis in ("heave", "surge", "yaw") for n in (1, 2, 3)]
    assert files == [*kinds, "rov.toml", "thrust_rear.csv", "thrust_top.csv"]
    for name in files:
        assert (folder / name).read_bytes() == (tmp_path / name).read_bytes()
    assert sum(path.stat().st_size for path in folder.iterdir()) < 1_000_000


def test_forces_scatter_about_the_curves(folder: Path) -> None:
    for curve, spread in (("rear", 0.25), ("top", 0.08)):
        command, force = np.loadtxt(folder / f"thrust_{curve}.csv", delimiter=",", skiprows=1).T
        true = np.array([tank_tests.bollard_pull(curve, c) for c in (command / 100.0).tolist()])
        assert not true[np.abs(command) <= 5.0].any()
        assert force[command == 100.0].mean() > -1.3 * force[command == -100.0].mean()
        assert 0.5 * spread < np.std(force - true) < 1.5 * spread


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


def test_a_dive_stays_under_water_and_turns_to_every_side() -> None:
    dived = dive_log.dive(60.0)
    assert dived.motion["z"].min() > 0.5
    assert np.ptp(dived.motion["psi"]) > np.pi
    for symbol in "uvwr":
        assert dived.motion[symbol].min() < -0.2
        assert dived.motion[symbol].max() > 0.2
