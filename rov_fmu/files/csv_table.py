"""CSV files of numbers, as spreadsheets and loggers save them; one clear line for whatever is wrong with one."""

import csv
import io
import re
from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass
from math import isfinite, nan
from pathlib import Path

from rov_fmu.files.messages import FileError, brief, shown
from rov_fmu.files.reading import read_text

_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,3})?")
_HEADER = re.compile(r"(?P<name>[^\[\]]+?)\s*\[(?P<unit>[^\[\]]+)\]")


class DataFileError(FileError):
    """A file of data that cannot be used: one line with file, line, column, value and reason."""


@dataclass(frozen=True)
class Column:
    """A column that may stand in a file: its units, how many of each make one of the first, what it may hold."""

    units: Mapping[str, float]
    optional: bool = False
    blanks: bool = False
    """Whether its cells may be empty; they read as NaN, as do those that a row of an optional column lacks."""
    minimum: float | None = None
    maximum: float | None = None
    """In the first unit."""
    least: float = 0.0
    """Magnitude, of a number other than zero; in the first unit."""


@dataclass(frozen=True)
class Columns:
    """The numbers of a file in the first unit of each column, and the line that each row stands on."""

    path: Path
    headers: Mapping[str, str]
    """As they stand there, by column."""
    texts: Mapping[str, list[str]]
    """The cells as they stand there."""
    values: Mapping[str, list[float]]
    lines: list[int]

    def error(self, row: int, column: str, reason: str) -> DataFileError:
        """The one line for a number that cannot be."""
        header, text = shown(self.headers[column]), brief(self.texts[column][row])
        return DataFileError(f"{self.path}, line {self.lines[row]}, column {header} = {text}: {reason}")


def read_columns(path: Path, columns: Mapping[str, Column], *, others: bool = False) -> Columns:
    """Read the columns, in any order, with headers such as `command [%]`. Raises DataFileError.

    `others` lets the file have columns besides, which are not read.
    """
    lines = _csv_lines(path)
    line, header = next(lines, (1, []))
    read: dict[int, tuple[str, float, Column]] = {}
    for place, title in enumerate(header):
        try:
            if found := _column(title, columns, [name for name, *_ in read.values()], others):
                read[place] = found
        except ValueError as error:
            raise DataFileError(f"{path}, line {line}, column {place + 1} = {shown(title)}: {error}") from None
    names = [name for name, *_ in read.values()]
    for name, column in columns.items():
        if name not in names and not column.optional:
            raise DataFileError(f"{path}, line {line}, column {len(header) + 1}: {_title(name, column)!r} is missing")
    headers = {name: header[place] for place, (name, *_) in read.items()}
    table = Columns(path, headers, {name: [] for name in names}, {name: [] for name in names}, [])
    for line, cells in lines:
        if len(cells) > len(header):
            text = shown(cells[len(header)])
            raise DataFileError(f"{path}, line {line}, column {len(header) + 1} = {text}: there is no such column")
        for place, (name, per, column) in read.items():
            text = cells[place] if place < len(cells) else ""
            try:
                if place >= len(cells) and not column.optional:
                    raise ValueError("this cell is missing")
                table.values[name].append(_value(text, per, column))
            except ValueError as error:
                value = f" = {shown(text)}" if text else ""
                raise DataFileError(f"{path}, line {line}, column {shown(header[place])}{value}: {error}") from None
            table.texts[name].append(text)
        table.lines.append(line)
    if not table.lines:
        raise DataFileError(f"{path}, line {line}: no rows below the header")
    return table


def _csv_lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Number and cells of every line that is not blank."""
    reader = csv.reader(io.StringIO(read_text(path, DataFileError), newline=""), strict=True)
    try:
        for cells in reader:
            if any(map(str.strip, cells)):
                yield reader.line_num, [cell.strip() for cell in cells]
    except csv.Error as error:
        raise DataFileError(f"{path}, line {reader.line_num}: {error}") from error


def _column(
    title: str, columns: Mapping[str, Column], above: Container[str], others: bool
) -> tuple[str, float, Column] | None:
    """Name, unit and column of a header; None for one that is not read. Raises ValueError with the reason alone."""
    match = _HEADER.fullmatch(title)
    name = match["name"] if match else title
    if name not in columns:
        if others:
            return None
        known = ", ".join(_title(n, c) for n, c in columns.items())
        raise ValueError(f"there is no such column, but {known}")
    column = columns[name]
    if not match or match["unit"] not in column.units:
        raise ValueError(f"must be {' or '.join(repr(f'{name} [{unit}]') for unit in column.units)}")
    if name in above:
        raise ValueError("there is such a column before")
    return name, column.units[match["unit"]], column


def _title(name: str, column: Column) -> str:
    return f"{name} [{next(iter(column.units))}]"


def _value(text: str, per: float, column: Column) -> float:
    """The number of a cell in the first unit. Raises ValueError with the reason alone."""
    if not text:
        if column.blanks:
            return nan
        raise ValueError("this cell is missing")
    if not _NUMBER.fullmatch(text) or not isfinite(plain := float(text)):
        raise ValueError("must be a number")
    value = plain / per
    if column.minimum is not None and value < column.minimum:
        raise ValueError(f"must be at least {column.minimum * per:g}")
    if column.maximum is not None and value > column.maximum:
        raise ValueError(f"must be at most {column.maximum * per:g}")
    if 0.0 < abs(value) < column.least:
        raise ValueError(f"must be 0, or {column.least * per:g} at least, or {-column.least * per:g} at most")
    return value
