"""Reading tables of measured thrust and electric current, such as those that makers publish of their thrusters."""

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from statistics import fmean

from rov_fmu.equation.parts import CommandTable
from rov_fmu.io.columns import BEYOND, COMMANDS, FORCE_UNITS, Column, read_columns
from rov_fmu.io.csv_table import DataFileError

_COMMAND = Column({"1": 1.0, "%": 100.0}, minimum=-1.0, maximum=1.0, also=("pulse", "pwm"), conversions=COMMANDS)
_THRUST = Column(FORCE_UNITS, also=("force",), minimum=-1e6, maximum=1e6)
_CURRENT = Column({"A": 1.0}, minimum=0.0, maximum=1e4)
_MOST_POINTS = 2000
_WIDEST = 0.05
"""The largest part of the commands that a table may leave out at each end."""


def read_thrust(path: Path) -> CommandTable:
    """Read a CSV file with the columns command [1], [%], [us] or [N 50], and thrust [N], [kgf] or [lbf].

    Raises DataFileError. Rows with equal commands become one point with their mean thrust. The table has no name yet.
    """

    def check(command: float, force: float) -> str | None:
        return "must have the sign of its command" if command * force < 0.0 else None

    commands, forces = _points(path, "thrust", _THRUST, check)
    if reason := _why_incomplete(commands) or _why_no_curve(commands, forces):
        raise DataFileError(f"{path}: {reason}")
    return thrust_table(commands, forces, path)


def thrust_table(points: Sequence[float], at_points: Sequence[float], path: Path | None = None) -> CommandTable:
    """Return the table with a force (N) at each command: a monotone cubic between them (Fritsch and Butland 1984).

    Beyond the outermost points, the thrust continues with their slopes to the commands -1 and 1.
    """
    from scipy.interpolate import PchipInterpolator  # takes long to import, and few vehicles have tables

    slopes = map(float, PchipInterpolator(points, at_points).derivative()(points))
    rows = [*zip(points, at_points, slopes, strict=True)]
    ends = [
        (end, force + slope * (end - command), slope)
        for end, (command, force, slope) in ((-1.0, rows[0]), (1.0, rows[-1]))
        if command != end
    ]
    commands, forces, steepness = zip(*sorted(rows + ends), strict=True)
    return CommandTable("", commands, forces, steepness, path=path)


def read_current(path: Path) -> CommandTable:
    """Read a CSV file with the columns command [1], [%], [us] or [N 50], and current [A]. Raises DataFileError.

    Rows with equal commands become one point with their mean current. The current is linear between the points, and
    that of the last point beyond them. The table has no name yet.
    """
    commands, currents = _points(path, "current", _CURRENT)
    if reason := _why_incomplete(commands):
        raise DataFileError(f"{path}: {reason}")
    rows = zip((-1.0, *commands, 1.0), (currents[0], *currents, currents[-1]), strict=True)
    lines = [(low, high) for low, high in pairwise(rows) if low[0] < high[0]]
    places, values = zip(*(end for line in lines for end in line), strict=True)
    slopes = [(high - low) / (to - at) for (at, low), (to, high) in lines for _ in range(2)]
    return CommandTable("", places, values, tuple(slopes), path=path, kind="current")


_Points = tuple[tuple[float, ...], tuple[float, ...]]


def _points(
    path: Path, name: str, column: Column, check: Callable[[float, float], str | None] = lambda _, __: None
) -> _Points:
    """Return the commands of a file in rising order and the mean of the values at each. Raises DataFileError.

    `check` returns what is wrong with a command and its value.
    """
    columns = read_columns(path, {"command": _COMMAND, name: column})
    points: dict[float, list[float]] = {}
    for row, (command, value) in enumerate(zip(columns.values["command"], columns.values[name], strict=True)):
        if abs(command) > 1.0:
            raise columns.error(row, "command", BEYOND)
        if reason := check(command, value):
            raise columns.error(row, name, reason)
        points.setdefault(command, []).append(value)
    commands = tuple(sorted(points))
    return commands, tuple(fmean(points[command]) for command in commands)


def _why_incomplete(commands: Sequence[float]) -> str | None:
    """Return the reason why the commands do not cover the whole range, or None."""
    if not 3 <= len(commands) <= _MOST_POINTS:
        return f"must have 3 to {_MOST_POINTS} different commands, not {len(commands)}"
    if commands[0] > _WIDEST - 1.0 or commands[-1] < 1.0 - _WIDEST:
        covered = f"{commands[0]:g} ... {commands[-1]:g}"
        return f"must cover the commands from -1 to 1 but for {_WIDEST:g} on each side, not only {covered}"
    return None


def _why_no_curve(commands: Sequence[float], forces: Sequence[float]) -> str | None:
    """Return the reason why the forces are not a thrust curve, or None."""
    if not forces[0] < 0.0 < forces[-1]:
        return "must give a force in reverse below 0 N, and one ahead above 0 N"
    nearest = forces[bisect_right(commands, 0.0) - 1], forces[bisect_left(commands, 0.0)]
    if any(nearest):
        return "must give 0 N at the command 0"
    return None
