"""Tables of held commands (CSV): the force, the steady velocity or the time constant at each."""

from dataclasses import dataclass
from pathlib import Path

from rov_fmu.io.csv_table import DataFileError, read_columns
from rov_fmu.model.layout import Axis
from rov_fmu.tank.columns import FORCE, HELD_COMMAND, refuse_slips, time_constant_column, velocity_column

_MOST = 10  # rows of a file that are told of


@dataclass(frozen=True)
class Row:
    """One measured number: force (N), velocity (m/s, rad/s) or time constant (s) at a held command."""

    file: str
    line: int
    command: float
    value: float


def read_rows(path: Path, kind: str, axis: Axis | None = None) -> list[Row]:
    """Rows of command, and force (`thrust`), velocity (`steady`, of an axis) or time constant. Raises DataFileError."""
    name = {"thrust": "force", "steady": "velocity", "time_constant": "time constant"}[kind]
    column = FORCE if kind == "thrust" else time_constant_column()
    if axis and kind == "steady":
        column = velocity_column(axis)
    table = read_columns(path, {"command": HELD_COMMAND, name: column})
    refuse_slips(table, ["command"])
    noise = 0.05 * max(map(abs, table.values[name]))
    numbers = [*zip(table.lines, table.values["command"], table.values[name], strict=True)]
    wrong = [(n, reason) for n, (_, c, value) in enumerate(numbers) if (reason := _wrong(kind, c, value, noise))]
    if wrong:
        told = [table.error(n, name if by_value else "command", words) for n, (by_value, words) in wrong[:_MOST]]
        more = [f"{path}: {len(wrong) - _MOST} more rows like these"] if len(wrong) > _MOST else []
        raise DataFileError(*map(str, told), *more)
    return [Row(path.name, *row) for row in numbers]


def _wrong(kind: str, command: float, value: float, noise: float) -> tuple[bool, str] | None:
    """Whether it is the value rather than the command that cannot be, and why; None where nothing is wrong."""
    if kind == "thrust" and command * value < 0.0 and abs(value) > noise:
        return True, "must have the sign of the command, for a thruster pushes where it is told to"
    if kind != "thrust" and command == 0.0:
        return False, "must not be zero, for nothing moves"
    if kind == "steady" and command * value <= 0.0:
        return True, "must have the sign of the command: forward, down, to starboard is +"
    if kind == "time_constant" and value <= 0.0:
        return True, "must be above 0"
    return None
