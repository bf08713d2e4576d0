"""What unknown headers of CSV files seem to mean, before a vehicle is known."""

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import groupby, islice, takewhile
from math import inf, pi
from pathlib import Path

import numpy as np

from rov_fmu.equation.catalogue import AXES, Axis
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import Curve, SourcedVector, Thruster, VehicleAxis
from rov_fmu.io.columns import NEUTRAL, NO_OUTPUT, PULSES, KnownColumns
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.catalogue import (
    COMMANDS,
    FALSE_FRIENDS,
    FORCE,
    HEADERS,
    NOT_COMMANDED,
    NOT_MEASURED,
    PLURALS,
    QUANTITIES,
    THRUSTER,
    TIMES,
    TORQUE,
    meanings,
    unit_names,
    words_in,
)
from rov_fmu.tank.columns import COMMAND, columns_of, columns_of_log, has_column
from rov_fmu.tank.commands import PULSE_RANGE
from rov_fmu.tank.folder import axis_in_name, kind_of_table, parts_of_name
from rov_fmu.tank.readers.listing import list_files
from rov_fmu.tank.readers.parsers import header_of

_HEADER = re.compile(r"(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]\s*")
_NO_UNIT = re.compile(r".*\S\(\d+\)|.*[\[(][xyz][\])]\s*", re.IGNORECASE)
_PERCENT = re.compile(r"(?P<name>.*\S)\s+(?P<unit>%)")
_MOST_THRUSTERS = 32
"""The largest number of columns of a CSV file that are taken as the commands of thrusters; no vehicle has more."""
_FEWEST_ROWS = 50
"""The least number of rows of a log whose clock is guessed. In a shorter table, commands may rise."""
_USUAL_PULSES = 1000.0, 2000.0
_REST = 20.0
"""The largest distance of the usual pulse of a thruster from the neutral one, µs."""
_IDLE_PULSE = 100.0
"""The largest distance of the only pulse of a thruster that is not used from the usual neutral one, µs."""
_FEWEST_WORKING = 3
"""The least number of numbered outputs that never rest and are taken as commands of thrusters."""
_NO_THRUSTER = 2
"""The grade of a header that names no thruster."""
_NO_COMMAND = {"rc", "rcin", "max", "min", "limit", "n", "kgf", "lbf", *NOT_COMMANDED}
"""Words in headers that are no commands: of a pilot, limits, and forces."""
_SHARES = {"force", "thrust", "torque"}
"""Words of forces, which are commands if their unit is one of commands: a thrust in percent."""
_UNKNOWN_UNITS = {
    *("a", "ma", "ah", "mah", "w", "wh", "c", "degc", "f", "k", "g", "hz", "rpm", "psi", "dbar", "ut", "gauss", "n"),
    *("percent", "pct", "raw", "count", "counts", "fathom", "fathoms", "fm", "id", "std", "var"),
}
"""Words at the end of a header that are units of other quantities, or of no measurement."""
_WITH_UNIT = {"pressure"}
"""The quantities that, like velocities, are recognised only with a unit: a pressure may be of air."""
_NAME = re.compile(r"[a-z][a-z0-9_]*|[1-9][0-9]?", re.IGNORECASE)
"""A name of a thruster that a vehicle file may have."""
_CURVE = re.compile(r"[a-z][a-z0-9_]{0,29}")
_LIKELY = {"depth": 100.0, "heading": 2.1 * pi, "roll angle": pi, "pitch angle": 0.5 * pi, "voltage": 1000.0}
"""The largest number that is likely in the SI unit. If a larger one has no unit, it is in a smaller unit."""
_EXTERNAL = {axis.external.casefold(): axis for axis in AXES.values()}
_VELOCITIES = {axis.velocity: f"{axis.name} velocity" for axis in AXES.values()}
_RATES = {True: "yaw velocity", False: "surge velocity"}
_LONG_STEP, _STEP, _LONG_LOG = 5.0, 1.5, 2e4
"""Times in seconds have no longer steps than the first number; nor than the second one in a log of five hours."""
_EPOCHS = ((1e17, "ns"), (1e14, "us"), (1e11, "ms"))
"""The least time since 1970 that is in a unit."""


@dataclass(frozen=True)
class TableHeaders:
    """The information in the names and headers of tables."""

    curves: tuple[str, ...] = ()
    """The thrust curves that are tested."""
    columns: Mapping[str, str] = field(default_factory=dict)
    """Headers of columns that seem to be meant, by the headers of the files; empty for one that is not recognised."""


def header_parts(title: str) -> tuple[str, str]:
    """Return the name and the unit in a header with brackets of any kind, or with a percent sign at its end.

    A number in round brackets right behind the name is that of a column of a matrix, such as `pwm(1)`, and the letter
    of an axis is no unit, either.
    """
    match = _HEADER.fullmatch(title) or _PERCENT.fullmatch(title)
    has_unit = match and not _NO_UNIT.fullmatch(title)
    return (match["name"].rstrip(), match["unit"]) if match and has_unit else (title, "")


def name_and_unit(title: str, units: Collection[str]) -> tuple[list[str], str | None]:
    """Return the words of a header without its unit, and which of some units that is: empty for none, None for another.

    It stands in brackets, or among the words of the name, as in `gyro_z_dps`; a letter is a unit only at the end.
    """
    name, bracket = header_parts(title)
    words, names = words_in(name), unit_names(tuple(units))
    if bracket in units:
        return words, bracket
    if bracket.strip():
        given = bracket, bracket.split()[-1]  # such as azimuth °
        return words, next((unit for one in given if (unit := names.get(" ".join(words_in(one))))), None)
    for end in range(len(words), 0, -1):
        for start in range(max(end - 3, 0), end):
            own = " ".join(words[start:end])
            if own in names and end - start < len(words) and (len(own) > 1 or end == len(words)):
                return words[:start] + words[end:], names[own]
    return words, None if len(words) > 1 and words[-1] in _UNKNOWN_UNITS else ""


def assumed_layout(thrusters: Iterable[str]) -> Layout:
    """Return a layout with all axes, and with thrusters of which only the names are known."""
    axes = tuple(VehicleAxis(axis) for axis in AXES.values())
    ahead = SourcedVector((1.0, 0.0, 0.0), "a guess")
    known = [Thruster(name=name, curve="t", direction=ahead, arm="port") for name in thrusters]
    return Layout(axes, (Curve("t"),), tuple(known))  # the names are those of a stranger, and are not checked


def fitting(names: Sequence[str], layouts: Iterable[Layout]) -> Layout | None:
    """Return the first layout with the same number of thrusters. None if the names are neither its names nor
    numbers."""
    found = next((layout for layout in layouts if len(layout.thrusters) == len(names)), None)
    fits = found and ({*names} == {thruster.name for thruster in found.thrusters} or all(map(str.isdigit, names)))
    return found if fits else None


# ---- Logs ------------------------------------------------------------------------------------------------------------


def guessed(
    titles: Sequence[str], numbers: Mapping[str, Array], axis: Axis | None, layouts: Iterable[Layout]
) -> tuple[Layout, dict[str, str]]:
    """Return a layout with the thrusters that a CSV file seems to have, and what its headers seem to mean.

    `numbers` has the numbers below each header as they stand in the file. The headers of commands mean the names of
    thrusters.
    """
    rotations = {words[:-1] for words in map(_words, titles) if words.endswith(" w")}
    meant = {title: _meant(title, numbers[title], rotations) for title in titles}
    if "time" not in meant.values():
        meant |= dict.fromkeys(_clock(meant, numbers), "time")
    layouts = [*layouts]
    commanding = _commanding(meant, numbers, layouts)
    names = _names(commanding)
    forces = {title: force for title in commanding if (force := _force(title))}
    if forces:  # beside them, a velocity may have its symbol alone
        layout = Layout.of_wrench(map(VehicleAxis, AXES.values()))
        meant = {title: name or _VELOCITIES.get(header_parts(title)[0], "") for title, name in meant.items()}
    else:
        layout = fitting(names, layouts) or assumed_layout(names)
    known = [thruster.name for thruster in layout.thrusters]
    is_column = KnownColumns(columns_of_log(layout, axis)).has
    columns = {title: f"{of.external} [{of.load}]" for title, of in forces.items() if not is_column(title)}
    if not forces and not all(map(is_column, commanding)):
        for title, name in zip(commanding, names if {*names} == {*known} else known, strict=True):
            columns[title] = f"u_{name} [{_unit_of_command(title, numbers[title])}]"
    others = {title: name for title, name in meant.items() if title not in commanding and not is_column(title)}
    if axis:
        columns |= _of_axis(axis, [title for title, name in others.items() if not name], numbers)
    return layout, columns | _measured(others, numbers, is_up=_is_up(meant, numbers))


def _of_axis(axis: Axis, titles: Iterable[str], numbers: Mapping[str, Array]) -> dict[str, str]:
    """Return what headers seem to mean in a log of one axis whose words alone say it: its command and its position."""
    found: dict[str, str] = {}
    for title in (title for title in titles if len(numbers[title])):
        words = _words(title)
        if words == COMMAND:
            found[title] = f"{COMMAND} [{_unit_of_command(title, numbers[title])}]"
        elif words in ("distance", "position") and name_and_unit(title, QUANTITIES[axis.position].units)[1] == "":
            found[title] = f"{axis.position} [{_unit(title, axis.position, numbers[title])}]"
    return found


def _commanding(meant: Mapping[str, str], numbers: Mapping[str, Array], layouts: Iterable[Layout]) -> list[str]:
    """Return the headers of the commands of thrusters, or else those of forces that are applied.

    Outputs are numbered: if one is a command, then so are the others of its name, unit and range.
    """
    possible = [title for title in meant if _may_be_command(title, numbers[title])]
    sure = {title for title in possible if _is_command(title, numbers[title], meant[title])}
    families: dict[tuple[str, str, bool], list[str]] = {}
    for title in possible:
        name, unit = header_parts(title)
        families.setdefault((re.sub(r"\d+", "#", name), unit, _are_pulses(numbers[title])), []).append(title)
    for (name, _, are_pulses), own in families.items():
        is_sure = not sure.isdisjoint(own) or (are_pulses and _work_all_the_time([numbers[title] for title in own]))
        if "#" in name and is_sure:
            sure.update(own)
    chosen = [title for title in possible if title in sure]
    best = min(map(_grade, chosen), default=0)
    chosen = [title for title in chosen if _grade(title) == best < _NO_THRUSTER][:_MOST_THRUSTERS]
    outputs = {name: numbers[title] for name, title in zip(_names(chosen), chosen, strict=True)}
    ends = {name: (float(own.min()), float(own.max())) for name, own in outputs.items()}
    is_pulse = any(map(_are_pulses, outputs.values()))
    kept = likely_thrusters(ends, layouts, *((NEUTRAL, _IDLE_PULSE) if is_pulse else (0.0, 0.0)))
    return [title for name, title in zip(ends, chosen, strict=True) if name in kept] or [
        title for title in meant if _force(title) and len(numbers[title])
    ]


def likely_thrusters(
    ends: Mapping[str, tuple[float, float]], layouts: Iterable[Layout], rest: float = 0.0, idle: float = 0.25
) -> list[str]:
    """Return the names of the outputs that seem to drive thrusters, from the ends of the range of each, in order.

    An output that never changes drives no thruster, unless it idles, which is closer to `rest` than `idle`, and an
    output after it changes, or a vehicle has as many.
    """
    if not any(low < high for low, high in ends.values()):
        return [*ends]
    names = [name for name, (low, high) in ends.items() if low < high or abs(low - rest) <= idle]
    last = max(n for n, name in enumerate(names, start=1) if ends[name][0] < ends[name][1])
    known = [*layouts]
    return next((names[:n] for n in range(last, len(names) + 1) if fitting(names[:n], known)), names[:last])


def _grade(title: str) -> int:
    """Return 0 for a header that may be that of a command, 1 for that of something wanted, which is a command if there
    is no other, and more for one that names no thruster."""
    words = {*_words(title).split()}
    if not (wanted := words & NOT_MEASURED):
        return 0
    if not (re.search(THRUSTER, _words(title)) or any(map(str.isdigit, words))):
        return _NO_THRUSTER
    return 0 if wanted <= {"cmd", "command", "commands"} else 1


def _clock(meant: Mapping[str, str], numbers: Mapping[str, Array]) -> list[str]:
    """Return the header of the first column that rises from row to row and may be a time, or nothing."""
    rows = max(map(len, numbers.values()), default=0)
    rising = (
        title
        for title, name in meant.items()
        if not name
        and header_parts(title)[1] in ("", *TIMES)
        and len(numbers[title]) == rows >= _FEWEST_ROWS
        and (np.diff(numbers[title]) > 0.0).all()
        and not _is_command(title, numbers[title], name)
    )
    return [*islice(rising, 1)]


def _is_up(meant: Mapping[str, str], numbers: Mapping[str, Array]) -> bool:
    """Return True if the third component of a position is negative, so that z points up and y to port."""
    depths = (numbers[title] for title, name in meant.items() if name == "depth" and "z" in words_in(title))
    depth = next((found for found in depths if len(found)), None)
    return depth is not None and bool(np.median(depth) < 0.0)


def _measured(meant: Mapping[str, str], numbers: Mapping[str, Array], *, is_up: bool) -> dict[str, str]:
    """Return the columns that headers mean; the first header of each column counts."""
    columns, taken = {}, {""}
    for title, name in meant.items():
        if name not in taken:
            taken.add(name)
            sign = "-" if is_up and {"y", "z"}.intersection(words_in(title)) else ""
            columns[title] = f"{sign}{name} [{_unit(title, name, numbers[title])}]"
    return columns


def _words(title: str) -> str:
    """Return the words and numbers of a header in small letters and in English, without a unit in brackets."""
    return " ".join(meanings(words_in(header_parts(title)[0])))


def _candidates(title: str, columns: Iterable[str]) -> Iterator[str]:
    """Yield the columns among these of which a header has a word, in the order of the catalogue."""
    words = _words(title)
    return (name for name, pattern in HEADERS if name in columns and re.search(rf"\b({pattern})\b", words))


def _meant(title: str, numbers: Array, rotations: Collection[str]) -> str:
    """Return the name of the column that a header seems to mean, or an empty text.

    `rotations` are the beginnings of headers of quaternions.
    """
    words = _words(title)
    if words.endswith((" x", " y", " z")) and (words[:-1] in rotations or not len(numbers)):
        return ""
    candidates = [*_candidates(title, ("", "time", *QUANTITIES))]
    for name in takewhile(bool, candidates):
        quantity = QUANTITIES.get(name)
        own, unit = name_and_unit(title, quantity.units if quantity else TIMES)
        is_sure = not (quantity and quantity.is_velocity) or own[-1] in ("x", "y", "z")
        if unit and (is_sure or PLURALS.isdisjoint(words_in(title))):
            return name
        if unit == "" and is_sure and name not in _WITH_UNIT and FALSE_FRIENDS.isdisjoint(own):
            return name
    return "" if candidates else _velocity_by_unit(title)


def _velocity_by_unit(title: str) -> str:
    """Return the velocity that a unit and a symbol or the letter of an axis mean, as in `r_dps` and `imu_gz_dps`."""
    for axis in AXES.values():
        name = f"{axis.name} velocity"
        words, unit = name_and_unit(title, QUANTITIES[name].units)
        is_part = len(words[-1:]) == 1 and len(words[-1]) <= 2 and words[-1].endswith("xyz"[axis.place])
        if unit and (is_part or words == [axis.velocity]):
            return name
    return ""


def one_of_several(title: str, numbers: Array) -> str:
    """Return words about a header that is not read, because others tell the same; empty for any other header."""
    name = _meant(title, numbers, ())
    return f"another {name} [{_unit(title, name, numbers)}]" if name and len(numbers) else ""


def may_be_velocity(title: str, *, is_rotation: bool) -> bool:
    """Return True for an unknown header or field whose words or unit are those of a velocity, of whatever axis."""
    words, (own, unit) = {*_words(title).split()}, name_and_unit(title, QUANTITIES[_RATES[is_rotation]].units)
    rates = {"gyro"} if is_rotation else {"velocity", "vel", "speed", "dvl"}
    return bool((unit or rates & words) and NOT_MEASURED.isdisjoint(words) and own)


def _may_be_command(title: str, numbers: Array) -> bool:
    """Return True if the name and the unit of a header are not against the command of a thruster."""
    unit = header_parts(title)[1].casefold()
    is_unit_of_command = unit == "%" or unit.startswith(PULSES)
    no_command = _NO_COMMAND - _SHARES if is_unit_of_command else _NO_COMMAND
    is_possible = is_unit_of_command or unit in ("", "1", "-", "pwm")
    is_other = no_command.intersection(_words(title).split()) or _velocity_by_unit(title)
    return bool(is_possible and len(numbers) and not is_other)


def _is_command(title: str, numbers: Array, meant: str) -> bool:
    """Return True for the command of a thruster, by its name, unit and size, or for pulses that rest at 1500 us."""
    if not _may_be_command(title, numbers):
        return False
    given = numbers[~np.isin(numbers, NO_OUTPUT)]
    unit = header_parts(title)[1]
    if unit.startswith(PULSES) and _within(given, PULSE_RANGE):
        return True
    if re.search(COMMANDS, _words(title)) or (unit == "%" and not meant):
        return bool((np.abs(given) <= 100.0).all()) or _within(given, PULSE_RANGE)
    values, counts = np.unique(given, return_counts=True)
    return _within(given, _USUAL_PULSES) and abs(values[counts.argmax()] - NEUTRAL) <= _REST


def _work_all_the_time(outputs: Iterable[Array]) -> bool:
    """Return True for several outputs in whole microseconds on both sides of the usual neutral pulse."""
    working = [values for values in outputs if values.min() < NEUTRAL < values.max()]
    whole = all(_within(values, _USUAL_PULSES) and (values == np.round(values)).all() for values in working)
    return len(working) >= _FEWEST_WORKING and whole


def _are_pulses(numbers: Array) -> bool:
    return _within(numbers[~np.isin(numbers, NO_OUTPUT)], PULSE_RANGE)


def _within(numbers: Array, ends: tuple[float, float]) -> bool:
    return bool(len(numbers) and ends[0] <= numbers.min() and numbers.max() <= ends[1])


def _names(titles: Sequence[str]) -> list[str]:
    """Return names of thrusters for columns of commands: what is particular in those of the columns, or else numbers.

    The words that all headers share say nothing: the particular part of `thr_FS_pwm` is `FS`. Numbers that count from 0
    become those of the thrusters, which count from 1.
    """
    parts = [header_parts(title)[0] for title in titles]
    words = [re.findall(r"[^\W\d_]+|\d+|[\W_]+", part) for part in parts]
    shared = set.intersection(*map(set, words)) if len(words) > 1 else {*words[0][:-1]} if words else set()
    particular = [re.sub(r"[\W_]+", "_", "".join(w for w in own if w not in shared)).strip("_") for own in words]
    if {*particular} == {str(n) for n in range(len(titles))}:
        return [str(int(number) + 1) for number in particular]
    for names in (particular, parts):
        if all(_NAME.fullmatch(name) for name in names) and len({name.casefold() for name in names}) == len(names):
            return names
    return [str(n + 1) for n in range(len(titles))]


def _unit(title: str, name: str, numbers: Array) -> str:
    """Return the unit of a column, from its header or else the likely one."""
    units, most = QUANTITIES[name].units if name in QUANTITIES else TIMES, float(np.abs(numbers).max(initial=0.0))
    given = name_and_unit(title, units)[1]
    if name == "time":
        long = float(np.ptp(numbers)) if len(numbers) else 0.0
        usual = long / max(len(numbers) - 1, 1)
        is_ms = (usual > _LONG_STEP or (usual > _STEP and long > _LONG_LOG)) and most < 1e9
        likely = next((unit for least, unit in _EPOCHS if most > least), "ms" if is_ms else "s")
    else:
        largest = _LIKELY.get(name, inf)
        likely = next((unit for unit, per in units.items() if most <= largest * per), [*units][-1])
    return given or likely


def _force(title: str) -> Axis | None:
    """Return the axis of a component of a wrench, a force or torque that is applied; None for another header.

    It has a symbol, such as `X_ext`, or names a force or a torque and its direction.
    """
    if axis := _EXTERNAL.get(header_parts(title)[0].casefold()):
        return axis
    match = re.search(rf"\b({FORCE}|{TORQUE})\b.* ([xyz])$", _words(title))
    if not match:
        return None
    index, is_rotation = "xyz".index(match[2]), match[1] == TORQUE
    return next(axis for axis in AXES.values() if (axis.place, axis.is_rotation) == (index, is_rotation))


def _unit_of_command(title: str, numbers: Array) -> str:
    """Return the unit of a command: from its header, or else from the size of the values."""
    unit, most = header_parts(title)[1], float(np.abs(numbers).max(initial=0.0))
    known = unit in ("%", "1") or unit.startswith(PULSES)
    return unit if known else "1" if most <= 1.0 else "%" if most <= 100.0 else "us"


# ---- Tables ----------------------------------------------------------------------------------------------------------


def headers_of_tables(folder: Path) -> TableHeaders:
    """Return the information in the tables of a folder. Of a table that cannot be read, only the name is used."""
    columns: dict[str, str] = {}
    tested = set()
    for path in list_files(folder).tests:
        if kind := kind_of_table(path, {}):
            if kind == "thrust":
                _, curve = parts_of_name(path)
                tested.add(curve)
            with suppress(DataFileError):
                for title, meant in guessed_of_table(kind, axis_in_name(path), header_of(path) or []).items():
                    columns[title] = meant or columns.get(title, "")
    return TableHeaders(tuple(_curves(tested)), columns)


def guessed_of_table(kind: str, axis: Axis | None, titles: Iterable[str]) -> dict[str, str]:
    """Return what the headers of a table that are not known seem to mean; an empty text for those that mean nothing.

    If no header has a word for a column, the only one with its unit seems to mean it.
    """
    of_table, known, columns = columns_of(kind, axis), [], {}
    is_column = KnownColumns(of_table).has
    for title in titles:
        if is_column(title):
            known.append(title)
        else:
            meant = (_with_unit(name, title) for name in _candidates(title, of_table))
            columns[title] = next(filter(is_column, meant), "")
    for name, column in of_table.items():
        if not has_column([*known, *columns.values()], {name: column}):
            by_unit = [title for title, meant in columns.items() if not meant and is_column(_with_unit(name, title))]
            if len(by_unit) == 1:
                columns[by_unit[0]] = _with_unit(name, by_unit[0])
    return columns


def _with_unit(name: str, title: str) -> str:
    """Return the header of a column with the unit that another header has."""
    return f"{name} [{header_parts(title)[1].replace(' ', '')}]"


def _curves(tested: Iterable[str]) -> Iterator[str]:
    """Yield the name of a curve for all names of files that begin with the same word: main for main_1 and main_2."""
    for _, group in groupby(sorted(tested), lambda name: name.partition("_")[0]):
        parts = zip(*(name.split("_") for name in group), strict=False)
        name = "_".join(words[0] for words in takewhile(lambda words: len({*words}) == 1, parts))
        if _CURVE.fullmatch(name):
            yield name
