"""The relation between the thrust curves and the axes of a vehicle."""

from collections.abc import Iterator

import numpy as np

from rov_fmu.model.layout import Axis, Curve, Layout
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array


def curves_of(layout: Layout, axis: Axis) -> list[Curve]:
    """Return the curves of the thrusters that act on an axis."""
    names = {thruster.curve for thruster in layout.drivers(axis)}
    return [curve for curve in layout.curves if curve.name in names]


def connected(layout: Layout, *, tilts: bool = False) -> Iterator[tuple[list[Curve], list[Axis]]]:
    """Yield groups of curves and of the axes that they drive. Nothing in one group acts on another.

    In a vehicle that `tilts`, the sensors of one axis see the motion of others.
    """
    if layout.is_linked or tilts:
        yield list(layout.curves), [form.axis for form in layout.axes]
        return
    remaining = list(layout.curves)
    while remaining:
        curves, axes = [remaining[0]], list[Axis]()
        while True:
            axes = [form.axis for form in layout.axes if any(c in curves for c in curves_of(layout, form.axis))]
            joined = [c for c in layout.curves if any(c in curves_of(layout, axis) for axis in axes)]
            if len(joined) <= len(curves):
                break
            curves = joined
        yield curves, axes
        remaining = [curve for curve in remaining if curve not in curves]


def thrust_along(rov: Rov, axis: Axis, commands: Array) -> Array:
    """Return the steady thrust along an axis before α (J: N, N.m) for commands of J x thrusters of the layout."""
    force = np.zeros(len(commands))
    for thruster, own in zip(rov.layout.thrusters, commands.T, strict=True):
        if effect := rov.effect(thruster, axis):
            curve = rov.layout.curve_of[thruster.name]
            levels, place = np.unique(own, return_inverse=True)
            force += effect * np.array([rov.curve_force(curve, level) for level in levels.tolist()])[place]
    return force
