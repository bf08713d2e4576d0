"""The command `rov-fmu sdf`: the file that it writes, SDFormat or URDF."""

from pathlib import Path

from rov_fmu.bridges.sdf import Model, gazebo_model
from rov_fmu.bridges.urdf import urdf_model
from rov_fmu.io.file_kinds import GAZEBO_MODEL, check_written
from rov_fmu.io.messages import InputError
from rov_fmu.io.output import Output, check_replaced, check_targets, write_whole
from rov_fmu.vehicle.vehicle import load_vehicle


def write_model(
    vehicle: Path, output: Path | None, *, in_world: bool, explicit: bool, force: bool = False
) -> tuple[Path, Model]:
    """Write the model of a vehicle for Gazebo, and return its path and the model. The default is <identifier>.sdf.

    A name that ends with .urdf asks for a robot description, which has neither a world nor thrusters.

    Raises FileError, InputError about a vehicle that Gazebo cannot have, and WriteError.
    """
    loaded = load_vehicle(vehicle)
    path = output or Path(f"{loaded.identifier}.sdf")
    check_targets([path], [vehicle, *loaded.files])
    check_written(path, GAZEBO_MODEL)
    check_replaced([path], force=force)
    is_urdf = path.suffix.lower() == ".urdf"
    if is_urdf and (in_world or explicit):
        raise InputError(
            f"{path}: URDF has no world, and always has the added mass in its own tags: leave out "
            f"{'--world' if in_world else '--added-mass plugin'}"
        )
    model = urdf_model(loaded) if is_urdf else gazebo_model(loaded, in_world=in_world, explicit=explicit)
    write_whole(Output(path, model.text.encode()), force=force)
    return path, model
