"""A dive in several CSV files, each with its own times, and names of columns and topics that rov.toml explains."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.identify.beginning import load_tests
from rov_fmu.io.messages import FileError
from rov_fmu.report.page.recording import recording_of
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.findings import Finding, sentences
from rov_fmu.tank.log import Log
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.tank.logs import commanded, measured, used
from tests.tank.readers import motion
from tests.tank.readers.motion import TIME
from tests.tank.readers.writers import table

ROV = """base = "bluerov2"
[vehicle]
name = "ROV"
identifier = "rov"
version = "1.0"
description = "An ROV"
source = "Dive of May"
"""
KINDS = "rows sorted", "unknown velocity"
FILES = 'files = ["commands.csv", "depth.csv", "heading.csv"]'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with a dive: commands at 10 Hz, a depth and a voltage at 5 Hz, a heading at 4 Hz."""
    (tmp_path / "rov.toml").write_text(f"{ROV}[dives.may]\n{FILES}\n", encoding="utf-8")
    titles = ",".join(["time [s]", *(f"u_{name} [1]" for name in motion.THRUSTERS)])
    table(tmp_path / "commands.csv", titles, 1000.0 + TIME, *motion.THRUSTERS.values())
    slow: Array = np.arange(0.01, 9.9, 0.2)
    table(tmp_path / "depth.csv", "time [s],depth [cm],voltage [V]", 1000.0 + slow, 100.0 + 10.0 * slow, 16.0 - slow)
    slower: Array = np.arange(0.02, 9.9, 0.25)
    table(tmp_path / "heading.csv", "time [s],heading [deg]", 1000.0 + slower, np.degrees(2.0 + 0.3 * slower))
    return tmp_path


def read(folder: Path) -> tuple[list[Finding], Log]:
    tests = load_tests(folder)
    (log,) = tests.folder.logs
    return tests.folder.findings, log


def mistakes(folder: Path) -> list[str]:
    with pytest.raises(FileError) as error:
        load_tests(folder)
    return str(error.value).replace(f"{folder}/", "").splitlines()


def test_files_of_one_clock_are_joined_by_their_times(folder: Path) -> None:
    _, log = read(folder)
    assert not [finding for finding in log.findings if "clock" in finding.kind]
    files = {"depth": "depth.csv", "heading": "heading.csv", "voltage": "depth.csv"}
    assert {quantity: used(log, quantity).file for quantity in files} == files
    expected = {"depth": (50, 1.0, 0.1), "heading": (40, 2.0, 0.3), "voltage": (50, 16.0, -1.0)}
    for quantity, (count, start, rate) in expected.items():
        channel = used(log, quantity)
        assert channel.count == count
        assert channel.values == pytest.approx(start + rate * (channel.time - 1000.0), abs=1e-6)
    assert commanded(log, "5", 1000.0 + TIME) == pytest.approx(np.where(TIME > 0.999, 0.5, 0.0))
    assert load_tests(folder).folder.inputs.keys() == {
        "rov.toml",
        "bluerov2",
        "commands.csv",
        "depth.csv",
        "heading.csv",
    }


def test_the_page_that_flies_joins_the_files_of_a_dive(folder: Path) -> None:
    recording = recording_of(folder / "heading.csv", load_vehicle(SHIPPED["bluerov2"]))
    signals = {signal["quantity"]: signal for signal in recording["signals"]}
    assert signals.keys() == {"depth", "heading"}
    assert len(signals["depth"]["times"]) == 50
    depths, slow = signals["depth"]["values"], np.array(signals["depth"]["times"])
    assert depths == pytest.approx(1.0 + 0.1 * slow, abs=1e-6)
    held = np.searchsorted(recording["times"], (0.9, 1.1), side="right") - 1
    assert [recording["commands"]["u_5"][n] for n in held] == [0.0, 0.5]
    (folder / "rov.toml").unlink()
    with pytest.raises(FileError, match="there is no column of commands"):
        recording_of(folder / "heading.csv", load_vehicle(SHIPPED["bluerov2"]))


def test_a_dive_of_the_same_files_counts_once(folder: Path) -> None:
    for name in ("commands", "depth", "heading"):
        shutil.copy(folder / f"{name}.csv", folder / f"{name}_2.csv")
    again = FILES.replace(".csv", "_2.csv")
    (folder / "rov.toml").write_text(f"{ROV}[dives.june]\n{again}\n[dives.may]\n{FILES}\n", encoding="utf-8")
    findings, _ = read(folder)
    (line,) = (line for line in sentences(findings) if "copy" in line)
    assert line.startswith("commands.csv, depth.csv, heading.csv: left out as a copy of commands_2.csv, depth_2.csv, h")


def test_a_sentence_about_several_files_has_the_range_of_their_numbers() -> None:
    counts = {"a": 1, "b": 3, "c": 3}
    found = [Finding(kind, file=file, words={"count": n}) for kind in KINDS for file, n in counts.items()]
    assert sentences(found) == (
        "a, b and c: 1 ... 3 rows out of order sorted",
        "a, b and c: 1 ... 3 velocities left out, because the filter marks them as unknown",
    )
    assert sentences(found[:1]) == ("a: 1 row out of order sorted",)
    assert sentences(found[4:]) == ("b and c: 3 velocities left out, because the filter marks them as unknown",)


@pytest.mark.parametrize("declared", [False, True])
def test_a_file_of_another_clock_is_told_and_aligned(folder: Path, declared: bool) -> None:
    """Its clock began at 0, or was set by hand and is 2 s late."""
    slower: Array = np.arange(0.0, 9.9, 0.25)
    start = 1002.0 if declared else 0.0
    table(folder / "heading.csv", "time [s],heading [deg]", start + slower, np.degrees(2.0 + 0.3 * slower))
    if declared:
        other = f'{ROV}[dives.may]\n{FILES}\nother_clock = ["heading.csv"]\n'
        (folder / "rov.toml").write_text(other, encoding="utf-8")
    findings, log = read(folder)
    late = 2.0 if declared else 0.0
    since = used(log, "heading").time - 1000.0 - late
    assert measured(log, "heading") == pytest.approx(2.0 + 0.3 * since, abs=1e-5)
    (line,) = (line for line in sentences(findings) if "clock" in line)
    assert line == (
        "heading.csv: it has another clock than the commands. Its times are used as they are, as if both clocks "
        "agreed. Correct them if they do not"
        if declared
        else "heading.csv: it has another clock than the commands, and their times do not overlap. Its first sample is "
        "moved to the first command, as if both had begun at once. Correct its times if they did not"
    )


@pytest.mark.parametrize(
    ("dive", "line"),
    [
        (
            'files = ["commands.csv", "dept.csv"]',
            "rov.toml: dives.may.files = ['commands.csv', 'dept.csv']: there is no such file in this folder: 'dept.c",
        ),
        (
            'files = ["heading.csv", "depth.csv"]',
            "heading.csv: exactly one file of the dive must have the commands. The files with commands are: none",
        ),
        (
            f'{FILES}\nother_clock = ["depht.csv"]',
            "rov.toml: dives.may.other_clock = ['depht.csv']: must be of its files, "
            "commands.csv, depth.csv, heading.csv: 'depht.csv' is not",
        ),
        ('files = ["commands.csv"]', "rov.toml: dives.may.files = ['commands.csv']: must be two or more files"),
    ],
)
def test_a_wrong_dive_is_one_line(folder: Path, dive: str, line: str) -> None:
    (folder / "rov.toml").write_text(f"{ROV}[dives.may]\n{dive}\n", encoding="utf-8")
    for name in ("heading.csv", "depth.csv", "commands.csv"):
        if name not in dive:
            (folder / name).unlink()
    found = mistakes(folder)
    assert len(found) == 1
    assert found[0].startswith(line)
