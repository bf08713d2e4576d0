"""The columns of tank tests and logs: their units and bounds, their names in rov.toml, and checks of their units.

Numbers are converted to SI units, and commands to fractions of the full command. The bounds are far beyond any vehicle,
so a number outside is a mistake; without bounds, fits could overflow.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timezone
from functools import partial

import numpy as np
from pydantic import TypeAdapter

from rov_fmu.equation.catalogue import AXES, EXTERNAL, SURGE, YAW, Axis
from rov_fmu.equation.layout import Layout
from rov_fmu.io.columns import (
    COMMANDS,
    FORCE_UNITS,
    NEUTRAL,
    PULSES,
    SPAN,
    Column,
    Columns,
    Conversion,
    KnownColumns,
    pulses,
)
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.io.messages import shown
from rov_fmu.io.toml_file import key_line
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.catalogue import FORCE, QUANTITIES, TIMES, TORQUE, MeasuredQuantity, shorts
from rov_fmu.tank.commands import NO_KEYS, LogKeys
from rov_fmu.tank.description import RovTables

VELOCITIES = 1e-5, 1e3
"""The smallest and the largest velocity, m/s or rad/s."""
RENAMING = "; rename the header in this file, or write into [columns] of rov.toml what it stands for"
"""The end of a message about a header that is not known."""
_DATE = TypeAdapter(datetime)


def seconds(text: str) -> float:
    """Return the time since 1970 of a text by ISO 8601, s; UTC if it names no offset. Raises ValueError."""
    date = _DATE.validate_python(text.replace(",", "."))
    return (date if date.tzinfo else date.replace(tzinfo=timezone.utc)).timestamp()


COMMAND = "command"
"""The column with the command of an axis, or of all thrusters of a curve."""
FRACTION = Column({"%": 100.0, "1": 1.0}, minimum=-1.0, maximum=1.0)
HELD_COMMAND = replace(FRACTION, least=1e-4, conversions=COMMANDS)
TIME = Column(TIMES, minimum=-1e10, maximum=1e10, parse=seconds)  # some loggers count from 1970
DATE = Column({"": 1.0}, optional=True, blanks=True)
"""The dates of times of day, as texts. Their header has no unit."""


def logged_command(keys: LogKeys = NO_KEYS) -> Column:
    """Return the column of a command in a log. A pulse in µs has the neutral and the span of the keys unless the header
    has others; a force in N needs the force of full thrust, as in [N 50]."""
    usual = (NEUTRAL if keys.neutral is None else keys.neutral, keys.span or SPAN)
    of_keys = dict.fromkeys(PULSES, partial(_pulses_about, usual))
    return replace(FRACTION, optional=True, conversions={**COMMANDS, **of_keys})


def _pulses_about(usual: tuple[float, float], numbers: tuple[float, ...]) -> Conversion:
    """Return the conversion of a pulse by the numbers of its header, or else by the usual neutral and span."""
    return pulses(numbers or usual)


TABLES = {"thrust": "force", "steady": "velocity", "time_constant": "time constant"}
"""The words that the name of a table of tank tests begins with, each with the measured quantity."""
_MEASURED = {
    "thrust": Column(FORCE_UNITS, also=("thrust",), minimum=-1e6, maximum=1e6),
    "time_constant": Column(TIMES, maximum=1e5, least=1e-4),
}


def columns_of(kind: str, axis: Axis | None = None) -> dict[str, Column]:
    """Return the columns of a table. Without an axis, the velocities may be linear or angular."""
    axes = [axis] if axis else [SURGE, YAW]
    units = {unit: per for one in axes for unit, per in QUANTITIES[f"{one.name} velocity"].units.items()}
    velocity = Column(units, minimum=-VELOCITIES[1], maximum=VELOCITIES[1], least=VELOCITIES[0])
    return {COMMAND: HELD_COMMAND, TABLES[kind]: _MEASURED.get(kind, velocity)}


def has_column(header: Iterable[str], columns: Mapping[str, Column]) -> bool:
    """Return True if a header has one of the columns, even in an unknown unit."""
    known = KnownColumns(columns)
    return any(known.has(title, in_any_unit=True) for title in header)


SLIPS = (
    (("%",), 1.0, "no command exceeds 1 %. Are they fractions? Then write [1]"),
    (PULSES, 1.0, "no pulse beyond 1 us: fractions under [us]? Write [1]"),
    (PULSES, 100.0, "no pulse beyond 100 us: percent under [us]? Write [%]"),
)
"""Units of commands, the largest number below such a header that shows a slip, and what is wrong."""


def refuse_slips(table: Columns, commands: Iterable[str]) -> None:
    """Raise DataFileError where the commands cannot be in the unit of their header: fractions under [%] or [us]."""
    names = [name for name in commands if name in table.values]

    def largest(name: str) -> float:
        numbers = table.numbers.get(name) or [FRACTION.units["%"] * value for value in table.values[name]]
        return float(np.nanmax(np.abs(numbers), initial=0.0))

    for units, most, mistake in SLIPS:
        columns = [name for name in names if table.units[name] in units]
        if 0.0 < max(map(largest, columns), default=0.0) <= most:
            titles = ", ".join(shown(table.headers[name]) for name in columns)
            raise DataFileError(f"{table.path}, column {titles}: {mistake}")


# ---- Columns of logs -------------------------------------------------------------------------------------------------

WELL_KNOWN = {"%time": "time [ns]"}
"""The headers of programs, by what they stand for: `rostopic echo -p`."""
INPUTS, THRUSTERS, AXIS = "inputs", "thrusters", "axis"
"""What the commands of a log are of: inputs that drive several thrusters, thrusters, or an axis."""


@dataclass(frozen=True)
class LogColumn(Column):
    """A column or a field that a log may have, with its meaning: a command, a quantity, or, without a name, a time."""

    name: str = ""
    """The name of the quantity, the input or the thruster; `command` for that of an axis."""
    quantity: MeasuredQuantity | None = None
    """None for a command."""
    commands: str = ""
    """What the command is of. A log has commands of one kind. Empty for another column."""
    convert: Conversion | None = None
    """The conversion of the numbers; None where they have the unit of the column already."""
    is_pulse: bool = False
    """True for a pulse, µs, whose neutral nobody states."""

    @classmethod
    def of(cls, column: Column, name: str = "", commands: str = "") -> "LogColumn":
        """Return a column of a command, or one without a name."""
        return cls(**vars(column), name=name, commands=commands)


def columns_of_log(layout: Layout, axis: Axis | None, keys: LogKeys = NO_KEYS) -> dict[str, LogColumn]:
    """Return the columns that a log of the axis, or of several, may have.

    In a log of one axis, the name of a quantity need not tell the axis: its depth is also its `position`. The name of a
    thruster alone is enough for the column of its command.
    """
    command = logged_command(keys)
    columns = {"time": LogColumn.of(TIME)}
    if layout.has_wrench:  # a vehicle need not have all forces
        for one in AXES.values():
            part = f"{TORQUE if one.is_rotation else FORCE} {'xyz'[one.place]}"
            force = Column({one.load: 1.0}, optional=True, minimum=-1e6, maximum=1e6, also=(part,))
            columns[one.external] = LogColumn.of(force, one.external, THRUSTERS)
    else:
        columns |= {COMMAND: LogColumn.of(command, COMMAND, AXIS)} if axis else {}
        for name in (thruster.name for thruster in layout.thrusters):
            title = f"thruster {name}" if layout.mix else f"u_{name}"
            columns[title] = LogColumn.of(replace(command, also=(name,)), name, THRUSTERS)
    for name in layout.commands if layout.mix else ():
        columns[name] = LogColumn.of(command, name, INPUTS)
    for name, quantity in QUANTITIES.items():
        short, *also = shorts(quantity) if axis and quantity.axis == axis else (name,)
        also += [name] if short != name else []
        # `read_log` checks the bounds after the marks of no measurement are left out.
        column = LogColumn(quantity.units, True, True, also=(*quantity.also, *also), name=name, quantity=quantity)
        columns.setdefault(short, column)  # the distance along the axis comes first
    return {**columns, "date": LogColumn.of(DATE)}


# ---- Names of rov.toml -----------------------------------------------------------------------------------------------

_OF_TABLES = {name: column for kind in TABLES for name, column in columns_of(kind).items() if name != COMMAND}
"""The columns of tables."""


@dataclass(frozen=True)
class ColumnNames:
    """The tables [columns], [topics], [valid] and [logs] of rov.toml."""

    columns: Mapping[str, str] = field(default_factory=lambda: WELL_KNOWN)
    """Headers, by the headers of the CSV files."""
    topics: Mapping[str, LogColumn] = field(default_factory=dict)
    """Meanings by topic and field: `/bar30/depth.data`."""
    valid: Mapping[str, Sequence[str]] = field(default_factory=dict)
    """The quantities of which a column or a field is a flag."""
    keys: LogKeys = NO_KEYS
    """What the logs do not tell."""


def names_of(layout: Layout | None, tables: RovTables) -> tuple[ColumnNames, list[str]]:
    """Return the names of rov.toml, and a line for every value that is no column of a log, or of a table in a CSV file.

    Without a layout, a value that is not known may be the command of a thruster.
    """
    known = columns_of_log(layout or Layout((), (), ()), None, tables.logs)
    of_csv = {**known, COMMAND: logged_command(tables.logs), **_OF_TABLES}
    of_topics = {name: column for name, column in known.items() if column.name}
    entries, mistakes = dict[str, LogColumn](), list[str]()
    for table, allowed, targets in (("columns", of_csv, tables.columns), ("topics", of_topics, tables.topics)):
        columns = KnownColumns(allowed)
        for source, title in targets.items():
            try:
                found = columns.find(title, others=layout is None)
            except ValueError as error:
                reason, choices = str(error), f", but {', '.join(columns.titles.values())}"
                if any(choices in mistake for mistake in mistakes):  # once is enough
                    reason = reason.replace(choices, "")
                mistakes.append(key_line(f"{table}.{source}", reason, title))
                continue
            if found and table == "topics":
                is_pulse = found.unit in PULSES and not found.numbers and tables.logs.neutral is None
                entries[source] = replace(known[found.name], convert=found.convert, is_pulse=is_pulse)
    return ColumnNames({**WELL_KNOWN, **tables.columns}, entries, tables.valid, tables.logs), mistakes


def is_of_inputs(layout: Layout, names: Iterable[str]) -> bool:
    """Return True for the names of inputs that drive several thrusters; False for those of thrusters or of an axis."""
    return bool(layout.mix) and {*names} <= {*layout.commands}


def push_along(layout: Layout, axis: Axis, values: Mapping[str, Array]) -> Array:
    """Return the command along an axis at each row, a fraction of that of all its thrusters at full command."""
    rows = len(next(iter(values.values())))
    if COMMAND in values:  # of a log of this axis alone
        return values[COMMAND]
    effects = [(thruster.name, thruster.effect(axis)) for thruster in layout.thrusters_along(axis)]
    total = sum(abs(effect) for _, effect in effects)
    pushes = [effect / total * values.get(name, np.zeros(rows)) for name, effect in effects]
    return np.sum(pushes, axis=0) if pushes else np.zeros(rows)


def thruster_commands(layout: Layout, values: Mapping[str, Array]) -> tuple[list[str], Array]:
    """Return the names of the thrusters, and n x thrusters commands within ±1, from n commands of inputs or thrusters.
    The forces of a wrench have no such limit.

    An input or a thruster without a command has the command 0. The command of an axis, and those of a vehicle whose
    thrusters are not known, keep their names.
    """
    named = [] if COMMAND in values else [thruster.name for thruster in layout.thrusters]
    gains = layout.gains if is_of_inputs(layout, values) else {}
    still = np.zeros(len(next(iter(values.values()))))
    mixed = {
        name: sum((gain * values.get(one, still) for one, gain in gains.get(name, {name: 1.0}).items()), still)
        for name in named or values
    }
    commands = np.column_stack([*mixed.values()])
    return [*mixed], np.clip(commands, -1.0, 1.0) if EXTERNAL.isdisjoint(mixed) else commands
