"""A recording: the commands of a log, and the measured motion along one axis."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from rov_fmu.model.layout import Axis, Layout
from rov_fmu.tank.arrays import Array

CONTEXT = {"voltage": "V", "roll": "rad", "pitch": "rad", "depth": "m", "distance": "m"}
"""The conditions that a recording may contain, with their units: the voltage of the battery, the angles of roll and
pitch, the depth, and the distance over ground from the start of the log."""

CLOCK_ERROR = 5.0
"""The largest error of times that were aligned with those of another clock, s."""


def signal_name(axis: Axis, quantity: str) -> str:
    """Return the name of a measured quantity: surge velocity, surge distance, depth, heading."""
    return f"{axis.name} {quantity}" if quantity in ("velocity", "distance") else quantity


@dataclass(frozen=True, eq=False)
class Recording:
    """Commands and motion over time, n samples in SI units; a heading is unwrapped."""

    file: str
    axis: Axis
    quantity: str
    """`velocity`, or the position whose rate it is: distance, depth, heading."""
    time: Array
    """n times in s, ascending from 0."""
    command: Array | None
    """n: the command of the axis, a fraction of the full command, held until the next. Every input that drives the axis
    has this command, with the sign that moves the vehicle in the positive direction. None if the thrusters had
    different commands."""
    values: Array
    """n: NaN where the sensor has no value."""
    thrusters: Mapping[str, Array] = field(default_factory=dict)
    """n each, by thruster: the command of the thruster, if logged; otherwise all thrusters follow `command`."""
    beside: Mapping[str, Array] = field(default_factory=dict)
    """n each: the logged u, v, r and psi, smoothed and interpolated; u and v are over ground."""
    context: Mapping[str, Array] = field(default_factory=dict)
    """n values each: the logged conditions, interpolated between their samples. The names are keys of CONTEXT."""

    clock: str = ""
    """The file whose clock gave the times of the measurements, if it differs from the clock of the commands. Empty if
    both have the same clock."""

    @property
    def is_position(self) -> bool:
        """True when the values are positions."""
        return self.quantity != "velocity"

    @property
    def unit(self) -> str:
        """The unit of the values."""
        return self.axis.position_unit if self.is_position else self.axis.unit

    def reaching(self, layout: Layout) -> Array:
        """Return the command of each thruster, within ±1: n x thrusters of the layout."""
        if self.thrusters:
            still = np.zeros(len(self.time))
            return np.column_stack([self.thrusters.get(thruster.name, still) for thruster in layout.thrusters])
        assert self.command is not None
        signs = layout.signs(self.axis)
        gains = [
            sum(gain * signs.get(name, 0.0) for name, gain in layout.gains[thruster.name].items())
            for thruster in layout.thrusters
        ]
        return np.asarray(np.clip(np.outer(self.command, gains), -1.0, 1.0))
