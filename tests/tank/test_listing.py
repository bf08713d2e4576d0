"""Every file of a folder is read, or named with the reason why it is not; its content tells what it is."""

import gzip
import os
import shutil
import zipfile
from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import pytest

from rov_fmu.cli import main
from rov_fmu.identify.beginning import load_tests
from rov_fmu.identify.findings import by_heading
from rov_fmu.identify.inspection.inspected import inspect_logs
from rov_fmu.tank.readers.listing import Listing, list_files
from tests.commands import TESTS
from tests.tank.readers.motion import DIVE
from tests.tank.readers.writers import LOGS

Capsys = pytest.CaptureFixture[str]
LOG = "time [s],u_t [%],depth [m]\n" + "".join(f"{n / 10},{20 * (n // 40 % 3 - 1)},{n % 50}\n" for n in range(200))


def _zip(name: str) -> bytes:
    content = BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        archive.writestr(name, "<a/>")
    return content.getvalue()


PACKED, WORKBOOK, PICTURE = "a packed file must first", "a workbook must first", "pictures, films and documents"
NO_TABLE, UNKNOWN = "a table needs a header", "its first bytes are those of none of the formats that are read"
OTHERS: dict[str, tuple[bytes, str]] = {  # files that are not read, with the beginning of the reason
    "thrust_t.xlsx": (_zip("xl/workbook.xml"), WORKBOOK),
    "steady_heave.ods": (_zip("content.xml"), WORKBOOK),
    "old.xls": (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(99), WORKBOOK),
    "logs.zip": (_zip("dive.csv"), PACKED),
    "dive.csv.gz": (gzip.compress(LOG.encode()), PACKED),
    "dive.ulg.gz": (b"\x1f\x8b\x08" + b"\x01" * 2000, PACKED),
    "dive.7z": (b"7z\xbc\xaf\x27\x1c\0\4", PACKED),
    "dive.h5": (b"\x89HDF\r\n\x1a\n", "a binary table must first"),
    "dive.rrd": (b"RRF2\0\0\1", UNKNOWN),
    "photo.jpg": (b"\xff\xd8\xff\xe0\0\x10JFIF\0", PICTURE),
    "dive.mp4": (b"\0\0\0\x20ftypmp42", PICTURE),
    "sheet.pdf": (b"%PDF-1.4\n%\xe2\xe3\xcf\xd3\n", PICTURE),
    "report.docx": (_zip("word/document.xml"), PICTURE),
    "README": (b"Dives of May, by us, 12, 13.\nTime: 10, 11, 12.\n", NO_TABLE),
    "notes.md": (b"# Dives\n\n- dive 1, 10:30\n- dive 2, 11:00\n", NO_TABLE),
    "blanks.dat": (b"time depth\n0.0 1.0\n0.1 1.1\n", NO_TABLE),
    "all.param": (b"ACRO_BAL_PITCH,1.0\nARMING_CHECK,1\nMOT_1_DIRECTION,1\n", NO_TABLE),
    "empty.txt": (b"", "the file is empty"),
}
USUAL = (PICTURE, NO_TABLE, "the file is empty")
SILENT = (".hidden.csv", "._dive.mcap", "mine.toml", "mine.fmu", "report.html", "Thumbs.db", "photos/._dive.csv")
"""Files that nobody expects to be read as a log or a table."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with tests that can be identified."""
    return Path(shutil.copytree(TESTS, tmp_path / "tests", ignore=shutil.ignore_patterns("README.md")))


def _told(folder: Path) -> dict[str, list[str]]:
    return {heading: [*lines] for heading, lines in by_heading(load_tests(folder).folder.findings).items()}


def test_each_file_that_is_not_read_is_named_with_the_reason(folder: Path, capsys: Capsys) -> None:
    before = _told(folder)
    for name, (content, _) in OTHERS.items():
        (folder / name).write_bytes(content)
    told = _told(folder)
    main(["identify", str(folder), "--inspect"])
    out, err = capsys.readouterr()
    for name, (_, reason) in OTHERS.items():
        is_usual = reason in USUAL
        (line,) = [line for line in told["Facts" if is_usual else "Warnings"] if name in line]
        assert ("not read, because " if is_usual else "left out as unreadable: ") in line
        assert reason in line
        assert line in (out if is_usual else err)
    (folder / "dive.txt").write_text(LOG)
    main(["identify", str(folder), "--inspect"])
    assert "steady_heave_down.csv and 5 more *.csv: read as tables of tank tests." in capsys.readouterr().out
    added = {heading: len({*lines} - {*before[heading]}) for heading, lines in told.items()}
    assert added == {"Warnings": 4, "Doubts": 0, "Facts": 3}, "one line for each reason"


@pytest.mark.parametrize("name", ["thrust_t.xlsx", "notes.md"])
def test_without_any_test_the_reasons_are_the_mistakes(name: str, tmp_path: Path, capsys: Capsys) -> None:
    content, reason = OTHERS[name]
    (tmp_path / name).write_bytes(content)
    for command in (["--inspect"], ["-o", str(tmp_path / "out.toml")]):
        assert main(["identify", str(tmp_path), *command]) == 2
        first, line = capsys.readouterr().err.splitlines()
        assert first.startswith(f"rov-fmu: {tmp_path}: there is no log and no table in this folder. These formats are ")
        assert line.startswith(f"rov-fmu: {tmp_path / name}: {reason}")


@pytest.mark.parametrize("name", ["dive.txt", "dive", "dive.log", "log.2024.dat", "dive.tsv", "DIVE.CSV"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_a_table_is_read_whatever_its_suffix(name: str, encoding: str, folder: Path) -> None:
    (folder / name).write_bytes(LOG.encode(encoding))
    found = load_tests(folder)
    assert [log.file for log in found.folder.logs] == [name]
    assert not [line for lines in _told(folder).values() for line in lines if "not read" in line]


def test_a_log_is_recognised_whatever_its_suffix(tmp_path: Path) -> None:
    own = tmp_path / "own"
    own.mkdir()
    paths = []
    for n, (suffix, write) in enumerate(LOGS.items()):
        (tmp_path / suffix).mkdir()
        paths.append(write(tmp_path / suffix, DIVE).rename(own / f"0000001{n}{'.log' * (n % 2)}"))
    assert list_files(own) == Listing(own, sorted(paths))
    (one,) = inspect_logs([paths[0]]).logs
    assert len(one.commands) == 6


@pytest.mark.parametrize("suffix", ["tsv", "txt", "data"])
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


def test_a_folder_with_many_photos_stays_readable(folder: Path) -> None:
    for n in range(40):
        (folder / f"IMG_{n:04}.jpg").write_bytes(OTHERS["photo.jpg"][0])
    (folder / "plan.png").write_bytes(b"\x89PNG\r\n\x1a\n\0\0")
    (line,) = [line for line in _told(folder)["Facts"] if "IMG" in line]
    assert line.startswith("IMG_0000.jpg and 39 more *.jpg and plan.png: not read, because pictures, films ")


def test_what_needs_no_word_has_none(folder: Path) -> None:
    before = _told(folder)
    (folder / "photos").mkdir()
    for name in SILENT:
        (folder / name).write_bytes(b"x = 1\n")
    (folder / "photos" / "a.jpg").write_bytes(OTHERS["photo.jpg"][0])
    assert _told(folder) == before


def test_logs_in_another_folder_are_told(folder: Path) -> None:
    (folder / "old").mkdir()
    (folder / "old" / "dive.txt").write_text(LOG)
    (line,) = [line for line in _told(folder)["Facts"] if "old" in line]
    assert line.startswith("old/: not read, because logs and tables in another folder do not count. If they belong ")


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
    assert main(["identify", "--inspect", str(folder / name)]) == 2


def test_a_folder_without_anything_says_that_it_has_no_log(tmp_path: Path, capsys: Capsys) -> None:
    for command in ([], ["--inspect"], ["--draft"], ["-o", str(tmp_path.with_suffix(".toml"))]):
        assert main(["identify", str(tmp_path), *command]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith(f"rov-fmu: {tmp_path}: there is no log and no table in this folder. These formats are ")
        assert all(word in line for word in ("CSV", "DataFlash", "telemetry", "ULog", "ROS 2", "MCAP", ".mat"))
    assert not [*tmp_path.iterdir()]
