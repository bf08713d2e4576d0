"""Reading tables of measured thrust, such as those that makers publish of their thrusters."""

from bisect import bisect_left, bisect_right
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean

from rov_fmu.io.csv_table import PULSES, Column, DataFileError, pulses, read_columns
from rov_fmu.model.layout import ThrustTable

_COLUMNS = {
    "command": Column(
        {"1": 1.0, "%": 100.0},
        minimum=-1.0,
        maximum=1.0,
        also=("pulse", "pwm"),
        conversions=dict.fromkeys(PULSES, pulses),
    ),
    "thrust": Column(
        {"N": 1.0, "kgf": 1.0 / 9.80665, "lbf": 1.0 / 4.4482216152605}, also=("force",), minimum=-1e6, maximum=1e6
    ),
}
_MOST_POINTS = 2000
_WIDEST = 0.05
"""The largest part of the commands, on each side, that a table may leave out. Its last slope continues there."""


@dataclass(frozen=True)
class ThrustFile:
    """The points of a table of thrust."""

    path: Path
    commands: tuple[float, ...]
    forces: tuple[float, ...]
    """The force at each command, N."""

    def table(self, name: str, voltage: float = 0.0) -> ThrustTable:
        """Return the table for the model: a monotone cubic between the points (Fritsch and Butland 1984)."""
        from scipy.interpolate import PchipInterpolator  # takes long to import, and few vehicles have tables

        slopes = map(float, PchipInterpolator(self.commands, self.forces).derivative()(self.commands))
        points = [*zip(self.commands, self.forces, slopes, strict=True)]
        ends = [
            (end, force + slope * (end - command), slope)
            for end, (command, force, slope) in ((-1.0, points[0]), (1.0, points[-1]))
            if command != end
        ]
        points = sorted(points + ends)
        commands, forces, steepness = zip(*points, strict=True)
        return ThrustTable(name, commands, forces, steepness, voltage)


def read_thrust(path: Path) -> ThrustFile:
    """Read a CSV file with the columns command [1], [%] or [us], and thrust [N], [kgf] or [lbf]. Raises DataFileError.

    Rows with equal commands become one point with their mean thrust.
    """
    columns = read_columns(path, _COLUMNS)
    points: dict[float, list[float]] = {}
    for row, (command, force) in enumerate(zip(*(columns.values[name] for name in _COLUMNS), strict=True)):
        if abs(command) > 1.0:
            raise columns.error(row, "command", "must be within full thrust in both directions")
        if command * force < 0.0:
            raise columns.error(row, "thrust", "must have the sign of its command")
        points.setdefault(command, []).append(force)
    commands = sorted(points)
    forces = [fmean(points[command]) for command in commands]
    if reason := _mistake(commands, forces):
        raise DataFileError(f"{path}: {reason}")
    return ThrustFile(path, tuple(commands), tuple(forces))


def _mistake(commands: list[float], forces: list[float]) -> str | None:
    """Return why the points are no thrust curve from full thrust in reverse to full thrust ahead, or None."""
    if not 3 <= len(commands) <= _MOST_POINTS:
        return f"must have 3 to {_MOST_POINTS} different commands, not {len(commands)}"
    if commands[0] > _WIDEST - 1.0 or commands[-1] < 1.0 - _WIDEST:
        covered = f"{commands[0]:g} ... {commands[-1]:g}"
        return f"must cover the commands from -1 to 1 but for {_WIDEST:g} on each side, not only {covered}"
    if not forces[0] < 0.0 < forces[-1]:
        return "must give a force in reverse below 0 N, and one ahead above 0 N"
    if forces[bisect_right(commands, 0.0) - 1] != 0.0 or forces[bisect_left(commands, 0.0)] != 0.0:
        return "must give 0 N at the command 0"
    return None
