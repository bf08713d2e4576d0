"""CSV files of numbers, as spreadsheets and loggers save them; one clear line for whatever is wrong with one."""

import csv
import re
from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice
from math import isfinite, isnan, nan
from pathlib import Path

from rov_fmu.io.messages import MOST, FileError, brief, did_you_mean, shown, similar
from rov_fmu.io.reading import read_lines

_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,3})?")
_HEADER = re.compile(r"(?P<name>[^\[\]]+?)\s*\[(?P<unit>[^\[\]]+)\]")
_BLANKS = ("", "-", "nan")
LARGEST = 500_000_000
"""Bytes of a file; numbers and lines take up to a few times its size in memory."""

Conversion = Callable[[float], float]


class DataFileError(FileError):
    """A file of data that cannot be used: a line each with file, line, column, value and reason."""


@dataclass(frozen=True)
class Column:
    """A column that may stand in a file: its units, how many of each make one of the first, what it may hold."""

    units: Mapping[str, float]
    optional: bool = False
    blanks: bool = False
    """Whether its cells may be empty, `-` or `nan`; they read as NaN, as do those that a row of an optional column
    lacks."""
    minimum: float | None = None
    maximum: float | None = None
    """In the first unit."""
    least: float = 0.0
    """Magnitude, of a number other than zero; in the first unit."""
    also: tuple[str, ...] = ()
    """Other names of it, where the unit is one of these."""
    conversions: Mapping[str, Callable[[tuple[float, ...]], Conversion]] = field(default_factory=dict)
    """Units that are no mere factor. Numbers may follow them, `[us 1500 400]`, and tell the conversion to the first
    unit; ValueError with the reason where they cannot. The bounds are not for them."""


@dataclass(frozen=True)
class Columns:
    """The numbers of a file in the first unit of each column, and the line that each row stands on."""

    path: Path
    headers: Mapping[str, str]
    """As they stand there, by column."""
    units: Mapping[str, str]
    """By column, without the numbers that may follow one."""
    values: Mapping[str, "array[float]"]
    lines: "array[int]"
    unread: Mapping[str, int]
    """Of a loose reading, by column: how many cells are neither numbers nor blank; they read as NaN."""
    torn: int
    """Of a loose reading: how many rows were left out, as they have more cells than the header."""
    rows: Callable[[], Iterator[Mapping[str, str]]]
    """Parses the file once more: the cells of each row by column. To keep these texts would take far more memory."""

    def texts(self, *columns: str) -> Iterator[tuple[str, ...]]:
        """The cells of some columns, row by row, as they stand there, but with decimal points; blanks are empty."""
        for cells, *values in zip(self.rows(), *(self.values[column] for column in columns), strict=True):
            yield tuple("" if isnan(value) else cells[column] for column, value in zip(columns, values, strict=True))

    def error(self, row: int, column: str, reason: str) -> DataFileError:
        """The one line for a number that cannot be."""
        header, text = shown(self.headers[column]), brief(next(islice(self.texts(column), row, None))[0])
        return DataFileError(f"{self.path}, line {self.lines[row]}, column {header} = {text}: {reason}")


@dataclass(frozen=True)
class _Found:
    """A column of the file at hand."""

    name: str
    column: Column
    unit: str
    convert: Conversion
    per: float


def read_columns(
    path: Path,
    columns: Mapping[str, Column],
    *,
    others: bool = False,
    loose: bool = False,
    check_header: Callable[[Mapping[str, str], Iterable[str]], Iterable[str]] = lambda _, __: (),
) -> Columns:
    """Read the columns, in any order, with headers such as `command [%]`. Raises DataFileError with all that is wrong.

    `others` lets the file have columns besides, which are not read. `loose` is for logs: a cell that is missing or no
    number reads as NaN, and a row with too many cells is left out. `check_header` is called before any row is read,
    with the headers that are read, by column, and with all other headers; it yields what is wrong with them.
    """
    opened = read_lines(path, DataFileError, most=LARGEST)
    separator = _separator(opened())
    lines = _csv_lines(path, opened(), separator)
    line, header = next(lines, (1, []))
    if not header:
        raise DataFileError(f"{path}: the file is empty")
    found = _header(path, line, header, columns, others)
    headers = {column.name: header[place] for place, column in found.items()}
    if reasons := [*check_header(headers, [title for n, title in enumerate(header) if n not in found])]:
        raise DataFileError(*(f"{path}, line {line}: {reason}" for reason in reasons))

    def by_column(cells: list[str]) -> dict[str, str]:
        plain = (_plain(cells[place], separator) if place < len(cells) else "" for place in found)
        return dict(zip(names, plain, strict=True))

    def rows() -> Iterator[Mapping[str, str]]:
        below = islice(_csv_lines(path, opened(), separator), 1, None)
        return (by_column(cells) for _, cells in below if len(cells) <= len(header))

    names = [column.name for column in found.values()]
    values = {name: array("d") for name in names}
    numbers = array("L")
    unread = dict.fromkeys(names, 0)
    torn, wrong = _Mistakes(), _Mistakes()
    for line, cells in lines:
        if len(cells) > len(header):
            told = (
                f"{path}, line {line}, column {len(header) + 1} = {shown(cells[len(header)])}: there is no such column"
            )
            (torn if loose else wrong).add(f"{told}{_comma_hint(cells, separator)}")
            continue
        numbers.append(line)
        for (place, column), cell in zip(found.items(), by_column(cells).values(), strict=True):
            try:
                value = _value(cell, place < len(cells), column, loose)
            except ValueError as error:
                told = f" = {shown(cell)}" if cell else ""
                wrong.add(f"{path}, line {line}, column {shown(header[place])}{told}: {error}")
                continue
            values[column.name].append(value)
            unread[column.name] += isnan(value) and not _is_blank(cell)
    if torn.count > len(numbers):
        wrong.add(torn.first[0])
    if wrong.count:
        more = wrong.count - len(wrong.first)
        raise DataFileError(*wrong.first, *([f"{path}: {more} more"] if more else []))
    if not numbers:
        raise DataFileError(f"{path}, line {line}: no rows below the header")
    units = {column.name: column.unit for column in found.values()}
    return Columns(path, headers, units, values, numbers, unread, torn.count, rows)


class _Mistakes:
    """The first mistakes, and how many there are."""

    def __init__(self) -> None:
        self.first: list[str] = []
        self.count = 0

    def add(self, line: str) -> None:
        """Count one more, and keep the line if it is among the first."""
        self.count += 1
        if self.count <= MOST:
            self.first.append(line)


# ---- Cells -----------------------------------------------------------------------------------------------------------


def _separator(lines: Iterable[str]) -> str:
    """What parts the cells: whichever of comma, semicolon and tabulator the header has most of."""
    header = next(filter(str.strip, lines), "")
    return max(",;\t", key=header.count)


def _csv_lines(path: Path, lines: Iterable[str], separator: str) -> Iterator[tuple[int, list[str]]]:
    """Number and cells of every line that is not blank; without blank cells at the end that the header lacks."""
    reader = csv.reader(lines, delimiter=separator, strict=True)
    width = 0
    try:
        for row in reader:
            cells = [cell.strip() for cell in row]
            if any(cells):
                while len(cells) > width and not cells[-1]:
                    cells.pop()
                width = width or len(cells)
                yield reader.line_num, cells
    except csv.Error as error:
        raise DataFileError(f"{path}, line {reader.line_num}: {error}") from error


def _plain(text: str, separator: str) -> str:
    """With a decimal point, where a decimal comma can be told from what parts the cells."""
    with_point = text.replace(",", ".", 1)
    return with_point if separator != "," and _NUMBER.fullmatch(with_point) else text


def _comma_hint(cells: list[str], separator: str) -> str:
    commas = separator == "," and all(_NUMBER.fullmatch(cell) for cell in cells)
    return " (are these decimal commas? They need ; between the columns)" if commas else ""


def _is_blank(text: str) -> bool:
    return text.casefold() in _BLANKS


def _number(text: str) -> float | None:
    number = float(text) if _NUMBER.fullmatch(text) else nan
    return number if isfinite(number) else None


def _value(text: str, there: bool, found: _Found, loose: bool) -> float:
    """The number of a cell in the first unit. Raises ValueError with the reason alone."""
    column, per = found.column, found.per
    if _is_blank(text) and (loose or (column.blanks and (there or column.optional))):
        return nan
    if not text:
        raise ValueError("this cell is missing")
    if (number := _number(text)) is None:
        if loose:
            return nan
        commas = "," in text and _NUMBER.fullmatch(text.replace(",", ".", 1))
        hint = " with a decimal point, unless ; parts the columns" if commas else ""
        hint = hint or ("; what separates the cells must be the same as in the header" if set(text) & {*";\t"} else "")
        raise ValueError(f"must be a number{hint}")
    value = found.convert(number)
    if found.unit in column.conversions:
        return value
    if column.minimum is not None and value < column.minimum:
        raise ValueError(f"must be at least {column.minimum * per:g}")
    if column.maximum is not None and value > column.maximum:
        raise ValueError(f"must be at most {column.maximum * per:g}")
    if 0.0 < abs(value) < column.least:
        raise ValueError(f"must be 0, or {column.least * per:g} at least, or {-column.least * per:g} at most")
    return value


# ---- Headers ---------------------------------------------------------------------------------------------------------


def _header(path: Path, line: int, header: list[str], columns: Mapping[str, Column], others: bool) -> dict[int, _Found]:
    """The columns that are read, by their places."""
    if not any(_may_be(title, columns) for title in header):
        needed = ", ".join(_title(name, column) for name, column in columns.items() if not column.optional)
        reason = f"the first line must be a header that names the columns, such as {needed}"
        raise DataFileError(f"{path}, line {line} = {shown(', '.join(header))}: {reason}")
    found: dict[int, _Found] = {}
    wrong = []
    for place, title in enumerate(header):
        try:
            if column := _column(title, columns, others):
                if any(column.name == before.name for before in found.values()):
                    raise ValueError("there is such a column before")
                found[place] = column
        except ValueError as error:
            wrong.append(f"{path}, line {line}, column {place + 1} = {shown(title)}: {error}")
    names = {column.name for column in found.values()}
    missing = {name: column for name, column in columns.items() if name not in names and not column.optional}
    if missing and not wrong:
        titles = ", and so is ".join(_is_missing([repr(_title(*of)) for of in missing.items()]))
        unread = {_name_and_unit(title)[0]: title for place, title in enumerate(header) if place not in found}
        near = [unread[name] for wanted in missing for name in similar(wanted, unread)]
        hint = f"; is it the column {' or '.join(map(shown, near))}?" if near else ""
        wrong.append(f"{path}, line {line}, column {len(header) + 1}: {titles}{hint}")
    if wrong:
        raise DataFileError(*wrong[:MOST])
    return found


def _is_missing(titles: list[str]) -> list[str]:
    return [f"{titles[0]} is missing", *titles[1:]]


def _column(title: str, columns: Mapping[str, Column], others: bool) -> _Found | None:
    """The column of a header, in any case; None for one that is not read. Raises ValueError with the reason alone."""
    name, unit_words = _name_and_unit(title)
    word, *numbers = unit_words.split() or [""]
    for key, column in columns.items():
        if name in map(_folded, (key, *column.also)) and (unit := _unit(word, column)):
            return _Found(key, column, unit, *_conversion(unit, numbers, column))
    for key, column in columns.items():
        if _folded(key) == name:
            raise ValueError(f"must be {' or '.join(repr(f'{key} [{unit}]') for unit in _units(column))}")
    if others:
        return None
    titles = {key: _title(key, column) for key, column in columns.items()}
    known = ", ".join(titles.values())
    raise ValueError(f"there is no such column, but {known}{did_you_mean(name, (), also=titles)}")


def _name_and_unit(title: str) -> tuple[str, str]:
    """The name and the unit in a header; the unit is empty where there is none."""
    match = _HEADER.fullmatch(title)
    return _folded(match["name"] if match else title), match["unit"] if match else ""


def _may_be(title: str, columns: Mapping[str, Column]) -> bool:
    """Whether a title has the name of a column, or a similar one, or at least the form of a header with a unit."""
    name, unit = _name_and_unit(title)
    names = [_folded(known) for key, column in columns.items() for known in (key, *column.also)]
    return bool(unit) or bool(similar(name, names))


def _conversion(unit: str, numbers: list[str], column: Column) -> tuple[Conversion, float]:
    """From a number of the file to the first unit, and how many of its unit make one of the first."""
    if unit in column.conversions:
        given = tuple(n for n in map(_number, numbers) if n is not None)
        if len(given) < len(numbers):
            raise ValueError(f"only numbers may follow {unit}")
        return column.conversions[unit](given), 1.0
    if numbers:
        raise ValueError(f"must be [{unit}] alone")
    per = column.units[unit]
    return lambda number: number / per, per


def _folded(text: str) -> str:
    return " ".join(text.casefold().split())


def _units(column: Column) -> list[str]:
    return [*column.units, *column.conversions]


def _unit(word: str, column: Column) -> str | None:
    """The unit as the column names it."""
    return next((unit for unit in _units(column) if unit.casefold() == word.casefold()), None)


def _title(name: str, column: Column) -> str:
    return f"{name} [{next(iter(column.units))}]"
