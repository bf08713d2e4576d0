"""Read a log in a CSV file.

It has a column `time`, columns of commands and columns of measured motion. The commands are one column `command` in a
log of one axis, or a column for each input of the vehicle (`u_<name>`), or a column for each thruster. Rows and cells
that cannot be used are left out and counted.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from rov_fmu.io.csv_table import NO_OUTPUT, PULSES, Column, Columns, DataFileError, read_columns
from rov_fmu.io.messages import did_you_mean, shown, similar
from rov_fmu.model.layout import Axis, Layout
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.columns import RENAMING, TIME, refuse_slips
from rov_fmu.tank.findings import Finding
from rov_fmu.tank.formats.content import Content
from rov_fmu.tank.formats.csv_columns import (
    COMMAND,
    CONDITIONS,
    LOGGED,
    Names,
    Sensor,
    inputs_of,
    sensors_of,
    thrusters_of,
)
from rov_fmu.tank.signals import Commands, Signal

_MOST_UNORDERED = 0.2
"""The largest share of rows out of order. If it is exceeded, the file contains two logs."""
_LEAST_AFTER_CLOCK = 10
"""The least number of consecutive rows after a clock was set back. Fewer rows are only out of order."""
_AGAIN = 0.5
"""The least number of earlier rows that have times in the range of these rows, as a share of their number."""
_IN_PULSES = tuple(f"{left}{unit}{right}" for unit in PULSES for left, right in ("[]", "()"))
"""The ends of headers in pulse widths, such as "PWM (us)": such a column may have commands."""
_Command = tuple[Array, Array]


def read_csv(
    path: Path, layout: Layout, axis: Axis | None, names: Names, *, is_part: bool = False
) -> tuple[Content, _Command | None]:
    """Read a CSV file. Return its content and, for a log of one axis, the times and the command of the axis (otherwise
    None).

    A part of a dive may have only commands or only motion. Raises DataFileError.
    """
    axes = [axis] if axis else [form.axis for form in layout.axes]
    sensors = sensors_of(axes, of_one=axis is not None)
    conditions = {name: sensor for name, sensor in CONDITIONS.items() if name not in sensors}
    kinds = {"inputs": inputs_of(layout), "thrusters": thrusters_of(layout), "axis": {COMMAND: LOGGED} if axis else {}}
    columns = {"time": TIME, **kinds["axis"], **kinds["inputs"], **kinds["thrusters"]}
    columns |= {name: sensor.column for name, sensor in (sensors | conditions).items()}
    check = _wrong_columns_of_part if is_part else _wrong_columns
    check_header = partial(check, path=path, layout=layout, kinds=kinds, sensors=sensors)
    table = read_columns(
        path, columns, others=True, loose=True, renamed=names.columns, hint=RENAMING, check_header=check_header
    )
    kind, commanding = next(iter(_commanding(table.values, kinds).items()), ("", []))
    refuse_slips(table, commanding)
    time, values, findings = _cleaned(table, commanding)
    content = Content(path.name, findings=findings, known={*table.header})
    del table  # a long log is large
    content.signals = [*_signals(sensors, time, values), *_signals(conditions, time, values)]
    if kind == "axis":
        return content, (time, values[COMMAND])
    missing = (name for name in kinds.get(kind, ()) if name not in values)
    content.findings += [Finding("missing column", file=path.name, names={"column": name}) for name in missing]
    if kind:
        thrusters = mixed_inputs(layout, values) if kind == "inputs" else _thruster_commands(layout, values)
        content.commands = Commands(time, thrusters)
    return content, None


# ---- Columns ---------------------------------------------------------------------------------------------------------


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
    sensors: Mapping[str, Sensor],
) -> Iterator[str]:
    """Yield a line for every mistake in the columns of a log, from the headers that are read and the others."""
    found = _commanding(headers, kinds)
    unread = {title.replace("(", "[").partition("[")[0].strip(): shown(title) for title in others}
    renaming = RENAMING if unread else ""
    command = next((title for name, title in unread.items() if name.casefold() == COMMAND), None)
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
        yield (
            f"there is no column of commands. Possible columns: {wanted}, each in [%], [1] or [us]{hint or renaming}"
        )
    if len(found) > 1:
        titles = ", ".join(shown(headers[names[0]]) for names in found.values())
        yield (
            f"columns {titles}: a log must have the commands of the axis, of the inputs or of the thrusters, "
            "but only one of these"
        )
    if not any(name in headers for name in sensors):
        titles = " or ".join(f"'{name} [{next(iter(s.column.units))}]'" for name, s in sensors.items())
        yield f"column {titles} is missing{renaming}"


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
    """Return the times in ascending order (s), the columns (commands limited to ±1), and findings about the changes.
    Raises DataFileError."""
    columns = {name: np.frombuffer(values) for name, values in table.values.items()}
    timed = np.isfinite(columns["time"])
    commanded = np.all([timed, *(np.isfinite(columns[name]) for name in commanding)], axis=0)
    rows = np.flatnonzero(timed & commanded)
    if not rows.size:
        raise DataFileError(f"{table.path}: no row has {'both a time and a command' if commanding else 'a time'}")
    time = columns["time"][rows]
    unordered = np.flatnonzero(time < np.maximum.accumulate(time))
    if set_back := _clock_set_back(time):
        row, seconds = set_back
        reason = f"the clock goes back by {seconds:.3g} s, and on from there over times that were logged before: "
        raise table.error(int(rows[row]), "time", f"{reason}split the log before this line into two files")
    if unordered.size > _MOST_UNORDERED * rows.size:
        raise table.error(
            int(rows[unordered[0]]), "time", "the time goes back and does not return. Are there two logs in one file?"
        )
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


def _clock_set_back(time: Array) -> tuple[int, float] | None:
    """Return the row from which a log goes on at an earlier time and by how much (s), or None.

    Rows that only arrived late fill a gap between earlier rows. After a clock was set back, times occur a second time.
    """
    latest = np.maximum.accumulate(time)
    goes_on = np.concatenate([[False], (time[1:] < latest[1:]) & (np.diff(time) >= 0.0)])
    edges = np.flatnonzero(np.diff(np.concatenate([[False], goes_on, [False]]).astype(int)))
    for start, end in zip(edges[::2] - 1, edges[1::2], strict=True):  # the first row goes back, the others go on
        again = (time[:start] >= time[start]) & (time[:start] <= time[end - 1])
        if end - start >= _LEAST_AFTER_CLOCK and again.sum() >= _AGAIN * (end - start):
            return int(start), float(latest[start] - time[start])
    return None


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


def mixed_inputs(layout: Layout, inputs: Mapping[str, Array]) -> dict[str, Array]:
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


def _signals(sensors: Mapping[str, Sensor], time: Array, columns: Mapping[str, Array]) -> list[Signal]:
    """Return the signal of each sensor."""
    found = ((sensor, columns[name]) for name, sensor in sensors.items() if name in columns)
    return [Signal(sensor.axis, sensor.quantity, time, values) for sensor, values in found]
