"""Logs of one test or of a whole dive, as they come: CSV files here, MAVLink logs in mavlink.py.

A CSV log has a column `time`; commands, as `command` of the axis that the log is of, or as a column for each input of
the vehicle (`u_<name>`) or for each thruster; and what was measured. What cannot be used is left out, counted and told.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from rov_fmu.io.csv_table import Column, Columns, DataFileError, read_columns
from rov_fmu.io.messages import did_you_mean, shown, similar
from rov_fmu.model.layout import HEAVE, YAW, Axis, Layout
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.columns import (
    LOGGED_COMMAND,
    NO_OUTPUT,
    PULSES,
    TIME,
    position_column,
    refuse_slips,
    velocity_column,
)
from rov_fmu.tank.mavlink import SUFFIXES, read_mavlink
from rov_fmu.tank.recording import Recording
from rov_fmu.tank.signals import LEAST_SAMPLES, Commands, Signal, recordings_of, unwrapped

_MOST_BACK = 0.2  # of the rows: with more of them out of order the time begins anew
_COMMAND = "command"
_STATES = {HEAVE: "z", YAW: "psi"}
"""What the FMU calls a position."""


@dataclass(frozen=True)
class Log:
    """What a log yields."""

    recordings: tuple[Recording, ...]
    notes: tuple[str, ...] = ()
    """What was left out and why, with the name of the file; counted."""


def read_log(path: Path, layout: Layout, axis: Axis | None = None) -> Log:
    """Every axis of the vehicle that the log tells of, or the one that it is of. Raises DataFileError."""
    if path.suffix.lower() in SUFFIXES:
        commands, signals, notes = read_mavlink(path, layout)
        return _log(path, layout, commands, signals, notes, axis)
    sensors = _sensors([axis] if axis else [form.axis for form in layout.axes], of_one=axis is not None)
    kinds = {"inputs": _inputs(layout), "thrusters": _thrusters(layout), "axis": {_COMMAND: _LOGGED} if axis else {}}
    columns = {"time": TIME, **kinds["axis"], **kinds["inputs"], **kinds["thrusters"]}
    columns |= {name: sensor.column for name, sensor in sensors.items()}
    check_header = partial(_wrong_columns, path=path, layout=layout, kinds=kinds, sensors=sensors)
    table = read_columns(path, columns, others=True, loose=True, check_header=check_header)
    ((kind, commanding),) = _commanding(table.values, kinds).items()
    refuse_slips(table, commanding)
    time, values, notes = _cleaned(table, commanding)
    del table  # a long log is large
    signals = _signals(sensors, time, values)
    if kind == "axis":
        return Log((_of_one_command(path, signals[0], values[_COMMAND]),), _named(path, notes))
    notes += tuple(f"no column of {name}, which is taken as 0" for name in kinds[kind] if name not in values)
    commands = Commands(time, _reaching(layout, values) if kind == "inputs" else _each(layout, values))
    del values
    return _log(path, layout, commands, signals, notes)


def _log(
    path: Path,
    layout: Layout,
    commands: Commands,
    signals: Iterable[Signal],
    notes: Iterable[str],
    axis: Axis | None = None,
) -> Log:
    found, reasons = recordings_of(path.name, layout, commands, signals, axis)
    if not found:
        raise DataFileError(*(f"{path}: {reason}" for reason in reasons or ["nothing measured of any axis"]))
    return Log(found, _named(path, (*notes, *reasons)))


def _named(path: Path, notes: Iterable[str]) -> tuple[str, ...]:
    return tuple(f"{path.name}: {note}" for note in notes)


def _of_one_command(path: Path, signal: Signal, command: Array) -> Recording:
    """Of an axis whose thrusters follow one command."""
    if (count := int(np.isfinite(signal.values).sum())) < LEAST_SAMPLES:
        raise DataFileError(f"{path}: {count} samples of {signal.quantity}, at least {LEAST_SAMPLES} are needed")
    values = unwrapped(signal.values) if signal.quantity == "heading" else signal.values
    return Recording(path.name, signal.axis, signal.quantity, signal.time - signal.time[0], command, values)


# ---- Columns ---------------------------------------------------------------------------------------------------------

_LOGGED = replace(LOGGED_COMMAND, optional=True)


@dataclass(frozen=True)
class _Sensor:
    """A column of motion."""

    axis: Axis
    quantity: str
    column: Column


def _sensors(axes: Iterable[Axis], *, of_one: bool) -> dict[str, _Sensor]:
    """By the names of their columns, positions before velocities; in a log of one axis the name needs not say which."""
    found = {}
    for axis in axes:
        for quantity in (axis.position, "velocity"):
            velocity = quantity == "velocity"
            column = velocity_column(axis, optional=True, least=0.0) if velocity else position_column(axis)
            long, state = f"{axis.name} {quantity}", axis.velocity if velocity else _STATES.get(axis)
            name = quantity if of_one or (axis in _STATES and not velocity) else long
            column = replace(column, also=tuple(filter(None, (long, state))))
            found[name] = _Sensor(axis, quantity, column)
    return found


def _inputs(layout: Layout) -> dict[str, Column]:
    """The inputs of the vehicle; where each drives one thruster, by the name of the thruster too."""
    names = {f"u_{t.name}": (t.name,) for t in layout.thrusters} if not layout.mix else {}
    return {name: replace(_LOGGED, also=names.get(name, ())) for name in layout.commands}


def _thrusters(layout: Layout) -> dict[str, Column]:
    """The thrusters, where inputs drive several."""
    return {f"thruster {t.name}": replace(_LOGGED, also=(t.name,)) for t in layout.thrusters} if layout.mix else {}


def _commanding(names: Iterable[str], kinds: Mapping[str, Mapping[str, Column]]) -> dict[str, list[str]]:
    """The columns of commands that a log has, by the kind of the commands."""
    has = {*names}
    return {kind: found for kind, of in kinds.items() if (found := [name for name in of if name in has])}


def _wrong_columns(
    headers: Mapping[str, str],
    others: Iterable[str],
    path: Path,
    layout: Layout,
    kinds: Mapping[str, Mapping[str, Column]],
    sensors: Mapping[str, _Sensor],
) -> Iterator[str]:
    """What is wrong with the columns of a log, by the headers that are read and the others."""
    found, others = _commanding(headers, kinds), [*others]
    of_one = next((title for title in others if title.partition("[")[0].strip().casefold() == _COMMAND), None)
    if not found and of_one:
        yield f"column {shown(of_one)} is the command of one axis, but {_of_no_axis(path, layout)}"
        return
    if not found:
        wanted = " or ".join(", ".join(of) for of in kinds.values() if of)
        unread = {title.partition("[")[0].strip(): shown(title) for title in others}
        near = dict.fromkeys(unread[name] for of in kinds.values() for column in of for name in similar(column, unread))
        hint = f"; is it the column {' or '.join(near)}?" if near else ""
        yield f"no column of commands: {wanted}, each in [%], [1] or [us]{hint}"
    if len(found) > 1:
        titles = ", ".join(shown(headers[names[0]]) for names in found.values())
        yield f"columns {titles}: the commands of the axis, of the inputs or of the thrusters, not several"
    if not any(name in headers for name in sensors):
        titles = " or ".join(f"'{name} [{next(iter(s.column.units))}]'" for name, s in sensors.items())
        yield f"column {titles} is missing"


def _of_no_axis(path: Path, layout: Layout) -> str:
    """Why the name of a file does not tell of which axis of the vehicle the log is."""
    axes, word = [*layout.kinds], path.stem.lower().partition("_")[2].partition("_")[0]
    names = " or ".join(f"log_{name}*{path.suffix}" for name in axes)
    hint = did_you_mean(word, axes)
    return f"{word or repr('')} is not an axis of this vehicle: the name of the file must be {names}{hint}"


# ---- Rows ------------------------------------------------------------------------------------------------------------


def _cleaned(table: Columns, commanding: list[str]) -> tuple[Array, dict[str, Array], tuple[str, ...]]:
    """Ascending time (s), columns, commands within ±1, and what was left out or changed. Raises DataFileError."""
    columns = {name: np.frombuffer(values) for name, values in table.values.items()}
    timed = np.isfinite(columns["time"])
    commanded = np.all([np.isfinite(columns[name]) for name in commanding], axis=0)
    rows = np.flatnonzero(timed & commanded)
    if not rows.size:
        raise DataFileError(f"{table.path}: no row has both a time and a command")
    time = columns["time"][rows]
    back = np.flatnonzero(time < np.maximum.accumulate(time))
    if back.size > _MOST_BACK * rows.size:
        raise table.error(int(rows[back[0]]), "time", "the time goes back, and stays back: two logs in one file?")
    rows = rows[np.argsort(time, kind="stable")]
    time = columns["time"][rows]
    first = np.concatenate([[True], np.diff(time) > 0.0])
    columns = {name: _merged(values[rows], first, commanded=name in commanding) for name, values in columns.items()}
    told = (
        (back.size, "row", "out of order sorted"),
        (int((~first).sum()), "repeated time stamp", "merged"),
        (int((~timed).sum()), "row", "without a time left out"),
        (int((timed & ~commanded).sum()), "row", "without a command left out"),
        (table.torn, "row", "with more cells than the header left out"),
        *(
            (n, "cell", f"of {name} without a number taken as blank")
            for name, n in table.unread.items()
            if name != "time" and name not in commanding
        ),
    )
    notes = [", ".join(f"{n} {what}{'s' if n > 1 else ''} {done}" for n, what, done in told if n)]
    notes += _on_pulses(table, commanding)
    return time[first], columns, tuple(filter(None, notes))


def _merged(values: Array, first: Array, *, commanded: bool) -> Array:
    """One value for each time: the last command, which is the one that is held; the last that was measured."""
    groups = np.cumsum(first) - 1
    found = np.full(groups[-1] + 1, np.nan)
    there = np.isfinite(values)
    found[groups[there]] = values[there]
    return np.clip(found, -1.0, 1.0) if commanded else found


def _on_pulses(table: Columns, commanding: Iterable[str]) -> list[str]:
    """How many were none, and how many are beyond full thrust."""
    pulsed = [name for name in commanding if table.units[name] in PULSES]
    none: Counter[str] = Counter()
    for row in table.texts(*pulsed) if pulsed else ():
        none.update(name for name, text in zip(pulsed, row, strict=True) if text and float(text) in NO_OUTPUT)
    notes = []
    for name in pulsed:
        beyond = sum(abs(value) > 1.0 for value in table.values[name])
        told = [f"{none[name]} of 0 or 65535 us taken as no command"] if none[name] else []
        told += [f"{beyond} beyond full thrust taken as full thrust"] if beyond else []
        notes += [f"pulses of {name}: {', '.join(told)}"] if told else []
    return notes


# ---- Commands and motion ---------------------------------------------------------------------------------------------


def _reaching(layout: Layout, inputs: Mapping[str, Array]) -> dict[str, Array]:
    """What reaches each thruster of the inputs, within ±1; an input without a column is 0."""
    still = np.zeros_like(inputs["time"])
    return {
        name: np.clip(sum((gain * inputs.get(of, still) for of, gain in gains.items()), still), -1.0, 1.0)
        for name, gains in layout.gains.items()
    }


def _each(layout: Layout, columns: Mapping[str, Array]) -> dict[str, Array]:
    """The columns of the thrusters; one without is at 0."""
    still = np.zeros_like(columns["time"])
    return {t.name: columns.get(f"thruster {t.name}", still) for t in layout.thrusters}


def _signals(sensors: Mapping[str, _Sensor], time: Array, columns: Mapping[str, Array]) -> list[Signal]:
    """What was measured of each axis: the position, unless the velocity alone has enough samples."""
    found: dict[str, Signal] = {}
    for name, sensor in sensors.items():
        if name in columns:
            signal = Signal(sensor.axis, sensor.quantity, time, columns[name])
            before = found.get(sensor.axis.name)
            if not before or np.isfinite(before.values).sum() < LEAST_SAMPLES:
                found[sensor.axis.name] = signal
    return list(found.values())
