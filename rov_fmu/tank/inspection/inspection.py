"""List the content of logs before a vehicle is known, and the headers that rov.toml would have to explain."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import inf, pi
from pathlib import Path

import numpy as np

from rov_fmu.io.csv_table import NEUTRAL, NO_OUTPUT, PULSES, Column, read_columns, read_header
from rov_fmu.io.file_kinds import LOG_SUFFIXES
from rov_fmu.model.layout import AXES, Axis, Curve, Layout, Thruster, VehicleAxis
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.columns import velocity_column
from rov_fmu.tank.description import RovFile
from rov_fmu.tank.findings import Finding
from rov_fmu.tank.formats.content import PULSE_RANGE, Content, Wanted
from rov_fmu.tank.formats.csv_columns import Names, is_column
from rov_fmu.tank.formats.csv_log import read_csv
from rov_fmu.tank.inspection.table_headers import header_parts
from rov_fmu.tank.logs import READERS
from rov_fmu.tank.recording import CONTEXT, signal_name
from rov_fmu.tank.signals import gaps
from rov_fmu.tank.tables import TABLES

_COMMAND = re.compile(
    r"(?<![a-z])(?:thr|thrusters?|motors?|propellers?|pwm|esc)(?![a-z])"
    r"|(?<![a-z])(?:servo|cmd|command|u)[ _]*\d+(?![a-z0-9])|^u_\S+$"
)
_GENERAL = re.compile(
    r"^(?:(?:thr|thrusters?|motors?|propellers?|pwm|esc|servo|cmd|command|u)(?=\d|$)|(?:raw|out|output)$)",
    re.IGNORECASE,
)
"""The general parts of the headers of commands, which do not identify a thruster."""
_UNITS_OF_COMMANDS = {"", "1", "-", "%", "pwm"}
_NO_COMMAND = {
    *("current", "voltage", "battery", "power", "temp", "temperature", "humidity", "rpm", "speed", "rate", "load"),
    *("status", "state", "fault", "error", "mode", "id", "enabled", "armed", "cpu", "gain", "light", "lights"),
    *("rc", "stick", "joystick"),
}
"""Words in headers of columns that are not commands of thrusters."""
_USUAL_PULSES = 1000.0, 2000.0
_REST = 20.0
"""The largest distance of the usual pulse of a thruster from the neutral one, µs."""
_NAME = re.compile(r"[a-z][a-z0-9_]*|[1-9][0-9]?", re.IGNORECASE)
"""A name of a thruster that a vehicle file may have."""
_LIKELY = {
    "depth": {"m": 100.0, "cm": 1e4, "mm": inf},
    "heading": {"rad": 2.1 * pi, "deg": inf},
    "roll": {"rad": pi, "deg": inf},
    "pitch": {"rad": 0.5 * pi, "deg": inf},
    "voltage": {"V": 1000.0, "mV": inf},
}
"""The columns that are recognised by a word, with their units. Each unit has the largest number for which it is
likely."""
_WORDS = {name: name for name in _LIKELY} | dict.fromkeys(("yaw", "compass", "hdg"), "heading") | {"battery": "voltage"}
_WANTED = {"set", "target", "desired"}
_NOT_MEASURED = {"rate", "speed", *_WANTED}
_DIRECTIONS = {
    "surge": ("surge", "forward", "ahead", "vx"),
    "sway": ("sway", "side", "sideways", "lateral", "vy"),
    "heave": ("heave", "vertical", "vz"),
    "yaw": ("yaw", "turn", "heading", "gyroz"),
    "roll": ("roll", "gyrox"),
    "pitch": ("pitch", "gyroy"),
}
"""The words by which the axis of a column of velocities is recognised; Gyro_Z has the word gyroz too."""


@dataclass(frozen=True)
class Row:
    """What one signal of a log contains."""

    name: str
    unit: str
    start: float
    """The time of the first sample, s."""
    samples: int
    rate: float
    """The usual rate, 1/s."""
    low: float
    high: float
    gaps: Sequence[tuple[float, float]]


@dataclass(frozen=True)
class Inspection:
    """What a log contains."""

    path: Path
    commands: tuple[Row, ...]
    """The commands of the thrusters in order, or the single command of an axis."""
    signals: tuple[Row, ...]
    unread: Mapping[str, str]
    """A description of everything that is not recognised, by name. For a column it is the range of its values."""
    findings: tuple[Finding, ...]
    columns: Mapping[str, str] = field(default_factory=dict)
    """Headers of columns of logs that seem to be meant, by the headers of the file."""


def inspect(path: Path, layouts: Iterable[Layout], described: RovFile | None = None) -> Inspection:
    """Return what a log contains.

    The thrusters and columns of a CSV log have the names of the described vehicle. Without one, the thrusters have the
    names of the first layout that fits, or else names that follow from the headers. Raises DataFileError.
    """
    columns: Mapping[str, str] = {}
    if read := READERS.get(path.suffix.lower()):
        content = read(path, Wanted())
        command = None
    else:
        titles = read_header(path)
        numbers, ranges = _numbers(path, titles)
        axis = next((AXES[word] for word in path.stem.lower().split("_") if word in AXES), None)
        if described and described.description:
            layout, columns = _with_all_axes(described.description.layout), described.columns
        else:
            layout, columns = _guessed(titles, numbers, axis, layouts)
        content, command = read_csv(path, layout, axis, Names(columns), is_part=True)
        unread = [title for title in titles if not is_column(columns.get(title, title), layout, axis)]
        content.unread = {title: ranges[title] for title in unread}
    rows = [_row("command", "1", *command)] if command else [*_commands(content)]
    return Inspection(path, tuple(rows), tuple(_signals(content)), content.unread, tuple(content.findings), columns)


def logs_of(path: Path) -> list[Path]:
    """Return the logs in a folder, or in the folder of a bag, or the path itself; tables of tank tests are no logs."""
    if not path.is_dir():
        return [path]
    tables = tuple(f"{kind}_" for kind in TABLES)
    logs = (file for file in path.iterdir() if file.name.lower().endswith((".csv", *LOG_SUFFIXES)))
    return sorted(file for file in logs if not file.name.lower().startswith(tables))


def fitting(names: Sequence[str], layouts: Iterable[Layout]) -> Layout | None:
    """Return the first layout with the same number of thrusters. None if the names are neither its names nor
    numbers."""
    found = next((layout for layout in layouts if len(layout.thrusters) == len(names)), None)
    fits = found and ({*names} == {thruster.name for thruster in found.thrusters} or all(map(str.isdigit, names)))
    return found if fits else None


def _with_all_axes(layout: Layout) -> Layout:
    return replace(layout, axes=tuple(VehicleAxis(axis) for axis in AXES.values()))


def _layout(names: Iterable[str]) -> Layout:
    """Return a layout of thrusters of which only the names are known."""
    return Layout((), (Curve("t"),), tuple(Thruster(name, "t", (1.0, 0.0, 0.0), arm=1) for name in names))


def _names(titles: Sequence[str]) -> list[str]:
    """Return names of thrusters for columns of commands: what is particular in those of the columns, or else numbers.

    The particular part of `thr_FS_pwm` is `FS`. Where it is a letter and a number in all columns, it is the number.
    """
    parts = [header_parts(title)[0] for title in titles]
    particular = ["_".join(filter(None, map(_particular, re.split(r"[\W_]+", part)))) for part in parts]
    numbered = [re.fullmatch(r"([a-z]?)(\d+)", name.casefold()) for name in particular]
    if len({match and match[1] for match in numbered}) == 1:
        particular = [match[2] if match else name for match, name in zip(numbered, particular, strict=True)]
    for names in (particular, parts):
        if all(_NAME.fullmatch(name) for name in names) and len({name.casefold() for name in names}) == len(names):
            return names
    return [str(n + 1) for n in range(len(titles))]


def _particular(word: str) -> str:
    """Return the specific part of a word of a header."""
    return _GENERAL.sub("", word)


def _row(name: str, unit: str, time: Array, values: Array) -> Row:
    there = np.isfinite(values)
    at, found = time[there], values[there]
    rate = 1.0 / float(np.median(np.diff(at))) if len(at) > 1 else 0.0
    low, high = (float(found.min()), float(found.max())) if len(found) else (np.nan, np.nan)
    return Row(name, unit, float(at[0]) if len(at) else 0.0, len(found), rate, low, high, gaps(time, values))


def _commands(content: Content) -> Iterator[Row]:
    if content.commands:
        for name, values in content.commands.thrusters.items():
            yield _row(f"thruster {name}", "1", content.commands.time, values)


def _signals(content: Content) -> Iterator[Row]:
    for signal in content.signals:
        name, axis = signal.quantity, signal.axis
        if axis is None:
            yield _row(name, CONTEXT[name], signal.time, signal.values)
        else:
            unit = axis.unit if name == "velocity" else axis.position_unit
            yield _row(signal_name(axis, name), unit, signal.time, signal.values)


# ---- Columns of unknown names ----------------------------------------------------------------------------------------


def _numbers(path: Path, titles: Sequence[str]) -> tuple[dict[str, Array], dict[str, str]]:
    """Return the numbers of every column as they stand in the file, and their range in words.

    A header that several columns share gets no numbers, because it is ambiguous.
    """
    names = {title: f"{n} [1]" for n, title in enumerate(titles) if titles.count(title) == 1}
    columns = {str(n): Column({"1": 1.0}, True, True) for n in range(len(titles))}
    table = read_columns(path, columns, others=True, loose=True, renamed=names)
    numbers, ranges = dict.fromkeys(titles, np.empty(0)), dict.fromkeys(titles, "")
    for title, name in names.items():
        values = np.frombuffer(table.values[name.removesuffix(" [1]")])
        numbers[title] = found = values[np.isfinite(values)]
        if table.unread[name.removesuffix(" [1]")] > len(found):
            ranges[title] = "text"
        elif len(found):
            ends = [f"{end:g}" for end in (found.min(), found.max())]
            ranges[title] = " to ".join(ends) if ends[0] != ends[1] else f"always {ends[0]}"
        else:
            ranges[title] = "empty"
    return numbers, ranges


def _guessed(
    titles: Sequence[str], numbers: Mapping[str, Array], axis: Axis | None, layouts: Iterable[Layout]
) -> tuple[Layout, dict[str, str]]:
    """Return a layout with the thrusters that a CSV file seems to have, and what its headers seem to mean."""
    commanding = [title for title in titles if _is_command(title, numbers[title])]
    names = _names(commanding)
    shipped = fitting(names, layouts)
    layout = _with_all_axes(shipped or _layout(names))
    known = [thruster.name for thruster in layout.thrusters]
    meant = dict(zip(commanding, names if {*names} == {*known} else known, strict=True))
    return layout, dict(_renamed(titles, numbers, meant, layout, axis))


def _is_command(title: str, numbers: Array) -> bool:
    """Return True for the command of a thruster, by its name, unit and size, or for pulses that rest at 1500 us."""
    name, unit = header_parts(title)
    words = {*re.findall("[a-z]+", name.casefold())}
    is_possible = unit.casefold() in _UNITS_OF_COMMANDS or unit.startswith(PULSES)
    if not is_possible or not len(numbers) or _NO_COMMAND & words:
        return False
    given = numbers[~np.isin(numbers, NO_OUTPUT)]
    if _COMMAND.search(name.casefold()) or (unit == "%" and not {*_WORDS} & words):
        return bool((np.abs(given) <= 100.0).all()) or _within(given, PULSE_RANGE)
    values, counts = np.unique(given, return_counts=True)
    return _within(given, _USUAL_PULSES) and abs(values[counts.argmax()] - NEUTRAL) <= _REST


def _within(numbers: Array, ends: tuple[float, float]) -> bool:
    return bool(len(numbers) and (ends[0] <= numbers).all() and (numbers <= ends[1]).all())


def _renamed(
    titles: Sequence[str], numbers: Mapping[str, Array], commands: Mapping[str, str], layout: Layout, axis: Axis | None
) -> Iterator[tuple[str, str]]:
    """Yield what unknown headers seem to mean; the headers of commands have the names of thrusters."""
    if not all(is_column(title, layout, axis) for title in commands):
        for title, name in commands.items():
            yield title, f"u_{name} [{_unit_of_command(title, numbers)}]"
    taken: set[str] = set()
    for title in titles:
        (name, unit), most = header_parts(title), float(np.abs(numbers[title]).max(initial=0.0))
        words = re.findall("[a-z]+", name.casefold())
        if title in commands or is_column(title, layout, axis):
            continue
        meant = next((name for word, name in _WORDS.items() if word in words), "")
        if {"time", "t", "timestamp"} & {*words} and "time" not in taken:
            usual = float(np.median(np.diff(numbers[title]))) if len(numbers[title]) > 1 else 0.0
            yield title, f"time [{unit if unit in ('s', 'ms') else 'ms' if usual > 5.0 else 's'}]"
            taken.add("time")
        elif (velocity := _velocity(words, unit)) and velocity not in taken:
            yield title, f"{velocity} [{unit}]"
            taken.add(velocity)
        elif meant and meant not in taken and not _NOT_MEASURED & {*words}:
            likely = next(one for one, largest in _LIKELY[meant].items() if most <= largest)
            yield title, f"{meant} [{unit if unit in _LIKELY[meant] else likely}]"
            taken.add(meant)


def _velocity(words: Sequence[str], unit: str) -> str:
    """Return the column of velocities that the words and the unit of a header mean, or an empty text."""
    if not _WANTED & {*words}:
        known = {*words, *map("".join, pairwise(words))}
        for name, directions in _DIRECTIONS.items():
            if {*directions} & known and unit in velocity_column(AXES[name]).units:
                return f"{name} velocity"
    return ""


def _unit_of_command(title: str, numbers: Mapping[str, Array]) -> str:
    """Return the unit of a command: from its header, or else from the size of the values."""
    _, unit = header_parts(title)
    most = float(np.abs(numbers[title]).max())
    known = unit in ("%", "1", *PULSES) or unit.startswith(PULSES)
    return unit if known else "1" if most <= 1.0 else "%" if most <= 100.0 else "us"
