"""The columns of tank tests and logs: their units and bounds, and checks of the unit of commands.

Numbers are converted to SI units, and commands to fractions of the full command. The bounds are far beyond any vehicle,
so a number outside is a mistake; without bounds, fits could overflow.
"""

from collections.abc import Iterable
from dataclasses import replace
from math import pi

from rov_fmu.io.csv_table import FORCE_UNITS, PULSES, Column, Columns, DataFileError, pulses
from rov_fmu.io.messages import shown
from rov_fmu.model.layout import SURGE, YAW, Axis

LENGTHS = {"m": 1.0, "cm": 100.0, "mm": 1000.0}
ANGLES = {"rad": 1.0, "deg": 180.0 / pi}
TIMES = {"s": 1.0, "ms": 1000.0}
VELOCITIES = 1e-5, 1e3
"""The smallest and the largest velocity, m/s or rad/s."""
_MOST_POSITION = 1e7

RENAMING = "; rename the header in this file, or write into [columns] of rov.toml what it stands for"
"""The end of a message about a header that is not known."""

COMMAND = Column({"%": 100.0, "1": 1.0}, minimum=-1.0, maximum=1.0)
HELD_COMMAND = replace(COMMAND, least=1e-4)
LOGGED_COMMAND = replace(COMMAND, conversions=dict.fromkeys(PULSES, pulses))
FORCE = Column(FORCE_UNITS, also=("thrust",), minimum=-1e6, maximum=1e6)
TIME = Column(TIMES, minimum=-1e10, maximum=1e10)  # some loggers count from 1970

VOLTAGE = Column({"V": 1.0, "mV": 1000.0}, True, True, 0.0, 1e4, also=("battery", "battery voltage"))


def in_degrees(unit: str) -> tuple[float, str]:
    """Return the factor from an SI unit to the printed unit, and the name of the printed unit. Angles are printed in
    degrees."""
    return (ANGLES["deg"], unit.replace("rad", "deg")) if "rad" in unit else (1.0, unit)


def velocity_column(axis: Axis, *, optional: bool = False, least: float = VELOCITIES[0]) -> Column:
    """Return a column of velocities along the axis; an optional column may have blanks."""
    lengths = ANGLES if axis.unit == "rad/s" else LENGTHS
    units = {f"{unit}/s": per for unit, per in lengths.items()}
    return Column(units, optional, optional, -VELOCITIES[1], VELOCITIES[1], least)


VELOCITY_OF_ANY_AXIS = replace(
    velocity_column(SURGE), units={**velocity_column(SURGE).units, **velocity_column(YAW).units}
)
"""A column of velocities, linear or angular."""


def position_column(axis: Axis) -> Column:
    """Return a column of positions along the axis, which may have blanks."""
    units = ANGLES if axis.position_unit == "rad" else LENGTHS
    return Column(units, True, True, -_MOST_POSITION, _MOST_POSITION)


def time_constant_column(*, optional: bool = False) -> Column:
    """Return a column of time constants; an optional column may have blanks."""
    return Column(TIMES, optional, optional, maximum=1e5, least=1e-4)


def refuse_slips(table: Columns, commands: Iterable[str]) -> None:
    """Raise DataFileError where the commands cannot be in the unit of their header: fractions under [%] or [us]."""
    names = [name for name in commands if name in table.values]
    for units, most, mistake in (
        (("%",), 1.0, "no command exceeds 1 %. Are they fractions? Then write [1]"),
        (PULSES, 1.0, "no pulse beyond 1 us: fractions under [us]? Write [1]"),
        (PULSES, 100.0, "no pulse beyond 100 us: percent under [us]? Write [%]"),
    ):
        columns = [name for name in names if table.units[name] in units]
        rows = table.texts(*columns) if columns else ()
        if 0.0 < max((abs(float(text)) for row in rows for text in row if text), default=0.0) <= most:
            titles = ", ".join(shown(table.headers[name]) for name in columns)
            raise DataFileError(f"{table.path}, column {titles}: {mistake}")
