"""The motion that the tests of log formats write, and what must be read of it."""

from collections.abc import Iterator

import numpy as np
import pytest

from rov_fmu.equation.layout import Layout
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.tank.logs import Read, commanded, measured, used

BLUEROV2: Layout = load_vehicle(SHIPPED["bluerov2"]).layout
TIME: Array = np.linspace(0.0, 9.9, 100)
COMMAND: Array = np.where(TIME > 0.95, 0.25, 0.0)
THRUSTERS = {"1": COMMAND, "2": -COMMAND, "3": 0.5 * COMMAND, "4": COMMAND, "5": 2.0 * COMMAND, "6": 1.6 * COMMAND}
ROLL, PITCH, HEADING = 0.1 + 0.01 * TIME, -0.2 + 0.02 * TIME, 2.0 + 0.3 * TIME
DEPTH = 1.0 + 0.1 * TIME
U, V = 0.3 + 0.02 * TIME, -0.1 + 0.01 * TIME
VOLTAGE = 16.0 - 0.05 * TIME


def rotations() -> Iterator[Array]:
    """Yield the rotation from the body (forward, starboard, down) to north, east, down at each time."""
    for phi, theta, psi in zip(ROLL, PITCH, HEADING, strict=True):
        (cf, ct, cs), (sf, st, ss) = np.cos([phi, theta, psi]), np.sin([phi, theta, psi])
        yaw = np.array([[cs, -ss, 0.0], [ss, cs, 0.0], [0.0, 0.0, 1.0]])
        pitch = np.array([[ct, 0.0, st], [0.0, 1.0, 0.0], [-st, 0.0, ct]])
        yield yaw @ pitch @ np.array([[1.0, 0.0, 0.0], [0.0, cf, -sf], [0.0, sf, cf]])


_DOWN = np.array([R[2] for R in rotations()])
W = (0.1 - _DOWN[:, 0] * U - _DOWN[:, 1] * V) / _DOWN[:, 2]
"""The velocity in heave with which the depth grows by 0.1 m/s, whatever roll and pitch are."""
OVER_GROUND: Array = np.array(
    [R @ velocity for R, velocity in zip(rotations(), zip(U, V, W, strict=True), strict=True)]
)
"""The velocity to the north, to the east and down."""
NORTH, EAST = (
    start + np.append(0.0, np.cumsum(0.5 * np.diff(TIME) * (rate[1:] + rate[:-1])))
    for start, rate in zip((5.0, 7.0), OVER_GROUND.T[:2], strict=True)
)


def quaternion(R: Array) -> tuple[float, float, float, float]:
    """Return w, x, y, z of a rotation of less than half a turn."""
    w = 0.5 * np.sqrt(1.0 + np.trace(R))
    x, y, z = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    return float(w), float(x / (4.0 * w)), float(y / (4.0 * w)), float(z / (4.0 * w))


def check(read: Read, *, distance: bool = True, within: float = 1e-6) -> None:
    """Check that a log of the BlueROV2 gives this motion again, in SI units."""
    log = read.log
    assert log.commands is not None
    start = log.commands.rows[0]
    expected = {"surge velocity": U, "sway velocity": V, "depth": DEPTH, "heading": HEADING}
    expected |= {"roll angle": ROLL, "pitch angle": PITCH, "voltage": VOLTAGE}
    expected |= {"distance": np.hypot(NORTH - NORTH[0], EAST - EAST[0])} if distance else {}
    for quantity, values in expected.items():
        channel = used(log, quantity)
        assert channel.count == (11 if quantity == "voltage" else len(TIME))
        at = channel.time[channel.there] - start
        assert measured(log, quantity) == pytest.approx(np.interp(at, TIME, values), abs=within), quantity
    for thruster, command in THRUSTERS.items():
        assert commanded(log, thruster) == pytest.approx(command, abs=2e-3)
