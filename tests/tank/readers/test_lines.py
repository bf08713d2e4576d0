"""Logs of lines: what VideoRay Cockpit exports, and the reports of Water Linked's DVL A50."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.identify.beginning import load_tests
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.tank.columns import ColumnNames
from rov_fmu.tank.findings import sentences
from rov_fmu.tank.log import Log
from rov_fmu.tank.read_log import read_logs
from tests.tank.logs import measured, used
from tests.tank.readers import motion
from tests.tank.readers.motion import BLUEROV2, DIVE, TIME, expected
from tests.tank.readers.writers import BOOT, cockpit_lines, dvl, dvl_reports, table

ROV = """base = "bluerov2"
[vehicle]
name = "ROV"
identifier = "rov"
version = "1.0"
description = "An ROV"
source = "A dive"
"""
EXPORTED, SPEEDS = (
    ("depth", "roll angle", "pitch angle", "heading"),
    ("surge velocity", "sway velocity", "heave velocity"),
)
BROKEN = "vr.txt: {} left out, which are cut or have a wrong checksum"


def read(path: Path) -> Log:
    (log,) = read_logs(path, BLUEROV2, ColumnNames(), is_part=True)
    return log


def joined(folder: Path, start: float, *names: str, titles: str = "time [s]") -> tuple[Log, str]:
    """Return the log of commands and other files of one dive, and the sentences about it."""
    others = ", ".join(f'"{name}"' for name in names)
    (folder / "rov.toml").write_text(f'{ROV}[dives.one]\nfiles = ["commands.csv", {others}]\n', encoding="utf-8")
    header = ",".join([titles, *(f"u_{name} [1]" for name in motion.THRUSTERS)])
    table(folder / "commands.csv", header, start + TIME, *motion.THRUSTERS.values())
    tests = load_tests(folder)
    (log,) = tests.folder.logs
    return log, "\n".join(sentences(tests.folder.findings))


def check(log: Log, quantities: Sequence[str], start: float, kept: Sequence[int] = range(len(TIME))) -> None:
    """Check that a log has some quantities of the dive in some of its rows, from its own start on."""
    truth = expected(DIVE)
    for name in quantities:
        channel, rows = used(log, name), [*kept]
        assert channel.samples[0] - start == pytest.approx(TIME[rows], abs=1e-5)
        values, within = truth[name]
        off = (measured(log, name) - values[rows] + np.pi) % (2.0 * np.pi) - np.pi
        assert off == pytest.approx(np.zeros(len(rows)), abs=within), name


def lines_of(tmp_path: Path, lines: Sequence[str], name: str = "vr.txt") -> Path:
    path = tmp_path / name
    path.write_text("\r\n".join(lines), encoding="utf-8", newline="")
    return path


COCKPIT_START = 1_789_380_482.0
"""2026-09-14 10:08:02, s since 1970."""


@pytest.mark.parametrize("suffix", [".txt", ".csv"])
def test_what_videoray_cockpit_exports_is_read_under_any_name(tmp_path: Path, suffix: str) -> None:
    log = read(lines_of(tmp_path, [*cockpit_lines(DIVE), ""], f"vr{suffix}"))
    check(log, EXPORTED, COCKPIT_START)
    assert not log.findings


def test_lines_with_a_wrong_checksum_or_that_are_cut_are_left_out_and_counted(tmp_path: Path) -> None:
    lines = cockpit_lines(DIVE)
    lines[7] = lines[7].replace(",1.", ",9.", 1)
    lines[-1] = lines[-1][:-20]
    banner, depth = "=~=~= a terminal =~=~=", "$VRDPT,1.0,0.0*45"
    log = read(lines_of(tmp_path, [banner, depth, *lines]))
    check(log, EXPORTED, COCKPIT_START, [n for n in range(len(TIME) - 1) if n != 7])
    assert sentences(log.findings) == (BROKEN.format("3 lines"),)
    assert log.unread == {"VRDPT": "1 messages"}
    assert read(lines_of(tmp_path, lines[:-1])).findings[0].words["count"] == 1
    with pytest.raises(DataFileError, match=r"vr.txt: its 2 lines are broken or have a wrong checksum$"):
        read(lines_of(tmp_path, [line[:-1] for line in lines[:2]]))


def test_a_header_with_units_above_the_lines_still_counts(tmp_path: Path) -> None:
    header = "id,date,time,depth [ft],heading [deg],pitch angle [deg],roll"
    log = read(lines_of(tmp_path, [header, *cockpit_lines(DIVE), ""]))
    assert measured(log, "depth") == pytest.approx(0.3048 * DIVE.position[:, 2], abs=1e-6)


@pytest.mark.parametrize("start", [0.0, 36482.0])
def test_several_files_of_one_sensor_are_one_log_on_one_clock(tmp_path: Path, start: float) -> None:
    """The commands begin at 0, or have a time of day without a date."""
    lines = cockpit_lines(DIVE)
    lines_of(tmp_path, lines[60:], "vr_2.txt")
    lines_of(tmp_path, lines[:60], "vr_1.txt")
    log, told = joined(tmp_path, start, "vr_2.txt", "vr_1.txt")
    check(log, EXPORTED, start)
    assert used(log, "depth").file == "vr_1.txt, vr_2.txt"
    moved = "Its first sample is moved to the first command" in told
    assert moved == (start == 0.0)
    assert ("as if both clocks agreed" in told) != moved


def test_a_clock_that_is_set_back_divides_the_log(tmp_path: Path) -> None:
    lines = cockpit_lines(DIVE)
    first, *_ = logs = read_logs(lines_of(tmp_path, lines + lines), BLUEROV2, ColumnNames(), is_part=True)
    assert len(logs) == 2
    check(first, EXPORTED, COCKPIT_START)


def test_the_dvl_gives_velocities_as_the_same_data_in_a_table(tmp_path: Path) -> None:
    dvl(tmp_path, DIVE)
    log, _ = joined(tmp_path, BOOT, "dvl.json")
    check(log, [*SPEEDS, "roll angle", "pitch angle", "heading"], BOOT)
    assert not [name for name in ("depth", *motion.PLACES) if log.used(name)], "a sum of the velocities tells no more"
    (tmp_path / "dvl.json").unlink()
    columns = zip(("surge", "sway", "heave"), DIVE.velocity.T, strict=True)
    titles, values = zip(*((f"{name} velocity [m/s]", own) for name, own in columns), strict=True)
    table(tmp_path / "dvl.csv", ",".join(["time [s]", *titles]), BOOT + TIME, *values)
    as_table, _ = joined(tmp_path, BOOT, "dvl.csv")
    for name in SPEEDS:
        assert used(log, name).time == pytest.approx(used(as_table, name).time, abs=1e-5)
        assert measured(log, name) == pytest.approx(measured(as_table, name), abs=1e-6)


def test_reports_of_the_dvl_without_a_date_invalid_ones_and_positions_alone(tmp_path: Path) -> None:
    reports = dvl_reports(DIVE, is_dated=False)
    reports[10]["velocity_valid"] = False
    path = lines_of(tmp_path, [json.dumps(one) for one in ({"response_to": "x"}, *reports)] + ['{"vx": 1'], "dvl.json")
    log = read(path)
    check(log, SPEEDS, 0.1, [n for n in range(len(TIME)) if n != 5])
    told = "\n".join(sentences(log.findings))
    assert "dvl.json: 1 line left out" in told
    assert "because velocity.velocity_valid says that they are invalid" in told
    check(
        read(lines_of(tmp_path, [json.dumps(one) for one in dvl_reports(DIVE)[1::2]])), ["depth", *motion.PLACES], BOOT
    )


HEADERLESS = {
    "$GPGGA,1,2*47\n$GPGGA,1,3*46\n": "NMEA",
    '{"time": 200.0, "a": 1}\n{"time": 100.0, "a": 2}\n': "JSON",
    "0,0,1500,1500\n1,,1500,1600\n": "numbers",
    "2019-03-02 10:00:00;1;a;b\n2019-03-02 10:00:01;2;c;d\n": "numbers",
}


@pytest.mark.parametrize("text", HEADERLESS)
def test_the_first_row_is_never_taken_as_a_header(tmp_path: Path, text: str) -> None:
    path = lines_of(tmp_path, text.splitlines(), "dive.csv")
    words = f"line 1 = .*: no header; these lines look like {HEADERLESS[text]}, and a table needs a line above them"
    with pytest.raises(DataFileError, match=words) as refused:
        read(path)
    assert len(str(refused.value).splitlines()) == 1


def test_numbers_as_names_of_thrusters_are_a_header(tmp_path: Path) -> None:
    table(tmp_path / "dive.csv", "time [s],depth [m],1,2,3", TIME, TIME, TIME, TIME, TIME)
    assert measured(read(tmp_path / "dive.csv"), "depth") == pytest.approx(TIME, abs=1e-6)
