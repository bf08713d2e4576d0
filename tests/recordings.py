"""Recordings of a vehicle with known coefficients: the exact motion with noise."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians
from pathlib import Path

import numpy as np

from rov_fmu.equation.catalogue import HEAVE, SURGE, YAW, Axis
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.vehicle import Vehicle
from verification.references.reference import Motion

NOISE = {"heave": 0.005, "yaw": radians(0.5), "surge": 0.02}
"""The standard deviations of depth (m), heading (rad) and the velocity of a camera (m/s)."""

PLANS: dict[str, Sequence[Sequence[tuple[float, float]]]] = {
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
class Clean:
    """A recording without noise."""

    axis: Axis
    time: Array
    command: Array
    velocity: Array
    position: Array

    def noisy(self, random: np.random.Generator, file: str = "log.csv", noise: float | None = None) -> Measured:
        """Return the recording of the axis's sensor: depth, heading, or the velocity in surge."""
        quantity = "velocity" if self.axis is SURGE else self.axis.position
        values = self.velocity if quantity == "velocity" else self.position
        spread = NOISE[self.axis.name] if noise is None else noise
        values = values + spread * random.standard_normal(len(values))
        return Measured(file, self.axis, quantity, self.time, self.command, values)


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


def clean(k: Vehicle, axis: Axis, plan: Sequence[tuple[float, float]], rate: float = 100.0) -> Clean:
    """Run a plan from rest, one exact motion per command."""
    command = np.concatenate([np.full(round(hold * rate), c) for c, hold in plan])
    v, s = 0.0, 0.0
    points: list[tuple[float, float]] = []
    for c, hold in plan:
        held = k.held(axis, c)
        motion = Motion(held.A, held.B, held.C, v, hold, held.reverse)
        *part, (v, end) = (
            (float(v), s + float(d)) for v, d in map(motion.at, np.arange(round(hold * rate) + 1) / rate)
        )
        points += part
        s = end
    velocity, position = np.array(points).T
    return Clean(axis, np.arange(len(command)) / rate, command, velocity, position)
