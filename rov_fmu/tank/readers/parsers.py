"""The formats of logs and tables, and the child process in which every file of a test is read, within a budget.

The file of a stranger may be damaged, or made to exhaust the machine: a few kB can stand for many GB of messages. A
function that reads such a file is `guarded`: it runs in the child process, with everything that uses what a parser
returns, and only its result comes back. A format can be read nowhere else.
"""

import os
import re
import warnings
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import wraps
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir
from threading import RLock
from traceback import walk_tb
from typing import Any, Concatenate, ParamSpec, TypeVar

import numpy as np

from rov_fmu.io.child_process import ChildError, ChildProcess, Functions, LimitError, Limits
from rov_fmu.io.csv_table import EMPTY, DataFileError, OpenStream, UnreadableFileError, open_text
from rov_fmu.io.messages import RovError, brief, listed, reason_of
from rov_fmu.io.reading import open_file
from rov_fmu.tank.findings import about
from rov_fmu.tank.readers.bags import read_bag, read_database, read_mcap, unpack
from rov_fmu.tank.readers.content import Content
from rov_fmu.tank.readers.lines import read_videoray, read_waterlinked
from rov_fmu.tank.readers.mavlink import read_dataflash, read_dataflash_text, read_telemetry
from rov_fmu.tank.readers.other_files import reason_against
from rov_fmu.tank.readers.recordings import ZSTD
from rov_fmu.tank.readers.tables import open_matlab, read_start
from rov_fmu.tank.readers.ulog import read_ulog


@dataclass(frozen=True)
class Format:
    """A format of logs."""

    name: str
    """Its name, with an article."""
    begins: bytes
    """A regular expression that matches the first bytes of such a file. The first format that matches counts."""
    open: Callable[[Path], OpenStream] | None = None
    """Return a function that opens the lines of a table."""
    read: Callable[[Path, Collection[str]], Content] | None = None
    """Read a log that is no table with a parser of somebody else, with the topics that rov.toml names."""
    unpack: Callable[[Path, Path], None] | None = None
    """Write the file that is packed in a file."""
    needs: str = ""
    """The parser, and the extra of this package that installs it."""
    repair: str = ""
    """The command that may repair a file that was cut short."""
    growth: int = 1
    """How many times as large as the file an honest content may be: it is compressed, or a number has few digits."""


_PYMAVLINK, _ROSBAGS = "pymavlink: pip install 'rov-fmu[mavlink]'", "rosbags and mcap: pip install 'rov-fmu[ros]'"
_HEADER = rb'(?=[^\n]*[,;\t])(?:[\t !#-~\x80-\xff]|"[^"\n]*")+\r?\n'
"""A first line of cells that are text. In a cell in quotes, and in the lines below it, a logger may have zero bytes."""
TABLE = Format("a CSV file", rb"\xff\xfe|\xfe\xff|[^\0]*\Z|" + _HEADER, open_text, growth=3)
FORMATS = (
    Format("a DataFlash log", rb"\xa3\x95", read=read_dataflash, needs=_PYMAVLINK),
    Format("a ULog", rb"ULog\x01\x12\x35", read=read_ulog, needs="pyulog: pip install 'rov-fmu[px4]'"),
    Format("a bag of ROS 1", rb"#ROSBAG V", read=read_bag, needs=_ROSBAGS, repair="rosbag reindex"),
    Format("a bag of ROS 2", rb"SQLite format 3\0", read=read_database, needs=_ROSBAGS, repair="sqlite3 .recover"),
    Format("an MCAP file", rb"\x89MCAP0\r\n", read=read_mcap, needs=_ROSBAGS, repair="mcap recover"),
    Format("a file that zstd compressed", re.escape(ZSTD), unpack=unpack, needs=_ROSBAGS, growth=8),
    Format("a .mat file", rb"MATLAB (5\.0|7\.3) MAT-file", open_matlab, growth=4),
    # µs since 1970, most significant byte first, and then the first byte of a MAVLink message
    Format("a telemetry log", rb"(?s)\0.{7}[\xfe\xfd]", read=read_telemetry, needs=_PYMAVLINK),
    Format("a DataFlash log in text", rb"(?m)[^\0]*?^FMT, ?\d", read=read_dataflash_text, needs=_PYMAVLINK),
    # without a bracket before it, in which a header above it would have a unit
    Format("an export of VideoRay Cockpit", rb"[^\0\[]*?\$PVRND,", read=read_videoray, growth=3),
    Format("a log of Water Linked's DVL", rb'[^\0]*?"(vx|position_local)" ?[:,}]', read=read_waterlinked, growth=3),
    TABLE,
)
"""All formats, and the only table of them."""
FORMAT_NAMES = listed(dict.fromkeys(kind.name for kind in (TABLE, *FORMATS)))


def format_of(path: Path) -> Format:
    """Return the format of a log by its first bytes. Raises DataFileError for a file that is none."""
    with open_file(path, UnreadableFileError) as file:
        head = file.read(1024)
    if not head:
        raise UnreadableFileError(f"{path}: {EMPTY}")
    reason = reason_against(path, head)
    kind = next((kind for kind in FORMATS if re.match(kind.begins, head)), None)
    if kind and not (kind is TABLE and reason):
        return kind
    reason = reason or f"its first bytes are those of none of the formats that are read: {FORMAT_NAMES}"
    raise UnreadableFileError(f"{path}: {reason}")


# ---- The child process -----------------------------------------------------------------------------------------------

_KEPT = 20_000_000
"""The contents of files of so many bytes together are kept. They take a sixth of the memory that any file may take."""

_OWN_CODE = str(Path(__file__).parents[2])
"""The folder of this package."""
_P = ParamSpec("_P")
_T = TypeVar("_T")


def guarded(function: Callable[Concatenate[Path, _P], _T]) -> Callable[Concatenate[Path, _P], _T]:
    """Let a function that reads a file, its first argument, run in the child process, within the budget of the file.

    Its other arguments and its result are pickled. It then raises DataFileError, too, for a file that exceeds its
    budget.
    """

    @wraps(function)
    def in_child(path: Path, /, *arguments: _P.args, **options: _P.kwargs) -> _T:
        if _PARSER.is_child:
            return function(path, *arguments, **options)
        with one_parser():
            result: _T = _PARSER.call(in_child, path, arguments, options)
            return result

    return in_child


def budget_for(size: int) -> Limits:
    """Return the budget for a file with a content of a size in bytes.

    The slowest parser takes about 0.5 s and 4 MB of memory for each MB of messages that it reads.
    """
    return Limits(time=30.0 + 2e-6 * size, memory=max(10**9, 600_000_000 + 8 * size), disk=max(10**9, 2 * size))


@contextmanager
def one_parser() -> Iterator[None]:
    """Read the files of the block in the same child process, because each start takes about half a second.

    All that reads a file in the block shares the time of its budget.
    """
    with _PARSER.lock:
        _PARSER.users += 1
    try:
        yield
    finally:
        with _PARSER.lock:
            _PARSER.users -= 1
            if not _PARSER.users:
                _PARSER.close()
                _PARSER.spent.clear()


_Key = tuple[int, int, int, int]


def _key(file: os.stat_result) -> _Key:
    """Return what tells a file from another one, also from what it was before it was written anew."""
    return file.st_dev, file.st_ino, file.st_mtime_ns, file.st_size


class _Parser:
    """The child process that reads files, while there is a user of it."""

    def __init__(self) -> None:
        self.lock = RLock()
        self.users = 0
        self.is_child = False
        """True in the child process."""
        self.spent: dict[_Key, float] = {}
        """The time that was spent on each file, s."""
        self.contents: dict[tuple[_Key, Path, frozenset[str]], Content] = {}
        """In the child process: the contents of logs by the file, its path and the topics that are named."""
        self._child: ChildProcess | None = None

    def call(self, function: Callable[..., Any], path: Path, arguments: Any, options: Any) -> Any:
        """Return what a function returns. Raises what it raises, and UnreadableFileError."""
        growth, file = format_of(path).growth, path.stat()
        limits = budget_for(growth * file.st_size)
        with self.lock:
            key = _key(file)
            left = replace(limits, time=limits.time and limits.time - self.spent.get(key, 0.0))
            try:
                if left.time is not None and left.time <= 0.0:
                    raise LimitError("time", limits)
                child = self._child = self._child or ChildProcess(Functions, limits=limits)
                begin = child.clock()
                try:
                    call = _call, Path.cwd(), function, path, arguments, options
                    return child.call("call", *call, limits=left)
                finally:
                    # The system tells the waiting late, so that a short call may seem to end before it began.
                    self.spent[key] = self.spent.get(key, 0.0) + max(child.clock() - begin, 0.0)
            except ChildError as error:
                self.close()
                if isinstance(error, LimitError):
                    raise UnreadableFileError(f"{path}: {LimitError(error.limit, limits)} to be read") from error
                raise UnreadableFileError(f"{path}: its parser {error}") from error
            finally:
                if limits.memory != budget_for(0).memory:
                    self.close()  # memory that it keeps would count for the next file, which may have a smaller budget

    def close(self) -> None:
        """End the process."""
        child, self._child = self._child, None
        if child:
            child.close()


_PARSER = _Parser()


def _call(folder: Path, function: Callable[..., Any], path: Path, arguments: Any, options: Any) -> Any:
    """Return what a guarded function returns, in the child process.

    `folder` is the working directory of the caller, from which its relative paths start.
    """
    _PARSER.is_child = True
    home = Path.cwd()
    os.chdir(folder)
    try:
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return function(path, *arguments, **options)
    finally:
        os.chdir(home)  # Windows does not remove a folder in which a process works


# ---- In the child process --------------------------------------------------------------------------------------------


_OF_DAMAGE = (ValueError, LookupError, ArithmeticError, EOFError, OSError, MemoryError)
"""The exceptions of Python by which the readers of this package say that bytes are damaged."""


@contextmanager
def _damage_told(path: Path) -> Iterator[None]:
    """Raise UnreadableFileError, in a block that parses a file, instead of an exception that is about its bytes.

    The code of somebody else may raise anything on damaged bytes, and the readers of this package one of `_OF_DAMAGE`.
    Another exception, such as an AttributeError, is a defect of this package, and stays what it is.
    """
    try:
        yield
    except (RovError, ModuleNotFoundError):
        raise
    except Exception as error:
        *_, (last, _) = walk_tb(error.__traceback__)
        is_own = last.f_code.co_filename.startswith(_OWN_CODE) and type(error).__module__ == "builtins"
        if is_own and not isinstance(error, _OF_DAMAGE):
            raise
        told = re.sub(rf"{re.escape(gettempdir())}\S*", lambda _: path.name, reason_of(error))  # where it was unpacked
        kind, reason = format_of(path), brief(told)
        hint = f"; `{kind.repair}` may repair it" if kind.repair else ""
        raise UnreadableFileError(
            f"{path}: begins as {kind.name}, but is damaged or was cut short, and cannot be read: {reason}{hint}"
        ) from error


def open_table(path: Path) -> OpenStream | None:
    """Return a function that opens the lines of a table; None for another log. Raises DataFileError."""
    assert _PARSER.is_child, "only a guarded function may read a file"
    with _damage_told(path):
        opens = format_of(path).open
        return opens(path) if opens else None


@guarded
def read_topics(path: Path, named: Collection[str]) -> Content:
    """Return the content of a log that is no table, with the topics that `named` has. Raises DataFileError.

    The process keeps it for the next function that uses it, unless it has kept much already.
    """
    contents, key = _PARSER.contents, (_key(path.stat()), path, frozenset(named))
    content = contents.get(key) or _parsed(path, named)
    if sum(size for (*_, size), *_ in {*contents, key}) > _KEPT:
        return content
    contents[key] = content
    return deepcopy(content)


def _parsed(path: Path, named: Collection[str]) -> Content:
    """Return the content of a log by the parser of its format. What the parser prints is about damage."""
    kind, printed = format_of(path), StringIO()
    try:
        with (
            _damage_told(path),
            redirect_stdout(printed),
            redirect_stderr(printed),
            TemporaryDirectory() as folder,
        ):
            file, shown = path, f"{path}"
            if kind.unpack:
                file, shown = Path(folder) / "unpacked", f"{path}, unpacked"
                kind.unpack(path, file)
                try:
                    kind = format_of(file)
                except DataFileError as error:
                    raise UnreadableFileError(str(error).replace(str(file), shown)) from error
            if not kind.read:
                raise UnreadableFileError(f"{shown}: is {kind.name}, and not a log with messages")
            content = kind.read(file, named)
    except ModuleNotFoundError:
        raise DataFileError(f"{path}: {kind.name} needs {kind.needs}") from None
    if printed.getvalue():
        content.findings.append(about(path.name, "damaged log"))
    findings = [replace(finding, file=path.name) for finding in content.findings]
    return replace(content, file=path.name, findings=findings)


@guarded
def header_of(path: Path) -> list[str] | None:
    """Return the headers of a table; None for another log. Raises DataFileError."""
    lines = open_table(path)
    return read_start(path, lines, 1)[0] if lines else None
