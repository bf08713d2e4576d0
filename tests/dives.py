"""The commands of a dive of a BlueROV2, which move all four axes at once, and the vehicle with a lag."""

import numpy as np

from rov_fmu.equation.catalogue import HEAVE, SURGE, SWAY, YAW
from rov_fmu.tank.log import Commands
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.tank.logs import commands
from verification.references.pool import Array

LAG = 0.15
"""The lag of the thrusters, s."""
TRUTH: Vehicle = load_vehicle(SHIPPED["bluerov2"]).replaced({"T_t200": LAG})
AXES = (SURGE, SWAY, HEAVE, YAW)
RATE = 10.0
NOISE = {"velocity": 0.01, "depth": 0.005}
"""The standard deviations of the sensors: m/s, m."""
_STICKS = ((0.4, 4.0), (0.3, 4.0), (0.45, 5.0), (0.18, 3.0))
"""The largest deflection of the stick of each axis, and the typical duration of a command (s)."""


def dive(seconds: float, seed: int = 0) -> Commands:
    """Return the commands of a dive in which each stick moves every few seconds, often back to the middle."""
    random, n = np.random.default_rng(seed), round(seconds * RATE)
    time = np.arange(n) / RATE
    sticks = [_stick(random, n, *stick) for stick in _STICKS]
    thrusters = {}
    for t in TRUTH.layout.thrusters:
        signs = [np.sign(round(TRUTH.effect(t, axis), 6)) for axis in AXES]
        pushes = (sign * stick for sign, stick in zip(signs, sticks, strict=True))
        thrusters[t.name] = np.clip(sum(pushes, np.zeros(n)), -1.0, 1.0)
    return commands(time, thrusters)


def _stick(random: np.random.Generator, n: int, most: float, hold: float) -> Array:
    found, side = np.zeros(round(2.0 * RATE)), most
    while len(found) < n:
        level = 0.0 if random.random() < 1 / 3 else side * random.uniform(0.4, 1.0)
        side = -side if level else side
        found = np.append(found, np.full(round(RATE * hold * random.uniform(0.5, 1.5)), level))
    return found[:n]
