"""An FMU from an unknown source is unpacked into its folder, within limits, or refused in one line."""

import stat
import struct
import time
import zipfile
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from rov_fmu.cli import main
from rov_fmu.fmus.unpacking import refusal, unpack_fmu
from rov_fmu.io.messages import FileError, shown
from rov_fmu.io.reading import open_file

_LINK = (stat.S_IFLNK | 0o777) << 16
_STUDY = 'fmu = "bad.fmu"\nstop_time = 1.0\nstep = 0.1\nsampler = "grid"\n[figures]\nend = "u[-1]"\n'


def _member(name: str, content: bytes = b"", mode: int = 0, method: int = zipfile.ZIP_DEFLATED) -> Callable[..., None]:
    def add(archive: zipfile.ZipFile) -> None:
        entry = zipfile.ZipInfo(name)
        entry.create_system, entry.external_attr = 3, mode
        archive.writestr(entry, content, method)

    return add


_PATH = "must be a relative path with forward slashes, whose parts are names on every system"
BAD: dict[str, tuple[Callable[..., None], str]] = {
    "a path upwards": (_member("resources/../../evil"), f"member 'resources/../../evil': {_PATH}"),
    "an absolute path": (_member("/tmp/evil"), f"member '/tmp/evil': {_PATH}"),
    "a path of Windows": (_member("..\\evil"), rf"member '..\\evil': {_PATH}"),
    "a drive": (_member("C:/evil"), f"member 'C:/evil': {_PATH}"),
    "a link": (_member("resources/link", b"/etc/passwd", _LINK), "member 'resources/link': is a link or a special"),
    "another compression": (
        _member("resources/a", bytes(1_000_000), method=zipfile.ZIP_BZIP2),
        "member 'resources/a': must be stored or deflated, the compression that FMI allows",
    ),
    "a name that is too long": (_member("ü" * 128), f"member {shown('ü' * 128)}: {_PATH}"),
    "a file below a file": (
        _member("modelDescription.xml/x"),
        "member 'modelDescription.xml': is a file, and a folder of other files",
    ),
    "the same path with a dot": (_member("./modelDescription.xml"), f"member './modelDescription.xml': {_PATH}"),
    "the same path with two slashes": (_member("binaries//a.so"), f"member 'binaries//a.so': {_PATH}"),
    "the same path with capital letters": (
        _member("MODELDescription.xml"),
        "member 'modelDescription.xml': is the path of another member, too, on",
    ),
    **{
        f"{name!a}, a device of Windows": (_member(f"resources/{name}"), f"member 'resources/{name}': {_PATH}")
        for name in ("con.txt", "COM¹", "lpt³.tar.gz", "CONIN$", "conout$.txt", "aux .c")
    },
    **{
        f"the character {character!a}": (_member(f"binaries/a{character}b"), f"member {f'binaries/a{character}b'!r}: ")
        for character in "\x7f\x85\xa0\xad\u061c\u200b\u200d\u200f\u2028\u202e\u2066\ufeff\u3164\ufe0f\U000e0020"
    },
    "a blank at the end": (_member("resources/x "), f"member 'resources/x ': {_PATH}"),
}


def _archive(*members: Callable[..., None]) -> BytesIO:
    content = BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        for add in members:
            add(archive)
    return content


@pytest.mark.parametrize("case", BAD)
def test_a_bad_archive_is_refused_in_one_line(case: str, tmp_path: Path) -> None:
    add, message = BAD[case]
    with pytest.raises(FileError) as error:
        unpack_fmu(_archive(_member("modelDescription.xml", b"<a/>"), add), Path("a.fmu"), tmp_path / "unpacked")
    assert str(error.value).startswith(f"a.fmu: {message}")
    assert "\n" not in str(error.value)
    assert {file.name for file in tmp_path.iterdir()} <= {"unpacked"}


def test_prove_and_study_refuse_it_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    add, message = BAD["a path upwards"]
    (tmp_path / "bad.fmu").write_bytes(_archive(add).getvalue())
    (tmp_path / "plan.toml").write_text(_STUDY)
    for command in (["prove", "bad.fmu"], ["study", "plan.toml", "-o", "results"]):
        assert main([command[0], *(str(tmp_path / one) if "." in one else one for one in command[1:])]) == 2
        out, err = capsys.readouterr()
        assert (out, err.count("\n")) == ("", 1)
        assert err.startswith(f"rov-fmu: {tmp_path / 'bad.fmu'}: {message}")


GB, MB = 10**9, 10**6


@pytest.mark.parametrize(
    ("most", "packed", "said"),
    [
        (2 * GB, GB, "would take 2,000,000,001 bytes unpacked; at most 2,000,000,000 are allowed"),
        (100 * MB, 1, "would take 100,000,001 bytes unpacked, and has 1; above 100,000,000 at most 100 times those of"),
        (200 * MB, 2 * MB, "would take 200,000,001 bytes unpacked, and has 2,000,000; above 100,000,000 at most 100 "),
    ],
)
def test_an_archive_may_unpack_to_so_many_bytes(most: int, packed: int, said: str) -> None:
    for size in (most, most + 1):
        member = zipfile.ZipInfo("a")
        member.file_size = size
        archive: Any = SimpleNamespace(infolist=lambda member=member: [member], start_dir=packed)
        reason = refusal(archive)
        assert reason[: len(said)] == (said if size > most else "")


def test_an_archive_that_claims_to_be_huge_is_refused_before_it_is_unpacked(tmp_path: Path) -> None:
    """The archive declares 3 GB, and nothing is written."""
    content = bytearray(_archive(_member("modelDescription.xml", b"a" * 100, method=zipfile.ZIP_STORED)).getvalue())
    size = content.rindex(b"PK\x01\x02") + 24
    struct.pack_into("<I", content, size, 3_000_000_000)
    start = time.perf_counter()
    with pytest.raises(FileError, match=r"^a\.fmu: would take 3,000,000,000 bytes unpacked; at most "):
        unpack_fmu(BytesIO(content), Path("a.fmu"), tmp_path)
    assert time.perf_counter() - start < 5.0
    assert list(tmp_path.iterdir()) == []


def test_an_archive_that_declares_too_small_a_size_is_not_unpacked_beyond_it(tmp_path: Path) -> None:
    content = bytearray(_archive(_member("resources/zeros.bin", bytes(20_000_000))).getvalue())
    for sign, offset in ((b"PK\x01\x02", 24), (b"PK\x03\x04", 22)):
        struct.pack_into("<I", content, content.rindex(sign) + offset, 1000)
    with pytest.raises(FileError, match=r"^a\.fmu: is not an FMU, or is damaged: Bad CRC-32"):
        unpack_fmu(BytesIO(content), Path("a.fmu"), tmp_path)
    assert sum(file.stat().st_size for file in tmp_path.rglob("*") if file.is_file()) <= 1000


def test_a_file_that_is_no_archive_is_one_line(tmp_path: Path) -> None:
    for path, reason in ((tmp_path / "none.fmu", "there is no such file"), (Path(__file__), "is not an FMU, or is")):
        with pytest.raises(FileError, match=f"^{path}: {reason}"), open_file(path) as file:
            unpack_fmu(file, path, tmp_path)
