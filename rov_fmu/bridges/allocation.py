"""Write how thrusters make a wrench, for thruster managers: the allocation matrix, and from force to command.

The wrench w on the body, along and about the axes of the vehicle in the frame of the FMU (forward, starboard, down), is
w = B F for the forces F of the thrusters. The forces of least size for a wrench are F = B^+ w, with the pseudo-inverse
(Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, 2011, 12.3.2). The tuning alpha and the
health of the thrusters are in B, so F are the forces of whole ones.
"""

import numpy as np

from rov_fmu.autopilot.allocation import allocation_matrix, thrust_rows, voltages
from rov_fmu.bridges.sdf import BESIDE_THRUST, Array, rendered_model
from rov_fmu.equation.forces import left_out
from rov_fmu.io.messages import InputError
from rov_fmu.vehicle.vehicle import Vehicle


def allocation_files(vehicle: Vehicle) -> dict[str, str]:
    """Return the files of the folder by name. Raises InputError if commands cannot give each thruster its own force."""
    _check(vehicle)
    layout = vehicle.layout
    matrix = allocation_matrix(vehicle)

    def command_of(fraction: float) -> float:
        """Return the command of a thruster: a fraction, or a pulse width where each thruster has its own input."""
        return fraction if layout.mix else layout.command_of(fraction)

    tables = {
        curve.name: {voltage: thrust_rows(vehicle, curve, voltage) for voltage in voltages(vehicle, curve)}
        for curve in layout.curves
    }
    content = {
        "axes": {axis.name: axis for axis in layout.bare_axes},
        "matrix": matrix.tolist(),
        "pseudo_inverse": np.linalg.pinv(matrix).tolist(),
        "of_inputs": np.linalg.pinv(_gains(vehicle)).tolist() if layout.mix else [],
        "tables": tables,
        "command_of": command_of,
        "row": _row,
        "left_out": left_out(layout, BESIDE_THRUST),
    }
    lines = ["curve,voltage_V,force_N,command"]
    for curve, by_voltage in tables.items():
        for voltage, rows in by_voltage.items():
            lines += [f"{curve},{voltage or ''},{force:.9g},{command_of(c):.9g}" for force, c in rows]
    text = rendered_model("allocation.yaml.j2", vehicle, (), **content)
    return {"allocation.yaml": text, "force_to_command.csv": "\n".join([*lines, ""])}


def _gains(vehicle: Vehicle) -> Array:
    """Return the gains of the inputs, thrusters x inputs."""
    return np.array(vehicle.layout.gain_rows(thruster.name for thruster in vehicle.layout.thrusters))


def _check(vehicle: Vehicle) -> None:
    layout = vehicle.layout
    if not layout.thrusters:
        raise InputError(f"{vehicle.identifier}: has no thrusters, so there is nothing to allocate")
    if np.linalg.matrix_rank(_gains(vehicle)) < len(layout.thrusters):
        raise InputError(
            f"{vehicle.identifier}: [inputs] drives several thrusters with one command, so they cannot have forces of "
            "their own: leave this table out, and each thruster has its command"
        )


def _row(values: list[float]) -> str:
    """Return numbers as a YAML list."""
    return f"[{', '.join(f'{value + 0.0:.12g}' for value in values)}]"
