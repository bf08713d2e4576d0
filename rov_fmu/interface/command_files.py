"""The inputs of a simulation in a file: a plain table of inputs, or any log that `rov-fmu identify` reads."""

import warnings
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from rov_fmu.equation.catalogue import Axis
from rov_fmu.equation.layout import Layout
from rov_fmu.interface.arguments import TIME, Array
from rov_fmu.io.csv_table import read_header, read_series
from rov_fmu.io.messages import NO_FILE, FileError, lines_on, only, shown
from rov_fmu.tank.clocks import held
from rov_fmu.tank.columns import names_of
from rov_fmu.tank.description import NO_ROV_FILE, ROV_FILE, RovFile, read_description
from rov_fmu.tank.findings import SENTENCES, sentences
from rov_fmu.tank.inspection.headers import axis_in_name, header_parts, layout_of
from rov_fmu.tank.log import Log
from rov_fmu.tank.read_log import read_logs
from rov_fmu.tank.readers.parsers import open_table
from rov_fmu.vehicle.vehicle import VehicleFileError

_NOT_TOLD = {"missing column", "unknown direction", "time of arrival"}
"""The findings that a simulation does not need."""


def read_inputs(path: Path, layout: Layout) -> dict[str, Array]:
    """Return the time (s) as `time`, and the values of inputs by their names in the FMU; each is held up to the next.

    A plain table has the time in the first column, and the names of inputs, without units, above the others. Any other
    file is a log: its commands, and its voltage if the vehicle has this input. A log begins at 0 s. The tables
    [columns], [topics] and [logs] of a rov.toml beside it are obeyed. Raises FileError.
    """
    described = path.parent / ROV_FILE
    rov_file = read_description(described) if described.is_file() and path.is_file() else NO_ROV_FILE
    if _is_plain(path, rov_file):
        return _of_table(path, layout)
    return _of_log(path, layout, rov_file)


def _is_plain(path: Path, rov_file: RovFile) -> bool:
    """Return True for a table of which no header after the first has a unit or is in [columns]."""
    if not path.is_file():
        raise FileError(f"{path}: {NO_FILE}")
    open_stream = open_table(path)
    if not open_stream:
        return False
    renamed = rov_file.tables.columns
    return not any(title in renamed or header_parts(title)[1] for title in read_header(path, open_stream)[1:])


def _of_table(path: Path, layout: Layout) -> dict[str, Array]:
    def why_wrong(name: str) -> str | None:
        return None if name in layout.inputs else f"there is no such input{only(name, layout.inputs)}"

    (_, times), *columns = read_series(path, why_wrong).items()
    return {name: np.asarray(values) for name, values in [(TIME, times), *columns]}


def _of_log(path: Path, layout: Layout, rov_file: RovFile) -> dict[str, Array]:
    axis = axis_in_name(path)
    log = _read(path, layout, axis, rov_file)
    if not log.commands:
        raise FileError(f"{path}: no commands of {', '.join(layout.commands)} were found")
    times = log.commands.rows
    fractions = log.commands.at(times)
    if axis and log.follows_axis:
        values = {name: sign * fractions[:, 0] for name, sign in layout.signs(axis).items()}
    else:
        values = {f"u_{name}": fractions[:, n] for n, name in enumerate(log.commands.thrusters)}
    found = {name: np.array([layout.command_of(fraction) for fraction in column]) for name, column in values.items()}
    voltage = log.used("voltage")
    if "voltage" in layout.inputs and voltage and voltage.count:
        found["voltage"] = held(voltage.time[voltage.there], voltage.values[voltage.there], times)
    return {TIME: times - times[0], **found}


def _read(path: Path, layout: Layout, axis: Axis | None, rov_file: RovFile) -> Log:
    """Read a log with a thruster for each command of the vehicle. Warns of what was left out. Raises FileError."""
    if open_stream := open_table(path):
        _check_header(path, layout, read_header(path, open_stream))
    elif layout.mix:
        raise FileError(
            f"{path}: has the commands of thrusters, but those of this vehicle are {', '.join(layout.commands)}"
        )
    driven = layout_of(name.removeprefix("u_") for name in layout.commands)
    names, wrong = names_of(driven, rov_file.tables)
    if wrong or not rov_file.explains_files:
        raise VehicleFileError(*(lines_on(path.parent / ROV_FILE, wrong) or rov_file.mistakes))
    log, *others = read_logs(path, driven, names, axis, is_part=True)
    if others:
        warnings.warn(f"{path}: only the part before the clock restarts is used", UserWarning, stacklevel=4)
    for sentence in sentences((f for f in log.findings if f.kind not in _NOT_TOLD), SENTENCES):
        warnings.warn(sentence, UserWarning, stacklevel=4)
    return log


def _check_header(path: Path, layout: Layout, header: Iterable[str]) -> None:
    """Raise FileError where a log has an input that is no command, such as a load."""
    for title in header:
        name = header_parts(title)[0]
        if name in layout.inputs and name not in layout.commands and name != "voltage":
            raise FileError(f"{path}: column {shown(title)}: a log has no such input; a table without units may have")
