"""Recordings of a vehicle with known coefficients: the motion by the integrator of the pool, with noise."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from math import radians
from pathlib import Path

import numpy as np

from rov_fmu.equation.catalogue import AXIS, CURVE, HEAVE, SURGE, YAW, Axis, coefficient_name
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.vehicle import Vehicle
from verification.references.pool import swim

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
