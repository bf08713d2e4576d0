"""Simulated dives of a BlueROV2 Heavy, whose true coefficients are known (verification/references/rigid_pool.py).

The owner knows the file of the usual vehicle as a base. The true one has other drag and inertia and slower thrusters. A
pilot drives all six axes. The rough water adds what a model may lack: a battery that sags, a tether, waves, a link with
a delay, a depth in steps of 1 cm, and a compass that is late.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import pi
from pathlib import Path

import numpy as np

from rov_fmu.equation.catalogue import AXES, HEAVE, PITCH, ROLL, SURGE, SWAY, YAW, Axis
from rov_fmu.tank.description import ROV_FILE
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from verification.identification.data import PARTS, Truth
from verification.references import pool, rigid_pool
from verification.references.pool import NOTHING, Array, Commands, Conditions

_CHANGED = {"a_d": 1.25, "b_d": 0.8, "beta": 0.85}
"""The factors of the true coefficients of every axis."""
_COMMANDS = (0.3, 0.5, -0.3, -0.5)
_NOISE = {"m/s": 0.01, "m": 0.005, "rad/s": 0.01, "rad": 0.005}
_HELD = (1.0, 4.0)
"""The shortest and the longest time that the pilot holds a stick, s."""
_HEAD = """base = "{base}"
[vehicle]
name = "Simulated"
identifier = "simulated"
version = "1"
description = "A simulated vehicle"
source = "rigid_pool.py"
[known]
{known}
"""


@dataclass(frozen=True)
class Simulated:
    """Recordings of one simulated vehicle. Every third one is for the test."""

    name: str
    conditions: Conditions = NOTHING
    waves: float = 0.0
    """The amplitude of the water's motion, m; its period is 6 s."""
    resolution: float = 0.0
    """The steps of the depth, m."""
    late: float = 0.0
    """How late the heading is, s."""
    base: str = "bluerov2_heavy"
    changed: Mapping[str, float] = field(default_factory=lambda: {"z_B": -0.05, "T_t200": 0.12})
    idle: Mapping[str, float] = field(default_factory=dict[str, float])
    known: str = 'z_B = { value = -0.05, unit = "m", source = "measured" }\n[fit]\nlag = true'
    axes: tuple[Axis, ...] = tuple(AXES.values())
    count: int = 6
    seconds: float = 40.0
    rate: float = 10.0
    strength: float = 0.35
    """The strongest command of the pilot, of each axis."""

    @property
    def vehicle(self) -> Vehicle:
        """The true vehicle."""
        usual = load_vehicle(SHIPPED[self.base])
        factors = {axis.coefficient(key): f for axis in self.axes for key, f in _CHANGED.items()}
        return usual.with_(**{n: usual[n] * f for n, f in factors.items()} | dict(self.changed))

    @property
    def truth(self) -> Truth:
        """V_ss with the thrust in the middle of a recording, and the quadratic drag over the inertia."""
        k, found = self.vehicle, {}
        factor = self.conditions.thrust(0.5 * self.seconds) if self.conditions.thrust else 1.0
        for axis in self.axes:
            if axis in (ROLL, PITCH):
                continue
            a, b, beta = (k[axis.coefficient(key)] for key in ("a_d", "b_d", "beta"))
            load = k["W"] - k["B"] if axis is HEAVE and "W" in k.coefficients else 0.0
            for c in _COMMANDS:
                F = factor * k[axis.coefficient("alpha")] * k.force(axis, c) + load
                found[axis.name, f"V_ss {100 * c:g} %"] = float((np.sqrt(b * b + 4 * a * abs(F)) - b) / (2 * a))
            body = k["I_r" if axis is YAW else "m_rov"] + k.coefficients.get(axis.coefficient("m_a"), 0.0)
            found[axis.name, "quadratic drag / inertia"] = a * beta / body
        return found

    def write(self, part: str, data: Path | None, folder: Path) -> None:  # noqa: ARG002
        """Simulate the recordings of a part."""
        (folder / ROV_FILE).write_text(_HEAD.format(base=self.base, known=self.known), encoding="utf-8")
        for n in range(self.count):
            if PARTS[n % 3 == 2] == part:
                table = self._table(np.random.default_rng(n))
                rows = zip(*table.values(), strict=True)
                text = "\n".join([",".join(table), *(",".join(f"{x:.8g}" for x in row) for row in rows), ""])
                (folder / f"dive_{n}.csv").write_text(text, encoding="utf-8")

    def _table(self, random: np.random.Generator) -> dict[str, Array]:
        k, time = self.vehicle, np.arange(0.0, self.seconds, 1.0 / self.rate)
        switches = np.cumsum(random.uniform(*_HELD, 2 + int(self.seconds / _HELD[0])))
        thrusters = {t.name: np.zeros(len(switches)) for t in k.layout.thrusters}
        for axis in self.axes:
            sticks = self.strength * random.uniform(-1.0, 1.0, len(switches)) * (random.random(len(switches)) < 0.6)
            for name, sign in k.layout.commands_along(axis, 1.0).items():
                thrusters[name.removeprefix("u_")] += sign * sticks
        commands = Commands(switches, {name: np.clip(c, -1.0, 1.0) for name, c in thrusters.items()})
        simulate = rigid_pool.motion if k.layout.has_attitude else pool.motion
        late = np.maximum(time - self.late, 0.0)
        both = np.union1d(time, late)
        found = simulate(k, commands, both, self.conditions)
        motion = {name: values[np.searchsorted(both, time)] for name, values in found.items()}
        motion["psi"] = found["psi"][np.searchsorted(both, late)]
        phase = 2.0 * pi * time / 6.0
        drift = self.waves * 2.0 * pi / 6.0 * np.cos(phase)
        motion["z"] = motion["z"] + self.waves * np.cos(phase)
        motion["u"] = motion["u"] + drift * np.cos(motion["psi"])
        table = {"time [s]": time} | {f"u_{n} [1]": c for n, c in commands.at(time + 1e-9).items()}
        for axis in self.axes:
            if axis is not HEAVE:
                table[f"{axis.name} velocity [{axis.unit}]"] = motion[axis.velocity]
        if SWAY in self.axes:
            table["sway velocity [m/s]"] = motion["v"] - drift * np.sin(motion["psi"])
        names = {HEAVE: ("depth [m]", "z"), ROLL: ("roll [rad]", "phi"), PITCH: ("pitch [rad]", "theta")}
        for axis, (header, state) in (names | {YAW: ("heading [rad]", "psi")}).items():
            if axis in self.axes:
                table[header] = motion[state]
        for header in [*table][1 + len(thrusters) :]:
            table[header] = table[header] + _NOISE[header.partition("[")[2][:-1]] * random.standard_normal(len(time))
        if self.resolution and "depth [m]" in table:
            table["depth [m]"] = np.round(table["depth [m]"] / self.resolution) * self.resolution
        return table


def _sagging(time: float) -> float:
    return 1.0 - 0.1 * time / 40.0


CALM = Simulated("simulated")
ROUGH = Simulated(
    "simulated in rough water",
    Conditions(delay=0.1, thrust=_sagging, tether=(0.4, 0.4, 0.0)),
    waves=0.05,
    resolution=0.01,
    late=0.15,
)
TINY = Simulated(
    "tiny",
    base="videoray",
    changed={},
    known="[priors]\nthrust = 0.0",
    axes=(SURGE, YAW),
    count=3,
    seconds=20.0,
)
"""A small vehicle for tests: surge and yaw, three recordings of 20 s."""
