"""CSV files of variables over time, with the time in the first column and a variable in each other column."""

import csv
import io
import re
from array import array
from collections.abc import Callable, Iterator, Sequence
from math import isfinite, nan

from rov_fmu.io.messages import FileError, shown

_NUMBER = re.compile(r"[-+0-9.][-+0-9.eE]*")
_UNIT = re.compile(r"\s\[[^\[\]]*\]$")
_WORDS = {"true": 1.0, "false": 0.0}


class Series(dict[str, "array[float]"]):
    """The columns of a CSV file by name; the first is the time."""

    lines: Sequence[int] = ()
    """The line of the file on which each row is."""


def series(text: str, error: Callable[[str], FileError], check_column: Callable[[str], None]) -> Series:
    """Return the columns of a CSV text.

    A mistake raises the exception that `error` returns for its reason. `check_column` may raise one about a name.
    """
    lines = _lines(text, error)
    if (first := next(lines, None)) is None:
        raise error("is empty")
    header = [name.strip() for name in first[1]]
    if all(_NUMBER.fullmatch(name) for name in header):
        raise error("the first line must be a header that names the columns: the time, and then variables")
    if len(header) == 1 and (mark := next((mark for mark in ";\t" if mark in header[0]), None)):
        raise error(f"columns must be separated by commas, not by {shown(mark)}, and numbers must have a decimal point")
    if twice := next((name for name in header if header.count(name) > 1), None):
        raise error(f"column {shown(twice)}: this column occurs twice")
    for name in header[1:]:
        if _UNIT.search(name):
            plain = shown(_UNIT.sub("", name))
            raise error(f"column {shown(name)}: must be {plain} without a unit; a command of 30 % is 0.3 here")
        check_column(name)
    found, numbers = Series({name: array("d") for name in header}), array("L")
    for n, line in lines:
        if len(line) != len(header):
            raise error(f"line {n}: {len(line)} cells below {len(header)} columns")
        for (name, column), cell in zip(found.items(), line, strict=True):
            column.append(number(cell, f"line {n}, column {shown(name)}", error))
        times = found[header[0]]
        if len(times) > 1 and times[-1] < times[-2]:
            raise error(f"line {n}: the time goes back")
        numbers.append(n)
    if not numbers:
        raise error("has no rows below a header")
    if len(header) < 2:
        raise error("has no columns beside the time")
    found.lines = numbers
    return found


def _lines(text: str, error: Callable[[str], FileError]) -> Iterator[tuple[int, list[str]]]:
    """Yield the lines that are not empty, each with its number. They are not kept, because cells take much memory."""
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        yield from ((reader.line_num, line) for line in reader if any(map(str.strip, line)))
    except csv.Error as wrong:
        raise error(f"not CSV: {wrong}") from wrong


def number(text: str, where: str, error: Callable[[str], FileError]) -> float:
    """Return a cell as a finite number; true is 1 and false is 0. Raises the exception that `error` returns."""
    try:
        found = float(_WORDS.get(text.strip().lower(), text))
    except ValueError:
        found = nan
    if not isfinite(found):
        raise error(f"{where} = {shown(text)}: must be a finite number")
    return found
