"""The coupling of surge, sway and yaw, and a horizontal current, computed from the logged motion.

The velocities of the other axes are measured, so each axis is still fitted by itself, with one more held force:
M_v v r in surge, -M_u u r in sway, -(M_v - M_u) u v in yaw, M = m/β, u and v through the water.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.integrate import cumulative_trapezoid

from rov_fmu.model.layout import SURGE, SWAY, YAW, Axis, Layout
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.recording import Recording

Current = tuple[float, float]
"""The velocity of the water north and east, m/s."""
NORTH: Final = "current north"
EAST: Final = "current east"

_OTHERS = {SURGE.name: ("v", "r"), SWAY.name: ("u", "r"), YAW.name: ("u", "v")}
_BETAS = SURGE.coefficient("beta"), SWAY.coefficient("beta")


@dataclass(frozen=True, eq=False)
class Coupling:
    """The force of coupling along an axis (N, N.m), and its derivatives by log β of surge and sway and current."""

    force: Array
    slopes: Mapping[str, Array]

    def at(self, here: Array, time: Array) -> "Coupling":
        """Interpolate at other times."""
        slopes = {name: np.interp(time, here, slope) for name, slope in self.slopes.items()}
        return Coupling(np.interp(time, here, self.force), slopes)


def is_coupled(layout: Layout, axis: Axis) -> bool:
    """Return True when other axes of the vehicle act on this one."""
    return layout.coupled and axis.name in _OTHERS


def is_logged(recording: Recording) -> bool:
    """Return True when the log has the velocities that the coupling depends on."""
    return recording.beside.keys() >= set(_OTHERS.get(recording.axis.name, ()))


def coupling(rov: Rov, recording: Recording, current: Current) -> Coupling | None:
    """Return the coupling at the times of the recording; None where there is none, or where it is not logged."""
    if not is_coupled(rov.layout, recording.axis) or not is_logged(recording):
        return None
    M_u, M_v = (rov.effective_inertia(rov.layout.kinds[axis.name]) for axis in (SURGE, SWAY))
    beside = recording.beside
    (c, s), still = _heading(recording), np.zeros(len(recording.time))
    north, east = current
    u = beside.get("u", still) - (north * c + east * s)
    v = beside.get("v", still) - (east * c - north * s)
    r = beside.get("r", still)
    if recording.axis is SURGE:
        force = M_v * v * r
        return Coupling(force, dict(zip((_BETAS[1], NORTH, EAST), (-force, M_v * r * s, -M_v * r * c), strict=True)))
    if recording.axis is SWAY:
        force = -M_u * u * r
        return Coupling(force, dict(zip((_BETAS[0], NORTH, EAST), (-force, M_u * r * c, M_u * r * s), strict=True)))
    M = M_v - M_u
    slopes = (-M_u * u * v, M_v * u * v, M * (c * v - s * u), M * (s * v + c * u))
    return Coupling(-M * u * v, dict(zip((*_BETAS, NORTH, EAST), slopes, strict=True)))


def is_in_flow(recording: Recording) -> bool:
    """Return True when a current north and east can be seen along the axis, because the heading is logged."""
    return recording.axis in (SURGE, SWAY) and "psi" in recording.beside


def carried(recording: Recording, time: Array) -> Array:
    """Return the change of the samples at these times due to a current of 1 m/s north and east, 2 x n."""
    if not is_in_flow(recording):
        return np.zeros((2, len(time)))
    c, s = _heading(recording)
    along = np.array([c, s] if recording.axis is SURGE else [-s, c])
    if recording.is_position:
        along = cumulative_trapezoid(along, recording.time, initial=0.0)
    found = np.array([np.interp(time, recording.time, row) for row in along])
    return found - found[:, :1] if recording.is_position else found


def _heading(recording: Recording) -> tuple[Array, Array]:
    """Return the cosine and sine of the heading; both are 0 where it is unknown, since the current is then too."""
    psi = recording.beside.get("psi")
    if psi is None:
        return np.zeros(len(recording.time)), np.zeros(len(recording.time))
    return np.cos(psi), np.sin(psi)
