"""Read tables (CSV) of the force, the steady velocity or the time constant at held commands."""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from rov_fmu.io.csv_table import Column, DataFileError, find_column, read_columns
from rov_fmu.model.layout import Axis
from rov_fmu.tank.columns import (
    FORCE,
    HELD_COMMAND,
    RENAMING,
    VELOCITY_OF_ANY_AXIS,
    refuse_slips,
    time_constant_column,
    velocity_column,
)

TABLES = {"thrust": "force", "steady": "velocity", "time_constant": "time constant"}
"""The words that the name of a table begins with, each with the measured quantity."""
_MOST_LINES = 10
"""The number of wrong rows in a file that get a line of their own."""


@dataclass(frozen=True)
class Row:
    """One measured number: force (N), velocity (m/s, rad/s) or time constant (s) at a held command."""

    file: str
    line: int
    command: float
    value: float


def columns_of(kind: str, axis: Axis | None = None) -> dict[str, Column]:
    """Return the columns of a table. Without an axis, the velocities may be linear or angular."""
    column = FORCE if kind == "thrust" else time_constant_column()
    if kind == "steady":
        column = velocity_column(axis) if axis else VELOCITY_OF_ANY_AXIS
    return {"command": HELD_COMMAND, TABLES[kind]: column}


def read_rows(
    path: Path, kind: str, axis: Axis | None = None, names: Mapping[str, str] = {}
) -> tuple[list[Row], frozenset[str]]:
    """Read rows of a command and a force (`thrust`), velocity (`steady`) or time constant. Raises DataFileError.

    `names` is the table [columns] of rov.toml. Also returns the keys of `names` that the file has.
    """
    name, columns = TABLES[kind], columns_of(kind, axis)
    renamed = dict(_renamed(names, columns))
    table = read_columns(path, columns, renamed=renamed, hint=RENAMING)
    refuse_slips(table, ["command"])
    noise = 0.05 * max(map(abs, table.values[name]))
    numbers = [*zip(table.lines, table.values["command"], table.values[name], strict=True)]
    mistakes = []
    for n, (_, command, value) in enumerate(numbers):
        if kind != "thrust" and command == 0.0:
            mistakes.append(table.error(n, "command", "must not be 0, because nothing moves then"))
        elif reason := _impossible(kind, command, value, noise):
            mistakes.append(table.error(n, name, reason))
    if mistakes:
        more = len(mistakes) - _MOST_LINES
        counted = [f"{path}: {more} more rows like these"] if more > 0 else []
        raise DataFileError(*map(str, mistakes[:_MOST_LINES]), *counted)
    return [Row(path.name, *row) for row in numbers], frozenset(renamed).intersection(table.header)


def _renamed(names: Mapping[str, str], columns: Mapping[str, Column]) -> Iterator[tuple[str, str]]:
    """Yield the entries of [columns] that rename a column of this table. The other entries are for logs."""
    for title, meant in names.items():
        with suppress(ValueError):  # such as a unit that only a log may have
            if find_column(meant, columns, others=True):
                yield title, meant


def _impossible(kind: str, command: float, value: float, noise: float) -> str | None:
    """Return the reason why a value cannot have been measured, or None."""
    if kind == "thrust" and command * value < 0.0 and abs(value) > noise:
        return "must have the sign of the command, because a thruster pushes in the commanded direction"
    if kind == "steady" and command * value <= 0.0:
        return "must have the sign of the command: forward, down and starboard are positive"
    if kind == "time_constant" and value <= 0.0:
        return "must be above 0"
    return None
