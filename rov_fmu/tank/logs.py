"""Read logs of one test or of a whole dive: CSV files here, other formats in formats/.

A CSV log has a column `time`, columns of commands and columns of measured motion. The commands are one column
`command` in a log of one axis, or a column for each input of the vehicle (`u_<name>`), or a column for each thruster.
Rows and cells that cannot be used are left out and counted.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from rov_fmu.io.csv_table import (
    NO_OUTPUT,
    PULSES,
    Column,
    Columns,
    Conversion,
    DataFileError,
    find_column,
    read_columns,
)
from rov_fmu.io.file_kinds import BAG_SUFFIXES, MAVLINK_SUFFIXES, ULOG_SUFFIX
from rov_fmu.io.messages import did_you_mean, shown, similar
from rov_fmu.io.toml_file import join_names, key_line
from rov_fmu.model.layout import HEAVE, PITCH, ROLL, YAW, Axis, Layout
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.columns import (
    LOGGED_COMMAND,
    TIME,
    VOLTAGE,
    position_column,
    refuse_slips,
    velocity_column,
)
from rov_fmu.tank.findings import SENTENCES, Finding, refusals
from rov_fmu.tank.formats.bags import read_bag
from rov_fmu.tank.formats.content import Content, Entry, Wanted
from rov_fmu.tank.formats.mavlink import read_mavlink
from rov_fmu.tank.formats.ulog import read_ulog
from rov_fmu.tank.recording import CLOCK_ERROR, Recording
from rov_fmu.tank.signals import LEAST_SAMPLES, Commands, Signal, context_at, gaps_of, main_signals, recordings_of

_MOST_UNORDERED = 0.2
"""The largest share of rows out of order; with more, the file holds two logs."""
_COMMAND = "command"
_Command = tuple[Array, Array]
READERS: dict[str, Callable[[Path, Wanted], Content]] = {
    **dict.fromkeys(MAVLINK_SUFFIXES, read_mavlink),
    ULOG_SUFFIX: read_ulog,
    **dict.fromkeys(BAG_SUFFIXES, read_bag),
}
"""The function that reads a log, by the suffix of the file. Other logs are CSV."""
_POSITION_NAMES = {HEAVE: ("z",), ROLL: ("phi", "roll"), PITCH: ("theta", "pitch"), YAW: ("psi",)}
"""Other names of positions that need no axis: those in the FMU, and that of the axis."""


@dataclass(frozen=True)
class Log:
    """The recordings of a log."""

    recordings: tuple[Recording, ...]
    findings: tuple[Finding, ...] = ()
    """What was left out, and why."""
    known: frozenset[str] = frozenset()
    """The keys that the tables [columns] and [topics] may have for this log."""


@dataclass(frozen=True)
class Names:
    """The tables [columns] and [topics] of rov.toml: what unknown names stand for."""

    columns: Mapping[str, str] = field(default_factory=dict)
    """Headers, by the headers of the CSV files."""
    topics: Mapping[str, Entry] = field(default_factory=dict)


def names_of(layout: Layout, columns: Mapping[str, str], topics: Mapping[str, str]) -> tuple[Names, list[str]]:
    """Return the names of rov.toml, and a line for every value that is no column of a log."""
    sensors = _sensors((form.axis for form in layout.axes), of_one=False) | _CONDITIONS
    commands = _inputs(layout) | _thrusters(layout)
    known = commands | {name: sensor.column for name, sensor in sensors.items()}
    of_csv = {"time": TIME, _COMMAND: _LOGGED, **known}
    thrusters = {f"{prefix}{t.name}": t.name for t in layout.thrusters for prefix in ("u_", "thruster ")}
    entries, mistakes = {}, []
    for table, titles, targets in (("columns", of_csv, columns), ("topics", known, topics)):
        for source, title in targets.items():
            opposite = table == "topics" and title.startswith("-")
            try:
                found = find_column(title[opposite:], titles, others=False)
                assert found
            except ValueError as error:
                mistakes.append(key_line(f"{table}.{source}", str(error), title))
                continue
            sensor, sign = sensors.get(found.name), -1.0 if opposite else 1.0
            name = found.name if layout.mix and found.name in layout.commands else thrusters.get(found.name, found.name)
            convert = partial(_converted, found.convert, sign)
            entries[source] = Entry(name, sensor.axis if sensor else None, sensor.quantity if sensor else "", convert)
    return Names(columns, {source: entries[source] for source in topics if source in entries}), mistakes


def is_column(title: str, layout: Layout, axis: Axis | None) -> bool:
    """Return True if a log of the axis, or of several, may have a column with this header."""
    axes = [axis] if axis else [form.axis for form in layout.axes]
    sensors = _sensors(axes, of_one=axis is not None) | _CONDITIONS
    columns = {"time": TIME, _COMMAND: _LOGGED, **_inputs(layout), **_thrusters(layout)}
    columns |= {name: sensor.column for name, sensor in sensors.items()}
    try:
        return find_column(title, columns, others=True) is not None
    except ValueError:
        return False


def _converted(convert: Conversion, sign: float, value: float) -> float:
    return sign * convert(value)


def read_content(path: Path, layout: Layout, names: Names) -> Content:
    """Read the content of a log of several axes, or of a part of a dive; commands are those of the thrusters.

    Raises DataFileError.
    """
    read = READERS.get(path.suffix.lower())
    if not read:
        content, _ = read_csv(path, layout, None, names, is_part=True)
        return content
    content = read(path, Wanted([t.name for t in layout.thrusters], names.topics))
    if content.commands:
        logged, named = content.commands, {"time": content.commands.time, **content.commands.thrusters}
        if layout.mix and logged.thrusters.keys() <= {*layout.commands}:
            thrusters = _mixed_inputs(layout, named)
        else:
            still = np.zeros_like(logged.time)
            thrusters = {t.name: named.get(t.name, still) for t in layout.thrusters}
            missing = (name for name in thrusters if name not in named)
            content.findings += [Finding("missing column", file=path.name, names={"column": name}) for name in missing]
        content.commands = Commands(logged.time, thrusters)
    return content


def read_log(path: Path, layout: Layout, axis: Axis | None = None, names: Names = Names()) -> Log:
    """Read a recording of every axis that the log measures, or of `axis` alone. Raises DataFileError."""
    if path.suffix.lower() in READERS:
        content = read_content(path, layout, names)
    else:
        content, command = read_csv(path, layout, axis, names)
        if axis and command is not None:
            recording = _recording_of_axis(path, axis, content.signals, command[1])
            return Log((recording,), (*content.findings, *gaps_of(recording)), frozenset(content.known))
    if not content.commands:
        raise DataFileError(
            f"{path}: no commands of thrusters are recognised: `rov-fmu identify --inspect` lists what "
            "is in it, and the table [topics] of rov.toml names them"
        )
    recordings, useless = recordings_of(path.name, layout, content.commands, content.signals, axis)
    if not recordings:
        reasons = refusals(useless, path.parent, SENTENCES) or [f"{path}: nothing measured of any axis"]
        raise DataFileError(*reasons)
    return Log(recordings, (*content.findings, *useless), frozenset(content.known))


def read_dive(paths: Sequence[Path], other_clock: Iterable[str], layout: Layout, names: Names) -> Log:
    """Read a dive of several files, of which one has the commands. Raises DataFileError.

    A file of another clock than that of the commands is told in its recordings. Where the times of both do not overlap,
    its first sample is moved to the first command.
    """
    contents = [read_content(path, layout, names) for path in paths]
    commanding = [content for content in contents if content.commands]
    if len(commanding) != 1:
        which = join_names(content.file for content in commanding) or "none"
        raise DataFileError(f"{paths[0]}: one file of its dive must have the commands, and not {which}")
    (commands,) = (content.commands for content in commanding if content.commands)
    findings, signals = [], {}
    for content in contents:
        findings += content.findings
        signals[content.file] = content.signals
        times = [s.time[np.isfinite(s.values)] for s in content.signals if np.isfinite(s.values).any()]
        if content in commanding or not times:
            continue
        start, end = min(time[0] for time in times), max(time[-1] for time in times)
        overlap = start <= commands.time[-1] and commands.time[0] <= end
        if content.file in other_clock or not overlap:
            kind = "other clock" if overlap else "aligned clock"
            findings.append(Finding(kind, file=content.file, numbers={"most": CLOCK_ERROR}))
        if not overlap:
            moved = commands.time[0] - start
            signals[content.file] = [replace(signal, time=signal.time + moved) for signal in content.signals]
    clocks = {finding.file for finding in findings if finding.kind in ("other clock", "aligned clock")}
    recordings: list[Recording] = []
    for file, own in signals.items():
        others = [signal for other, found in signals.items() if other != file for signal in found]
        found, useless = recordings_of(file, layout, commands, own, others=others)
        recordings += [replace(recording, clock=file if file in clocks else "") for recording in found]
        findings += useless
    if not recordings:
        reasons = [finding for finding in findings if finding.axis]
        raise DataFileError(*refusals(reasons, paths[0].parent, SENTENCES) or [f"{paths[0]}: nothing measured"])
    return Log(tuple(recordings), tuple(findings), frozenset().union(*(content.known for content in contents)))


def read_csv(
    path: Path, layout: Layout, axis: Axis | None, names: Names, *, is_part: bool = False
) -> tuple[Content, _Command | None]:
    """Read a CSV file, and the times and the command of the axis if it has one.

    A part of a dive may have only commands or only motion. Raises DataFileError.
    """
    axes = [axis] if axis else [form.axis for form in layout.axes]
    sensors = _sensors(axes, of_one=axis is not None)
    conditions = {name: sensor for name, sensor in _CONDITIONS.items() if name not in sensors}
    kinds = {"inputs": _inputs(layout), "thrusters": _thrusters(layout), "axis": {_COMMAND: _LOGGED} if axis else {}}
    columns = {"time": TIME, **kinds["axis"], **kinds["inputs"], **kinds["thrusters"]}
    columns |= {name: sensor.column for name, sensor in (sensors | conditions).items()}
    check = _wrong_columns_of_part if is_part else _wrong_columns
    check_header = partial(check, path=path, layout=layout, kinds=kinds, sensors=sensors)
    table = read_columns(path, columns, others=True, loose=True, renamed=names.columns, check_header=check_header)
    kind, commanding = next(iter(_commanding(table.values, kinds).items()), ("", []))
    refuse_slips(table, commanding)
    time, values, findings = _cleaned(table, commanding)
    content = Content(path.name, findings=findings, known={*table.header})
    del table  # a long log is large
    content.signals = [*_signals(sensors, time, values), *_signals(conditions, time, values)]
    if kind == "axis":
        return content, (time, values[_COMMAND])
    missing = (name for name in kinds.get(kind, ()) if name not in values)
    content.findings += [Finding("missing column", file=path.name, names={"column": name}) for name in missing]
    if kind:
        thrusters = _mixed_inputs(layout, values) if kind == "inputs" else _thruster_commands(layout, values)
        content.commands = Commands(time, thrusters)
    return content, None


def _recording_of_axis(path: Path, axis: Axis, signals: Sequence[Signal], command: Array) -> Recording:
    """Return the recording of an axis whose thrusters follow one command. Raises DataFileError."""
    (signal,) = main_signals(signals, axis)
    if (count := int(np.isfinite(signal.values).sum())) < LEAST_SAMPLES:
        raise DataFileError(f"{path}: {count} samples of {signal.quantity}, at least {LEAST_SAMPLES} are needed")
    time, context = signal.time - signal.time[0], context_at(signal.time, signals)
    return Recording(path.name, axis, signal.quantity, time, command, signal.unwrapped(), context=context)


# ---- Columns ---------------------------------------------------------------------------------------------------------

_LOGGED = replace(LOGGED_COMMAND, optional=True)
_IN_PULSES = tuple(f"{left}{unit}{right}" for unit in PULSES for left, right in ("[]", "()"))
"""The ends of headers, such as "PWM (us)", that columns of commands may have under another name."""


@dataclass(frozen=True)
class _Sensor:
    """A column of measured motion, or of a condition."""

    axis: Axis | None
    quantity: str
    column: Column


_CONDITIONS = {
    axis.position: _Sensor(axis, axis.position, replace(position_column(axis), also=_POSITION_NAMES[axis]))
    for axis in (HEAVE, ROLL, PITCH)
} | {"voltage": _Sensor(None, "voltage", VOLTAGE)}
"""The columns that any log may have, whether or not the vehicle has their axis."""


def _sensors(axes: Iterable[Axis], *, of_one: bool) -> dict[str, _Sensor]:
    """Return the sensors by column name, positions before velocities.

    In a log of one axis the column need not name the axis.
    """
    found = {}
    for axis in axes:
        for quantity in (axis.position, "velocity"):
            velocity = quantity == "velocity"
            column = velocity_column(axis, optional=True, least=0.0) if velocity else position_column(axis)
            long_name = f"{axis.name} {quantity}"
            others = (axis.velocity,) if velocity else _POSITION_NAMES.get(axis, ())
            name = quantity if of_one or (axis in _POSITION_NAMES and not velocity) else long_name
            column = replace(column, also=(long_name, *others))
            found[name] = _Sensor(axis, quantity, column)
    return found


def _inputs(layout: Layout) -> dict[str, Column]:
    """Return the columns of inputs; where each drives one thruster, a column may have the thruster's name."""
    names = {f"u_{t.name}": (t.name,) for t in layout.thrusters} if not layout.mix else {}
    return {name: replace(_LOGGED, also=names.get(name, ())) for name in layout.commands}


def _thrusters(layout: Layout) -> dict[str, Column]:
    """Return the columns of thrusters, of a vehicle whose inputs drive several thrusters."""
    return {f"thruster {t.name}": replace(_LOGGED, also=(t.name,)) for t in layout.thrusters} if layout.mix else {}


def _commanding(names: Iterable[str], kinds: Mapping[str, Mapping[str, Column]]) -> dict[str, list[str]]:
    """Return the columns of commands among the names, by the kind of the commands."""
    names = {*names}
    found = {kind: [name for name in columns if name in names] for kind, columns in kinds.items()}
    return {kind: columns for kind, columns in found.items() if columns}


def _wrong_columns(
    headers: Mapping[str, str],
    others: Iterable[str],
    path: Path,
    layout: Layout,
    kinds: Mapping[str, Mapping[str, Column]],
    sensors: Mapping[str, _Sensor],
) -> Iterator[str]:
    """Yield a line for every mistake in the columns of a log, from the headers that are read and the others."""
    found = _commanding(headers, kinds)
    unread = {title.replace("(", "[").partition("[")[0].strip(): shown(title) for title in others}
    command = next((title for name, title in unread.items() if name.casefold() == _COMMAND), None)
    if not found and command and not kinds["axis"]:
        yield f"column {command} is the command of one axis, but {_no_axis_in_name(path, layout)}"
        return
    if not found:
        wanted = " or ".join(", ".join(columns) for columns in kinds.values() if columns)
        known = [name for columns in kinds.values() for name in columns]
        near = dict.fromkeys(unread[name] for column in known for name in similar(column, unread))
        near |= dict.fromkeys(shown(title) for title in others if title.endswith(_IN_PULSES))
        hint = f"; is it the column {' or '.join(near)}?" if near else ""
        hint += " Units stand in square brackets." if any("(" in title for title in near) else ""
        yield f"no column of commands: {wanted}, each in [%], [1] or [us]{hint}"
    if len(found) > 1:
        titles = ", ".join(shown(headers[names[0]]) for names in found.values())
        yield f"columns {titles}: the commands of the axis, of the inputs or of the thrusters, not several"
    if not any(name in headers for name in sensors):
        titles = " or ".join(f"'{name} [{next(iter(s.column.units))}]'" for name, s in sensors.items())
        yield f"column {titles} is missing"


def _wrong_columns_of_part(
    headers: Mapping[str, str], others: Iterable[str], kinds: Mapping[str, Mapping[str, Column]], **more: Any
) -> Iterator[str]:
    """Yield a line for every mistake in the columns of a part of a dive, as `_wrong_columns` does."""
    for mistake in _wrong_columns(headers, others, kinds=kinds, **more):
        if len(_commanding(headers, kinds)) > 1 or headers.keys() == {"time"}:
            yield mistake


def _no_axis_in_name(path: Path, layout: Layout) -> str:
    """Explain that the name of a file does not contain an axis of the vehicle."""
    axes, word = [*layout.kinds], path.stem.lower().partition("_")[2].partition("_")[0]
    names = " or ".join(f"log_{name}*{path.suffix}" for name in axes)
    hint = did_you_mean(word, axes)
    return f"{word or repr('')} is not an axis of this vehicle: the name of the file must be {names}{hint}"


# ---- Rows ------------------------------------------------------------------------------------------------------------


def _cleaned(table: Columns, commanding: list[str]) -> tuple[Array, dict[str, Array], list[Finding]]:
    """Return ascending time (s), the columns with commands within ±1, and what was changed. Raises DataFileError."""
    columns = {name: np.frombuffer(values) for name, values in table.values.items()}
    timed = np.isfinite(columns["time"])
    commanded = np.all([timed, *(np.isfinite(columns[name]) for name in commanding)], axis=0)
    rows = np.flatnonzero(timed & commanded)
    if not rows.size:
        raise DataFileError(f"{table.path}: no row has {'both a time and a command' if commanding else 'a time'}")
    time = columns["time"][rows]
    unordered = np.flatnonzero(time < np.maximum.accumulate(time))
    if unordered.size > _MOST_UNORDERED * rows.size:
        raise table.error(int(rows[unordered[0]]), "time", "the time goes back, and stays back: two logs in one file?")
    rows = rows[np.argsort(time, kind="stable")]
    time = columns["time"][rows]
    first = np.concatenate([[True], np.diff(time) > 0.0])
    columns = {name: _merged(values[rows], first, commanded=name in commanding) for name, values in columns.items()}
    counts = {
        "rows sorted": unordered.size,
        "time stamps merged": (~first).sum(),
        "rows without time": (~timed).sum(),
        "rows without command": (timed & ~commanded).sum(),
        "torn rows": table.torn,
    }
    file = table.path.name
    findings = [Finding(kind, file=file, numbers={"count": int(n)}) for kind, n in counts.items() if n]
    for name, n in table.unread.items():
        if n and name != "time" and name not in commanding:
            findings.append(Finding("unread cells", file=file, names={"column": name}, numbers={"count": n}))
    findings += _pulse_findings(table, commanding)
    return time[first], columns, findings


def _merged(values: Array, first: Array, *, commanded: bool) -> Array:
    """Return the last value at each time; the last command is the one that is held."""
    groups = np.cumsum(first) - 1
    found = np.full(groups[-1] + 1, np.nan)
    there = np.isfinite(values)
    found[groups[there]] = values[there]
    return np.clip(found, -1.0, 1.0) if commanded else found


def _pulse_findings(table: Columns, commanding: Iterable[str]) -> Iterator[Finding]:
    """Count the values that stand for no pulse, and the pulses beyond full thrust."""
    pulsed = [name for name in commanding if table.units[name] in PULSES]
    if not pulsed:
        return
    without_pulse: Counter[str] = Counter()
    for row in table.texts(*pulsed):
        without_pulse.update(name for name, text in zip(pulsed, row, strict=True) if text and float(text) in NO_OUTPUT)
    for name in pulsed:
        beyond = sum(abs(value) > 1.0 for value in table.values[name])
        for kind, count in (("no pulse", without_pulse[name]), ("pulse beyond full thrust", beyond)):
            if count:
                yield Finding(kind, file=table.path.name, names={"column": name}, numbers={"count": count})


# ---- Commands and motion ---------------------------------------------------------------------------------------------


def _mixed_inputs(layout: Layout, inputs: Mapping[str, Array]) -> dict[str, Array]:
    """Return the command of each thruster, within ±1, from the inputs; an input without a column is 0."""
    still = np.zeros_like(inputs["time"])
    return {
        name: np.clip(sum((gain * inputs.get(u, still) for u, gain in gains.items()), still), -1.0, 1.0)
        for name, gains in layout.gains.items()
    }


def _thruster_commands(layout: Layout, columns: Mapping[str, Array]) -> dict[str, Array]:
    """Return the column of each thruster; a thruster without a column has the command 0."""
    still = np.zeros_like(columns["time"])
    return {t.name: columns.get(f"thruster {t.name}", still) for t in layout.thrusters}


def _signals(sensors: Mapping[str, _Sensor], time: Array, columns: Mapping[str, Array]) -> list[Signal]:
    """Return the signal of each sensor."""
    found = ((sensor, columns[name]) for name, sensor in sensors.items() if name in columns)
    return [Signal(sensor.axis, sensor.quantity, time, values) for sensor, values in found]
