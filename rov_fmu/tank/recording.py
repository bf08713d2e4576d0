"""A recording: the commands of a log, and the motion along one axis that it measured."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from rov_fmu.model.layout import Axis, Layout
from rov_fmu.tank.arrays import Array


@dataclass(frozen=True, eq=False)
class Recording:
    """Commands and motion over time, n samples; SI units, the heading unwrapped."""

    file: str
    axis: Axis
    quantity: str
    """`velocity`, or the position whose rate it is: distance, depth, heading."""
    time: Array
    """n: s, ascending, from 0."""
    command: Array | None
    """n: of the axis, a fraction of full thrust, held from its time to the next: every input that drives the axis
    stands at it, with the sign that drives it to the positive side. None where the thrusters had another pattern."""
    values: Array
    """n: NaN where the sensor has none."""
    thrusters: Mapping[str, Array] = field(default_factory=dict)
    """n each, by thruster: the command that reaches it, where the log tells; otherwise they follow `command`."""
    beside: Mapping[str, Array] = field(default_factory=dict)
    """n each, as far as the log tells: u, v, r and psi, smoothed and interpolated; u and v over ground."""

    @property
    def is_position(self) -> bool:
        """Whether the velocity is the rate of the values."""
        return self.quantity != "velocity"

    @property
    def unit(self) -> str:
        """Of the values."""
        return self.axis.position_unit if self.is_position else self.axis.unit

    def reaching(self, layout: Layout) -> Array:
        """n x thrusters of the layout: the command that reaches each, within ±1."""
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
