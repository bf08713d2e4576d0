"""The command `rov-fmu tune`: the meaning of its options, and the vehicle file that it writes."""

from pathlib import Path

from rov_fmu.identify.tuning import Tuning, TuningError, read_points, tune, tune_over, tuned_values
from rov_fmu.io.file_kinds import VEHICLE_FILE, check_written
from rov_fmu.io.messages import InputError
from rov_fmu.io.output import check_targets
from rov_fmu.model.layout import Axis
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from rov_fmu.vehicle.writer import write_tuned


def tune_vehicle(
    path: Path,
    axis: Axis,
    command: float | None,
    V_ss: float | None,
    Tau: float | None,
    points: Path | None,
    output: Path | None,
) -> Tuning:
    """Tune an axis as the options say, and write the tuned vehicle if there is a path for it.

    Raises InputError about the options, FileError, and WriteError.
    """
    if points is not None and (command, V_ss, Tau) != (None, None, None):
        raise InputError("tune: use either --points, or --command, --v-ss and --tau")
    vehicle = load_vehicle(path)
    if not vehicle.layout.has(axis):
        raise InputError(f"tune: {path}: --axis {axis.name}: the vehicle has only {', '.join(vehicle.layout.kinds)}")
    if output:
        check_targets([output], [*([points] if points else []), *vehicle.files])
        check_written(output, VEHICLE_FILE)
    try:
        tuning = _tuned(vehicle, axis, command, V_ss, Tau, points)
    except TuningError as error:
        raise InputError(f"tune: {error}") from error
    if output:
        write_tuned(path, output, *tuned_values(tuning))
    return tuning


def _tuned(
    vehicle: Vehicle, axis: Axis, command: float | None, V_ss: float | None, Tau: float | None, points: Path | None
) -> Tuning:
    """Tune to the points of a table, or else to one command."""
    if points is not None:
        return tune_over(vehicle.rov, axis, read_points(points, vehicle.rov, axis))
    if command is None or V_ss is None:
        raise InputError("tune: give --command and --v-ss (and --tau), or --points")
    return tune(vehicle.rov, axis, command, V_ss, Tau)
