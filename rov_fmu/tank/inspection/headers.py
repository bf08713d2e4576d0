"""What unknown headers of CSV files seem to mean, before a vehicle is known."""

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from itertools import groupby, islice, takewhile
from math import inf, pi
from pathlib import Path

import numpy as np

from rov_fmu.equation.catalogue import AXES, Axis
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import Curve, SourcedVector, Thruster, VehicleAxis
from rov_fmu.io.columns import NEUTRAL, NO_OUTPUT, PULSES, KnownColumns
from rov_fmu.io.csv_table import NUMBER, DataFileError
from rov_fmu.io.groups import grouped
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
_COMPONENTS = ("x", "y", "z", "north", "east", "down", "up")
"""The last words of headers that are components of a vector, also without a unit."""
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
_BY_DIRECTION = {("xyz"[axis.place], axis.is_rotation): axis for axis in AXES.values()}
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


@dataclass(frozen=True, eq=False)
class _CsvColumn:
    """A column of a CSV file: its header, and the numbers below it as they stand in the file."""

    title: str
    numbers: Array
    name: str
    unit: str
    """The name and the unit in the header."""
    words: str
    """The words of the name in small letters and in English."""

    @classmethod
    def of(cls, title: str, numbers: Array) -> "_CsvColumn":
        """Return the column below a header."""
        return cls(title, numbers, *header_parts(title), _words(title))

    @cached_property
    def pulses(self) -> Array:
        """The numbers without those that stand for no pulse."""
        return self.numbers[~np.isin(self.numbers, NO_OUTPUT)]

    @cached_property
    def are_pulses(self) -> bool:
        """True if the numbers are in the range of pulses."""
        return _within(self.pulses, PULSE_RANGE)

    @cached_property
    def may_be_command(self) -> bool:
        """True if the name and the unit of the header are not against the command of a thruster."""
        unit = self.unit.casefold()
        is_unit_of_command = unit == "%" or unit.startswith(PULSES)
        no_command = _NO_COMMAND - _SHARES if is_unit_of_command else _NO_COMMAND
        is_possible = is_unit_of_command or unit in ("", "1", "-", "pwm")
        is_other = no_command.intersection(self.words.split()) or _velocity_by_unit(self.title)
        return bool(is_possible and len(self.numbers) and not is_other)

    def is_command(self, meant: str) -> bool:
        """Return True for the command of a thruster, by its name, unit and size, or for pulses that rest at 1500 us.

        `meant` is the column that the header seems to mean.
        """
        if not self.may_be_command:
            return False
        unit = self.unit
        if unit.startswith(PULSES) and self.are_pulses:
            return True
        if re.search(COMMANDS, self.words) or (unit == "%" and not meant):
            return bool((np.abs(self.pulses) <= 100.0).all()) or self.are_pulses
        values, counts = np.unique(self.pulses, return_counts=True)
        return _within(values, _USUAL_PULSES) and abs(values[counts.argmax()] - NEUTRAL) <= _REST

    @cached_property
    def force(self) -> Axis | None:
        """The axis of a component of a wrench, a force or torque that is applied; None for another column.

        Its header has a symbol, such as `X_ext`, or names a force or a torque and its direction.
        """
        if axis := _EXTERNAL.get(self.name.casefold()):
            return axis
        match = re.search(rf"\b({FORCE}|{TORQUE})\b.* ([xyz])$", self.words)
        return _BY_DIRECTION[match[2], match[1] == TORQUE] if match else None

    @property
    def largest(self) -> float:
        """The size of the largest number; 0 without numbers."""
        return float(np.abs(self.numbers).max(initial=0.0))

    @property
    def unit_of_command(self) -> str:
        """The unit of a command: from the header, or else from the size of the numbers."""
        unit, most = self.unit, self.largest
        known = unit in ("%", "1") or unit.startswith(PULSES)
        return unit if known else "1" if most <= 1.0 else "%" if most <= 100.0 else "us"

    def unit_of(self, name: str) -> str:
        """Return the unit of the column as a quantity or a time: that of the header, or else the likely one."""
        units = QUANTITIES[name].units if name in QUANTITIES else TIMES
        if given := name_and_unit(self.title, units)[1]:
            return given
        most = self.largest
        if name == "time":
            long = float(np.ptp(self.numbers)) if len(self.numbers) else 0.0
            usual = long / max(len(self.numbers) - 1, 1)
            is_ms = (usual > _LONG_STEP or (usual > _STEP and long > _LONG_LOG)) and most < 1e9
            return next((unit for least, unit in _EPOCHS if most > least), "ms" if is_ms else "s")
        largest = _LIKELY.get(name, inf)
        return next((unit for unit, per in units.items() if most <= largest * per), [*units][-1])

    def meant(self, rotations: Collection[str] = ()) -> str:
        """Return the name of the column that the header seems to mean, or an empty text.

        `rotations` are the beginnings of headers of quaternions.
        """
        if self.words.endswith((" x", " y", " z")) and (self.words[:-1] in rotations or not len(self.numbers)):
            return ""
        candidates = [*_candidates(self.title, ("", "time", *QUANTITIES))]
        for name in takewhile(bool, candidates):
            quantity = QUANTITIES.get(name)
            own, unit = name_and_unit(self.title, quantity.units if quantity else TIMES)
            is_sure = not (quantity and quantity.is_velocity) or own[-1] in _COMPONENTS
            if unit and (is_sure or PLURALS.isdisjoint(words_in(self.title))):
                return name
            if unit == "" and is_sure and name not in _WITH_UNIT and FALSE_FRIENDS.isdisjoint(own):
                return name
        return "" if candidates else _velocity_by_unit(self.title)


_Meant = Mapping[_CsvColumn, str]
"""The names of the columns of rov.toml that the columns of a file seem to mean; empty texts for none."""


def guessed(
    numbers: Mapping[str, Array], axis: Axis | None, layouts: Iterable[Layout]
) -> tuple[Layout, dict[str, str]]:
    """Return a layout with the thrusters that a CSV file seems to have, and what its headers seem to mean.

    `numbers` has the numbers below each header as they stand in the file. The headers of commands mean the names of
    thrusters.
    """
    own = [_CsvColumn.of(*column) for column in numbers.items()]
    rotations = {column.words[:-1] for column in own if column.words.endswith(" w")}
    meant = {column: column.meant(rotations) for column in own}
    if "time" not in meant.values():
        meant |= dict.fromkeys(_clock(meant), "time")
    layouts = [*layouts]
    commanding = _commanding(meant, layouts)
    names = _names(commanding)
    forces = {column: force for column in commanding if (force := column.force)}
    if forces:  # beside them, a velocity may have its symbol alone
        layout = Layout.of_wrench(map(VehicleAxis, AXES.values()))
        meant = {column: name or _VELOCITIES.get(column.name, "") for column, name in meant.items()}
    else:
        layout = fitting(names, layouts) or assumed_layout(names)
    known = [thruster.name for thruster in layout.thrusters]
    is_column = KnownColumns(columns_of_log(layout, axis)).has
    new = [column for column in own if not is_column(column.title)]
    found = {column: f"{of.external} [{of.load}]" for column, of in forces.items() if column in new}
    if not forces and not {*new}.isdisjoint(commanding):
        for column, name in zip(commanding, names if {*names} == {*known} else known, strict=True):
            found[column] = f"u_{name} [{column.unit_of_command}]"
    others = {column: meant[column] for column in new if column not in commanding}
    if axis:
        found |= _of_axis(axis, others)
    found |= _measured(others, is_up=_is_up(meant))
    return layout, {column.title: title for column, title in found.items()}


def _of_axis(axis: Axis, meant: _Meant) -> dict[_CsvColumn, str]:
    """Return what headers seem to mean in a log of one axis whose words alone say it: its command and its position."""
    found: dict[_CsvColumn, str] = {}
    for column in (column for column, name in meant.items() if not name and len(column.numbers)):
        if column.words == COMMAND:
            found[column] = f"{COMMAND} [{column.unit_of_command}]"
        elif (
            column.words in ("distance", "position")
            and name_and_unit(column.title, QUANTITIES[axis.position].units)[1] == ""
        ):
            found[column] = f"{axis.position} [{column.unit_of(axis.position)}]"
    return found


def _commanding(meant: _Meant, layouts: Iterable[Layout]) -> list[_CsvColumn]:
    """Return the columns of the commands of thrusters, or else those of forces that are applied.

    Outputs are numbered: if one is a command, then so are the others of its name, unit and range.
    """
    possible = [column for column in meant if column.may_be_command]
    sure = {column for column in possible if column.is_command(meant[column])}
    families = grouped(((re.sub(r"\d+", "#", c.name), c.unit, c.are_pulses), c) for c in possible)
    for (name, _, are_pulses), own in families.items():
        is_sure = not sure.isdisjoint(own) or (are_pulses and _work_all_the_time(own))
        if "#" in name and is_sure:
            sure.update(own)
    chosen = [column for column in possible if column in sure]
    best = min(map(_grade, chosen), default=0)
    chosen = [column for column in chosen if _grade(column) == best < _NO_THRUSTER][:_MOST_THRUSTERS]
    by_name = dict(zip(_names(chosen), chosen, strict=True))
    ends = {name: (float(own.numbers.min()), float(own.numbers.max())) for name, own in by_name.items()}
    is_pulse = any(column.are_pulses for column in chosen)
    kept = likely_thrusters(ends, layouts, *((NEUTRAL, _IDLE_PULSE) if is_pulse else (0.0, 0.0)))
    return [by_name[name] for name in kept] or [column for column in meant if column.force and len(column.numbers)]


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


def _grade(column: _CsvColumn) -> int:
    """Return 0 for a header that may be that of a command, 1 for that of something wanted, which is a command if there
    is no other, and more for one that names no thruster."""
    words = {*column.words.split()}
    if not (wanted := words & NOT_MEASURED):
        return 0
    if not (re.search(THRUSTER, column.words) or any(map(str.isdigit, words))):
        return _NO_THRUSTER
    return 0 if wanted <= {"cmd", "command", "commands"} else 1


def _clock(meant: _Meant) -> list[_CsvColumn]:
    """Return the first column that rises from row to row and may be a time, or nothing."""
    rows = max((len(column.numbers) for column in meant), default=0)
    rising = (
        column
        for column, name in meant.items()
        if not name
        and column.unit in ("", *TIMES)
        and len(column.numbers) == rows >= _FEWEST_ROWS
        and (np.diff(column.numbers) > 0.0).all()
        and not column.is_command(name)
    )
    return [*islice(rising, 1)]


def _is_up(meant: _Meant) -> bool:
    """Return True if the third component of a position is negative, so that z points up and y to port."""
    named = (column for column, name in meant.items() if name == "depth" and "z" in words_in(column.title))
    depths = [column.numbers for column in named if len(column.numbers)]
    return bool(depths and np.median(depths[0]) < 0.0)


def _measured(meant: _Meant, *, is_up: bool) -> dict[_CsvColumn, str]:
    """Return the columns that headers mean; the first header of each column counts."""
    columns, taken = {}, {""}
    for column, name in meant.items():
        if name not in taken:
            taken.add(name)
            sign = "-" if is_up and {"y", "z"}.intersection(words_in(column.title)) else ""
            columns[column] = f"{sign}{name} [{column.unit_of(name)}]"
    return columns


def _words(title: str) -> str:
    """Return the words and numbers of a header in small letters and in English, without a unit in brackets."""
    return " ".join(meanings(words_in(header_parts(title)[0])))


def _candidates(title: str, columns: Iterable[str]) -> Iterator[str]:
    """Yield the columns among these of which a header has a word, in the order of the catalogue."""
    words = _words(title)
    return (name for name, pattern in HEADERS if name in columns and re.search(rf"\b({pattern})\b", words))


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
    column = _CsvColumn.of(title, numbers)
    name = column.meant()
    return f"another {name} [{column.unit_of(name)}]" if name and len(numbers) else ""


def meant_by_field(name: str, fields: Mapping[str, str]) -> str:
    """Return what a field of a message of an unknown kind seems to mean, by its name and its range; empty for none.

    `fields` has the ranges of all fields as `range_in_words` tells them; a quaternion has a field w.
    """
    numbers = [] if f"{name[:-1]}w" in fields else [float(match[0]) for match in NUMBER.finditer(fields[name])][:2]
    column = _CsvColumn.of(re.sub(r"[/.\[\]]+", " ", name).strip(), np.array(numbers))
    meant = column.meant()
    if numbers and column.is_command(meant):
        number = [int(word) for word in column.words.split() if word.isdigit()][-1:]
        return f"u_{number[0] + name.endswith(']')} [{column.unit_of_command}]" if number else ""
    return f"{meant} [{column.unit_of(meant)}]" if meant in QUANTITIES else ""


def may_be_velocity(title: str, *, is_rotation: bool) -> bool:
    """Return True for an unknown header or field whose words or unit are those of a velocity, of whatever axis."""
    words, (own, unit) = {*_words(title).split()}, name_and_unit(title, QUANTITIES[_RATES[is_rotation]].units)
    rates = {"gyro"} if is_rotation else {"velocity", "vel", "speed", "dvl"}
    return bool((unit or rates & words) and NOT_MEASURED.isdisjoint(words) and own)


def _work_all_the_time(outputs: Iterable[_CsvColumn]) -> bool:
    """Return True for several outputs in whole microseconds on both sides of the usual neutral pulse."""
    working = [own.numbers for own in outputs if own.numbers.min() < NEUTRAL < own.numbers.max()]
    whole = all(_within(values, _USUAL_PULSES) and (values == np.round(values)).all() for values in working)
    return len(working) >= _FEWEST_WORKING and whole


def _within(numbers: Array, ends: tuple[float, float]) -> bool:
    return bool(len(numbers) and ends[0] <= numbers.min() and numbers.max() <= ends[1])


def _names(columns: Sequence[_CsvColumn]) -> list[str]:
    """Return names of thrusters for columns of commands: what is particular in those of the columns, or else numbers.

    The words that all headers share say nothing: the particular part of `thr_FS_pwm` is `FS`. Numbers that count from 0
    become those of the thrusters, which count from 1.
    """
    parts = [column.name for column in columns]
    words = [re.findall(r"[^\W\d_]+|\d+|[\W_]+", part) for part in parts]
    shared = set.intersection(*map(set, words)) if len(words) > 1 else {*words[0][:-1]} if words else set()
    particular = [re.sub(r"[\W_]+", "_", "".join(w for w in own if w not in shared)).strip("_") for own in words]
    if {*particular} == {str(n) for n in range(len(columns))}:
        return [str(int(number) + 1) for number in particular]
    for names in (particular, parts):
        if all(_NAME.fullmatch(name) for name in names) and len({name.casefold() for name in names}) == len(names):
            return names
    return [str(n + 1) for n in range(len(columns))]


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
