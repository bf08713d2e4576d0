"""Recordings of a vehicle with known coefficients: the motion by the integrator of the pool, with noise."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from math import radians
from pathlib import Path

import numpy as np

from rov_fmu.equation.catalogue import AXIS, CURVE, HEAVE, SURGE, YAW, Axis, coefficient_name
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.folders import HEAD, folder_of
from verification.references.pool import stick, swim

Plan = Sequence[tuple[float, float]]
"""Commands with their durations, s."""

PLANS: dict[str, Sequence[Plan]] = {
    "heave": (
        ((0.0, 4.0), (0.3, 16.0), (-0.3, 16.0), (0.5, 12.0), (-0.5, 12.0)),
        ((0.0, 4.0), (0.2, 18.0), (-0.2, 18.0), (0.4, 10.0), (-0.4, 10.0)),
        ((0.0, 4.0), (0.7, 10.0), (-0.7, 10.0), (0.6, 10.0), (-0.6, 10.0), (0.0, 16.0)),
    ),
    "yaw": (
        ((0.0, 4.0), (0.3, 14.0), (-0.3, 14.0), (0.5, 14.0), (-0.5, 14.0)),
        ((0.0, 4.0), (0.2, 16.0), (-0.2, 16.0), (0.4, 12.0), (0.0, 12.0)),
        ((0.0, 4.0), (0.7, 10.0), (-0.7, 10.0), (0.6, 10.0), (-0.6, 10.0), (0.0, 16.0)),
    ),
    "surge": (
        ((0.0, 4.0), (0.3, 14.0), (0.0, 14.0), (0.5, 14.0), (0.0, 14.0)),
        ((0.0, 4.0), (0.2, 16.0), (0.0, 14.0), (0.4, 13.0), (0.0, 13.0)),
        ((0.0, 4.0), (0.7, 10.0), (0.0, 10.0), (0.6, 10.0), (0.0, 10.0), (-0.5, 16.0)),
    ),
}
"""Three plans of 60 s for each axis: commands with their durations (s), in both directions, not always from rest."""
AXES = (SURGE, HEAVE, YAW)
NOISE = {"depth": 0.005, "heading": radians(0.5), "distance": 0.02, "velocity": 0.02}
"""The standard deviations of the sensors: m, rad, m, m/s."""


def with_more(k: Vehicle, **values: float) -> Vehicle:
    """Return the vehicle with other coefficients, including new ones such as F_0_w, T_top or a_t_rear_reverse."""
    axes, curves = [], []
    for form in k.layout.axes:
        more = [key for key in AXIS if coefficient_name(key, form.axis.velocity) in values and key not in form.keys]
        axes.append(replace(form, keys=(*form.keys, *more)))
    for curve in k.layout.curves:
        more = [key for key in CURVE if coefficient_name(key, curve.name) in values and key not in curve.keys]
        curves.append(replace(curve, keys=(*curve.keys, *more)))
    layout = replace(k.layout, axes=tuple(axes), curves=tuple(curves))
    assert values.keys() <= layout.coefficients.keys()
    return Vehicle(layout, {**k.coefficients, **values})


@dataclass(frozen=True, eq=False)
class Measured:
    """n samples of the only sensor of a test of one axis, SI units."""

    file: str
    axis: Axis
    quantity: str
    """`velocity`, or the position along or about the axis: distance, depth, heading."""
    time: Array
    command: Array
    values: Array

    @property
    def is_position(self) -> bool:
        return self.quantity != "velocity"


@dataclass(frozen=True, eq=False)
class Run:
    """n samples of the motion along one axis without noise, SI units."""

    axis: Axis
    time: Array
    command: Array
    velocity: Array
    position: Array

    def noisy(
        self,
        random: np.random.Generator,
        quantity: str = "",
        *,
        file: str = "log.csv",
        noise: float | None = None,
        colour: float = 0.0,
        jitter: float = 0.0,
    ) -> Measured:
        """Return the recording of a sensor; the usual one of the axis is that of depth, heading, or surge velocity.

        `colour` is the correlation of the noise of successive samples, `jitter` the error of time stamps (s).
        """
        quantity = quantity or ("velocity" if self.axis is SURGE else self.axis.position)
        values = self.velocity if quantity == "velocity" else self.position
        if jitter:
            values = np.interp(self.time + jitter * random.standard_normal(len(values)), self.time, values)
        errors = random.standard_normal(len(values))
        if colour:
            errors = coloured(errors, colour)
        values = values + (NOISE[quantity] if noise is None else noise) * errors
        return Measured(file, self.axis, quantity, self.time, self.command, values)


def coloured(errors: Array, colour: float) -> Array:
    """Return errors of the same variance of which each is correlated with the next one."""
    new = np.sqrt(1.0 - colour**2) * errors
    return np.array([*accumulate(new.tolist(), lambda last, error: colour * last + error)])


def write_log(folder: Path, name: str, recording: Measured) -> Path:
    """Write the recording like a logger: commands in %, headings in degrees from 0 to 360."""
    heading = recording.quantity == "heading"
    values = np.degrees(recording.values) % 360.0 if heading else recording.values
    unit = "deg" if heading else "m" if recording.is_position else recording.axis.unit
    rows = [f"time [s],command [%],{recording.quantity} [{unit}]"]
    rows += [
        f"{t:.4f},{100.0 * c:g},{'' if np.isnan(v) else f'{v:.5f}'}"
        for t, c, v in zip(recording.time.tolist(), recording.command.tolist(), values.tolist(), strict=True)
    ]
    path = folder / f"log_{recording.axis.name}_{name}.csv"
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


def run(k: Vehicle, axis: Axis, plan: Plan, rate: float) -> Run:
    """Run a plan from rest along one axis."""
    command = np.concatenate([np.full(round(hold * rate), c) for c, hold in plan])
    time = np.arange(len(command)) / rate
    thrusters = {name.removeprefix("u_"): sign * command for name, sign in k.layout.signs(axis).items()}
    motion = swim(k, time, thrusters)
    position = {"surge": "x", "sway": "y", "heave": "z", "yaw": "psi"}[axis.name]
    return Run(axis, time, command, motion[axis.velocity], motion[position])


# ---- Dives -----------------------------------------------------------------------------------------------------------

RATE = 20
"""The rows of the log of a dive per second."""
_STICKS = {SURGE: (0.7, 5.0), HEAVE: (0.7, 6.0), YAW: (0.3, 3.0)}
"""The farthest place of each stick, and for how long about it stays, s."""


SHOWN = {"u": NOISE["velocity"], "z": NOISE["depth"], "psi": NOISE["heading"]}
"""The standard deviation of the sensor of each state in a dive."""


@dataclass(frozen=True, eq=False)
class Dive:
    """n samples of a dive of the VideoRay by hand, SI units, without noise."""

    time: Array
    commands: Mapping[str, Array]
    """By thruster, fractions of the full command."""
    shown: Mapping[str, Array]
    """What its sensors show, by the name of the state: surge velocity over ground, depth, heading."""

    def noisy(self, random: np.random.Generator) -> dict[str, Array]:
        """Return the values with the noise of the sensors."""
        return {name: v + SHOWN[name] * random.standard_normal(len(v)) for name, v in self.shown.items()}


def dive(random: np.random.Generator, seconds: float, current: tuple[float, float] = (0.0, 0.0)) -> Dive:
    """Dive in a current, whose velocity north and east is given, m/s. β of surge differs from 1, where a fit begins."""
    k, n = load_vehicle(VIDEORAY).with_(beta_u=0.8), round(seconds * RATE)
    commands = {thruster.name: np.zeros(n) for thruster in k.layout.thrusters}
    for axis, (most, held) in _STICKS.items():
        moved = stick(random, n, (most, most), RATE * held)
        moved[: 4 * RATE] = 0.0
        for name, sign in k.layout.signs(axis).items():
            commands[name.removeprefix("u_")] += sign * moved
    commands = {name: np.clip(command, -1.0, 1.0) for name, command in commands.items()}
    time = np.arange(n) / RATE
    motion = swim(k, time, commands, current=current)
    over_ground = motion["u"] + current[0] * np.cos(motion["psi"]) + current[1] * np.sin(motion["psi"])
    return Dive(time, commands, {"u": over_ground, "z": motion["z"], "psi": motion["psi"]})


def write_dives(folder: Path, seed: int, count: int, seconds: float, current: tuple[float, float] = (0.0, 0.0)) -> Path:
    """Write a folder of dives of a VideoRay whose thrust is exactly that of the base."""
    random, logs = np.random.default_rng(seed), {}
    for n in range(count):
        dived = dive(random, seconds, current)
        noisy = dived.noisy(random)
        table = {"time [s]": dived.time} | {f"u_{name} [%]": 100.0 * c for name, c in dived.commands.items()}
        table |= {
            "surge velocity [m/s]": noisy["u"],
            "depth [m]": noisy["z"],
            "heading [deg]": np.degrees(noisy["psi"]),
        }
        rows = (",".join(f"{value:.8g}" for value in row) for row in zip(*table.values(), strict=True))
        logs[f"log_{n}.csv"] = "\n".join([",".join(table), *rows, ""])
    priors = "[priors]\nthrust = 0.0\nthrust_shape = 0.0\n"
    return folder_of(folder, f'base = "videoray"\n{HEAD}\n{priors}', logs)
