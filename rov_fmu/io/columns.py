"""Reading the columns of tables whose headers have units, such as `command [%]`; each mistake gives one line."""

from array import array
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from itertools import islice
from math import isnan, nan
from pathlib import Path
from types import MappingProxyType

from rov_fmu.io.csv_table import (
    HEADER,
    NO_ROWS,
    THOUSANDS,
    CsvFile,
    DataFileError,
    FindGrown,
    Mistakes,
    OpenStream,
    is_blank,
    number_of,
    read_numbers,
)
from rov_fmu.io.messages import MOST, brief, did_you_mean, shown, similar

_MOST_COMPARED = 1000
"""The largest number of headers that are compared with all known names, which takes long."""
Conversion = Callable[[float], float]
"""The conversion of a number. It can be sent to the child process that reads a log."""


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
    numbers: Mapping[str, "array[float]"]
    """The numbers as they stand in the file, by column, of those whose unit needs more than a factor."""
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
        where = f"line {self.lines[row]}, column {shown(self.headers[column])}"
        return DataFileError(f"{self.path}, {where} = {brief(text)}: {reason}")


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
    grown: FindGrown = lambda _: None,
    open_stream: OpenStream | None = None,
) -> Columns:
    """Read the columns, in any order, with headers such as `command [%]`. Raises DataFileError with all mistakes.

    With `others`, the file may have other columns, which are not read. `loose` is for logs: a cell that is missing or
    not a number becomes NaN, and a row with too many cells is left out. `renamed` has other headers for some of those
    of the file. `hint` ends the messages about missing columns. `check_header` is called before the rows are
    read, with the headers that are read, by column, and with all other headers; it returns the mistakes in them.
    `grown` finds the columns where rows have more cells than the header. `open_stream` opens the lines of a table that
    is not the text of the file itself.
    """
    file = CsvFile(path, open_stream)
    line, titles = next(iter(file))
    header = [*map(renamed.get, titles, titles)]
    file_columns = _find_columns(path, line, header, columns, others, hint)
    headers = {column.name: header[index] for index, column in file_columns.items()}
    wrong = Mistakes(path)
    for reason in check_header(headers, _others(header, file_columns)):
        wrong.add(f"{path}, line {line}: {reason}")
    wrong.check()
    cells = {index: (column.name, partial(_value, column, loose)) for index, column in file_columns.items()}
    values, lines, unread, torn = read_numbers(file, header, cells, _content, loose=loose)
    if torn.count and file.align(grown):
        values, lines, unread, torn = read_numbers(file, header, cells, _content, loose=loose)
    special = [column for column in file_columns.values() if column.unit in column.column.conversions]
    numbers = {column.name: values[column.name] for column in special}
    values |= {column.name: array("d", map(column.convert, numbers[column.name])) for column in special}
    if torn.count > len(lines):
        raise DataFileError(file.too_many(torn))
    if not lines:
        raise DataFileError(f"{path}, line {line}: {NO_ROWS}")
    return Columns(
        path,
        titles,
        headers,
        {column.name: " ".join([column.unit, *column.numbers]) for column in file_columns.values()},
        {column.name: column.convert for column in file_columns.values()},
        values,
        numbers,
        lines,
        unread,
        torn.count + file.left_out,
        file.assumed,
        partial(_rows, file, file_columns, len(header)),
    )


def _rows(file: CsvFile, file_columns: Mapping[int, FileColumn], width: int) -> Iterator[Mapping[str, str]]:
    """Yield the cells of each row that has not more of them than the header, by column; one that it lacks is empty."""
    for _, cells in islice(file, 1, None):
        if len(cells) <= width:
            yield {one.name: cells[index] if index < len(cells) else "" for index, one in file_columns.items()}


def _content(cell: str) -> str:
    """Return the content of a cell for a message; empty for an empty cell."""
    return f" = {shown(cell)}" if cell else ""


def _value(file_column: FileColumn, loose: bool, text: str, exists: bool) -> float:
    """Return the number of a cell in the first unit, or as it stands there if its unit needs more than a factor. Raises
    ValueError with only the reason.

    `exists` is False for a cell that its row does not have.
    """
    column, factor = file_column.column, file_column.factor
    if is_blank(text) and (loose or (column.blanks and (exists or column.optional))):
        return nan
    if not text:
        raise ValueError("this cell is missing; leave out the row if nothing was measured")
    if (number := number_of(text)) is None:
        if column.parse:
            with suppress(ValueError):
                return column.parse(text)
        if loose:
            return nan
        raise ValueError(_why_no_number(text))
    if file_column.unit in column.conversions:
        return number
    value = file_column.convert(number)
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


def _find_columns(
    path: Path, line: int, header: list[str], columns: Mapping[str, Column], others: bool, hint: str
) -> dict[int, FileColumn]:
    """Return the columns that are read, by their index in the header. Raises DataFileError."""
    known = KnownColumns(columns)
    if not any(_may_be_header(title, known) for title in header[:_MOST_COMPARED]):
        needed = ", ".join(_title(name, column) for name, column in columns.items() if not column.optional)
        reason = f"none of these headers is known; the first line must have the headers {needed}{hint}"
        raise DataFileError(f"{path}, line {line} = {shown(', '.join(header))}: {reason}")
    file_columns: dict[int, FileColumn] = {}
    names: set[str] = set()
    wrong = []
    for index, title in enumerate(header):
        try:
            if column := known.find(title, others):
                if column.name in names:
                    raise ValueError("this column occurs twice")
                file_columns[index] = column
                names.add(column.name)
        except ValueError as error:
            wrong.append(f"{path}, line {line}, column {index + 1} = {shown(title)}: {error}")
    missing = {name: column for name, column in columns.items() if name not in names and not column.optional}
    if missing and not wrong:
        reason = _what_lacks(missing, _others(header, file_columns), hint)
        wrong.append(f"{path}, line {line}: {reason}")
    if wrong:
        raise DataFileError(*wrong[:MOST])
    return file_columns


def _others(header: Sequence[str], read: Container[int]) -> list[str]:
    """Return the headers of the columns that are not read."""
    return [title for index, title in enumerate(header) if index not in read]


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
        titles = self.titles
        known = ", ".join(titles.values())
        raise ValueError(f"there is no such column, but {known}{did_you_mean(name, (), also=titles)}")

    @property
    def titles(self) -> dict[str, str]:
        """A header of each column."""
        return {key: _title(key, column) for key, column in self._columns.items()}

    def has(self, title: str, *, in_any_unit: bool = False) -> bool:
        """Return True if a file may have a column with this header; or with its name, in a unit that is not known."""
        try:
            return self.find(title, others=True) is not None
        except ValueError:
            return in_any_unit


def _name_and_unit(title: str) -> tuple[str, str]:
    """Return the name and the unit in a header; the unit is empty if there is none."""
    match = HEADER.fullmatch(title)
    return _folded(match["name"] if match else title), match["unit"] if match else ""


def _may_be_header(title: str, columns: KnownColumns) -> bool:
    """Return True if a title has a unit, or a name that is similar to that of a column."""
    name, unit = _name_and_unit(title)
    return bool(unit) or bool(similar(name, columns.keys))


def _conversion(unit: str, numbers: list[str], column: Column) -> tuple[Conversion, float]:
    """Return the conversion to the first unit, and how many of the given unit make one of the first."""
    if unit in column.conversions:
        parameters = tuple(n for n in map(number_of, numbers) if n is not None)
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
