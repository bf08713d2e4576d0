"""How thrusters make a wrench: the allocation matrix, and the tables from the force of a thruster to its command.

The wrench along and about the axes of the vehicle is w = B F for the forces F of the thrusters. With the tuning alpha
and the health of the thrusters in B, F are the forces of whole ones.
"""

from collections.abc import Iterator
from itertools import pairwise
from math import ceil

import numpy as np

from rov_fmu.equation.parts import Curve
from rov_fmu.tank.arrays import Array
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


def thrust_rows(vehicle: Vehicle, curve: Curve, voltage: float | None, exact: float = _EXACT) -> list[Row]:
    """Return the forces and commands of one thruster, both rising, from full reverse to full ahead.

    Where the force does not rise with the command, the smaller command stands, and it is 0 for no force. Between two
    rows, the command is linear in the force. At the samples, the error of the force is at most `exact`, relative to the
    force or to a small one where it is smaller. Between two samples, it may be a third larger.
    """
    ahead, astern = (list(_one_way(vehicle, curve, voltage, sign, exact)) for sign in (1.0, -1.0))
    return [*((-force, -c) for force, c in reversed(astern)), (0.0, 0.0), *ahead]


def _one_way(vehicle: Vehicle, curve: Curve, voltage: float | None, sign: float, exact: float) -> Iterator[Row]:
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
        while end <= last and _is_straight(
            commands[n : end + 1], forces[n : end + 1], exact * np.maximum(forces[n : end + 1], _SMALL * strongest)
        ):
            end += 1
        n = max(min(end - 1, last), n + 1)


def _is_straight(commands: Array, forces: Array, allowed: Array) -> bool:
    """Return True if a line between the ends gives the forces in between."""
    line = np.interp(commands, commands[[0, -1]], forces[[0, -1]])
    return bool((np.abs(line - forces) <= allowed).all())
