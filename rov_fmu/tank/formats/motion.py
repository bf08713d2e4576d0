"""Signals from an attitude, a position and velocities in three dimensions."""

from collections.abc import Iterator

import numpy as np

from rov_fmu.model.layout import HEAVE, PITCH, ROLL, SURGE, SWAY, YAW
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.signals import Signal


def rotations(quaternions: Array) -> Array:
    """Return n x 3 x 3 rotation matrices of quaternions w, x, y, z; NaN for those without a direction."""
    norm = np.linalg.norm(quaternions, axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        w, x, y, z = (quaternions / norm).T
    rows = (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )
    return np.moveaxis(np.array(rows), -1, 0)


def attitude_signals(time: Array, R: Array) -> Iterator[Signal]:
    """Yield roll, pitch and heading, from the rotations from the body (forward, starboard, down) to north-east-down."""
    yield Signal(ROLL, ROLL.position, time, np.arctan2(R[:, 2, 1], R[:, 2, 2]))
    yield Signal(PITCH, PITCH.position, time, -np.arcsin(np.clip(R[:, 2, 0], -1.0, 1.0)))
    yield Signal(YAW, YAW.position, time, np.arctan2(R[:, 1, 0], R[:, 0, 0]))


def position_signals(time: Array, position: Array) -> Iterator[Signal]:
    """Yield the depth, and the horizontal distance from the first place, from n x 3 positions north, east and down."""
    yield Signal(HEAVE, HEAVE.position, time, position[:, 2])
    there = np.isfinite(position[:, :2]).all(axis=1)
    if there.any():
        yield Signal(None, "distance", time, np.hypot(*(position - position[there][0])[:, :2].T))


def velocity_signals(time: Array, linear: Array | None, angular: Array | None) -> Iterator[Signal]:
    """Yield a signal for each component of n x 3 linear and angular velocities of the body: forward, starboard,
    down."""
    for axes, values in (((SURGE, SWAY, HEAVE), linear), ((ROLL, PITCH, YAW), angular)):
        if values is not None:
            for axis, column in zip(axes, values.T, strict=True):
                yield Signal(axis, "velocity", time, column)


def to_body(time: Array, velocity: Array, attitude_time: Array, R: Array) -> Array:
    """Rotate n x 3 velocities (north, east, down) into the body frame, with the latest attitude before each time."""
    at = np.maximum(np.searchsorted(attitude_time, time, side="right") - 1, 0)
    return np.asarray(np.einsum("nji,nj->ni", R[at], velocity))
