"""The files of a folder: which are logs and tables, by their content, and why the others are not read."""

import os
import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Collection, Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from io import StringIO
from itertools import groupby
from pathlib import Path

from rov_fmu.io.csv_table import EMPTY, CsvFile, DataFileError
from rov_fmu.io.file_kinds import LOG_SUFFIXES, OWN_SUFFIXES, TABLE_SUFFIXES
from rov_fmu.io.messages import listed
from rov_fmu.tank.findings import Finding, about
from rov_fmu.tank.readers.other_files import PICTURE
from rov_fmu.tank.readers.parsers import FORMAT_NAMES, TABLE, format_of
from rov_fmu.tank.readers.recordings import WAL

_BAG = "metadata.yaml"
"""The file in the folder of a bag of ROS 2."""
_OF_SYSTEM = (_BAG, "Thumbs.db", "desktop.ini")
"""The files that systems put into folders."""
_OF_DATABASE = (WAL, "-shm", "-journal")
"""What SQLite appends to the name of a database for those of its other files."""
NOT_OPENED = "a device, a pipe or a link that leads nowhere is not opened"
_NO_TABLE = "a table needs a header, and rows of numbers with commas, semicolons or tabs between the columns"
_IN_FOLDER = "logs and tables in another folder do not count. If they belong to the tests, move them beside rov.toml"
_START = 100_000
"""The number of bytes at the beginning of a text that tell whether it is a table."""
_MOST_NAMES = 3
"""The largest number of files with the same suffix that a sentence names one by one."""


@dataclass
class Listing:
    """The files of a folder."""

    folder: Path
    tests: list[Path] = field(default_factory=list)
    """The logs and tables, also those of bags in folders of their own, in order."""
    others: dict[str, list[Path]] = field(default_factory=dict)
    """The files that are not read, by the reason."""

    @property
    def findings(self) -> list[Finding]:
        """A finding for each reason why files are not read: a warning, unless nobody expects them to be read."""
        usual = (PICTURE, EMPTY, _NO_TABLE, _IN_FOLDER)
        return [
            about(named(paths), "other files" if reason in usual else "unreadable file", reason=reason)
            for reason, paths in self.others.items()
        ]

    def lines(self, *kinds: str) -> list[str]:
        """Return a line for each finding of these kinds."""
        return [f"{self.folder / one.file}: {one.words['reason']}" for one in self.findings if one.kind in kinds]

    def no_tests(self) -> list[str]:
        """Return the lines about a folder without logs and tables."""
        none = f"{self.folder}: there is no log and no table in this folder. These formats are read: {FORMAT_NAMES}"
        return [none, *self.lines("unreadable file", "other files")]


def list_files(folder: Path, known: Collection[str] = ()) -> Listing:
    """Return the files of a folder.

    Nothing is told of hidden files, of vehicle files, FMUs and pages, and of those whose names are known.
    """
    listing = Listing(folder)
    for path in sorted(folder.iterdir()):
        if is_bag(path):
            listing.tests += sorted(part for part in path.iterdir() if part.is_file() and not _needs_no_word(part))
        elif path.is_dir() and not has_usual_suffix(path):
            if _has_tests(path):
                listing.others.setdefault(_IN_FOLDER, []).append(path)
        elif not (_needs_no_word(path) or path.name in known):
            if reason := _why_not_read(path):
                listing.others.setdefault(reason, []).append(path)
            else:
                listing.tests.append(path)
    return listing


def is_bag(folder: Path) -> bool:
    """Return True for the folder of a bag of ROS 2. A recorder that lost its power has written no metadata, but its
    files are named after the folder."""
    if os.path.isfile(folder / _BAG):  # noqa: PTH113 (in a folder that nobody may search, there is no bag)
        return True
    own = rf"{re.escape(folder.name)}_\d+\.(db3|mcap)(\.zstd)?"
    with suppress(OSError):
        names = [part.name for part in folder.iterdir() if not _needs_no_word(part)]
        return bool(names) and all(re.fullmatch(own, name) for name in names)
    return False


def has_usual_suffix(path: Path) -> bool:
    """Return True if the name of a file tells that it is a log or a table."""
    return path.name.lower().endswith((*LOG_SUFFIXES, *TABLE_SUFFIXES))


def _needs_no_word(path: Path) -> bool:
    """Return True for a hidden file, a file of the system, and one that this program has written or reads by name."""
    if path.name.startswith(".") or path.name in _OF_SYSTEM or path.suffix.lower() in OWN_SUFFIXES:
        return True
    return any(path.name.endswith(end) and path.with_name(path.name[: -len(end)]).is_file() for end in _OF_DATABASE)


def _has_tests(folder: Path) -> bool:
    """Return True for a folder with a log or a table that is not hidden. One that may not be listed has none."""
    with suppress(OSError):
        parts = (part for part in folder.iterdir() if part.is_file() and not _needs_no_word(part))
        return not (_needs_no_word(folder) or all(map(_why_not_read, parts)))
    return False


def _why_not_read(path: Path) -> str:
    """Return why a file is not read, and what to do; an empty text if it is.

    What has a usual suffix is always read, so that its mistakes are told.
    """
    if not (path.is_file() or path.is_dir()):
        return NOT_OPENED
    if has_usual_suffix(path):
        return ""
    try:
        is_text = format_of(path) is TABLE
    except DataFileError as error:
        return str(error).removeprefix(f"{path}: ")
    return _NO_TABLE if is_text and not _looks_like_table(path) else ""


def _looks_like_table(path: Path) -> bool:
    """Return True if a text has a row of numbers below a header with as many columns. Only its beginning is read."""
    with path.open("rb") as file:
        start = file.read(_START)
    encoding = "utf-16" if start.startswith((BOM_UTF16_LE, BOM_UTF16_BE)) else "utf-8-sig"
    return CsvFile(path, partial(StringIO, start.decode(encoding, "replace"))).has_rows


def named(paths: Iterable[Path]) -> str:
    """Return the names of files; of many with the same suffix, only the first one and how many there are."""
    names = []
    for suffix, group in groupby(sorted(paths, key=lambda path: path.suffix), lambda path: path.suffix):
        first, *more = (f"{path.name}/" if path.is_dir() else path.name for path in group)
        names += [first, *more] if len(more) < _MOST_NAMES else [f"{first} and {len(more)} more *{suffix}"]
    return listed(names)
