"""The formats of logs, and the logs that need a parser of somebody else, in a child process within a budget.

The file of a stranger may be damaged, or made to exhaust the machine: a few kB can stand for many GB of messages. A
reader therefore runs with everything that uses what its parser returns in the child process, and only the topics of
the log come back.
"""

import shutil
import warnings
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, replace
from functools import partial
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import RLock
from typing import TextIO

import numpy as np

from rov_fmu.io.child_process import ChildError, ChildProcess, Functions, LimitError, Limits
from rov_fmu.io.csv_table import LARGEST, DataFileError, UnreadableFileError
from rov_fmu.io.messages import brief, listed
from rov_fmu.io.reading import open_file, read_lines
from rov_fmu.tank.findings import about
from rov_fmu.tank.readers.bags import read_bag, read_mcap
from rov_fmu.tank.readers.content import Content
from rov_fmu.tank.readers.mavlink import read_dataflash, read_telemetry
from rov_fmu.tank.readers.tables import open_matlab
from rov_fmu.tank.readers.ulog import read_ulog


@dataclass(frozen=True)
class Format:
    """A format of logs."""

    name: str
    """Its name, with an article."""
    open: Callable[[Path], Callable[[], TextIO]] | None = None
    """Return a function that opens the lines of a table."""
    read: Callable[[Path, Collection[str]], Content] | None = None
    """Read a log that is no table with a parser of somebody else, with the topics that rov.toml names."""
    needs: str = ""
    """The parser, and the extra of this package that installs it."""
    repair: str = ""
    """The command that may repair a file that was cut short."""
    suffix: str = ""
    """The suffix without which its parser does not know the format."""


_PYMAVLINK, _ROSBAGS = "pymavlink: pip install 'rov-fmu[mavlink]'", "rosbags and mcap: pip install 'rov-fmu[ros]'"
_MATLAB = Format("a .mat file", open_matlab)
_BEGINNINGS = {
    b"\xa3\x95": Format("a DataFlash log", None, read_dataflash, _PYMAVLINK),
    b"ULog\x01\x12\x35": Format("a ULog", None, read_ulog, "pyulog: pip install 'rov-fmu[px4]'"),
    b"#ROSBAG V": Format("a bag of ROS 1", None, read_bag, _ROSBAGS, "rosbag reindex", ".bag"),
    b"SQLite format 3\0": Format("a bag of ROS 2", None, read_bag, _ROSBAGS, "sqlite3 .recover", ".db3"),
    b"\x89MCAP0\r\n": Format("an MCAP file", None, read_mcap, _ROSBAGS, "mcap recover", ".mcap"),
    b"MATLAB 5.0 MAT-file": _MATLAB,
    b"MATLAB 7.3 MAT-file": _MATLAB,
}
"""The formats by their first bytes."""
_TABLE = Format("a CSV file", partial(read_lines, kind=UnreadableFileError, most=LARGEST))
_TELEMETRY = Format("a telemetry log", None, read_telemetry, _PYMAVLINK)
_MAVLINK_STARTS = (b"\xfe", b"\xfd")
"""The first byte of a MAVLink message, which follows eight bytes of time in a telemetry log."""


def format_of(path: Path) -> Format:
    """Return the format of a log by its first bytes. Raises DataFileError for a file that is none."""
    with open_file(path, UnreadableFileError) as file:
        head = file.read(1024)
    if not head:
        raise UnreadableFileError(f"{path}: the file is empty")
    for beginning, kind in _BEGINNINGS.items():
        if head.startswith(beginning):
            return kind
    if head[8:9] in _MAVLINK_STARTS and head[0] == 0:  # µs since 1970, most significant byte first
        return _TELEMETRY
    if b"\0" not in head:
        return _TABLE
    names = listed(dict.fromkeys(kind.name for kind in (_TABLE, _TELEMETRY, *_BEGINNINGS.values())))
    raise UnreadableFileError(f"{path}: its first bytes are those of none of the formats that are read: {names}")


def open_table(path: Path) -> Callable[[], TextIO] | None:
    """Return a function that opens the lines of a table; None for another log. Raises DataFileError."""
    opens = format_of(path).open
    return opens(path) if opens else None


def read_parsed(path: Path, kind: Format, named: Collection[str]) -> Content:
    """Read a log with its parser. Raises DataFileError, also if it exceeds its budget."""
    with one_parser():
        return _PARSER.read(path, kind, named, budget(path.stat().st_size))


def budget(size: int) -> Limits:
    """Return the budget for a file of a size in bytes.

    The slowest parser takes about 0.5 s and 4 MB of memory for each MB of messages that it reads.
    """
    return Limits(time=30.0 + 2e-6 * size, memory=max(10**9, 600_000_000 + 8 * size), disk=max(10**9, 2 * size))


@contextmanager
def one_parser() -> Iterator[None]:
    """Read the logs of the block in the same child process, because each start takes about half a second."""
    with _PARSER.lock:
        _PARSER.users += 1
    try:
        yield
    finally:
        with _PARSER.lock:
            _PARSER.users -= 1
            if not _PARSER.users:
                _PARSER.close()


class _Parser:
    """The child process that reads logs, while there is a user of it."""

    def __init__(self) -> None:
        self.lock = RLock()
        self.users = 0
        self._child: ChildProcess | None = None

    def read(self, path: Path, kind: Format, named: Collection[str], limits: Limits) -> Content:
        """Read a log. Raises DataFileError."""
        with self.lock:
            try:
                self._child = self._child or ChildProcess(Functions, limits=limits)
                content: Content = self._child.call("call", read_guarded, Path.cwd(), path, kind, named, limits=limits)
            except ChildError as error:
                self.close()
                end = " to be read" if isinstance(error, LimitError) else ""
                reason = str(error) if end else f"its parser {error}"
                raise UnreadableFileError(f"{path}: {reason}{end}") from error
            if limits.memory != budget(0).memory:
                self.close()  # memory that it keeps would count for the next file, which may have a smaller budget
            return content

    def close(self) -> None:
        """End the process."""
        child, self._child = self._child, None
        if child:
            child.close()


_PARSER = _Parser()


def read_guarded(folder: Path, path: Path, kind: Format, named: Collection[str]) -> Content:
    """Read a log. Any exception means that the file is damaged: a DataFileError, which names the file by `path`.

    `folder` is what a relative path starts from: the caller's working directory, which this process may not share. What
    a parser prints is about damage.
    """
    printed = StringIO()
    try:
        with (
            np.errstate(all="ignore"),
            warnings.catch_warnings(),
            redirect_stdout(printed),
            redirect_stderr(printed),
        ):
            warnings.simplefilter("ignore")
            content = _read(folder / path, kind, named)
    except ImportError:
        raise DataFileError(f"{path}: {kind.name} needs {kind.needs}") from None
    except Exception as error:  # a parser may raise anything on damaged bytes, and return anything
        reason = brief(str(error)) or type(error).__name__
        hint = f"; `{kind.repair}` may repair it" if kind.repair else ""
        raise UnreadableFileError(
            f"{path}: begins as {kind.name}, but is damaged or was cut short, and cannot be read: {reason}{hint}"
        ) from error
    if printed.getvalue():
        content.findings.append(about(path.name, "damaged log"))
    return content


def _read(path: Path, kind: Format, named: Collection[str]) -> Content:
    """Read a log, under a name with the suffix that its parser needs."""
    assert kind.read
    if path.name.lower().endswith(kind.suffix):
        return kind.read(path, named)
    with TemporaryDirectory() as folder:
        link = Path(folder) / f"log{kind.suffix}"
        try:
            link.symlink_to(path.resolve())
        except OSError:  # on a system without links
            shutil.copyfile(path, link)
        content = kind.read(link, named)
    findings = [replace(finding, file=path.name) for finding in content.findings]
    return replace(content, file=path.name, findings=findings)
