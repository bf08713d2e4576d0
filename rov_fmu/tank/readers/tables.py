"""Read a log that is a table: a CSV file, or the variables of a .mat file of MATLAB.

It has a column `time`, columns of commands and columns of measured motion. The commands are one column `command` in a
log of one axis, or a column for each input of the vehicle (`u_<name>`), or a column for each thruster. Rows and cells
that cannot be used are left out and counted.
"""

import re
from collections import Counter, deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from io import StringIO
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rov_fmu.equation.catalogue import EXTERNAL, Axis
from rov_fmu.equation.layout import Layout
from rov_fmu.io.columns import COMMANDS, NEUTRAL, NO_OUTPUT, PULSES, SPAN, Columns, read_columns
from rov_fmu.io.csv_table import (
    MOST_BEFORE,
    NUMBER,
    QUOTED_NUMBER,
    THOUSANDS,
    VALUE,
    CsvFile,
    DataFileError,
    Grown,
    Lines,
    OpenStream,
    is_missing,
)
from rov_fmu.io.messages import did_you_mean, listed, shown, similar
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.catalogue import ATMOSPHERE, HULL, LEAST_PRESSURE, PRESSURE_GRADIENT, TIMES
from rov_fmu.tank.channels import Topic
from rov_fmu.tank.clocks import AGAIN, LATE, LEAST_AFTER, ascending, parts_of_clock, restart_rows
from rov_fmu.tank.columns import (
    AXIS,
    COMMAND,
    FRACTION,
    INPUTS,
    RENAMING,
    SLIPS,
    THRUSTERS,
    WELL_KNOWN,
    ColumnNames,
    LogColumn,
    columns_of_log,
    refuse_slips,
)
from rov_fmu.tank.findings import Finding, about, sentences
from rov_fmu.tank.log import LEAST_SAMPLES, Source
from rov_fmu.tank.readers.content import Content, Piece
from rov_fmu.tank.readers.no_measurement import FLAG, flag_columns
from rov_fmu.tank.readers.times_of_day import FIRST_ROWS, HOW, time_columns, times_of_day
from rov_fmu.tank.readers.times_of_day import time_rules_of_page as clock_rules

_MOST_UNORDERED = 0.2
"""The largest share of rows out of order. If it is exceeded, the times are not those of a log."""
_IN_PULSES = tuple(f"{left}{unit}{right}" for unit in PULSES for left, right in ("[]", "()"))
"""The ends of headers in pulse widths, such as "PWM (us)": such a column may have commands."""
_ELSEWHERE = "; if another file of the same dive has it, [dives] in rov.toml joins the files"
"""The end of a message about a log that has commands or motion, but not both."""
_NUMBERED = re.compile(r"\s*u_([0-9]{1,2})\s*\[[^\]]+\]\s*")
"""The header of the command of a numbered thruster."""
_SLOW, _SHORTEST = 0.1, 1e-5
"""A log with fewer rows per second than the first number, or with shorter intervals than the second, s, has times in
another unit than its header says, in all likelihood."""


def rules_of_page() -> dict[str, Any]:
    """Return the rules by which recording.js, of the page that flies, reads tables as `read_table` does."""
    return {
        "number": NUMBER.pattern,
        "value": VALUE.pattern,
        "quoted": QUOTED_NUMBER.pattern,
        "thousands": THOUSANDS.pattern,
        "mostBefore": MOST_BEFORE,
        "times": TIMES,
        "clock": clock_rules(),
        "fractions": FRACTION.units,
        "pulses": {"units": PULSES, "neutral": NEUTRAL, "span": SPAN, "none": NO_OUTPUT},
        "forces": [unit for unit in COMMANDS if unit not in PULSES],
        "renamed": WELL_KNOWN,
        "slips": SLIPS,
        "mostUnordered": _MOST_UNORDERED,
        "late": LATE,
        "leastAfter": LEAST_AFTER,
        "again": AGAIN,
        "leastSamples": LEAST_SAMPLES,
        "pressures": {
            "atmosphere": ATMOSPHERE,
            "gradient": PRESSURE_GRADIENT,
            "hull": HULL,
            "least": LEAST_PRESSURE * ATMOSPHERE,
        },
    }


def read_start(path: Path, open_stream: OpenStream | None, count: int) -> list[list[str]]:
    """Return the cells of the header and of the first rows, at most `count` of all. Raises DataFileError."""
    return [cells for _, cells in islice(CsvFile(path, open_stream), count)]


def read_table(
    path: Path,
    layout: Layout,
    axis: Axis | None,
    names: ColumnNames,
    open_stream: OpenStream,
    *,
    is_part: bool = False,
) -> tuple[Content, dict[str, LogColumn]]:
    """Read a table, and return its columns, with the meaning of each. Raises DataFileError.

    The numbers are in SI units, but pulses whose neutral nobody states are as they stand in the file. `open_stream`
    opens its lines. A part of a dive may have only commands or only motion.
    """
    known = columns_of_log(layout, axis, names.keys)
    start = read_start(path, open_stream, FIRST_ROWS)
    names = replace(names, columns={**time_columns(start, names.columns), **names.columns})
    flags = flag_columns(start[0], known, names)
    known |= dict.fromkeys(flags, LogColumn.of(FLAG))
    meant = {names.columns.get(title, title) for title in start[0] if title in names.columns}
    given_away = {title: "" for title in start[0] if title in meant}
    check = partial(_wrong_columns, path=path, layout=layout, axis=axis, known=known, is_part=is_part)
    table = read_columns(
        path,
        known,
        others=True,
        loose=True,
        grown=grown_rows,
        renamed={**given_away, **names.columns, **{title: f"{name} [1]" for name, title in flags.items()}},
        hint=RENAMING,
        check_header=check,
        open_stream=open_stream,
    )
    headers = {name: title for name, title in {**table.headers, **flags}.items() if name != "date"}
    table = replace(table, headers=headers)
    commanding = [name for name in table.values if known[name].commands]
    refuse_slips(table, commanding)
    pulses = {name: np.frombuffer(table.numbers[name]) for name in commanding if table.units[name].split()[0] in PULSES}
    unstated = [name for name in pulses if table.units[name] in PULSES] if names.keys.neutral is None else []
    values = {name: np.frombuffer(table.values[name]) for name in table.headers}
    if (times := times_of_day(table)) is not None:
        values["time"] = times
    values |= {name: pulses[name] for name in unstated}
    unlikely = _unlikely_rate(table, values["time"])
    if unlikely and not is_part:
        raise DataFileError(*sentences([replace(unlikely, file=f"{path}")]))
    content = Content(
        path.name, [], names=frozenset(table.header), without_thruster=_without_thruster(table, names.columns)
    )
    _add_pieces(content, table, values, commanding)
    _tell_cells(content, table, pulses, names.keys.neutral)
    content.findings += [about(path.name, kind, **words) for kind, words in table.assumed.items()]
    _tell_headers(content, table, known)
    if unlikely:
        content.findings.append(unlikely)
    entries = {name: known[name] for name in table.headers if known[name].name}
    entries |= {name: replace(entries[name], convert=table.conversions[name], is_pulse=True) for name in unstated}
    return content, {table.headers[name]: entry for name, entry in entries.items()}


# ---- Columns ---------------------------------------------------------------------------------------------------------


def _wrong_columns(
    headers: Mapping[str, str],
    others: Sequence[str],
    path: Path,
    layout: Layout,
    axis: Axis | None,
    known: Mapping[str, LogColumn],
    is_part: bool,
) -> Iterator[str]:
    """Yield a line for every mistake in the columns of a log, from the headers that are read and the others."""
    found = {known[name].commands: shown(title) for name, title in headers.items() if known[name].commands}
    if len(found) > 1:
        reason = "a log must have the commands of the axis, of the inputs or of the thrusters, but only one of these"
        yield f"columns {', '.join(found.values())}: {reason}"
    zero = next((title for title in others if (match := _NUMBERED.fullmatch(title)) and int(match[1]) == 0), None)
    if zero and any(map(_NUMBERED.fullmatch, headers.values())):
        yield f"column {shown(zero)}: these columns count from 0, and the thrusters of this vehicle from 1{RENAMING}"
    if is_part and headers.keys() - {"date"} != {"time"}:
        return
    unread = {title.replace("(", "[").partition("[")[0].strip(): shown(title) for title in others}
    renaming = RENAMING if unread else ""
    command = next((title for name, title in unread.items() if name.casefold() == COMMAND), None)
    if not found and command and not axis:
        names, word = [*layout.by_name], path.stem.lower().partition("_")[2].partition("_")[0]
        allowed = " or ".join(f"log_{name}*{path.suffix}" for name in names)
        reason = f"is not an axis of this vehicle: the name of the file must be {allowed}{did_you_mean(word, names)}"
        yield f"column {command} is the command of one axis, but {word or repr('')} {reason}"
        return
    wrong = [] if found else [_no_commands(known, unread, others, renaming)]
    axes = [axis] if axis else layout.bare_axes
    wanted = {name: of.unit for name, one in known.items() if (of := one.quantity) and of.axis in axes}
    if not headers.keys() & {*wanted, "pressure"}:
        titles = " or ".join(f"'{name} [{unit}]'" for name, unit in wanted.items())
        wrong.append(f"column {titles} is missing{renaming}")
    elsewhere = _ELSEWHERE if len(wrong) == 1 and not axis else ""
    yield from (f"{line}{elsewhere}" for line in wrong)


def _no_commands(
    known: Mapping[str, LogColumn], unread: Mapping[str, str], others: Sequence[str], renaming: str
) -> str:
    """Return the line about a log without a column of commands, with the headers that may be meant."""
    kinds = [[name for name, one in known.items() if one.commands == kind] for kind in (INPUTS, THRUSTERS, AXIS)]
    wanted = " or ".join(", ".join(columns) for columns in kinds if columns)
    near = dict.fromkeys(unread[name] for columns in kinds for column in columns for name in similar(column, unread))
    near |= dict.fromkeys(shown(title) for title in others if title.endswith(_IN_PULSES))
    hint = f"; is it the column {' or '.join(near)}?" if near else ""
    hint += " Units stand in square brackets." if any("(" in title for title in near) else ""
    units = dict.fromkeys(f"[{unit}]" for one in known.values() if one.commands for unit in one.units)
    if loads := [title for name, title in unread.items() if name in EXTERNAL]:
        hint = f"; {listed(loads)} are forces on the body, if wrench = true stands in [logs] of rov.toml"
    every = "each in [%], [1] or [us]" if "[%]" in units else f"in {listed(units, 'or')}"
    return f"there is no column of commands. Possible columns: {wanted}, {every}{hint or renaming}"


# ---- Rows ------------------------------------------------------------------------------------------------------------


def _add_pieces(content: Content, table: Columns, columns: Mapping[str, Array], commanding: Sequence[str]) -> None:
    """Add the rows with a time between the restarts of the clock, and what was left out or sorted. Raises
    DataFileError.

    A row without a command keeps its measurements: in many tables, each message has a row of its own. Rows before the
    first command are only counted, because nothing is learnt from them.
    """
    stray = np.isfinite(columns["time"]) & (parts_of_clock(columns["time"]) < 0)
    columns["time"][stray] = np.nan
    timed = np.isfinite(columns["time"])
    told = np.any([np.isfinite(columns[name]) for name in commanding or ["time"]], axis=0) & timed
    if not told.any():
        what = "both a time and a command" if commanding else "a time"
        for name in (name for name in ("time", *commanding) if table.unread[name]):
            kind, how = ("time", f"; {HOW}") if name == "time" else ("number", "")
            reason = f"is no {kind}, and no row has {what}{how}"
            raise table.error(table.unread[name][0], name, reason)
        raise DataFileError(f"{table.path}: no row has {what}")
    rows = np.flatnonzero(timed)
    starts, late = _order(columns, rows)
    if len(late) > _MOST_UNORDERED * rows.size:
        reason = "the time goes back and does not return. Are there two logs in one file?"
        raise table.error(int(late[0]), "time", reason)
    merged, since = rows.size, 0.0
    for own in np.split(rows, starts):
        times = columns["time"][own]
        # One column after the other, because a log may be as large as the memory allows.
        fields = {table.headers[name]: ascending(times, values[own])[1] for name, values in columns.items()}
        time = fields.pop(table.headers["time"])
        content.pieces.append(Piece([Topic(Source(""), time, fields)], since=since))
        merged -= len(time)
        since += float(time[-1] - time[0])
    content.count("rows sorted", len(late))
    content.count("time stamps merged", merged)
    content.count("stray times", int(stray.sum()))
    content.count("rows without time", int((~timed).sum() - stray.sum()))
    if len(table.headers) == len(table.header):  # otherwise the numbers of a row may be in columns that are not read
        has_number = np.any([np.isfinite(values[rows]) for name, values in columns.items() if name != "time"], axis=0)
        content.count("rows without numbers", int((~has_number).sum()))
    content.count("rows before commands", int((columns["time"][rows] < columns["time"][told].min()).sum()))


def _order(columns: Mapping[str, Array], rows: NDArray[np.intp]) -> tuple[list[int], NDArray[np.intp]]:
    """Return the indices in `rows` at which the clock restarts, and the rows that only are out of order.

    Both show in the times at which a column has numbers. Tables of several sensors may stand one after the other in a
    file: each begins with an earlier time than that at which the one before it ended.
    """
    time, late, is_restarted = columns["time"], [rows[:0]], False
    there = {name: np.isfinite(values[rows]) for name, values in columns.items() if name != "time"}
    for known in {mask.tobytes(): mask for mask in there.values()}.values():
        own = rows[known]
        restarts = restart_rows(time[own])
        is_restarted |= bool(restarts)
        late += [part[time[part] < np.maximum.accumulate(time[part])] for part in np.split(own, restarts) if len(part)]
    return restart_rows(time[rows]) if is_restarted else [], np.unique(np.concatenate(late))


def _tell_cells(content: Content, table: Columns, pulses: Mapping[str, Array], neutral: float | None) -> None:
    """Add what the cells tell: too many in a row, no numbers, and no pulses. `neutral` is that of rov.toml, µs."""
    content.count("torn rows", table.torn)
    for name, rows in table.unread.items():
        if name not in ("time", "date"):
            content.count("unread cells", len(rows), column=table.headers[name])
    for name, values in pulses.items():
        is_none = np.isin(values, NO_OUTPUT) & (np.frombuffer(table.values[name]) == 0.0)
        _, *numbers = table.units[name].split()
        is_none &= values != (float(numbers[0]) if numbers else neutral)
        content.count("no pulse", int(is_none.sum()), column=table.headers[name])


def _tell_headers(content: Content, table: Columns, known: Mapping[str, LogColumn]) -> None:
    """Add each header that would name a measurement if it had a unit."""
    wanted = {
        title.casefold(): column
        for name, column in known.items()
        if name not in table.values and column.quantity
        for title in (name, *column.also)
    }
    for title in table.header:
        if title not in table.headers.values() and (column := wanted.get(title.strip().casefold())):
            better = shown(f"{title.strip()} [{next(iter(column.units))}]")
            content.findings.append(about(table.path.name, "column without unit", column=shown(title), header=better))


def _without_thruster(table: Columns, renamed: Mapping[str, str]) -> dict[str, int]:
    """Return the numbers in headers such as `u_7 [%]` that are not read, although others like it are."""
    used, all_numbers = (
        {shown(title): int(match[1]) for title in titles if (match := _NUMBERED.fullmatch(title))}
        for titles in (table.headers.values(), map(renamed.get, table.header, table.header))
    )
    unused = {title: number for title, number in all_numbers.items() if number not in used.values()}
    return unused if used else {}


def _unlikely_rate(table: Columns, time: Array) -> Finding | None:
    """Return the finding about times whose unit is probably another one than their header says, or None."""
    intervals = np.abs(np.diff(time[np.isfinite(time)]))
    usual = float(np.median(intervals)) if len(intervals) else 0.0
    if usual <= 1.0 / _SLOW and (usual == 0.0 or usual >= _SHORTEST):
        return None
    return about(table.path.name, "unlikely rate", column=table.headers["time"], rate=f"{1.0 / usual:.3g}")


# ---- Variables of MATLAB ---------------------------------------------------------------------------------------------


def open_matlab(path: Path) -> OpenStream:
    """Return a function that opens the numeric variables of a .mat file as the lines of a CSV file: all vectors as long
    as the time.

    Fields of structures have the names of both, such as `log.depth`. Raises DataFileError.
    """
    from scipy.io import loadmat

    try:
        content = loadmat(path, simplify_cells=True)
    except NotImplementedError:
        reason = "is a .mat file of version 7.3 (HDF5), which SciPy does not read: save it with -v7"
        raise DataFileError(f"{path}: {reason}") from None
    vectors = dict(_vectors("", content))
    lengths = Counter(len(values) for values in vectors.values())
    time = next((name for name in vectors if name.rpartition(".")[2].casefold() in _TIME_NAMES), None)
    if not lengths:
        raise DataFileError(f"{path}: has no vectors of numbers")
    length = len(vectors[time]) if time else lengths.most_common(1)[0][0]
    columns = {name: values for name, values in vectors.items() if len(values) == length}
    lines = StringIO()
    np.savetxt(lines, np.column_stack([*columns.values()]), "%.17g", ";", header=";".join(columns), comments="")
    return partial(StringIO, lines.getvalue())


_TIME_NAMES = ("time", "t", "timestamp", "tout")


def _vectors(field: str, value: Any) -> Iterator[tuple[str, Array]]:
    """Yield the vectors of numbers in the variables of a .mat file, with their names."""
    if isinstance(value, np.ndarray) and value.dtype.kind in "fiub":
        if value.ndim == 1 and len(value) > 1:
            yield field, value.astype(float)
        elif value.ndim == 2 and value.size:
            columns = value.T if value.shape[0] >= value.shape[1] else value
            yield from ((f"{field}({n})", column.astype(float)) for n, column in enumerate(columns, start=1))
    elif isinstance(value, dict):
        for name, inner in value.items():
            if not name.startswith("__"):
                yield from _vectors(f"{field}.{name}" if field else name, inner)


# ---- Columns that a logger inserted ----------------------------------------------------------------------------------

_COMPARED_ROWS = 50
"""The number of rows before and after an insertion of columns that tell where it is."""
_FEWEST, _MOST_ODD, _MOST_MISFITS = 3, 0.05, 0.25
"""The least number of rows before and after an insertion, the largest share of rows after it with yet another number of
cells, and the largest share of columns that do not go on as before."""


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
    """Return the first and the last index at which the cells may have been inserted that make the rows longer.

    An index is judged by the number of columns that would not go on as before. One of them is no proof, because a
    sensor may begin or end just then.
    """
    more = after.width - before.width
    old, new = [*zip(*before.last, strict=True)], [*zip(*after.first, strict=True)]
    stay = [_differ(column, new[n]) for n, column in enumerate(old)]
    move = [_differ(column, new[n + more]) for n, column in enumerate(old)]
    misfits = [sum(stay[:index]) + sum(move[index:]) for index in range(before.width + 1)]
    if min(misfits) > _MOST_MISFITS * before.width:
        return 0, before.width
    likely = [index for index, count in enumerate(misfits) if count <= min(misfits) + 1]
    return likely[0], likely[-1]


def _differ(old: Sequence[str], new: Sequence[str]) -> bool:
    """Return True if cells can hardly be of the same column: they have other forms, or their numbers lie far apart."""
    filled = [[cell for cell in cells if not is_missing(cell)] for cells in (old, new)]
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


def grown_rows(rows: Lines) -> Grown | None:
    """Return where the columns of the header are in rows that have more cells from some line on, or None.

    A logger may write the header before it knows all columns, and insert the others later. What stands in the rows
    before and after tells where. A few rows may have yet another number of cells.
    """
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
        return None
    indices: list[int | None] = [*range(width)]
    by_width = {}
    for before, after in pairwise(parts):
        low, high = _where_inserted(before, after)
        moved = [*range(low), *[None] * (high - low), *range(high + after.width - before.width, after.width)]
        indices = [None if index is None else moved[index] for index in indices]
        by_width[after.width] = indices
    first = sum(index == n for n, index in enumerate(indices))
    last = sum(index == n for n, index in enumerate(indices, start=parts[-1].width - width))
    counts = {"line": parts[1].line, "cells": parts[-1].width, "columns": width, "first": first, "last": last}
    return Grown(by_width, odd, {name: str(n) for name, n in counts.items()}) if first + last else None
