"""Unpack an FMU that may come from anyone.

The files stay in their folder, and their size is limited.
"""

import errno
import os
import stat
import zipfile
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import accumulate
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
_ENCRYPTED, _UTF_8 = 1, 0x800
"""The flags of a file that is encrypted, and of one whose name is in UTF-8."""


def unpack_fmu(file: IO[bytes], fmu: Path, folder: Path, kind: str = FMU) -> None:
    """Unpack an FMU into a folder, or another kind of archive in words.

    Raises FileError, which names the FMU by the path `fmu`, if it is damaged, if a file would lie outside the folder or
    is a link, or if the files take too much space.
    """
    with opened_archive(file, fmu, kind) as zipped:
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
        is_special = stat.S_IFMT(member.external_attr >> 16) not in (0, stat.S_IFREG, stat.S_IFDIR)
        for is_wrong, reason in (
            (not is_valid, "must be a relative path with forward slashes, whose parts are names on every system"),
            (not is_read_alike, "must be ASCII, or marked as UTF-8: readers take it as different names"),
            (is_special, "is a link or a special file; an FMU must have files and folders only"),
            (member.compress_type not in _METHODS, "must be stored or deflated, the compression that FMI allows"),
            (member.flag_bits & _ENCRYPTED, "is encrypted"),
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
