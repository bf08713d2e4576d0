"""A log as the page that flies reads it: the commands of the vehicle, and what was measured.

Any format that `rov-fmu identify` reads is converted, with the tables [columns], [topics], [dives] and [logs] of the
rov.toml beside the file. Of a dive of several files, all are read, whichever is named. Nothing is resampled: commands
and measurements keep their own times.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from rov_fmu.equation.catalogue import EXTERNAL
from rov_fmu.equation.layout import Layout
from rov_fmu.equation.parts import VehicleAxis
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.catalogue import QUANTITIES
from rov_fmu.tank.columns import COMMAND
from rov_fmu.tank.folder import description_beside, one_log
from rov_fmu.tank.log import Commands, Log
from rov_fmu.tank.readers.parsers import one_parser
from rov_fmu.vehicle.vehicle import Vehicle

_MOST_SAMPLES = 20_000
"""The largest number of samples of a quantity. Of more samples, every second, third … is flown."""


@one_parser()
def recording_of(path: Path, vehicle: Vehicle) -> dict[str, Any]:
    """Return the recording in a log, as fmu_src/live/recording.js declares it.

    Warns of what is left out. Raises FileError if the log cannot be flown by this vehicle.
    """
    rov_file, layout = description_beside(path), vehicle.layout
    if rov_file.tables.has_wrench:
        layout = Layout.of_wrench(layout.axes)
    log = one_log(path, layout, rov_file)
    if not log.commands:
        raise DataFileError(f"{path}: no commands of thrusters were found, so it cannot be flown")
    start, end = float(log.commands.rows[0]), log.commands.end
    signals = [*_signals(log, vehicle.layout.axes, start, end)]
    if not signals:
        names = ", ".join(vehicle.layout.by_name)
        raise DataFileError(f"{path}: no motion of an axis of this vehicle was found: {names}")
    times, commands = _commands(log, vehicle.layout)
    return {
        "name": path.name,
        "times": _rounded(times - start),
        "commands": commands,
        "signals": signals,
        "notes": [],
        "left": 0,
    }


def _commands(log: Log, layout: Layout) -> tuple[Array, dict[str, list[float]]]:
    """Return the times at which commands change, and the commands of the vehicle that give those of the log best.

    Of a log of forces on the body, they are the loads.
    """
    commands = log.commands
    assert isinstance(commands, Commands)
    times = np.unique([commands.rows[0], *commands.time, commands.rows[-1]])
    given = commands.at(times)
    if EXTERNAL.issuperset(commands.thrusters):  # the forces of a wrench are loads
        return times, {name: _rounded(column) for name, column in zip(commands.thrusters, given.T, strict=True)}
    if commands.thrusters == (COMMAND,) and log.axis:
        signs = layout.signs(log.axis)
        values = given @ np.array([[signs.get(name, 0.0) for name in layout.commands]])
    else:
        mix = np.array(layout.gain_rows(commands.thrusters))
        values = given @ np.linalg.pinv(mix, rcond=1e-9).T
    columns = np.clip(values, -1.0, 1.0).T
    return times, {name: _rounded(column) for name, column in zip(layout.commands, columns, strict=True)}


def _signals(log: Log, axes: tuple[VehicleAxis, ...], start: float, end: float) -> Iterator[dict[str, Any]]:
    """Yield what is compared: of each axis the position, or else the velocity."""
    for n, axis in enumerate(form.axis for form in axes):
        known = (quantity for quantity in QUANTITIES.values() if quantity.axis == axis)
        channels = (log.used(quantity.name) for quantity in sorted(known, key=lambda one: one.is_velocity))
        for channel in filter(None, channels):
            times, values = channel.unwrapped
            is_meant = (times >= start) & (times <= end)
            if np.count_nonzero(is_meant) < 2:
                continue
            stride = -(-np.count_nonzero(is_meant) // _MOST_SAMPLES)
            yield {
                "axis": n,
                "quantity": channel.quantity.name,
                "isPosition": not channel.quantity.is_velocity,
                "times": _rounded(times[is_meant][::stride] - start),
                "values": _rounded(values[is_meant][::stride]),
            }
            break


def _rounded(values: Array) -> list[float]:
    """Return numbers with nine decimals, far below what a sensor or a clock tells."""
    rounded: list[float] = np.round(values, 9).tolist()
    return rounded
