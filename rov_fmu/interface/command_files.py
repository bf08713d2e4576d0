"""The inputs of a simulation in a file: a plain table of inputs, or any log that `rov-fmu identify` reads."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from rov_fmu.equation.layout import Layout
from rov_fmu.interface.arguments import TIME, Array
from rov_fmu.io.csv_table import read_series
from rov_fmu.io.messages import FileError, only, shown
from rov_fmu.tank.clocks import held
from rov_fmu.tank.description import RovFile
from rov_fmu.tank.folder import description_beside, one_log
from rov_fmu.tank.inspection.headers import assumed_layout, header_parts
from rov_fmu.tank.readers.parsers import guarded, header_of, one_parser, open_table


@one_parser()
def read_inputs(path: Path, layout: Layout) -> dict[str, Array]:
    """Return the time (s) as `time`, and the values of inputs by their names in the FMU; each is held up to the next.

    A plain table has the time in the first column, and the names of inputs, without units, above the others. Any other
    file is a log: its commands, and its voltage if the vehicle has this input. A log begins at 0 s. The tables
    [columns], [topics], [dives] and [logs] of a rov.toml beside it are obeyed. Raises FileError.
    """
    rov_file = description_beside(path)
    return _of_table(path, layout) if _is_plain(path, rov_file) else _of_log(path, layout, rov_file)


def _is_plain(path: Path, rov_file: RovFile) -> bool:
    """Return True for a table of which no header after the first has a unit or is in [columns]."""
    header, renamed = header_of(path), rov_file.tables.columns
    return header is not None and not any(title in renamed or header_parts(title)[1] for title in header[1:])


@guarded
def _of_table(path: Path, layout: Layout) -> dict[str, Array]:
    def why_wrong(name: str) -> str | None:
        return None if name in layout.inputs else f"there is no such input{only(name, layout.inputs)}"

    (_, times), *columns = read_series(path, why_wrong, open_table(path)).items()
    return {name: np.asarray(values) for name, values in [(TIME, times), *columns]}


def _of_log(path: Path, layout: Layout, rov_file: RovFile) -> dict[str, Array]:
    if header := header_of(path):
        _check_header(path, layout, header)
    elif layout.mix:
        raise FileError(
            f"{path}: has the commands of thrusters, but those of this vehicle are {', '.join(layout.commands)}"
        )
    driven = assumed_layout(name.removeprefix("u_") for name in layout.commands)  # a thruster for each command
    log = one_log(path, driven, rov_file, is_part=True)
    if not log.commands:
        raise FileError(f"{path}: no commands of {', '.join(layout.commands)} were found")
    times = log.commands.rows
    fractions = log.commands.at(times)
    if log.axis and log.follows_axis:
        values = {name: sign * fractions[:, 0] for name, sign in layout.signs(log.axis).items()}
    else:
        values = {f"u_{name}": fractions[:, n] for n, name in enumerate(log.commands.thrusters)}
    inputs = {name: np.array([layout.command_of(fraction) for fraction in column]) for name, column in values.items()}
    voltage = log.used("voltage")
    if "voltage" in layout.inputs and voltage and voltage.count:
        inputs["voltage"] = held(*voltage.samples, times)
    return {TIME: times - times[0], **inputs}


def _check_header(path: Path, layout: Layout, header: Iterable[str]) -> None:
    """Raise FileError where a log has an input that is no command, such as a load."""
    for title in header:
        name = header_parts(title)[0]
        if name in layout.inputs and name not in layout.commands and name != "voltage":
            raise FileError(f"{path}: column {shown(title)}: a log has no such input; a table without units may have")
