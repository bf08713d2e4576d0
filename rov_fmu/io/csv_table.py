"""Reading CSV files of numbers from spreadsheets, loggers and FMUs; each mistake gives one line.

Every table has a header with the names of the columns, and rows below it. Encoding, separator and what stands before
the header are those of the file (`_Dialect`).

`read_columns` reads tables whose headers have units, such as `command [%]`. `read_series` reads variables of an FMU
over time, whose headers are names.
"""

import csv
import re
from array import array
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections import deque
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from io import BytesIO, StringIO, TextIOWrapper
from itertools import islice, pairwise, zip_longest
from math import isfinite, isnan, nan
from pathlib import Path
from types import MappingProxyType
from typing import TextIO

from rov_fmu.io.messages import MOST, FileError, brief, did_you_mean, shown, similar
from rov_fmu.io.reading import read_bytes

NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,3})?")
"""A number as a cell has it, with a decimal point."""
VALUE = re.compile(rf"(?:{NUMBER.pattern})|[0-9]{{1,4}}([-/.])[0-9]{{1,2}}\\3[0-9]{{2,4}}.*|[0-9]+:[0-9]{{2}}.*")
"""A cell of a row: a number, a date or a time of day."""
QUOTED_NUMBER = re.compile(r'" *([+-]?[0-9]*,[0-9]+(?:[eE][+-]?[0-9]+)?) *"')
"""A number with a comma in quotes."""
THOUSANDS = re.compile(r"[+-]?[1-9][0-9]{0,2},[0-9]{3}")
"""A number whose comma may separate thousands."""
_HEADER = re.compile(r"(?P<name>[^\[\]]+)\[(?P<unit>[^\[\]]+)\]")
_SEPARATORS, _COMMENT = ",;\t", "#"
_GIVEN_SEPARATOR = re.compile(rf'"?sep=([{_SEPARATORS}])"?', re.IGNORECASE)
"""The line by which Excel is told the separator."""
_UTF_16_MARKS = (BOM_UTF16_LE, BOM_UTF16_BE)
"""The first bytes of a text in UTF-16."""
_CODE_PAGE = "cp1252"
MOST_BEFORE = 100
"""The number of lines in which the header is looked for."""
_START = 100_000
"""The number of bytes at the beginning of a text that tell whether it is a table."""
_COMPARED_ROWS = 50
"""The number of rows before and after an insertion of columns that tell its place."""
_FEWEST, _MOST_ODD, _MOST_MISFITS = 3, 0.05, 0.25
"""The least number of rows before and after an insertion, the largest share of rows after it with yet another number of
cells, and the largest share of columns that do not go on as before."""
_UNIT = re.compile(r"\s\[[^\[\]]*\]$")
_WORDS = {"true": 1.0, "false": 0.0}
EMPTY = "the file is empty"
"""What is wrong with a file without content."""
_NO_ROWS = "no rows below the header"
_BLANKS = ("", "-", "nan")
_MOST_COMPARED = 1000
"""The largest number of headers that are compared with all known names, which takes long."""
LARGEST = 500_000_000
"""The largest file that is read, in bytes. Its numbers and lines take up to a few times its size in memory."""

OpenStream = Callable[[], TextIO]
"""Opens the lines of a table."""
Conversion = Callable[[float], float]
"""The conversion of a number. It can be sent to the child process that reads a log."""


class DataFileError(FileError):
    """A data file that cannot be used. Each mistake is a line with the place in the file, the value and a reason."""


class UnreadableFileError(DataFileError):
    """A data file of which nothing can be read, because it is damaged, cut short, or of an unknown kind."""


@dataclass(frozen=True)
class Column:
    """A column that a file may have, and the numbers that it may contain."""

    units: Mapping[str, float]
    """The units that the file may use, and how many of each make one of the first unit. The empty unit
    is that of a header without one."""
    optional: bool = False
    """True if a file may be without this column."""
    blanks: bool = False
    """True if cells may be empty, `-` or `nan`. These cells, and missing cells of an optional column, become NaN."""
    minimum: float | None = None
    """The smallest number, in the first unit."""
    maximum: float | None = None
    """The largest number, in the first unit."""
    least: float = 0.0
    """The smallest magnitude of a number other than zero, in the first unit."""
    also: tuple[str, ...] = ()
    """Other names of the column. They are recognised only together with one of its units."""
    parse: Callable[[str], float] | None = None
    """Returns the number, in the first unit, of a text that is no number, such as a date; raises ValueError."""
    conversions: Mapping[str, Callable[[tuple[float, ...]], Conversion]] = field(default_factory=dict)
    """Units that need more than a factor. Numbers may follow such a unit, as in `[us 1500 400]`. The function takes
    these numbers and returns the conversion to the first unit, or raises ValueError with the reason. The bounds do not
    apply here."""


@dataclass(frozen=True)
class Columns:
    """The numbers of a file, in the first unit of each column."""

    path: Path
    header: Sequence[str]
    """All cells of the header, as the file has them."""
    headers: Mapping[str, str]
    """The headers of the columns that are read, as the file has them or as they are renamed."""
    units: Mapping[str, str]
    """The units of the file by column, with the numbers that follow a unit."""
    conversions: Mapping[str, Conversion]
    """The conversions of the numbers of the file to the first unit, by column."""
    values: Mapping[str, "array[float]"]
    """The numbers by column."""
    lines: "array[int]"
    """The line of the file on which each row is."""
    unread: Mapping[str, "array[int]"]
    """The rows by column whose cells are neither numbers nor blank. A loose reading makes these NaN."""
    torn: int
    """The number of rows with more cells than the header. A loose reading leaves them out."""
    assumed: Mapping[str, Mapping[str, str | float]]
    """What was assumed about the form of the file, as the kind of a finding with its words."""
    rows: Callable[[], Iterator[Mapping[str, str]]]
    """Return the cells of each row by column. The file is parsed again, because keeping the texts takes much memory."""

    def texts(self, *columns: str) -> Iterator[tuple[str, ...]]:
        """Yield the texts of some columns, row by row, with decimal points; blank cells are empty."""
        for cells, *values in zip(self.rows(), *(self.values[column] for column in columns), strict=True):
            yield tuple("" if isnan(value) else cells[column] for column, value in zip(columns, values, strict=True))

    def error(self, row: int, column: str, reason: str) -> DataFileError:
        """Return the error about a cell that is wrong."""
        text = next(islice(self.rows(), row, None))[column]
        place = f"line {self.lines[row]}, column {shown(self.headers[column])}"
        return DataFileError(f"{self.path}, {place} = {brief(text)}: {reason}")


@dataclass(frozen=True)
class FileColumn:
    """A column of the file that is read."""

    name: str
    column: Column
    unit: str
    convert: Conversion
    """The conversion of a number to the first unit."""
    factor: float
    """How many of this unit make one of the first unit; 1 if a factor is not enough. Negative with a minus sign."""
    numbers: tuple[str, ...] = ()
    """The numbers that follow the unit."""


def read_columns(
    path: Path,
    columns: Mapping[str, Column],
    *,
    others: bool = False,
    loose: bool = False,
    renamed: Mapping[str, str] = MappingProxyType({}),
    hint: str = "",
    check_header: Callable[[Mapping[str, str], Sequence[str]], Iterable[str]] = lambda _, __: (),
    open_stream: OpenStream | None = None,
) -> Columns:
    """Read the columns, in any order, with headers such as `command [%]`. Raises DataFileError with all mistakes.

    With `others`, the file may have other columns, which are not read. `loose` is for logs: a cell that is missing or
    not a number becomes NaN, and a row with too many cells is left out. `renamed` has other headers for some of those
    of the file. `hint` ends the messages about missing columns. `check_header` is called before the rows are
    read, with the headers that are read, by column, and with all other headers; it returns the mistakes in them.
    `open_stream` opens the lines of a table that is not the text of the file itself.
    """
    file = _CsvFile(path, open_stream)
    line, titles = next(iter(file))
    header = [*map(renamed.get, titles, titles)]
    file_columns = _find_columns(path, line, header, columns, others, hint)
    headers = {column.name: header[place] for place, column in file_columns.items()}
    wrong = _Mistakes(path)
    for reason in check_header(headers, _others(header, file_columns)):
        wrong.add(f"{path}, line {line}: {reason}")
    wrong.check()
    values, lines, unread, torn = _numbers(file, header, file_columns, loose)
    if torn.count and file.align():
        values, lines, unread, torn = _numbers(file, header, file_columns, loose)
    if torn.count > len(lines):
        raise DataFileError(file.too_many(torn))
    if not lines:
        raise DataFileError(f"{path}, line {line}: {_NO_ROWS}")
    return Columns(
        path,
        titles,
        headers,
        {column.name: " ".join([column.unit, *column.numbers]) for column in file_columns.values()},
        {column.name: column.convert for column in file_columns.values()},
        values,
        lines,
        unread,
        torn.count + file.left_out,
        file.assumed,
        partial(_rows, file, file_columns, len(header)),
    )


def _numbers(
    file: "_CsvFile", header: Sequence[str], file_columns: Mapping[int, FileColumn], loose: bool
) -> tuple[dict[str, "array[float]"], "array[int]", dict[str, "array[int]"], "_TornRows"]:
    """Return the numbers by column, the line of each row, the rows by column whose cells are unread, and the rows with
    too many cells. Raises DataFileError."""
    path = file.path
    torn, wrong = _TornRows(len(header)), _Mistakes(path)
    values = {column.name: array("d") for column in file_columns.values()}
    lines = array("L")
    unread = {name: array("L") for name in values}
    for line, cells in islice(file, 1, None):
        if len(cells) > len(header):
            torn.add(line, cells)
            continue
        lines.append(line)
        for (place, column), cell in zip(file_columns.items(), _by_column(cells, file_columns).values(), strict=True):
            try:
                value = _value(cell, place < len(cells), column, loose)
            except ValueError as error:
                wrong.add(f"{path}, line {line}, column {shown(header[place])}{_content(cell)}: {error}")
                continue
            values[column.name].append(value)
            if isnan(value) and not _is_blank(cell):
                unread[column.name].append(len(lines) - 1)
    if torn.count and not loose:
        wrong.add(file.too_many(torn))
    wrong.check()
    return values, lines, unread, torn


def _rows(file: "_CsvFile", file_columns: Mapping[int, FileColumn], width: int) -> Iterator[Mapping[str, str]]:
    """Yield the cells of each row that has not more of them than the header, by column."""
    return (_by_column(cells, file_columns) for _, cells in islice(file, 1, None) if len(cells) <= width)


def _content(cell: str) -> str:
    """Return the content of a cell for a message; empty for an empty cell."""
    return f" = {shown(cell)}" if cell else ""


def _by_column(cells: list[str], file_columns: Mapping[int, FileColumn]) -> dict[str, str]:
    """Return the cells of a row that are read, by column. One that the row does not have is empty."""
    return {column.name: cells[place] if place < len(cells) else "" for place, column in file_columns.items()}


def read_header(path: Path, open_stream: OpenStream | None = None) -> list[str]:
    """Return the cells of the header. Raises DataFileError."""
    return read_start(path, open_stream, 1)[0]


def read_start(path: Path, open_stream: OpenStream | None, count: int) -> list[list[str]]:
    """Return the cells of the header and of the first rows, at most `count` of all. Raises DataFileError."""
    return [cells for _, cells in islice(_CsvFile(path, open_stream), count)]


class Series(dict[str, "array[float]"]):
    """Variables over time by their names; the first is the time."""

    lines: Sequence[int] = ()
    """The line of the file on which each row is."""


def read_series(
    path: Path | str, why_wrong: Callable[[str], str | None], open_stream: OpenStream | None = None
) -> Series:
    """Read variables over time: the first column is the time, which may stay but not go back, the others are variables.

    `why_wrong` returns what is wrong with the name of a variable, or None. Names have no units. Each cell must be a
    finite number, true or false. Raises DataFileError with all mistakes. `open_stream` opens the lines if `path` is not
    the file itself, but words for its place in an archive.
    """
    file = _CsvFile(path, open_stream)
    lines = iter(file)
    line, header = next(lines)
    if all(NUMBER.fullmatch(name) for name in header):
        words = "the first line must be a header that names the columns: the time, and then variables"
        raise DataFileError(f"{path}: {words}")
    wrong = _Mistakes(path)
    for place, name in enumerate(header):
        if reason := _why_no_variable(header, place, why_wrong):
            wrong.add(f"{path}, line {line}, column {shown(name)}: {reason}")
    wrong.check()
    series, numbers, torn = Series({name: array("d") for name in header}), array("L"), _TornRows(len(header))
    for line, cells in lines:
        numbers.append(line)
        if len(cells) > len(header):
            torn.add(line, cells)
            continue
        for name, cell in zip_longest(header, cells, fillvalue=""):
            try:
                series[name].append(finite(cell))
            except ValueError as error:
                wrong.add(f"{path}, line {line}, column {shown(name)} = {shown(cell)}: {error}")
    if torn.count:
        wrong.add(file.too_many(torn))
    wrong.check()
    times = series[header[0]]
    for line, before, time in zip(numbers[1:], times, times[1:], strict=False):
        if time < before:
            raise DataFileError(f"{path}, line {line}: the time goes back")
    if not numbers or len(header) < 2:
        raise DataFileError(f"{path}: {'no columns beside the time' if numbers else _NO_ROWS}")
    series.lines = numbers
    return series


def finite(text: str) -> float:
    """Return a text as a finite number; true is 1 and false is 0. Raises ValueError with only the reason."""
    number = _WORDS.get(text.strip().lower(), _number(text.strip()))
    if number is None:
        raise ValueError("must be a finite number")
    return number


class _Mistakes:
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
    Windows writes µ and °. The stream takes less memory than the text.
    """
    content = read_bytes(path, UnreadableFileError, most=LARGEST)
    for encoding in ("utf-16",) if content.startswith(_UTF_16_MARKS) else ("utf-8-sig", _CODE_PAGE):
        with suppress(UnicodeDecodeError):
            content.decode(encoding)
            return partial(_stream, content, encoding)
    raise UnreadableFileError(f"{path}: is no text in UTF-8, UTF-16 or code page 1252. Save it as UTF-8")


def _stream(content: bytes, encoding: str) -> TextIO:
    return TextIOWrapper(BytesIO(content), encoding)


def looks_like_table(path: Path) -> bool:
    """Return True if a text has a row of numbers below a header with as many columns. Only its beginning is read."""
    with path.open("rb") as file:
        start = file.read(_START)
    encoding = "utf-16" if start.startswith(_UTF_16_MARKS) else "utf-8-sig"
    return _dialect(StringIO(start.decode(encoding, "replace"))).has_rows


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
        return any(map(_HEADER.fullmatch, self.titles))

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
    filled = [cell for cell in cells if not _is_missing(cell)]
    return 2 * sum(bool(VALUE.fullmatch(cell)) for cell in filled) > len(filled)


def _is_missing(cell: str) -> bool:
    """Return True for a cell that stands for no value: blank, or only dashes and points."""
    return _is_blank(cell) or not cell.strip("-.")


@dataclass
class _TornRows:
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


class _CsvFile:
    """The lines of a CSV file from its header on that are not blank, each with its number and its cells."""

    def __init__(self, path: Path | str, open_stream: OpenStream | None) -> None:
        self.path = path
        self._open = open_stream or open_text(Path(path))
        self._dialect = _dialect(self._open())
        self._has_decimal_commas = self._dialect.separator != "," or _has_decimal_commas(self._open())
        self._places: dict[int, list[int | None]] = {}
        """The place of each column of the header in rows with so many cells, if they have more than the header."""
        self.left_out = 0
        """The number of rows that are left out because the places of their columns are unknown."""
        self.assumed: dict[str, Mapping[str, str | float]] = {}
        """What was assumed, as the kind of a finding with its words."""
        if getattr(self._open(), "encoding", "") == _CODE_PAGE:
            self.assumed["code page"] = {}
        before = [line for line in islice(self._open(), self._dialect.before) if line.strip()]
        if count := sum(not _GIVEN_SEPARATOR.fullmatch(line.strip(" \r\n")) for line in before):
            self.assumed["lines before header"] = {"count": count}

    def __iter__(self) -> Iterator[tuple[int, list[str]]]:
        """Yield the lines. They are not kept, because their cells take much memory. Raises DataFileError.

        Numbers have decimal points, and empty cells at the end of a line are dropped if the header has no such column.
        """
        width, is_grown = 0, False
        for line, row in self._rows():
            places = self._places.get(len(row))
            is_grown = is_grown or places is not None
            if is_grown and places is None:
                continue
            cells = ["" if place is None else row[place] for place in places] if places else row
            while len(cells) > width and not cells[-1]:
                cells.pop()
            width = width or len(cells)
            yield line, cells

    def _rows(self) -> Iterator[tuple[int, list[str]]]:
        """Yield the lines with all their cells. Raises DataFileError."""
        before, separator = self._dialect.before, self._dialect.separator
        reader = csv.reader(islice(self._open(), before, None), delimiter=separator, strict=True)
        is_header = True
        try:
            for row in reader:
                cells = [_with_point(cell.strip()) if self._has_decimal_commas else cell.strip() for cell in row]
                if any(cells):
                    if is_header and self._dialect.has_rows:
                        cells[0] = cells[0].lstrip(_COMMENT).strip() or cells[0]
                    is_header = False
                    yield before + reader.line_num, cells
        except csv.Error as error:
            raise DataFileError(f"{self.path}, line {before + reader.line_num}: not CSV: {error}") from error
        if is_header:
            raise UnreadableFileError(f"{self.path}: {EMPTY}")

    def align(self) -> bool:
        """Find the columns of the header in rows that have more cells from some line on. Return True if some are found.

        A logger may write the header before it knows all columns, and insert the others later. What stands in the rows
        before and after tells where. A few rows may have yet another number of cells.
        """
        rows = self._rows()
        width = len(next(rows)[1])
        parts = [_Part(0, width)]
        odd = 0
        for line, row in rows:
            if len(row) > parts[-1].width:
                parts.append(_Part(line, len(row)))
            if len(row) == parts[-1].width:
                parts[-1].add(row)
            elif len(parts) > 1:
                odd += 1
        if (
            len(parts) == 1
            or any(part.count < _FEWEST for part in parts)
            or odd > _MOST_ODD * sum(part.count for part in parts[1:])
        ):
            return False
        places: list[int | None] = [*range(width)]
        by_width = {}
        for before, after in pairwise(parts):
            low, high = _where_inserted(before, after)
            moved = [*range(low), *[None] * (high - low), *range(high + after.width - before.width, after.width)]
            places = [None if place is None else moved[place] for place in places]
            by_width[after.width] = places
        first = sum(place == n for n, place in enumerate(places))
        last = sum(place == n for n, place in enumerate(places, start=parts[-1].width - width))
        if not first + last:
            return False
        self._places, self.left_out = by_width, odd
        counts = {"cells": parts[-1].width, "columns": width, "first": first, "last": last}
        self.assumed["grown rows"] = {"line": str(parts[1].line), **{name: str(n) for name, n in counts.items()}}
        return True

    def too_many(self, torn: _TornRows) -> str:
        """Return the line about rows with more cells than the header has."""
        commas = self._dialect.separator == "," and all(NUMBER.fullmatch(cell) for cell in torn.cells)
        hint = " (are these decimal commas? They need ; between the columns, or quotes)" if commas else ""
        if torn.count > 1:
            hint += (
                f", and {torn.count} rows have more cells than the header, which has {torn.most}. Complete the header"
            )
        place = f"line {torn.line}, column {torn.most + 1} = {shown(torn.cells[torn.most])}"
        return f"{self.path}, {place}: there is no such column{hint}"


@dataclass
class _Part:
    """Rows of a file with the same number of cells."""

    line: int
    """The line of the first one."""
    width: int
    count: int = 0
    first: list[list[str]] = field(default_factory=list)
    last: deque[list[str]] = field(default_factory=lambda: deque(maxlen=_COMPARED_ROWS))

    def add(self, row: list[str]) -> None:
        """Add a row. Only the first and the last ones are kept."""
        self.count += 1
        self.last.append(row)
        if len(self.first) < _COMPARED_ROWS:
            self.first.append(row)


def _where_inserted(before: _Part, after: _Part) -> tuple[int, int]:
    """Return the first and the last place at which the cells may have been inserted that make the rows longer.

    A place is judged by the number of columns that would not go on as before. One of them is no proof, because a sensor
    may begin or end just then.
    """
    more = after.width - before.width
    old, new = [*zip(*before.last, strict=True)], [*zip(*after.first, strict=True)]
    stay = [_differ(column, new[n]) for n, column in enumerate(old)]
    move = [_differ(column, new[n + more]) for n, column in enumerate(old)]
    misfits = [sum(stay[:place]) + sum(move[place:]) for place in range(before.width + 1)]
    if min(misfits) > _MOST_MISFITS * before.width:
        return 0, before.width
    likely = [place for place, count in enumerate(misfits) if count <= min(misfits) + 1]
    return likely[0], likely[-1]


def _differ(old: Sequence[str], new: Sequence[str]) -> bool:
    """Return True if cells can hardly be of the same column: they have other forms, or their numbers lie far apart."""
    filled = [[cell for cell in cells if not _is_missing(cell)] for cells in (old, new)]
    forms = [{_form(cell) for cell in cells} for cells in filled]
    if not all(forms) or forms[0].isdisjoint(forms[1]):
        return all(forms)
    numbers = [[float(cell) for cell in cells if NUMBER.fullmatch(cell)] for cells in filled]
    if not all(numbers):
        return False
    (low, high), (least, most) = ((min(own), max(own)) for own in numbers)
    return max(least - high, low - most) > (high - low) + (most - least)


def _form(cell: str) -> tuple[str, int]:
    """Return the form of a cell: its characters that are no digits, and the number of decimals."""
    whole, _, decimals = cell.lstrip("+-").rpartition(".") if "." in cell else (cell.lstrip("+-"), "", "")
    return re.sub("[0-9]+", "9", whole), len(decimals)


# ---- Cells -----------------------------------------------------------------------------------------------------------


def _is_blank(text: str) -> bool:
    """Return True if a cell stands for a missing number."""
    return text.casefold() in _BLANKS


def _number(text: str) -> float | None:
    """Return a text as a finite number, or None."""
    number = float(text) if NUMBER.fullmatch(text) else nan
    return number if isfinite(number) else None


def _value(text: str, exists: bool, file_column: FileColumn, loose: bool) -> float:
    """Return the number of a cell in the first unit. Raises ValueError with only the reason.

    `exists` is False for a cell that its row does not have.
    """
    column, factor = file_column.column, file_column.factor
    if _is_blank(text) and (loose or (column.blanks and (exists or column.optional))):
        return nan
    if not text:
        raise ValueError("this cell is missing; leave out the row if nothing was measured")
    if (number := _number(text)) is None:
        if column.parse:
            with suppress(ValueError):
                return column.parse(text)
        if loose:
            return nan
        raise ValueError(_why_no_number(text))
    value = file_column.convert(number)
    if file_column.unit not in column.conversions:
        _check_bounds(value, column, factor)
    return value


def _why_no_number(text: str) -> str:
    """Return what a cell must be that is not a number."""
    hint = ""
    if THOUSANDS.fullmatch(text):
        hint = " without a comma, which may separate decimals or thousands here"
    elif ";" in text or "\t" in text:
        hint = "; what separates the cells must be the same as in the header"
    elif not any(map(str.isdigit, text)):
        hint = "; leave out the row if nothing was measured"
    return f"must be a number{hint}"


def _check_bounds(value: float, column: Column, factor: float) -> None:
    """Raise ValueError if a value is out of the bounds of its column, which the message gives in the file's unit."""
    lower, upper = ("least", "most") if factor > 0.0 else ("most", "least")
    if column.minimum is not None and value < column.minimum:
        raise ValueError(f"must be at {lower} {column.minimum * factor:g}")
    if column.maximum is not None and value > column.maximum:
        raise ValueError(f"must be at {upper} {column.maximum * factor:g}")
    if 0.0 < abs(value) < column.least:
        least = column.least * abs(factor)
        raise ValueError(f"must be 0, or {least:g} at least, or {-least:g} at most")


def _why_no_variable(header: Sequence[str], place: int, why_wrong: Callable[[str], str | None]) -> str | None:
    """Return what is wrong with a name above a column of variables over time, or None."""
    name = header[place]
    if name in header[:place]:
        return "this column occurs twice"
    if place and _UNIT.search(name):
        return f"must be {shown(_UNIT.sub('', name))} without a unit; a command of 30 % is 0.3 here"
    if (unit := _UNIT.search(name)) and unit[0] != " [s]":
        return "must be the time in s, which is the unit here"
    return why_wrong(name) if place else None


# ---- Headers ---------------------------------------------------------------------------------------------------------


def _find_columns(
    path: Path, line: int, header: list[str], columns: Mapping[str, Column], others: bool, hint: str
) -> dict[int, FileColumn]:
    """Return the columns that are read, by their index in the header. Raises DataFileError."""
    known = KnownColumns(columns)
    if not any(_may_be_header(title, known) for title in header[:_MOST_COMPARED]):
        raise DataFileError(
            f"{path}, line {line} = {shown(', '.join(header))}: {_why_no_header(header, columns, hint)}"
        )
    file_columns: dict[int, FileColumn] = {}
    names: set[str] = set()
    wrong = []
    for place, title in enumerate(header):
        try:
            if column := known.find(title, others):
                if column.name in names:
                    raise ValueError("this column occurs twice")
                file_columns[place] = column
                names.add(column.name)
        except ValueError as error:
            wrong.append(f"{path}, line {line}, column {place + 1} = {shown(title)}: {error}")
    missing = {name: column for name, column in columns.items() if name not in names and not column.optional}
    if missing and not wrong:
        reason = _what_lacks(missing, _others(header, file_columns), hint)
        wrong.append(f"{path}, line {line}: {reason}")
    if wrong:
        raise DataFileError(*wrong[:MOST])
    return file_columns


def _why_no_header(header: Sequence[str], columns: Mapping[str, Column], hint: str) -> str:
    """Return what the first line of a file must be, none of whose headers is known."""
    needed = ", ".join(_title(name, column) for name, column in columns.items() if not column.optional)
    if all(any(map(str.isalpha, title)) for title in header):
        return f"none of these headers is known; the first line must have the headers {needed}{hint}"
    return f"the first line must be a header that names the columns, such as {needed}"


def _others(header: Sequence[str], read: Container[int]) -> list[str]:
    """Return the headers of the columns that are not read."""
    return [title for place, title in enumerate(header) if place not in read]


def _what_lacks(missing: Mapping[str, Column], others: Iterable[str], hint: str) -> str:
    """Return words about the columns that are missing, with the other headers that may be meant by them."""
    unread = {_name_and_unit(title)[0]: title for title in others}
    first, *more = (repr(_title(name, column)) for name, column in missing.items())
    reason = ", and so is ".join([f"{first} is missing", *more])
    if near := [shown(unread[name]) for wanted in missing for name in similar(wanted, [*unread][:_MOST_COMPARED])]:
        return f"{reason}; is it the column {' or '.join(near)}?"
    return reason + (f". The other columns are {brief(', '.join(map(repr, unread.values())))}" if unread else "") + hint


class KnownColumns:
    """The columns that a file may have, by their names, so that a header is found without a look at all."""

    def __init__(self, columns: Mapping[str, Column]) -> None:
        self._columns = columns
        self.keys: dict[str, dict[str, None]] = {}
        """The columns that may have a name, by the name as it is compared."""
        for key, column in columns.items():
            for name in (key, *column.also):
                self.keys.setdefault(_folded(name), {})[key] = None

    def find(self, title: str, others: bool) -> FileColumn | None:
        """Return the column with this header, or None if it is not read. Raises ValueError with only the reason.

        A header that begins with a minus sign is that of a column with the opposite sign.
        """
        name, unit_and_numbers = _name_and_unit(title.removeprefix("-"))
        word, *numbers = unit_and_numbers.split() or [""]
        keys = self.keys.get(name, {})
        for key in keys:
            column = self._columns[key]
            unit = next((unit for unit in _units(column) if unit.casefold() == word.casefold()), None)
            if unit is not None:
                convert, factor = _conversion(unit, numbers, column)
                if title.startswith("-"):
                    convert, factor = partial(_opposite, convert), -factor
                return FileColumn(key, column, unit, convert, factor, tuple(numbers))
        if key := next((key for key in keys if _folded(key) == name and "" not in self._columns[key].units), ""):
            raise ValueError(f"must be {' or '.join(repr(f'{key} [{unit}]') for unit in _units(self._columns[key]))}")
        if others:
            return None
        titles = {key: _title(key, column) for key, column in self._columns.items()}
        known = ", ".join(titles.values())
        raise ValueError(f"there is no such column, but {known}{did_you_mean(name, (), also=titles)}")

    def has(self, title: str, *, in_any_unit: bool = False) -> bool:
        """Return True if a file may have a column with this header; or with its name, in a unit that is not known."""
        try:
            return self.find(title, others=True) is not None
        except ValueError:
            return in_any_unit


def _name_and_unit(title: str) -> tuple[str, str]:
    """Return the name and the unit in a header; the unit is empty if there is none."""
    match = _HEADER.fullmatch(title)
    return _folded(match["name"] if match else title), match["unit"] if match else ""


def _may_be_header(title: str, columns: KnownColumns) -> bool:
    """Return True if a title has a unit, or a name that is similar to that of a column."""
    name, unit = _name_and_unit(title)
    return bool(unit) or bool(similar(name, columns.keys))


def _conversion(unit: str, numbers: list[str], column: Column) -> tuple[Conversion, float]:
    """Return the conversion to the first unit, and how many of the given unit make one of the first."""
    if unit in column.conversions:
        parameters = tuple(n for n in map(_number, numbers) if n is not None)
        if len(parameters) < len(numbers):
            raise ValueError(f"only numbers may follow {unit}")
        return column.conversions[unit](parameters), 1.0
    if numbers:
        raise ValueError(f"must be [{unit}] alone")
    factor = column.units[unit]
    return partial(_divided, factor), factor


def _divided(by: float, number: float) -> float:
    return number / by


def _opposite(convert: Conversion, number: float) -> float:
    return -convert(number)


def _folded(text: str) -> str:
    """Return a name without differences of case and space."""
    return " ".join(text.casefold().split())


def _units(column: Column) -> list[str]:
    """Return all units that a column may have."""
    return [*column.units, *column.conversions]


def _title(name: str, column: Column) -> str:
    """Return the header of a column in its first unit."""
    return f"{name} [{next(iter(column.units))}]".removesuffix(" []")


FORCE_UNITS = {"N": 1.0, "kgf": 1.0 / 9.80665, "lbf": 1.0 / 4.4482216152605}
"""The units of a force, as files spell them, and 1 N in each."""

# ---- Pulses ----------------------------------------------------------------------------------------------------------

NEUTRAL, SPAN = 1500.0, 400.0
"""The pulse that stops a thruster, and the distance from it to full thrust, µs (ArduSub, T200)."""
NO_OUTPUT = (0.0, 65535.0)
"""The values that autopilots log where they give no pulse, µs."""
PULSES = ("us", "µs")
"""The unit of a pulse, as files spell it."""


def pulses(numbers: tuple[float, ...] = ()) -> Conversion:
    """Return the conversion of a pulse (µs) to a command that is not yet saturated. Raises ValueError.

    The numbers are neutral and span. Neutral is 0 where pulses are given relative to it. The span is negative for a
    thruster that turns in the opposite direction.
    """
    neutral, span = numbers if len(numbers) == 2 else (NEUTRAL, 0.0 if numbers else SPAN)
    if span == 0.0:
        raise ValueError("must be [us], or [us NEUTRAL SPAN] with a span other than 0, such as [us 1500 400]")
    return partial(_command, neutral, span)


def _command(neutral: float, span: float, pulse: float) -> float:
    """Return a command. A pulse within the span is one, even if it has a value of `NO_OUTPUT`."""
    command = (pulse - neutral) / span
    return 0.0 if pulse in NO_OUTPUT and abs(command) > 1.0 else command


# ---- Forces as commands ----------------------------------------------------------------------------------------------


def shares(numbers: tuple[float, ...] = ()) -> Conversion:
    """Return the conversion of a force to the share of the force at full command, which is the only number. Raises
    ValueError."""
    if len(numbers) != 1 or numbers[0] <= 0.0:
        raise ValueError("must be a unit of force with the force at full command, such as [N 50]")
    return partial(_divided, numbers[0])


COMMANDS = dict.fromkeys(PULSES, pulses) | dict.fromkeys((*FORCE_UNITS, "N.m"), shares)
"""The units of commands that need more than a factor."""
BEYOND = "is beyond full thrust; [us NEUTRAL SPAN] states another range of pulses, such as [us 0 400] for offsets"
"""The reason against such a command in a table."""
