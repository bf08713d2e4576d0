"""Write how thrusters make a wrench, for thruster managers: the allocation matrix, and from force to command.

The wrench w on the body, along and about the axes of the vehicle in the frame of the FMU (forward, starboard, down), is
w = B F for the forces F of the thrusters. The forces of least size for a wrench are F = B^+ w, with the pseudo-inverse
(Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, 2011, 12.3.2). The tuning alpha and the
health of the thrusters are in B, so F are the forces of whole ones.
"""

from collections.abc import Iterator
from itertools import pairwise
from math import ceil

import numpy as np

from rov_fmu.bridges.sdf import Array, rendered_model
from rov_fmu.equation.forces import (
    COUPLING,
    DEAD_BAND,
    LIFT,
    LINEAR,
    LOAD,
    QUADRATIC,
    RESTORING,
    THRUST,
    WEIGHT,
    left_out,
)
from rov_fmu.equation.parts import Curve
from rov_fmu.io.messages import InputError
from rov_fmu.vehicle.vehicle import Vehicle

Row = tuple[float, float]
"""A force, N, and the fraction of the full command that gives it."""

_EXACT = 3e-4
"""The largest error of a force that is interpolated between two rows, relative to the force."""
_SMALL = 0.005
"""The share of the strongest force below which errors are no smaller than at this share."""
_FAINT = 1e-5
"""The least force of a table beside 0, relative to the strongest one: within it, the dead band is crossed."""
_APART = 0.0125
"""The most that two neighbouring voltages differ, relative to the lower one."""
_RANGE = 0.8, 1.2
"""The range of the voltage relative to the usual one, where the thrust follows a power of it."""
_SAMPLES = 300
"""The commands among which the rows of a table are chosen."""


_HAS = (THRUST, DEAD_BAND, LOAD, WEIGHT, LINEAR, QUADRATIC, LIFT, RESTORING, COUPLING)
"""The effects that the files have, and those that act on the body whatever its thrusters do."""


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
        "left_out": left_out(layout, _HAS),
    }
    lines = ["curve,voltage_V,force_N,command"]
    for curve, by_voltage in tables.items():
        for voltage, rows in by_voltage.items():
            lines += [f"{curve},{voltage or ''},{force:.9g},{command_of(c):.9g}" for force, c in rows]
    text = rendered_model("allocation.yaml.j2", vehicle, (), **content)
    return {"allocation.yaml": text, "force_to_command.csv": "\n".join([*lines, ""])}


def allocation_matrix(vehicle: Vehicle) -> Array:
    """Return B, axes x thrusters: the force along, or the moment (m) about, each axis per newton of each thruster."""
    return np.array(
        [
            [
                vehicle[axis.coefficient("alpha")]
                * vehicle[thruster.coefficient("health")]
                * vehicle.effect(thruster, axis)
                for thruster in vehicle.layout.thrusters
            ]
            for axis in vehicle.layout.bare_axes
        ]
    )


def _gains(vehicle: Vehicle) -> Array:
    """Return the gains of the inputs, thrusters x inputs."""
    layout = vehicle.layout
    return np.array([[layout.gains[t.name].get(u, 0.0) for u in layout.commands] for t in layout.thrusters])


def _check(vehicle: Vehicle) -> None:
    layout = vehicle.layout
    if not layout.thrusters:
        raise InputError(f"{vehicle.identifier}: has no thrusters, so there is nothing to allocate")
    if np.linalg.matrix_rank(_gains(vehicle)) < len(layout.thrusters):
        raise InputError(
            f"{vehicle.identifier}: [inputs] drives several thrusters with one command, so they cannot have forces of "
            "their own: leave this table out, and each thruster has its command"
        )


def voltages(vehicle: Vehicle, curve: Curve) -> list[float | None]:
    """Return the voltages of the tables of a curve, V, or None if its thrust does not depend on the voltage.

    They are near enough to each other for linear interpolation between two tables.
    """
    usual = vehicle.layout.voltage
    if usual is None or not (len(curve.tables) > 1 or "V_0" in curve.keys):
        return [None]
    known = [one.voltage for one in curve.tables] if len(curve.tables) > 1 else [usual * share for share in _RANGE]
    ends = sorted({*known, min(max(usual, known[0]), known[-1])})
    found = [ends[0]]
    for low, high in pairwise(ends):
        count = ceil((high - low) / (_APART * low))
        found += [low + (high - low) * n / count for n in range(1, count + 1)]
    return [*map(float, found)]


def thrust_rows(vehicle: Vehicle, curve: Curve, voltage: float | None) -> list[Row]:
    """Return the forces and commands of one thruster, both rising, from full reverse to full ahead.

    Where the force does not rise with the command, the smaller command stands, and it is 0 for no force. Between two
    rows, the command is linear in the force.
    """
    ahead, astern = (list(_one_way(vehicle, curve, voltage, sign)) for sign in (1.0, -1.0))
    return [*((-force, -c) for force, c in reversed(astern)), (0.0, 0.0), *ahead]


def _one_way(vehicle: Vehicle, curve: Curve, voltage: float | None, sign: float) -> Iterator[Row]:
    """Yield forces and commands in one direction, without their sign: as few as the interpolation needs."""

    def force(command: float) -> float:
        return sign * vehicle.curve_force(curve, sign * command, voltage)

    strongest = max(map(force, np.linspace(0.0, 1.0, 65).tolist()))
    low, high = 0.0, 1.0
    while high - low > 1e-12 and strongest > 0.0:  # where the force rises above the least one
        middle = 0.5 * (low + high)
        low, high = (low, middle) if force(middle) > _FAINT * strongest else (middle, high)
    commands = low + (1.0 - low) * np.linspace(0.0, 1.0, _SAMPLES) ** 2  # most near the dead band
    forces = np.array([*map(force, commands.tolist())])
    rises = (forces > 0.0) & (forces > np.concatenate([[0.0], np.maximum.accumulate(forces)[:-1]]))
    commands, forces = commands[rises], forces[rises]
    n, last = 0, len(forces) - 1
    while n <= last:
        yield float(forces[n]), float(commands[n])
        end = n + 2
        while end <= last and _is_straight(commands[n : end + 1], forces[n : end + 1], _SMALL * strongest):
            end += 1
        n = max(min(end - 1, last), n + 1)


def _is_straight(commands: Array, forces: Array, small: float) -> bool:
    """Return True if a line between the ends gives the forces in between."""
    line = np.interp(commands, commands[[0, -1]], forces[[0, -1]])
    return bool((np.abs(line - forces) <= _EXACT * np.maximum(forces, small)).all())


def _row(values: list[float]) -> str:
    """Return numbers as a YAML list."""
    return f"[{', '.join(f'{value + 0.0:.12g}' for value in values)}]"
