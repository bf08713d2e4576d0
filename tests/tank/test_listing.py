"""Every file of a folder is read, or named with the reason why it is not; its content tells what it is."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from rov_fmu.cli import main
from rov_fmu.identify.beginning import load_tests
from rov_fmu.identify.findings import by_heading
from rov_fmu.identify.inspection.inspected import inspect_paths
from rov_fmu.tank.readers.listing import Listing, list_files
from tests.commands import ROOT, TESTS
from tests.tank.readers.motion import DIVE
from tests.tank.readers.writers import LOGS

LOGS_OF_OTHERS = ROOT / "tests" / "frozen" / "logs" / "other_files"
Capsys = pytest.CaptureFixture[str]
LOG = "time [s],u_t [%],depth [m]\n" + "".join(
    f"{n / 10},{20 * (n // 40 % 3 - 1)},{abs(n % 100 - 50)}\n" for n in range(200)
)


SILENT = (".hidden.csv", "._dive.mcap", "mine.toml", "mine.fmu", "report.html", "Thumbs.db", "photos/._dive.csv")
"""Files that nobody expects to be read as a log or a table."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with tests that can be identified."""
    return Path(shutil.copytree(TESTS, tmp_path / "tests", ignore=shutil.ignore_patterns("README.md")))


def _told(folder: Path) -> dict[str, list[str]]:
    return {heading: [*lines] for heading, lines in by_heading(load_tests(folder).folder.findings).items()}


@pytest.mark.parametrize(
    ("name", "reason"), [("thrust_t.xlsx", "a workbook must first"), ("notes.md", "a table needs a header")]
)
def test_without_any_test_the_reasons_are_the_mistakes(name: str, reason: str, tmp_path: Path, capsys: Capsys) -> None:
    """All kinds of such files, with their reasons, are in tests/frozen."""
    shutil.copy(LOGS_OF_OTHERS / name, tmp_path)
    for command in (["inspect"], ["identify", "-o", str(tmp_path / "out.toml")]):
        assert main([*command, str(tmp_path)]) == 2
        first, line = capsys.readouterr().err.splitlines()
        assert first.startswith(f"rov-fmu: {tmp_path}: there is no log and no table in this folder. These formats are ")
        assert line.startswith(f"rov-fmu: {tmp_path / name}: {reason}")


@pytest.mark.parametrize(
    ("name", "encoding"), [("dive.txt", "utf-16"), ("dive", "utf-8"), ("log.2024.dat", "utf-8"), ("DIVE.CSV", "utf-8")]
)
def test_a_table_is_read_whatever_its_suffix(name: str, encoding: str, folder: Path) -> None:
    (folder / name).write_bytes(LOG.encode(encoding))
    found = load_tests(folder)
    assert [log.file for log in found.folder.logs] == [name]
    assert not [line for lines in _told(folder).values() for line in lines if "not read" in line]


def test_a_log_is_recognised_whatever_its_suffix(tmp_path: Path) -> None:
    own = tmp_path / "own"
    own.mkdir()
    paths = []
    for n, (suffix, write) in enumerate((suffix, LOGS[suffix]) for suffix in (".bin", ".tlog", ".ulg", ".mcap")):
        (tmp_path / suffix).mkdir()
        paths.append(write(tmp_path / suffix, DIVE).rename(own / f"0000001{n}{'.log' * (n % 2)}"))
    assert list_files(own) == Listing(own, sorted(paths))
    (inspection,) = inspect_paths([paths[0]]).logs
    assert len(inspection.commands) == 6


@pytest.mark.parametrize("suffix", ["tsv", "data"])
def test_a_table_of_tank_tests_is_used_whatever_its_suffix(suffix: str, folder: Path) -> None:
    expected = load_tests(folder).folder
    for path in folder.glob("*.csv"):
        path.with_suffix(f".{suffix}").write_text(path.read_text(encoding="utf-8").replace(",", "\t"), encoding="utf-8")
        path.unlink()
    found = load_tests(folder).folder
    assert {**found.files}.keys() == {**expected.files}.keys()
    assert [[(row.command, row.value) for row in rows] for rows in found.rows.values()] == [
        [(row.command, row.value) for row in rows] for rows in expected.rows.values()
    ]


def test_a_text_with_numbers_that_is_no_test_does_not_stop_the_others(folder: Path) -> None:
    (folder / "frames.txt").write_text("frame,x,y\n1,2,3\n2,3,4\n")
    (line,) = [line for line in _told(folder)["Warnings"] if "frames.txt" in line]
    assert line.startswith("frames.txt: left out as unreadable: neither a log, which has a column 'time")


def test_what_needs_no_word_has_none(folder: Path) -> None:
    before = _told(folder)
    (folder / "photos").mkdir()
    for name in SILENT:
        (folder / name).write_bytes(b"x = 1\n")
    shutil.copy(LOGS_OF_OTHERS / "photo.jpg", folder / "photos")
    assert _told(folder) == before


@pytest.mark.parametrize(
    ("name", "make"),
    [
        ("pipe.csv", os.mkfifo),
        ("pipe", os.mkfifo),
        ("zero.csv", lambda path: path.symlink_to("/dev/zero")),
        ("gone.bin", lambda path: path.symlink_to("nowhere")),
    ],
)
def test_only_files_are_opened(name: str, make: Callable[[Path], None], folder: Path) -> None:
    make(folder / name)
    assert list_files(folder).others == {"a device, a pipe or a link that leads nowhere is not opened": [folder / name]}
    assert f"{name}: left out as unreadable: a device, a pipe " in _told(folder)["Warnings"][0]
    assert main(["inspect", str(folder / name)]) == 2


def test_a_folder_without_anything_says_that_it_has_no_log(tmp_path: Path, capsys: Capsys) -> None:
    for command in (["identify"], ["inspect"], ["inspect", "--draft"]):
        assert main([*command, str(tmp_path)]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith(f"rov-fmu: {tmp_path}: there is no log and no table in this folder. These formats are ")
        assert all(word in line for word in ("CSV", "DataFlash", "telemetry", "ULog", "ROS 2", "MCAP", ".mat"))
    assert not [*tmp_path.iterdir()]
