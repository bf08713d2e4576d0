"""A dive of a BlueROV2: simultaneous motion in all four axes with coupling, lag and a current."""

from dataclasses import dataclass
from math import radians

import numpy as np

from rov_fmu.equation.catalogue import HEAVE, SURGE, SWAY, YAW
from rov_fmu.tank.log import Commands, Log
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.tank.logs import channel, commands, log
from verification.references.pool import Array, swim

LAG = 0.15
"""The lag of the thrusters, s."""
CURRENT = (0.06, -0.03)
"""The velocity of the water north and east, m/s."""
TRUTH: Vehicle = load_vehicle(SHIPPED["bluerov2"]).replaced({"T_t200": LAG})
AXES = (SURGE, SWAY, HEAVE, YAW)
RATE = 10.0
NOISE = {"velocity": 0.01, "distance": 0.02, "depth": 0.005, "heading": radians(0.3)}
_STICKS = ((0.4, 4.0), (0.3, 4.0), (0.45, 5.0), (0.18, 3.0))
"""The largest deflection of the stick of each axis, and the typical duration of a command (s)."""


@dataclass(frozen=True, eq=False)
class Dive:
    """n samples of a dive without noise, in SI units."""

    commands: Commands
    motion: dict[str, Array]

    def logged(self, noise: float = 1.0, seed: int = 0, quantity: str = "velocity") -> Log:
        """Return a log of velocities or distances over ground; `noise` is a multiple of NOISE."""
        random, time = np.random.default_rng(seed), self.commands.rows
        psi, (north, east) = self.motion["psi"], CURRENT
        c, s = np.cos(psi), np.sin(psi)
        ground = {
            SURGE: self.motion["u"] + north * c + east * s,
            SWAY: self.motion["v"] - north * s + east * c,
        }
        if quantity == "distance":  # by the trapezoidal rule, which is accurate enough
            steps = {axis: 0.5 * (v[1:] + v[:-1]) / RATE for axis, v in ground.items()}
            ground = {axis: np.concatenate([[0.0], np.cumsum(step)]) for axis, step in steps.items()}
        clean = [(axis, quantity, values) for axis, values in ground.items()]
        clean += [(HEAVE, "depth", self.motion["z"]), (YAW, "heading", psi)]
        channels = [
            channel(
                f"{axis.name} {measured}" if measured in ("velocity", "distance") else measured,
                time,
                values + noise * NOISE[measured] * random.standard_normal(len(time)),
            )
            for axis, measured, values in clean
        ]
        return log(self.commands, *channels, file="dive.tlog")


def dive(seconds: float, seed: int = 0) -> Dive:
    """Simulate a dive in which each stick moves every few seconds, often back to the middle."""
    random, n = np.random.default_rng(seed), round(seconds * RATE)
    time = np.arange(n) / RATE
    sticks = [_stick(random, n, *stick) for stick in _STICKS]
    thrusters = {}
    for t in TRUTH.layout.thrusters:
        signs = [np.sign(round(TRUTH.effect(t, axis), 6)) for axis in AXES]
        pushes = (sign * stick for sign, stick in zip(signs, sticks, strict=True))
        thrusters[t.name] = np.clip(sum(pushes, np.zeros(n)), -1.0, 1.0)
    return Dive(commands(time, thrusters), swim(TRUTH, time, thrusters, current=CURRENT))


def _stick(random: np.random.Generator, n: int, most: float, hold: float) -> Array:
    found, side = np.zeros(round(2.0 * RATE)), most
    while len(found) < n:
        level = 0.0 if random.random() < 1 / 3 else side * random.uniform(0.4, 1.0)
        side = -side if level else side
        found = np.append(found, np.full(round(RATE * hold * random.uniform(0.5, 1.5)), level))
    return found[:n]
