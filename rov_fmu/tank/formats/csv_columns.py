"""The columns that a CSV log may have: commands, measured motion, and conditions such as the voltage."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

from rov_fmu.io.csv_table import Column, Conversion, find_column
from rov_fmu.io.toml_file import key_line
from rov_fmu.model.layout import AXES, HEAVE, PITCH, ROLL, YAW, Axis, Layout
from rov_fmu.tank.columns import LOGGED_COMMAND, TIME, VOLTAGE, position_column, velocity_column
from rov_fmu.tank.formats.content import Entry
from rov_fmu.tank.tables import TABLES, columns_of

COMMAND = "command"
"""The column with the command of a log of one axis."""
_POSITION_NAMES = {HEAVE: ("z",), ROLL: ("phi", "roll"), PITCH: ("theta", "pitch"), YAW: ("psi",)}
"""Other names of the columns depth, roll angle, pitch angle and heading: the names in the FMU and of the axis."""
LOGGED = replace(LOGGED_COMMAND, optional=True)
_OF_TABLES = {name: column for kind in TABLES for name, column in columns_of(kind).items() if name != COMMAND}
"""The columns of tables and of logs of one axis. Their headers need not name the axis."""


@dataclass(frozen=True)
class Sensor:
    """A column of measured motion, or of a condition."""

    axis: Axis | None
    quantity: str
    column: Column


@dataclass(frozen=True)
class Names:
    """The tables [columns] and [topics] of rov.toml: the meanings of names that would otherwise be unknown."""

    columns: Mapping[str, str] = field(default_factory=dict)
    """Headers, by the headers of the CSV files."""
    topics: Mapping[str, Entry] = field(default_factory=dict)


CONDITIONS = {
    axis.position: Sensor(axis, axis.position, replace(position_column(axis), also=_POSITION_NAMES[axis]))
    for axis in (HEAVE, ROLL, PITCH)
} | {"voltage": Sensor(None, "voltage", VOLTAGE)}
"""The columns that any log may have, whether or not the vehicle has their axis."""


def sensors_of(axes: Iterable[Axis], *, of_one: bool) -> dict[str, Sensor]:
    """Return the sensors by column name, positions before velocities.

    In a log of one axis the column need not name the axis.
    """
    found = {}
    for axis in axes:
        for quantity in (axis.position, "velocity"):
            velocity = quantity == "velocity"
            column = velocity_column(axis, optional=True, least=0.0) if velocity else position_column(axis)
            long_name = f"{axis.name} {quantity}"
            rate = f"{axis.name} {'rate' if axis.unit == 'rad/s' else 'speed'}"
            others = (axis.velocity, rate) if velocity else _POSITION_NAMES.get(axis, ())
            name = quantity if of_one or (axis in _POSITION_NAMES and not velocity) else long_name
            column = replace(column, also=(long_name, *others))
            found[name] = Sensor(axis, quantity, column)
    return found


def inputs_of(layout: Layout) -> dict[str, Column]:
    """Return the columns of inputs. If each input drives one thruster, its column may also have the name of the
    thruster."""
    names = {f"u_{t.name}": (t.name,) for t in layout.thrusters} if not layout.mix else {}
    return {name: replace(LOGGED, also=names.get(name, ())) for name in layout.commands}


def thrusters_of(layout: Layout) -> dict[str, Column]:
    """Return the columns of thrusters, of a vehicle whose inputs drive several thrusters."""
    return {f"thruster {t.name}": replace(LOGGED, also=(t.name,)) for t in layout.thrusters} if layout.mix else {}


def names_of(layout: Layout | None, columns: Mapping[str, str], topics: Mapping[str, str]) -> tuple[Names, list[str]]:
    """Return the names of rov.toml, and a line for every value that is no column of a log, or of a table in a CSV file.

    A log may also measure the motion along axes that the vehicle does not have. Without a layout, a value that is not
    known may be the command of a thruster.
    """
    thrusters_known, layout = layout is not None, layout or Layout((), (), ())
    sensors = sensors_of(AXES.values(), of_one=False) | CONDITIONS
    commands = inputs_of(layout) | thrusters_of(layout)
    known = commands | {name: sensor.column for name, sensor in sensors.items()}
    of_csv = {"time": TIME, COMMAND: LOGGED, **known, **_OF_TABLES}
    thrusters = {f"{prefix}{t.name}": t.name for t in layout.thrusters for prefix in ("u_", "thruster ")}
    entries, mistakes = {}, []
    for table, titles, targets in (("columns", of_csv, columns), ("topics", known, topics)):
        for source, title in targets.items():
            opposite = table == "topics" and title.startswith("-")
            try:
                found = find_column(title[opposite:], titles, others=not thrusters_known)
            except ValueError as error:
                mistakes.append(key_line(f"{table}.{source}", str(error), title))
                continue
            if not found:
                continue
            sensor, sign = sensors.get(found.name), -1.0 if opposite else 1.0
            name = found.name if layout.mix and found.name in layout.commands else thrusters.get(found.name, found.name)
            convert = partial(_converted, found.convert, sign)
            entries[source] = Entry(name, sensor.axis if sensor else None, sensor.quantity if sensor else "", convert)
    return Names(columns, {source: entries[source] for source in topics if source in entries}), mistakes


def is_column(title: str, layout: Layout, axis: Axis | None) -> bool:
    """Return True if a log of the axis, or of several, may have a column with this header."""
    axes = [axis] if axis else [form.axis for form in layout.axes]
    sensors = sensors_of(axes, of_one=axis is not None) | CONDITIONS
    columns = {"time": TIME, COMMAND: LOGGED, **inputs_of(layout), **thrusters_of(layout)}
    columns |= {name: sensor.column for name, sensor in sensors.items()}
    try:
        return find_column(title, columns, others=True) is not None
    except ValueError:
        return False


def _converted(convert: Conversion, sign: float, value: float) -> float:
    return sign * convert(value)
