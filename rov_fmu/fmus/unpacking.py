"""Unpack an FMU that may come from anyone.

The files stay in their folder, their size is limited, and every reader of the archive finds the same files.
"""

import errno
import os
import re
import stat
import struct
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import accumulate, combinations
from pathlib import Path
from typing import IO
from unicodedata import normalize

from rov_fmu.io.file_kinds import FMU
from rov_fmu.io.messages import FileError, ProofError, brief, reason_of, shown
from rov_fmu.io.paths import is_portable

_MOST_UNPACKED = 2_000_000_000
"""The size of all files."""
_MOST_RATIO = 100
"""The size of all files, relative to that of the archive, if it is above _SMALL."""
_SMALL = 100_000_000
"""Bytes that an archive may unpack to, however well it is compressed."""
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""The compression that FMI allows. Python takes memory without limit for other methods."""
_ENCRYPTED, _SIZES_BEHIND, _UTF_8 = 1, 8, 0x800
"""The flags of a file that is encrypted, of one whose sizes follow its content, and of one whose name is in UTF-8."""
_LARGE = 0x0001
"""The extra field with the sizes of a large file, and with its offset."""
_FORMS = {
    _LARGE: b"(.{8}){1,3}",
    0x000A: b".{4}\1\0\x18\0.{24}",  # times of NTFS
    0x5455: b".(.{4}){0,3}",  # times
    0x5855: b".{8}(.{4})?",  # times and the owner, in the old form of Info-ZIP
    0x7855: b"(.{4})?",  # the owner, likewise
    0x7875: b"\1(\2.{2}|\4.{4}|\x08.{8}){2}",  # the owner
    0xCAFE: b"",  # the mark of an archive of Java
    0xD935: b".{2}\0*",  # what aligns the content
}
"""The forms of the extra fields that are allowed (APPNOTE 4.5 and 4.6, and the list of Info-ZIP). To the readers that
know them, others give a file another name, or make it a link or an encrypted one."""
_HAS_MORE = "has an extra field that is damaged, or that could give the file another name or size, or make it a link"
_END = "<4s4H2LH"
"""The form of the end of an archive: disks, counts, the size and the offset of the directory (APPNOTE 4.3.16)."""
_PIECE = 2**14
"""The number of bytes that are unpacked at a time."""


def unpack_fmu(file: IO[bytes], fmu: Path, folder: Path, kind: str = FMU) -> None:
    """Unpack an FMU into a folder, or another kind of archive in words.

    Raises FileError, which names the FMU by the path `fmu`, if it is damaged, if a file would lie outside the folder or
    is a link, or if the files take too much space.
    """
    with opened_archive(file, fmu, kind) as zipped:
        check_order(zipped, fmu)
        try:
            zipped.extractall(folder)
        except OSError as error:
            where = f": {os.path.relpath(error.filename, folder)}" if error.filename else ""
            raise FileError(f"{fmu}: cannot be unpacked: {error.strerror or error}{where}") from error


# ---- The archive -----------------------------------------------------------------------------------------------------


@contextmanager
def opened_archive(file: IO[bytes], fmu: Path, kind: str = FMU) -> Iterator[zipfile.ZipFile]:
    """Open the archive of an FMU. Raises FileError, also in place of what zipfile raises in the block."""
    try:
        with zipfile.ZipFile(file) as zipped:
            if reason := refusal(zipped):
                raise FileError(f"{fmu}: {reason}")
            yield zipped
    except (FileError, ProofError):
        raise
    except Exception as error:  # zipfile raises many kinds on damaged or encrypted archives
        is_outside = isinstance(error, OSError) and error.errno == errno.EINVAL
        reason = "its directory names a place outside of it" if is_outside else brief(reason_of(error))
        raise FileError(f"{fmu}: is not {kind}, or is damaged: {reason}") from error


def refusal(zipped: zipfile.ZipFile) -> str:
    """Return why an archive may not be unpacked, or an empty text."""
    members = zipped.infolist()
    # On some systems, capital letters and accents make no other path.
    paths = [normalize("NFC", member.orig_filename.removesuffix("/")).casefold() for member in members]
    names, times = Counter(member.orig_filename for member in members), Counter(paths)
    folders = {folder for path in paths for folder in accumulate(path.split("/")[:-1], "{}/{}".format)}
    for member, path in zip(members, paths, strict=True):
        name = member.orig_filename
        is_valid = all(map(is_portable, name.removesuffix("/").split("/")))
        is_read_alike = name.isascii() or member.flag_bits & _UTF_8
        fields = _fields(member.extra)
        is_special = stat.S_IFMT(member.external_attr >> 16) not in (0, stat.S_IFREG, stat.S_IFDIR)
        for is_wrong, reason in (
            (not is_valid, "must be a relative path with forward slashes, whose parts are names on every system"),
            (not is_read_alike, "must be ASCII, or marked as UTF-8: readers take it as different names"),
            (is_special, "is a link or a special file; an FMU must have files and folders only"),
            (member.compress_type not in _METHODS, "must be stored or deflated, the compression that FMI allows"),
            (member.flag_bits & _ENCRYPTED, "is encrypted"),
            (fields is None or _has_other_numbers(member, fields), _HAS_MORE),
            (names[name] > 1, f"is {names[name]} times in the archive"),
            (times[path] > 1, "is the path of another member, too, on systems that ignore case"),
            (path in folders and not member.is_dir(), "is a file, and a folder of other files"),
        ):
            if is_wrong:
                return f"member {shown(name)}: {reason}"
    total = sum(member.file_size for member in members)
    if total > _MOST_UNPACKED:
        return f"would take {total:,} bytes unpacked; at most {_MOST_UNPACKED:,} are allowed"
    if total > max(_SMALL, _MOST_RATIO * zipped.start_dir):
        return (
            f"would take {total:,} bytes unpacked, and has {zipped.start_dir:,}; "
            f"above {_SMALL:,} at most {_MOST_RATIO} times those of the archive are allowed"
        )
    return ""


def _fields(extra: bytes) -> dict[int, bytes] | None:
    """Return the extra fields of a file; None if one is not of an allowed kind and form, or is there twice."""
    found = dict[int, bytes]()
    while extra:
        kind, size = struct.unpack("<2H", extra[:4].ljust(4, b"\0"))
        content, extra = extra[4 : 4 + size], extra[4 + size :]
        form = _FORMS.get(kind)
        if form is None or kind in found or len(content) < size or not re.fullmatch(form, content, re.DOTALL):
            return None
        found[kind] = content
    return found


def _has_other_numbers(entry: zipfile.ZipInfo, fields: dict[int, bytes]) -> bool:
    """Return True if the directory has sizes or an offset of a file in 8 bytes that are not those of the file."""
    if _LARGE not in fields:
        return False
    numbers = entry.file_size, entry.compress_size, entry.header_offset
    return all(fields[_LARGE] != struct.pack(f"<{n}Q", *some) for n in (1, 2, 3) for some in combinations(numbers, n))


def check_order(zipped: zipfile.ZipFile, fmu: Path) -> None:
    """Raise FileError if two readers could find different files in an archive.

    Some go by the directory at the end of an archive, others by the header before each file. So both must say the same,
    and there may be nothing that belongs to no file.
    """
    offset, size, file = 0, 0, zipped.fp
    assert file
    for entry in sorted(zipped.infolist(), key=lambda entry: entry.header_offset):
        where = f"{fmu}: member {shown(entry.orig_filename)}"
        if entry.header_offset != offset:
            raise FileError(f"{where}: must begin at byte {offset} of the archive, and not at {entry.header_offset}")
        if entry.is_dir() and entry.file_size:
            raise FileError(f"{where}: is a folder, and must have no content")
        offset = _end_of(file, entry, where)
        if not offset:
            raise FileError(f"{where}: its header and its content must be as the directory of the archive says")
        size += 46 + len(_encoded(entry)) + len(entry.extra) + len(entry.comment)
    file.seek(offset + size)
    end, count = file.read(100 + len(zipped.comment)), len(zipped.infolist())
    largest = (2**16 - 1, 2**32 - 1) if end.startswith(b"PK\6\6") else ()
    end = end[76:] if largest else end  # after the records of large archives, of 56 and 20 bytes
    expected = b"PK\5\6", 0, 0, count, count, size, offset, len(zipped.comment)
    if len(end) != 22 + len(zipped.comment) or any(
        number not in (right, *largest) for number, right in zip(struct.unpack(_END, end[:22]), expected, strict=True)
    ):
        raise FileError(f"{fmu}: has bytes beside its files and its directory that belong to nothing")


def _encoded(entry: zipfile.ZipInfo) -> bytes:
    """Return the name of a file as it stands in the archive."""
    return entry.orig_filename.encode("utf-8" if entry.flag_bits & _UTF_8 else "cp437")


def _end_of(file: IO[bytes], entry: zipfile.ZipInfo, where: str) -> int:
    """Return where a file ends in an archive; 0 if its header or its content is not as the directory says.

    A writer that did not know the sizes before the content gives them behind it, with 4 or 8 bytes each, and with or
    without a signature (APPNOTE 4.3.9). Raises FileError about an extra field.
    """
    file.seek(entry.header_offset)
    sign, _, flags, method, modified, *numbers, name, extra = struct.unpack("<4s3H4s3L2H", file.read(30))
    if (sign, flags, method) != (b"PK\3\4", entry.flag_bits, entry.compress_type):
        return 0
    if modified != entry.FileHeader()[10:14] or file.read(name) != _encoded(entry):
        return 0
    fields = _fields(file.read(extra))
    if fields is None:
        raise FileError(f"{where}: {_HAS_MORE}")
    if large := fields.get(_LARGE):
        sizes = [*struct.unpack(f"<{len(large) // 8}Q", large)][::-1]
        if numbers[1:] not in ([2**32 - 1] * 2, sizes):
            return 0
        numbers[1:] = sizes
    if not _is_whole(file, entry):
        return 0
    end, expected = file.tell(), (entry.CRC, entry.compress_size, entry.file_size)
    if flags & _SIZES_BEHIND and all(number in (0, right) for number, right in zip(numbers, expected, strict=True)):
        following = file.read(24)
        for form in ("<4sL2Q", "<4s3L", "<0sL2Q", "<0s3L"):
            descriptor = struct.pack(form, b"PK\7\10", *expected)
            if following.startswith(descriptor):
                return end + len(descriptor)
    return end if tuple(numbers) == expected else 0


def _is_whole(file: IO[bytes], entry: zipfile.ZipInfo) -> bool:
    """Return True if the content that begins here ends where the directory says, and has the size that it says."""
    left, size = entry.compress_size, 0
    inflate = zlib.decompressobj(-zlib.MAX_WBITS)
    if entry.compress_type == zipfile.ZIP_STORED:
        file.seek(left, os.SEEK_CUR)
        return left == entry.file_size
    try:
        while size <= entry.file_size and (piece := file.read(min(left, _PIECE))):
            left -= len(piece)
            size += len(inflate.decompress(piece))
    except zlib.error:
        return False
    return inflate.eof and not (left or inflate.unused_data) and size == entry.file_size
