"""Every reader of an archive that `prove` accepts finds the same files, and no bit of an FMU of ours can be changed."""

import random
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest

from rov_fmu.fmu.archive import META_DATA, archive
from rov_fmu.fmu.meta_data import meta_data, own_hash
from rov_fmu.fmus.unpacking import unpack_fmu
from rov_fmu.io.messages import FileError, ProofError
from rov_fmu.prove.check import check_evidence
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.often import often

_FILES = {"modelDescription.xml": b"<a/>" * 9, "binaries/linux64/ü.so": bytes(range(64)), "resources/empty": b""}


@pytest.fixture(scope="module")
def small() -> bytes:
    """An archive as the builder writes it, with few files."""
    return archive(_FILES, partial(meta_data, load_vehicle(SHIPPED["videoray"]), _FILES))


def is_refused(content: bytes, path: Path) -> bool:
    """Return True if `prove` refuses an archive before it runs the FMU, in one line."""
    path.write_bytes(content)
    try:
        check_evidence(path)
    except (FileError, ProofError) as error:
        return "\n" not in str(error)
    return False


def flipped(content: bytes, offset: int, bit: int = 0) -> bytes:
    """Return the content with another bit at a place."""
    return content[:offset] + bytes([content[offset] ^ 1 << bit]) + content[offset + 1 :]


# ---- FMUs of ours ----------------------------------------------------------------------------------------------------


@often("stride", 4, 2, 1)
def test_no_bit_of_an_archive_can_be_changed(stride: int, small: bytes, tmp_path: Path) -> None:
    """Of some bytes one bit, or all bits of all: headers, compressed bytes, the directory, and its end.

    Of the meta-data a few bytes are enough, because test_evidence.py changes each of them.
    """
    path = tmp_path / "small.fmu"
    assert not is_refused(small, path)
    begin, end = small.index(b"<?xml"), small.index(b"ResourceMetaData>\n") + 16
    assert small[begin:end].count(b"rov-fmu.archive") == 1
    for offset in range(0, len(small), stride):
        if not begin <= offset < end or offset % 50 == 0:
            for bit in range(8) if stride == 1 else [offset // stride % 8]:
                assert is_refused(flipped(small, offset, bit), path), (offset, bit)


def _pieces(content: bytes, draws: random.Random) -> Iterator[bytes]:
    """Yield pieces of bytes of every kind: random ones, zeros, parts of the archive, and a whole archive."""
    while True:
        begin = draws.randrange(len(content))
        yield draws.randbytes(draws.randint(1, 100))
        yield bytes(draws.randint(1, 100))
        yield content[begin : begin + draws.randint(1, 1000)]
        yield archive({"binaries/linux64/other.so": b"evil"})


def test_an_empty_block_in_the_compressed_bytes_is_found(small: bytes, tmp_path: Path) -> None:
    """It changes no file. With the right sizes in both headers, it still changes the bytes that have a hash."""
    with zipfile.ZipFile(BytesIO(small)) as zipped:
        first, *others = zipped.infolist()
        data = zipped.read(first)
    compress = zlib.compressobj(9, zlib.DEFLATED, -15)
    longer = compress.compress(data) + compress.flush(zlib.Z_FULL_FLUSH) + compress.flush()
    begin, end = 30 + len(first.filename), 30 + len(first.filename) + first.compress_size
    more = len(longer) - first.compress_size
    changed = bytearray(small[:begin] + longer + small[end:])
    directory = changed.index(b"PK\1\2")
    struct.pack_into("<L", changed, 18, len(longer))
    struct.pack_into("<L", changed, directory + 20, len(longer))
    for entry in others:
        offset = changed.index(entry.filename.encode(), directory) - 4
        struct.pack_into("<L", changed, offset, entry.header_offset + more)
    struct.pack_into("<L", changed, len(changed) - 6, directory)
    unpack_fmu(BytesIO(bytes(changed)), Path("a.fmu"), tmp_path / "as in any FMU")
    (tmp_path / "small.fmu").write_bytes(changed)
    with pytest.raises(ProofError, match="the archive was altered after the FMU was built, although its files are the"):
        check_evidence(tmp_path / "small.fmu")


def test_a_date_or_an_attribute_of_a_file_is_found_and_named(small: bytes, tmp_path: Path) -> None:
    path, directory = tmp_path / "small.fmu", small.index(b"PK\1\2")
    for offset in (directory + 4, directory + 5, directory + 36, directory + 38, len(small) - 18):
        path.write_bytes(flipped(small, offset, 0))
        with pytest.raises(ProofError, match=r"small\.fmu: the archive was altered after the FMU was built, although"):
            check_evidence(path)


def test_an_fmu_of_an_earlier_version_is_to_be_built_again(tmp_path: Path) -> None:
    """Its meta-data have no hash of the archive."""
    document = meta_data(load_vehicle(SHIPPED["videoray"]), _FILES, b"")
    old = re.sub(rb'(?s) *<stc:Classification type="rov-fmu.archive">.*?</stc:Classification>\n', b"", document)
    assert len(old) < len(document)
    offset = old.index(b'">', old.index(META_DATA.encode())) + 2
    old = old[:offset] + own_hash(old).encode() + old[offset + 64 :]
    (tmp_path / "old.fmu").write_bytes(archive(_FILES, lambda _: old))
    with pytest.raises(ProofError, match="no hash, because an earlier rov-fmu built it: build it again"):
        check_evidence(tmp_path / "old.fmu")


# ---- FMUs of others --------------------------------------------------------------------------------------------------


class _Stream(BytesIO):
    """A file that cannot go back, such as a pipe: sizes stand behind the content."""

    def seekable(self) -> bool:
        return False

    def tell(self) -> int:
        raise OSError

    def seek(self, *_: Any) -> int:
        raise OSError


def _written(write: Callable[[zipfile.ZipFile], None], file: BytesIO | None = None) -> bytes:
    file = file or BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as zipped:
        write(zipped)
    return file.getvalue()


def _plain(zipped: zipfile.ZipFile) -> None:
    for name, content in _FILES.items():
        zipped.writestr(name, content)


def _with_folders(zipped: zipfile.ZipFile) -> None:
    zipped.mkdir("resources") if hasattr(zipped, "mkdir") else zipped.writestr("resources/", b"")
    zipped.writestr(zipfile.ZipInfo("binaries/", (2026, 11, 28, 23, 59, 58)), b"", zipfile.ZIP_DEFLATED)
    _plain(zipped)
    zipped.comment = b"made by another tool"


def _large(zipped: zipfile.ZipFile) -> None:
    """With sizes of 8 bytes, as of a file whose size was not known when it was begun."""
    for name, content in _FILES.items():
        with zipped.open(name, "w", force_zip64=True) as file:
            file.write(content)


def _many() -> bytes:
    """Return an archive with the records of one that has more than 65,535 files."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(zipfile, "ZIP_FILECOUNT_LIMIT", 1)
        content = _written(_plain)
    assert b"PK\6\6" in content
    return content


def _field(kind: int, content: bytes = b"") -> bytes:
    """Return an extra field (APPNOTE 4.5)."""
    return struct.pack("<2H", kind, len(content)) + content


_TIMES = _field(0x5455, b"\1abcd")
_HONEST = (
    _TIMES + _field(0x7875, b"\1\4abcd\4abcd"),  # Info-ZIP
    _field(0x000A, bytes(4) + struct.pack("<2H", 1, 24) + bytes(24)),  # 7-Zip
    _field(0xCAFE) + _field(0x5455, b"\7" + bytes(12)),  # Java
    _field(0x5855, bytes(8)) + _field(0x7855) + _field(0xD935, b"\4\0\0\0\0"),
    _field(0x5855, bytes(12)) + _field(0x7855, bytes(4)),
)
"""Extra fields that writers put into both headers."""


def _with_extra_fields(zipped: zipfile.ZipFile) -> None:
    for n, (name, content) in enumerate([*_FILES.items(), ("a", b""), ("b", b"")]):
        entry = zipfile.ZipInfo(name, (2024, 2, 29, 1, 2, 4))
        entry.extra, entry.comment, entry.external_attr = _HONEST[n], b"a word", 0o100755 << 16
        zipped.writestr(entry, content, zipfile.ZIP_STORED)


def _with_fields(before: bytes, of_directory: bytes) -> bytes:
    """Return an archive with one file and these extra fields in its two headers."""
    local, behind = bytearray(ONE[:DIRECTORY]), bytearray(ONE[DIRECTORY:])
    name = len("modelDescription.xml")
    local[30 + name : 30 + name], behind[46 + name : 46 + name] = before, of_directory
    struct.pack_into("<H", local, 28, len(before))
    struct.pack_into("<H", behind, 30, len(of_directory))
    struct.pack_into("<2L", behind, len(behind) - 10, len(behind) - 22, len(local))
    return bytes(local + behind)


def _without_signatures(content: bytes) -> bytes:
    """Leave the optional signatures of the sizes behind the content out of a streamed archive with one file."""
    offset, directory = content.index(b"PK\7\10"), content.index(b"PK\1\2") - 4
    changed = bytearray(content[:offset] + content[offset + 4 :])
    struct.pack_into("<L", changed, len(changed) - 6, directory)
    return bytes(changed)


HONEST: dict[str, Callable[[], bytes]] = {
    "ours": lambda: archive(_FILES),
    "plain": lambda: _written(_plain),
    "stored, with extra fields and comments": lambda: _written(_with_extra_fields),
    "with folders and a comment": lambda: _written(_with_folders),
    "as a stream": lambda: _written(_plain, _Stream()),
    "as a stream of large files": lambda: _written(_large, _Stream()),
    "large files": lambda: _written(_large),
    "many files": _many,
    "without the optional signature": lambda: _without_signatures(
        _written(lambda zipped: zipped.writestr("modelDescription.xml", b"<a/>" * 9), _Stream())
    ),
}


@pytest.mark.parametrize("kind", HONEST)
def test_an_honest_archive_is_unpacked_and_refused_if_a_piece_is_inserted(kind: str, tmp_path: Path) -> None:
    content, draws = HONEST[kind](), random.Random(1)
    unpack_fmu(BytesIO(content), Path("a.fmu"), tmp_path)
    assert (tmp_path / "modelDescription.xml").read_bytes() == b"<a/>" * 9
    for n, piece in zip(range(40), _pieces(content, draws), strict=False):
        offset = (0, len(content), draws.randrange(len(content)))[n % 3]
        with pytest.raises(FileError, match=r"^a\.fmu: "):
            unpack_fmu(BytesIO(content[:offset] + piece + content[offset:]), Path("a.fmu"), tmp_path)


def _entry(name: str, content: bytes) -> bytes:
    """Return a file with the header before it, as a streaming reader finds it."""
    return archive({name: content}).partition(b"PK\1\2")[0]


def _moved(content: bytes, more: int) -> bytes:
    """Return an archive whose directory says that all files lie further behind."""
    changed, offset = bytearray(content), 0
    while (offset := changed.find(b"PK\1\2", offset)) >= 0:
        struct.pack_into("<L", changed, offset + 42, struct.unpack_from("<L", changed, offset + 42)[0] + more)
        offset += 4
    struct.pack_into("<L", changed, len(changed) - 6, struct.unpack_from("<L", changed, len(changed) - 6)[0] + more)
    return bytes(changed)


def _hidden_behind_a_stream(content: bytes) -> bytes:
    """Let the compressed bytes of the only file contain another entry, which only a streaming reader finds."""
    hidden, end = _entry("binaries/linux64/other.so", b"evil"), content.index(b"PK\1\2")
    size = struct.unpack_from("<L", content, 18)[0] + len(hidden)
    changed = bytearray(_moved(content[:end] + hidden + content[end:], 0))
    struct.pack_into("<L", changed, len(changed) - 6, end + len(hidden))
    for offset in (18, end + len(hidden) + 20):
        struct.pack_into("<L", changed, offset, size)
    return bytes(changed)


ONE = archive({"modelDescription.xml": b"<a/>"})
DIRECTORY = ONE.index(b"PK\1\2")
HIDDEN: dict[str, tuple[Callable[[], bytes], str]] = {
    "an entry in front": (
        lambda: _entry("modelDescription.xml", b"<b/>") + _moved(ONE, DIRECTORY),
        "member 'modelDescription.xml': must begin at byte 0 of the archive, and not at 5",
    ),
    "another name before the content": (lambda: flipped(ONE, 30, 0), "member 'modelDescription.xml': its header and"),
    "another size before the content": (lambda: flipped(ONE, 22, 0), "member 'modelDescription.xml': its header and"),
    "another checksum before the content": (lambda: flipped(ONE, 14, 0), "member 'modelDescription.xml': its header"),
    "other flags": (lambda: flipped(ONE, 6, 3), "member 'modelDescription.xml': its header and its content must be as"),
    "another date": (lambda: flipped(ONE, 12, 0), "member 'modelDescription.xml': its header and its content must be"),
    "an entry in the content": (lambda: _hidden_behind_a_stream(ONE), "member 'modelDescription.xml': its header and"),
    "a word behind": (lambda: ONE + b"more", "has bytes beside its files and its directory that belong to nothing"),
    "another count": (lambda: flipped(ONE, len(ONE) - 12, 1), "has bytes beside its files and its directory that"),
    "offsets that are too large": (
        lambda: _moved(ONE, 5),
        "has bytes beside its files and its directory that belong to nothing",
    ),
    "a folder without its sign": (
        lambda: flipped(archive({"a/": b""}), 2, 3),
        "member 'a/': its header and its content",
    ),
    "a folder with content": (lambda: archive({"a/": b"x"}), "member 'a/': is a folder, and must have no content"),
    "a name in an unknown code page": (
        lambda: flipped(flipped(archive({"ü": b""}), 7, 3), archive({"ü": b""}).index(b"PK\1\2") + 9, 3),
        "member '├╝': must be ASCII, or marked as UTF-8: readers take it as different names",
    ),
    "a number that is too large": (
        lambda: ONE[: DIRECTORY + 42] + b"\xff\xff\xff\x7f" + ONE[DIRECTORY + 46 :],
        "member 'modelDescription.xml': must begin at byte 0 of the archive, and not at 2147483647",
    ),
}


@pytest.mark.parametrize("case", HIDDEN)
def test_what_readers_would_read_differently_is_refused_in_one_line(case: str, tmp_path: Path) -> None:
    make, reason = HIDDEN[case]
    with pytest.raises(FileError) as error:
        unpack_fmu(BytesIO(make()), Path("a.fmu"), tmp_path / "unpacked")
    assert str(error.value).startswith(f"a.fmu: {reason}")
    assert "\n" not in str(error.value)
    assert not (tmp_path / "unpacked").exists()


_PATH_FIELD = b"\1" + struct.pack("<L", zlib.crc32(b"modelDescription.xml")) + b"binaries/linux64/videoray.so"
_SIZES = len(b"<a/>"), struct.unpack_from("<L", ONE, 18)[0]
FIELDS: dict[str, bytes] = {
    "another path": _field(0x7075, _PATH_FIELD),
    "another path behind times": _TIMES + _field(0x7075, _PATH_FIELD),
    "a comment": _field(0x6375, _PATH_FIELD),
    "a link of PKWARE": _field(0x000D, bytes(12) + b"/etc/passwd"),
    "a link of ASi": _field(0x756E, bytes(14) + b"/etc/passwd"),
    "another path of a Macintosh": _field(0x2605, b"ZPIT\4evil"),
    "a link behind the owner": _field(0x7875, b"\1\4abcd\4abcd/etc/passwd"),
    "encryption": _field(0x9901, b"\2\0AE\3\0\0"),
    "an unknown kind": _field(0x4D4D, b"abcd"),
    "one kind twice": 2 * _TIMES,
    "times that are cut off": _TIMES[:-1],
    "a kind that is cut off": _TIMES + b"UT",
    "zeros": bytes(4),
    "a word in what aligns": _field(0xD935, b"\4\0evil"),
    "other sizes": _field(0x0001, struct.pack("<2Q", 3, 3)),
    "a size that is cut off": _field(0x0001, b"abc"),
}


@pytest.mark.parametrize("place", ["before the content", "in the directory"])
@pytest.mark.parametrize("case", FIELDS)
def test_an_extra_field_that_could_give_a_file_another_name_is_refused(case: str, place: str, tmp_path: Path) -> None:
    fields = (FIELDS[case], b"") if place == "before the content" else (b"", FIELDS[case])
    reason = (
        r"member 'modelDescription\.xml': (has an extra field|its header and)|is not an FMU, or is damaged: Corrupt"
    )
    with pytest.raises(FileError, match=rf"^a\.fmu: ({reason})"):
        unpack_fmu(BytesIO(_with_fields(*fields)), Path("a.fmu"), tmp_path / "unpacked")
    assert not (tmp_path / "unpacked").exists()


@pytest.mark.parametrize("fields", [*_HONEST, _TIMES + _field(0x0001, struct.pack("<2Q", *_SIZES))])
def test_extra_fields_without_a_name_are_accepted_in_either_header(fields: bytes, tmp_path: Path) -> None:
    for n, (before, of_directory) in enumerate(((fields, b""), (b"", fields), (fields, fields))):
        unpack_fmu(BytesIO(_with_fields(before, of_directory)), Path("a.fmu"), tmp_path / str(n))
        assert (tmp_path / str(n) / "modelDescription.xml").read_bytes() == b"<a/>"


@often("count", 100, 1000, 20_000)
def test_two_damaged_bytes_are_one_line(count: int, small: bytes, tmp_path: Path) -> None:
    """Such as an offset that lies outside the file, where reading would raise an OSError."""
    draws = random.Random(count)
    for content in (small, ONE):
        for _ in range(count // 2):
            changed = bytearray(content)
            for _ in range(2):
                changed[draws.randrange(len(changed))] = draws.randrange(256)
            with suppress(FileError):
                unpack_fmu(BytesIO(changed), Path("a.fmu"), tmp_path)
            assert changed == content or is_refused(bytes(changed), tmp_path / "small.fmu") or content is ONE
