"""Read tables (CSV) of the force, the steady velocity or the time constant at held commands."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from rov_fmu.equation.catalogue import Axis
from rov_fmu.io.columns import BEYOND, KnownColumns, read_columns
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.io.messages import MOST
from rov_fmu.tank.columns import RENAMING, TABLES, columns_of, refuse_slips
from rov_fmu.tank.findings import Finding, about
from rov_fmu.tank.readers.parsers import guarded, open_table


@dataclass(frozen=True)
class Row:
    """One measured number: force (N), velocity (m/s, rad/s) or time constant (s) at a held command."""

    file: str
    line: int
    command: float
    value: float


@guarded
def read_rows(
    path: Path, kind: str, axis: Axis | None = None, names: Mapping[str, str] = {}
) -> tuple[list[Row], frozenset[str], list[Finding]]:
    """Read rows of a command and a force (`thrust`), velocity (`steady`) or time constant. Raises DataFileError.

    `names` is the table [columns] of rov.toml. Also returns the keys of `names` that the file has, and what was assumed
    about its form.
    """
    name, columns = TABLES[kind], columns_of(kind, axis)
    is_column = KnownColumns(columns).has
    renamed = {title: meant for title, meant in names.items() if is_column(meant)}  # the other entries are for logs
    table = read_columns(path, columns, others=True, renamed=renamed, hint=RENAMING, open_stream=open_table(path))
    refuse_slips(table, ["command"])
    noise = 0.05 * max(map(abs, table.values[name]))
    numbers = [*zip(table.lines, table.values["command"], table.values[name], strict=True)]
    mistakes = []
    for n, (_, command, value) in enumerate(numbers):
        if abs(command) > 1.0:  # a pulse or a force
            mistakes.append(table.error(n, "command", BEYOND))
        elif kind != "thrust" and command == 0.0:
            mistakes.append(table.error(n, "command", "must not be 0, because nothing moves then"))
        elif reason := _impossible(kind, command, value, noise):
            mistakes.append(table.error(n, name, reason))
    if mistakes:
        more = len(mistakes) - MOST
        counted = [f"{path}: {more} more rows like these"] if more > 0 else []
        raise DataFileError(*map(str, mistakes[:MOST]), *counted)
    told = [about(path.name, kind, **words) for kind, words in table.assumed.items()]
    return [Row(path.name, *row) for row in numbers], frozenset(renamed).intersection(table.header), told


def _impossible(kind: str, command: float, value: float, noise: float) -> str | None:
    """Return the reason why a value cannot have been measured, or None."""
    if kind == "thrust" and command * value < 0.0 and abs(value) > noise:
        return "must have the sign of the command, because a thruster pushes in the commanded direction"
    if kind == "steady" and command * value <= 0.0:
        return "must have the sign of the command: forward, down and starboard are positive"
    if kind == "time_constant" and value <= 0.0:
        return "must be above 0"
    return None
