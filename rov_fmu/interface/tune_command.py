"""The command `rov-fmu tune`: the meaning of its options, and the vehicle file that it writes."""

from collections.abc import Sequence
from dataclasses import replace
from math import isfinite
from pathlib import Path

from rov_fmu.equation.catalogue import TUNING, Axis
from rov_fmu.identify.tuning import Target, Tuning, TuningError, impossible, tune
from rov_fmu.io.columns import read_columns
from rov_fmu.io.csv_table import DataFileError
from rov_fmu.io.file_kinds import VEHICLE_FILE
from rov_fmu.io.messages import InputError
from rov_fmu.io.output import check_targets
from rov_fmu.tank.columns import columns_of, refuse_slips
from rov_fmu.vehicle.vehicle import TUNED, Vehicle, load_vehicle
from rov_fmu.vehicle.writer import write_tuned


def tune_vehicle(
    path: Path,
    axis: Axis,
    command: float | None,
    V_ss: float | None,
    Tau: float | None,
    points: Path | None,
    output: Path | None,
    *,
    force: bool = False,
) -> tuple[Tuning, dict[Path, str]]:
    """Tune an axis as the options say, and write the tuned vehicle if there is a path for it.

    Return also the files that were written, each with what it replaced.

    Raises InputError about the options, FileError, and WriteError.
    """
    if points is not None and (command, V_ss, Tau) != (None, None, None):
        raise InputError("tune: use either --points, or --command, --v-ss and --tau")
    vehicle = load_vehicle(path)
    if not vehicle.layout.has(axis):
        raise InputError(f"tune: {path}: --axis {axis.name}: the vehicle has only {', '.join(vehicle.layout.by_name)}")
    if not vehicle.layout.signs(axis):
        raise InputError(f"tune: {path}: --axis {axis.name}: no thruster drives this axis, so it cannot be tuned")
    check_targets([(output, VEHICLE_FILE)], [*([points] if points else []), *vehicle.files], force=force)
    if points is not None:
        wanted = read_points(points, vehicle, axis)
    elif command is None or V_ss is None:
        raise InputError("tune: give --command and --v-ss (and --tau), or --points")
    else:
        wanted = [Target("V_ss", command, V_ss)] + ([] if Tau is None else [Target("Tau", command, Tau)])
    try:
        tuning = tune(vehicle, axis, wanted)
    except TuningError as error:
        raise InputError(f"tune: {f'{points}: ' if points else ''}{error}") from error
    values = {name: tuning.vehicle[name] for name in map(axis.coefficient, TUNING)}
    return tuning, write_tuned(path, output, values, source(wanted), force=force) if output else {}


def source(wanted: Sequence[Target]) -> str:
    """Return the source of coefficients that are tuned to some points."""
    points = ", ".join(f"{p.quantity} = {p.value:g} at {p.command:.0%}" for p in wanted[:2])
    return f"{TUNED} {points}{', ...' if len(wanted) > 2 else ''}"


def read_points(path: Path, vehicle: Vehicle, axis: Axis) -> list[Target]:
    """Read wanted points from a CSV file with command, velocity and time constant, which may have blanks.

    Raises DataFileError.
    """
    columns = columns_of("steady", axis) | columns_of("time_constant")
    optional = {name: replace(column, optional=True, blanks=True) for name, column in columns.items()}
    table = read_columns(path, optional | {"command": columns["command"]})
    refuse_slips(table, ["command"])
    points = []
    for quantity, column in (("V_ss", "velocity"), ("Tau", "time constant")):
        for n, value in enumerate(table.values.get(column, ())):
            if isfinite(value):
                points.append(Target(quantity, table.values["command"][n], value))
                if reason := impossible(vehicle, axis, points[-1]):
                    raise table.error(n, column, reason)
    if not any(point.quantity == "V_ss" for point in points):
        raise DataFileError(f"{path}: no row has a velocity, and alpha is tuned to velocities")
    return points
