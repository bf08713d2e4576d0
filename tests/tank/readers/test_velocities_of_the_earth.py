"""Velocities north, east, down and up, in tables, messages and other files of a dive."""

from pathlib import Path

import numpy as np
import pytest

from rov_fmu.tank.arrays import Array
from rov_fmu.tank.columns import names_of
from rov_fmu.tank.description import RovTables
from rov_fmu.tank.findings import sentences
from rov_fmu.tank.log import Log
from rov_fmu.tank.quality import checked_log
from rov_fmu.tank.read_log import read_logs
from tests.tank.logs import measured, used
from tests.tank.readers import motion
from tests.tank.readers.motion import BLUEROV2, DIVE, TIME
from tests.tank.readers.test_lines import joined
from tests.tank.readers.writers import table

NORTH, EAST, DOWN = DIVE.over_ground.T
ROLL, PITCH, HEADING = DIVE.euler.T
ANGLES = {"heading [rad]": HEADING, "roll [rad]": ROLL, "pitch [rad]": PITCH}
HORIZONTAL = {"velocity_north [m/s]": NORTH, "velocity_east [m/s]": EAST}


def read(folder: Path, written: dict[str, Array], tables: RovTables | None = None) -> Log:
    table(folder / "dive.csv", ",".join(["time [s]", *written]), TIME, *written.values())
    names, wrong = names_of(BLUEROV2, tables or RovTables())
    assert not wrong
    (log,) = read_logs(folder / "dive.csv", BLUEROV2, names, is_part=True)
    return checked_log(log)


@pytest.mark.parametrize(("title", "values"), [("velocity_down [m/s]", DOWN), ("velocity_up [m/s]", -DOWN)])
def test_they_are_turned_into_the_frame_of_the_body(tmp_path: Path, title: str, values: Array) -> None:
    log = read(tmp_path, {**ANGLES, **HORIZONTAL, title: values})
    for name, truth in zip(("surge", "sway", "heave"), DIVE.velocity.T, strict=True):
        assert measured(log, f"{name} velocity") == pytest.approx(truth, abs=1e-5)
    assert any("from velocities north and east, which the heading turns" in one for one in sentences(log.findings))


def test_rov_toml_names_them_with_units_and_signs(tmp_path: Path) -> None:
    own = {"vn": 100.0 * NORTH, "ve": -100.0 * EAST, "vu": -100.0 * DOWN}
    meant = {"vn": "north velocity [cm/s]", "ve": "-velocity_east [cm/s]", "vu": "velocity up [cm/s]"}
    log = read(tmp_path, {**ANGLES, **own}, RovTables(columns=meant))
    assert measured(log, "heave velocity") == pytest.approx(DIVE.velocity[:, 2], abs=1e-5)
    assert measured(log, "sway velocity") == pytest.approx(DIVE.velocity[:, 1], abs=1e-5)
    _, wrong = names_of(BLUEROV2, RovTables(topics={"/dvl.vn": "north velocity [m]"}))
    assert "must be 'north velocity [m/s]'" in wrong[0]


def test_without_a_tilt_the_vehicle_is_level_and_a_vertical_one_is_that_in_heave(tmp_path: Path) -> None:
    log = read(tmp_path, {"heading [rad]": HEADING, **HORIZONTAL})
    ahead = np.cos(HEADING) * NORTH + np.sin(HEADING) * EAST
    assert measured(log, "surge velocity") == pytest.approx(ahead, abs=1e-5)
    assert log.used("heave velocity") is None
    alone = read(tmp_path, {"depth [m]": TIME, "velocity_up [m/s]": -DOWN})
    assert measured(alone, "heave velocity") == pytest.approx(DOWN, abs=1e-5)


def test_the_heading_may_be_in_another_file_of_the_dive(tmp_path: Path) -> None:
    alone = read(tmp_path, HORIZONTAL)
    assert alone.used("surge velocity") is None
    assert "no heading beside velocities north and east" in " ".join(sentences(alone.findings))
    slow = slice(None, None, 2)
    titles = "time [s],heading [rad],pitch [rad],roll [rad]"
    table(tmp_path / "imu.csv", titles, TIME[slow], HEADING[slow], PITCH[slow], ROLL[slow])
    down = {**HORIZONTAL, "velocity_down [m/s]": DOWN}
    table(tmp_path / "dvl.csv", ",".join(["time [s]", *down]), TIME, *down.values())
    (tmp_path / "dive.csv").unlink()
    log, _ = joined(tmp_path, 0.0, "imu.csv", "dvl.csv")
    assert used(log, "surge velocity").file == "dvl.csv"
    assert measured(log, "surge velocity") == pytest.approx(motion.U, abs=2e-3)


def test_what_is_invalid_stays_so(tmp_path: Path) -> None:
    valid = np.where(np.arange(len(TIME)) % 10 < 8, 1.0, 0.0)
    log = read(tmp_path, {**ANGLES, **HORIZONTAL, "velocity_down [m/s]": DOWN, "dvl_valid": valid})
    assert used(log, "surge velocity").count == int(valid.sum())
