"""One log that a command names, read with the rov.toml beside it: its commands are flown or simulated."""

import warnings
from pathlib import Path

from rov_fmu.equation.layout import Layout
from rov_fmu.io.messages import lines_on
from rov_fmu.io.reading import open_file
from rov_fmu.tank.columns import names_of
from rov_fmu.tank.description import NO_ROV_FILE, ROV_FILE, RovFile, read_description
from rov_fmu.tank.findings import sentences
from rov_fmu.tank.folder import joined_dive
from rov_fmu.tank.inspection.headers import axis_in_name
from rov_fmu.tank.log import Log
from rov_fmu.tank.read_log import read_logs
from rov_fmu.vehicle.vehicle import VehicleFileError

_NOT_TOLD = {"missing column", "unknown direction", "time of arrival"}
"""The findings that a flight or a simulation does not need."""


def description_beside(path: Path) -> RovFile:
    """Return what the rov.toml beside a log says. Raises FileError if there is no log."""
    with open_file(path):
        described = path.parent / ROV_FILE
        return read_description(described) if described.exists() else NO_ROV_FILE


def one_log(path: Path, layout: Layout, rov_file: RovFile, *, is_part: bool = False) -> Log:
    """Return a log up to the first restart of its clock, and warn of what is left out. Raises FileError.

    Of a dive of several files, all are read, whichever is named. `is_part` is true where a log of commands alone will
    do. The tables [columns], [topics], [valid], [dives] and [logs] of the rov.toml beside the log are obeyed.
    """
    names, wrong = names_of(layout, rov_file.tables)
    if wrong or not rov_file.explains_files:
        raise VehicleFileError(*(lines_on(path.parent / ROV_FILE, wrong) or rov_file.mistakes))
    dives = [dive for dive in rov_file.tables.dives.values() if path.name in dive.files]
    if dives:
        log, others = joined_dive(path.parent, dives[0], layout, names), []
    else:
        log, *others = read_logs(path, layout, names, axis_in_name(path), is_part=is_part)
    told = [f"{path}: only the part before the clock restarts is used"] * bool(others)
    for sentence in (*told, *sentences(f for f in log.findings if f.kind not in _NOT_TOLD)):
        warnings.warn(sentence, UserWarning, stacklevel=4)
    return log
