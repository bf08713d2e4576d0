"""List the content of logs before a vehicle is known, and the headers that rov.toml would have to explain."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from math import nan
from pathlib import Path

import numpy as np

from rov_fmu.equation.catalogue import AXES
from rov_fmu.equation.layout import Layout
from rov_fmu.io.columns import Column, KnownColumns, read_columns
from rov_fmu.io.csv_table import DataFileError, OpenStream
from rov_fmu.io.messages import shown
from rov_fmu.tank.arrays import Array, range_in_words
from rov_fmu.tank.clocks import gaps
from rov_fmu.tank.columns import TABLES, TIME, columns_of, columns_of_log, has_column, names_of
from rov_fmu.tank.description import NO_ROV_FILE, RovFile, RovTables
from rov_fmu.tank.findings import Finding, about
from rov_fmu.tank.folder import axis_in_name, kind_of_table
from rov_fmu.tank.inspection.headers import guessed, guessed_of_table, one_of_several
from rov_fmu.tank.log import Log
from rov_fmu.tank.quality import checked_log, rate
from rov_fmu.tank.read_log import read_logs
from rov_fmu.tank.readers.no_measurement import flag_columns
from rov_fmu.tank.readers.parsers import guarded, open_table
from rov_fmu.tank.readers.tables import grown_rows, read_start
from rov_fmu.tank.readers.tank_tables import read_rows
from rov_fmu.tank.readers.times_of_day import FIRST_ROWS, time_columns
from rov_fmu.tank.rest import without_rests

PARTS = 32
"""The number of parts of the time for which the course of a signal is told."""


@dataclass(frozen=True)
class Signal:
    """What one command or one channel of a log contains."""

    name: str
    unit: str
    start: float
    end: float
    """The times of the first and the last sample, s; NaN in a table of tank tests."""
    samples: int
    rate: float
    """The usual rate, 1/s; NaN in a table of tank tests."""
    low: float
    high: float
    gaps: Sequence[tuple[float, float]]
    """How long the gaps are, and when they begin after the begin of the log, s."""
    course: Sequence[float] = ()
    """The mean in each of PARTS equal parts of the time of the log; NaN where there is no sample. Empty without
    times."""


@dataclass(frozen=True)
class Inspection:
    """What a log contains."""

    path: Path
    name: str
    """The name of the log, or of the piece between two restarts of its clock."""
    commands: tuple[Signal, ...]
    """The commands of the thrusters in order, or the single command of an axis."""
    channels: tuple[Signal, ...]
    """The channels that are used."""
    unread: Mapping[str, str]
    """A description of everything that is not recognised, by name. For a column it is the range of its values."""
    findings: tuple[Finding, ...]
    columns: Mapping[str, str] = field(default_factory=dict)
    """Headers of columns of logs that seem to be meant, by the headers of the file."""
    log: Log | None = None
    """What is read of a log; None for a table, and where not enough is recognised."""


def inspect(path: Path, layouts: Iterable[Layout], described: RovFile = NO_ROV_FILE) -> list[Inspection]:
    """Return what a log contains, for each piece between two restarts of its clock, or what a table contains.

    The thrusters and columns have the names of the described vehicle, and the tables [columns], [topics], [valid] and
    [logs] of its rov.toml are obeyed. What it does not explain is guessed from headers and numbers. Without a
    description, the thrusters of a CSV log have the names of the first layout that fits, or else names that follow from
    the headers. Raises DataFileError.
    """
    tables = described.tables  # those with quantities cannot be pickled
    told = RovTables(columns=tables.columns, topics=tables.topics, valid=tables.valid, logs=tables.logs)
    return _inspected(path, [*layouts], described.layout, told)


@guarded
def _inspected(path: Path, layouts: Sequence[Layout], layout: Layout | None, tables: RovTables) -> list[Inspection]:
    axis = axis_in_name(path)
    columns: Mapping[str, str] = {}
    unread: dict[str, str] = {}
    if open_stream := open_table(path):
        start = read_start(path, open_stream, FIRST_ROWS)
        titles = start[0]
        numbers, ranges = _numbers(path, titles, open_stream)
        if not any(map(len, numbers.values())):
            raise DataFileError(
                f"{path}, line 1 = {shown(', '.join(titles))}: no column below these headers has numbers"
            )
        columns = renamed = {title: tables.columns[title] for title in titles if title in tables.columns}
        if kind := kind_of_table(path, columns):
            return [_of_table(path, kind, columns, ranges)]
        renamed = time_columns(start, renamed) | renamed
        own = {renamed.get(title, title): numbers[title] for title in titles}
        guess, columns = guessed(own, axis, [layout] if layout else layouts)
        layout = layout or guess
        known = columns_of_log(layout, axis)
        named = KnownColumns(known)
        name_of = partial(_known_name, named)
        # Where headers count from 0, u_1 is u_2 in truth, and a u_6 that is left gives its name away.
        names_now = {title: name_of(title) for title in own}
        moved = {title for title, name in names_now.items() if name and name_of(columns.get(title, title)) != name}
        moved |= {columns[title] for title in moved}
        told = {name for title, name in names_now.items() if title not in moved} | {""}
        columns = {title: meant for title, meant in columns.items() if title in numbers and name_of(meant) not in told}
        columns |= renamed
        names, _ = names_of(layout, tables.model_copy(update={"columns": columns}))
        flags = {*flag_columns(titles, known, names).values()}
        meant = {title: names.columns.get(title, title) for title in titles}
        unread = {
            title: ", ".join(filter(None, (ranges[title], one_of_several(title, numbers[title]))))
            for title in titles
            if not (named.has(meant[title]) or title in flags)
        }
        count = sum(title not in unread for title in titles)
        has_time = has_column(meant.values(), {"time": TIME})
        if not has_time and (table := _of_unnamed_table(path, renamed, ranges)):
            return [table]
        if count < 2 or not has_time:
            return [Inspection(path, path.name, (), (), unread, (), columns)]
    else:
        names, _ = names_of(layout, tables)
        axis = None
    layout = layout or Layout((), (), ())
    logs = [checked_log(log) for log in read_logs(path, layout, names, axis, is_part=True)]
    return [_of_log(path, log, without_rests(log, layout)[0].findings, unread, columns) for log in logs]


def _known_name(known: KnownColumns, header: str) -> str:
    """Return the name of the column that has a header; empty without one."""
    with suppress(ValueError):
        return found.name if (found := known.find(header, others=True)) else ""
    return ""


def _of_log(
    path: Path, log: Log, findings: Sequence[Finding], unread: Mapping[str, str], columns: Mapping[str, str]
) -> Inspection:
    """Return what a log contains, with its findings; `unread` has the columns that are not recognised."""
    used = [channel for channel in log.channels if not channel.unused]
    times = [channel.samples[0] for channel in used if channel.count] + ([log.commands.rows] if log.commands else [])
    ends = [float(end) for time in times for end in time[[0, -1]]]
    clock = log.begin, min(ends, default=nan), max(ends, default=nan)
    channels = tuple(_signal(one.quantity.name, one.quantity.unit, one.time, one.values, clock) for one in used)
    unread = {**unread, **log.unread}
    return Inspection(path, log.file, tuple(_commands(log, clock)), channels, unread, tuple(findings), columns, log)


def _of_table(path: Path, kind: str, renamed: Mapping[str, str], ranges: Mapping[str, str]) -> Inspection:
    """Return what a table of tank tests contains. Raises DataFileError.

    `renamed` has what rov.toml says of its headers, and `ranges` has the range of the numbers below each.
    """
    axis = axis_in_name(path)
    of_table = columns_of(kind, axis)
    guesses = {title: meant for title, meant in guessed_of_table(kind, axis, ranges).items() if meant}
    columns = {**guesses, **renamed}
    is_column = KnownColumns(of_table).has
    unread = {title: what for title, what in ranges.items() if not is_column(columns.get(title, title))}
    channels, told = list[Signal](), list[Finding]()
    if len(ranges) - len(unread) >= len(of_table):
        rows, _, told = read_rows(path, kind, axis, columns)
        numbers = np.array([(row.command, row.value) for row in rows]).T
        units = ("1", next(iter(of_table[TABLES[kind]].units)))
        channels = [*map(_signal, of_table, units, np.full(numbers.shape, nan), numbers, [_NO_CLOCK] * len(units))]
    return Inspection(path, path.name, (), tuple(channels), unread, tuple(told), columns)


def _of_unnamed_table(path: Path, renamed: Mapping[str, str], ranges: Mapping[str, str]) -> Inspection | None:
    """Return what a table contains whose name does not tell its kind, if its headers tell it, with the right name."""
    for kind, measured in TABLES.items():
        with suppress(DataFileError):
            if (found := _of_table(path, kind, renamed, ranges)).channels:
                name = f"{kind}_<{'curve' if kind == 'thrust' else 'axis'}>{path.suffix}"
                return replace(
                    found, findings=(*found.findings, about(path.name, "unnamed table", measured=measured, name=name))
                )
    return None


def logs_among(tests: Sequence[Path], columns: Mapping[str, str] = {}) -> Sequence[Path]:
    """Return the logs among tests, or without logs the tables. `columns` is the table [columns] of rov.toml."""
    return [file for file in tests if not kind_of_table(file, columns)] or tests


_Clock = tuple[float, float, float]
"""The begin of a log, from which times count, and the first and the last time that it tells, s."""
_NO_CLOCK = (nan, nan, nan)


def _signal(name: str, unit: str, time: Array, values: Array, clock: _Clock) -> Signal:
    there = np.isfinite(values)
    at, found = time[there], values[there]
    ends = (at[0], at[-1], found.min(), found.max()) if len(found) else (np.nan,) * 4
    start, end, low, high = map(float, ends)
    told = [(after - before, before - clock[0]) for before, after in gaps(time, values)]
    return Signal(name, unit, start, end, len(found), rate(at), low, high, told, _course(at, found, *clock[1:]))


def _course(time: Array, values: Array, start: float, end: float) -> list[float]:
    """Return the mean in each of PARTS equal parts of the time from a start to an end, s, where there is any."""
    if len(time) < 2 or not time[0] < time[-1] < np.inf:
        return []
    ends = np.linspace(start, np.nextafter(end, np.inf), PARTS + 1)
    parts = [values[(time >= low) & (time < high)] for low, high in pairwise(ends)]
    return [float(part.mean()) if len(part) else nan for part in parts]


def _commands(log: Log, clock: _Clock) -> Iterator[Signal]:
    if not log.commands:
        return
    rows = log.commands.rows
    loads = {axis.external: axis.load for axis in AXES.values()}
    for name, values in zip(log.commands.thrusters, log.commands.at(rows).T, strict=True):
        is_named = log.follows_axis or name in loads
        yield _signal(name if is_named else f"thruster {name}", loads.get(name, "1"), rows, values, clock)


# ---- Columns of unknown names ----------------------------------------------------------------------------------------


def _numbers(path: Path, titles: Sequence[str], open_stream: OpenStream) -> tuple[dict[str, Array], dict[str, str]]:
    """Return the numbers of every column as they stand in the file, and their range in words.

    A header that several columns share gets no numbers, because it is ambiguous.
    """
    counts = Counter(titles)
    columns_of = {title: str(n) for n, title in enumerate(titles) if counts[title] == 1}
    columns = dict.fromkeys(columns_of.values(), Column({"1": 1.0}, True, True))
    renamed = {title: f"{name} [1]" for title, name in columns_of.items()}
    table = read_columns(
        path, columns, others=True, loose=True, renamed=renamed, grown=grown_rows, open_stream=open_stream
    )
    numbers, ranges = dict.fromkeys(titles, np.empty(0)), dict.fromkeys(titles, "")
    for title, name in columns_of.items():
        values = np.frombuffer(table.values[name])
        numbers[title] = found = values[np.isfinite(values)]
        ranges[title] = "text" if len(table.unread[name]) > len(found) else range_in_words(found)
    return numbers, ranges
