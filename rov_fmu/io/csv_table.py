"""Reading CSV files of numbers from spreadsheets, loggers and FMUs; each mistake gives one line.

Every table has a header with the names of the columns, and rows below it. Encoding, separator and what stands before
the header are those of the file (`_Dialect`).

`read_series` reads variables of an FMU over time, whose headers are names. columns.py reads tables whose headers have
units.
"""

import csv
import re
from array import array
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from io import BytesIO, TextIOWrapper
from itertools import islice
from math import isfinite, isnan, nan
from pathlib import Path
from typing import NamedTuple, TextIO

from rov_fmu.io.messages import MOST, FileError, shown
from rov_fmu.io.reading import read_bytes

NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,3})?")
"""A number as a cell has it, with a decimal point."""
VALUE = re.compile(rf"(?:{NUMBER.pattern})|[0-9]{{1,4}}([-/.])[0-9]{{1,2}}\3[0-9]{{2,4}}.*|[0-9]+:[0-9]{{2}}.*")
"""A cell of a row: a number, a date or a time of day."""
QUOTED_NUMBER = re.compile(r'" *([+-]?[0-9]*,[0-9]+(?:[eE][+-]?[0-9]+)?) *"')
"""A number with a comma in quotes."""
THOUSANDS = re.compile(r"[+-]?[1-9][0-9]{0,2},[0-9]{3}")
"""A number whose comma may separate thousands."""
HEADER = re.compile(r"(?P<name>[^\[\]]+)\[(?P<unit>[^\[\]]+)\]")
_SEPARATORS, _COMMENT = ",;\t", "#"
_GIVEN_SEPARATOR = re.compile(rf'"?sep=([{_SEPARATORS}])"?', re.IGNORECASE)
"""The line by which Excel is told the separator."""
_UTF_16_MARKS = (BOM_UTF16_LE, BOM_UTF16_BE)
"""The first bytes of a text in UTF-16."""
_CODE_PAGE = "cp1252"
MOST_BEFORE = 100
"""The number of lines in which the header is looked for."""
_UNIT = re.compile(r"\s\[[^\[\]]*\]$")
_WORDS = {"true": 1.0, "false": 0.0}
_LOOKS = {"NMEA": re.compile(r"[$!][A-Z0-9]{5,}[,*]"), "JSON": re.compile(r'\s*(\{|\[[\s0-9"{\[-])')}
"""How lines begin that have no header, by what they look like."""
EMPTY = "the file is empty"
"""What is wrong with a file without content."""
NO_ROWS = "no rows below the header"
_BLANKS = ("", "-", "nan")
LARGEST = 500_000_000
"""The largest file that is read, in bytes. Its numbers and lines take up to a few times its size in memory."""

OpenStream = Callable[[], TextIO]
"""Opens the lines of a table."""


class DataFileError(FileError):
    """A data file that cannot be used. Each mistake is a line with the place in the file, the value and a reason."""


class UnreadableFileError(DataFileError):
    """A data file of which nothing can be read, because it is damaged, cut short, or of an unknown kind."""


class Series(dict[str, "array[float]"]):
    """Variables over time by their names; the first is the time."""

    lines: Sequence[int] = ()
    """The line of the file on which each row is."""


def read_series(
    path: Path | str,
    why_wrong: Callable[[str], str | None],
    open_stream: OpenStream | None = None,
    *,
    has_time: bool = True,
) -> Series:
    """Read variables over time: the first column is the time, which may stay but not go back, the others are variables.

    Without `has_time`, all columns are variables. `why_wrong` returns what is wrong with the name of a variable, or
    None. Names have no units. Each cell must be a finite number, true or false. Raises DataFileError with all mistakes.
    `open_stream` opens the lines if `path` is not the file itself, but words for its path in an archive.
    """
    file = CsvFile(path, open_stream)
    line, header = next(iter(file))
    wrong = Mistakes(path)
    for index, name in enumerate(header):
        if reason := _why_no_variable(header, index, why_wrong, is_time=has_time and not index):
            wrong.add(f"{path}, line {line}, column {shown(name)}: {reason}")
    wrong.check()
    columns = {index: (name, lambda cell, _: finite(cell)) for index, name in enumerate(header)}
    values, lines, _, _ = read_numbers(file, header, columns, lambda cell: f" = {shown(cell)}")
    times = values[header[0]]
    for line, before, time in zip(lines[1:], times, times[1:], strict=False):
        if has_time and time < before:
            raise DataFileError(f"{path}, line {line}: the time goes back")
    if not lines or len(header) < 1 + has_time:
        raise DataFileError(f"{path}: {'no columns beside the time' if lines else NO_ROWS}")
    series = Series(values)
    series.lines = lines
    return series


def read_numbers(
    file: "CsvFile",
    header: Sequence[str],
    columns: Mapping[int, tuple[str, Callable[[str, bool], float]]],
    content: Callable[[str], str],
    *,
    loose: bool = False,
) -> tuple[dict[str, "array[float]"], "array[int]", dict[str, "array[int]"], "TornRows"]:
    """Return the numbers by column, the line of each row, the rows by column whose cells are unread, and the rows with
    too many cells, which are a mistake unless the table is `loose`. Raises DataFileError with all mistakes.

    `columns` has the name of each column that is read, by its index in the header, and returns the number of a cell. It
    is told whether the row has this cell, and raises ValueError with only the reason. `content` returns the content of
    a cell for a message.
    """
    torn, wrong = TornRows(len(header)), Mistakes(file.path)
    values = {name: array("d") for name, _ in columns.values()}
    lines, unread = array("L"), {name: array("L") for name in values}
    for line, cells in islice(file, 1, None):
        if len(cells) > len(header):
            torn.add(line, cells)
            continue
        lines.append(line)
        for index, (name, number) in columns.items():
            exists = index < len(cells)
            cell = cells[index] if exists else ""
            try:
                value = number(cell, exists)
            except ValueError as error:
                wrong.add(f"{file.path}, line {line}, column {shown(header[index])}{content(cell)}: {error}")
                continue
            values[name].append(value)
            if isnan(value) and not is_blank(cell):
                unread[name].append(len(lines) - 1)
    if torn.count and not loose:
        wrong.add(file.too_many(torn))
    wrong.check()
    return values, lines, unread, torn


def finite(text: str) -> float:
    """Return a text as a finite number; true is 1 and false is 0. Raises ValueError with only the reason."""
    number = _WORDS.get(text.strip().lower(), number_of(text.strip()))
    if number is None:
        raise ValueError("must be a finite number")
    return number


class Mistakes:
    """The first mistakes in a file, and the number of all mistakes."""

    def __init__(self, path: Path | str) -> None:
        self._path = path
        self.first: list[str] = []
        self.count = 0

    def add(self, line: str) -> None:
        """Count a mistake, and keep its line if it is among the first."""
        self.count += 1
        if self.count <= MOST:
            self.first.append(line)

    def check(self) -> None:
        """Raise DataFileError if there are mistakes."""
        if more := self.count - len(self.first):
            self.first.append(f"{self._path}: {more} more")
        if self.first:
            raise DataFileError(*self.first)


# ---- Lines -----------------------------------------------------------------------------------------------------------


def open_text(path: Path) -> OpenStream:
    """Return a function that opens the lines of a table, each time from the start. Raises UnreadableFileError.

    The text is in UTF-16 if it begins with its byte order mark, otherwise in UTF-8, or else in code page 1252, in which
    Windows writes µ and °. Zero bytes in it, which some loggers put into cells of text, are left out. The stream takes
    less memory than the text.
    """
    content = read_bytes(path, UnreadableFileError, most=LARGEST)
    if not content.startswith(_UTF_16_MARKS):
        content = content.replace(b"\0", b"")
    for encoding in ("utf-16",) if content.startswith(_UTF_16_MARKS) else ("utf-8-sig", _CODE_PAGE):
        with suppress(UnicodeDecodeError):
            content.decode(encoding)
            return partial(_stream, content, encoding)
    raise UnreadableFileError(f"{path}: is no text in UTF-8, UTF-16 or code page 1252. Save it as UTF-8")


def _stream(content: bytes, encoding: str) -> TextIO:
    return TextIOWrapper(BytesIO(content), encoding)


@dataclass(frozen=True)
class _Dialect:
    """The form of a table."""

    separator: str = ","
    before: int = 0
    """The number of lines before the header."""
    titles: Sequence[str] = ()
    """The cells of the header."""
    has_rows: bool = False
    """True if a row of numbers with as many cells follows the header."""

    @property
    def has_unit(self) -> bool:
        """True if a title has a unit."""
        return any(map(HEADER.fullmatch, self.titles))

    def is_above(self, line: str) -> bool:
        """Return True if a line is a row below this header: most of its cells are numbers, and their number fits."""
        row = _cells(line, self.separator)
        fits = len(row) <= len(self.titles) if self.has_unit else 1 < len(row) == len(self.titles)
        return fits and _is_row(row)


def _dialect(lines: Iterable[str]) -> _Dialect:
    """Return the form of a table with these lines.

    The header is a line without numbers above the first row: the first such line with a unit, or else the first one
    with as many cells as the row. A row has mostly numbers. Titles and comments may stand before the header, but no
    row. If there is no such line, the header is the first line.
    """
    given = ""
    first = None
    headers: list[_Dialect] = []
    for number, line in enumerate(islice(lines, MOST_BEFORE)):
        if not first and (mark := _GIVEN_SEPARATOR.fullmatch(line.strip(" \r\n"))):
            given = mark[1]
            continue
        separator = given or max(_SEPARATORS, key=line.count)
        cells = _cells(line, separator)
        if not any(cells):
            continue
        own = _Dialect(separator, number, cells)
        first = first or own
        if not line.startswith(_COMMENT):
            for header in sorted(headers, key=lambda one: not one.has_unit):
                if header.is_above(line):
                    return replace(header, has_rows=len(header.titles) > 1)
            if len(cells) > 1 and _is_row(cells):
                break
        if not any(map(VALUE.fullmatch, cells)):
            headers.append(own)
    return first or _Dialect()


def _looks_like(dialect: _Dialect, lines: Iterable[str]) -> str:
    """Return what the lines of a table without a header look like; an empty text for those that begin with a header.

    The first of them is a row if its cells are numbers where those of the second one are.
    """
    first, second, *_ = [*islice(filter(str.strip, islice(lines, dialect.before, None)), 2), "", ""]
    if dialect.has_rows:
        return ""
    if found := next((kind for kind, begins in _LOOKS.items() if begins.match(first)), ""):
        return found
    rows = (
        [(VALUE.fullmatch(cell) is not None, is_missing(cell)) for cell in cells]
        for cells in (dialect.titles, _cells(second, dialect.separator) or dialect.titles)
    )
    both = [(one, other) for (one, a), (other, b) in zip(*rows, strict=False) if not (a or b)]
    return "numbers" if (True, True) in both and all(one == other for one, other in both) else ""


def _cells(line: str, separator: str) -> list[str]:
    """Return the cells of a line, without empty ones at its end."""
    cells = []
    with suppress(csv.Error):  # the line is no CSV, and reading it will say so
        cells = [_with_point(cell.strip()) for cell in next(csv.reader([line], delimiter=separator), [])]
    while cells and not cells[-1]:
        cells.pop()
    return cells


def _with_point(text: str) -> str:
    """Return a cell with a decimal point instead of a comma in a number."""
    with_point = text.replace(",", ".", 1)
    return with_point if with_point != text and NUMBER.fullmatch(with_point) else text


def _has_decimal_commas(lines: Iterable[str]) -> bool:
    """Return True if a number in quotes between commas has a comma that separates no thousands, as in "0,35"."""
    quoted = (number for line in lines if '"' in line for number in QUOTED_NUMBER.findall(line))
    return any(not THOUSANDS.fullmatch(number) for number in quoted)


def _is_row(cells: Iterable[str]) -> bool:
    """Return True if most of the cells that are not blank are numbers or times."""
    filled = [cell for cell in cells if not is_missing(cell)]
    return 2 * sum(bool(VALUE.fullmatch(cell)) for cell in filled) > len(filled)


def is_missing(cell: str) -> bool:
    """Return True for a cell that stands for no value: blank, or only dashes and points."""
    return is_blank(cell) or not cell.strip("-.")


@dataclass
class TornRows:
    """The rows that have more cells than the header."""

    most: int
    """The number of cells of the header."""
    count: int = 0
    line: int = 0
    """The line of the first one."""
    cells: Sequence[str] = ()
    """The cells of the first one."""

    def add(self, line: int, cells: Sequence[str]) -> None:
        """Count a row."""
        self.count += 1
        if self.count == 1:
            self.line, self.cells = line, cells


Indices = Mapping[int, Sequence[int | None]]
"""The index of each column of the header in rows with so many cells, if they have more than the header."""
Lines = Iterator[tuple[int, list[str]]]
"""The lines of a table, each with its number and its cells."""


class Grown(NamedTuple):
    """Where the columns of the header are in rows that have more cells."""

    indices: Indices
    left_out: int
    """The number of rows that are left out because the indices of their columns are unknown."""
    words: Mapping[str, str | float]
    """The words of the finding about it."""


FindGrown = Callable[[Lines], Grown | None]
"""Finds the columns of the header in the rows of a table that have more cells."""


class CsvFile:
    """The lines of a CSV file from its header on that are not blank, each with its number and its cells."""

    def __init__(self, path: Path | str, open_stream: OpenStream | None) -> None:
        self.path = path
        self._open = open_stream or open_text(Path(path))
        self._dialect = _dialect(self._open())
        self._looks_like = _looks_like(self._dialect, self._open())
        self._has_decimal_commas = self._dialect.separator != "," or _has_decimal_commas(self._open())
        self._indices: Indices = {}
        self.left_out = 0
        """The number of rows that are left out because the indices of their columns are unknown."""
        self.assumed: dict[str, Mapping[str, str | float]] = {}
        """What was assumed, as the kind of a finding with its words."""
        if getattr(self._open(), "encoding", "") == _CODE_PAGE:
            self.assumed["code page"] = {}
        before = [line for line in islice(self._open(), self._dialect.before) if line.strip()]
        if count := sum(not _GIVEN_SEPARATOR.fullmatch(line.strip(" \r\n")) for line in before):
            self.assumed["lines before header"] = {"count": count}

    @property
    def has_rows(self) -> bool:
        """True if a row of numbers with as many cells follows the header."""
        return self._dialect.has_rows

    def __iter__(self) -> Lines:
        """Yield the lines. They are not kept, because their cells take much memory. Raises DataFileError.

        Numbers have decimal points, and empty cells at the end of a line are dropped if the header has no such column.
        """
        width, is_grown = 0, False
        for line, row in self._rows():
            indices = self._indices.get(len(row))
            is_grown = is_grown or indices is not None
            if is_grown and indices is None:
                continue
            cells = ["" if index is None else row[index] for index in indices] if indices else row
            while len(cells) > width and not cells[-1]:
                cells.pop()
            width = width or len(cells)
            yield line, cells

    def _rows(self) -> Lines:
        """Yield the lines with all their cells. Raises DataFileError."""
        before, separator = self._dialect.before, self._dialect.separator
        reader = csv.reader(islice(self._open(), before, None), delimiter=separator, strict=True)
        is_header = True
        try:
            for row in reader:
                cells = [_with_point(cell.strip()) if self._has_decimal_commas else cell.strip() for cell in row]
                if any(cells):
                    if is_header and self._looks_like:
                        raise self._no_header(cells)
                    if is_header and self._dialect.has_rows:
                        cells[0] = cells[0].lstrip(_COMMENT).strip() or cells[0]
                    is_header = False
                    yield before + reader.line_num, cells
        except csv.Error as error:
            raise DataFileError(f"{self.path}, line {before + reader.line_num}: not CSV: {error}") from error
        if is_header:
            raise UnreadableFileError(f"{self.path}: {EMPTY}")

    def _no_header(self, cells: Iterable[str]) -> DataFileError:
        where = f"{self.path}, line {self._dialect.before + 1} = {shown(', '.join(cells))}"
        needs = "a table needs a line above them that names the columns"
        return DataFileError(f"{where}: no header; these lines look like {self._looks_like}, and {needs}")

    def align(self, grown: FindGrown) -> bool:
        """Find the columns of the header in rows that have more cells from some line on. Return True if they are."""
        if found := grown(self._rows()):
            self._indices, self.left_out, self.assumed["grown rows"] = found
        return bool(found)

    def too_many(self, torn: TornRows) -> str:
        """Return the line about rows with more cells than the header has."""
        commas = self._dialect.separator == "," and all(NUMBER.fullmatch(cell) for cell in torn.cells)
        hint = " (are these decimal commas? They need ; between the columns, or quotes)" if commas else ""
        if torn.count > 1:
            hint += (
                f", and {torn.count} rows have more cells than the header, which has {torn.most}. Complete the header"
            )
        where = f"line {torn.line}, column {torn.most + 1} = {shown(torn.cells[torn.most])}"
        return f"{self.path}, {where}: there is no such column{hint}"


# ---- Cells -----------------------------------------------------------------------------------------------------------


def is_blank(text: str) -> bool:
    """Return True if a cell stands for a missing number."""
    return text.casefold() in _BLANKS


def number_of(text: str) -> float | None:
    """Return a text as a finite number, or None."""
    number = float(text) if NUMBER.fullmatch(text) else nan
    return number if isfinite(number) else None


def _why_no_variable(
    header: Sequence[str], index: int, why_wrong: Callable[[str], str | None], *, is_time: bool
) -> str | None:
    """Return what is wrong with a name above a column of variables, or of their times, or None."""
    name = header[index]
    if name in header[:index]:
        return "this column occurs twice"
    if not is_time and _UNIT.search(name):
        return f"must be {shown(_UNIT.sub('', name))} without a unit; a command of 30 % is 0.3 here"
    if (unit := _UNIT.search(name)) and unit[0] != " [s]":
        return "must be the time in s, which is the unit here"
    return None if is_time else why_wrong(name)
