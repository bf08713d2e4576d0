"""Plots that the pages share: thrust curves, and steps of the command from rest."""

from collections.abc import Sequence
from decimal import Decimal
from math import ceil, isfinite
from typing import TypeVar

import numpy as np
from matplotlib.axes import Axes

from rov_fmu.c.simulation import simulate
from rov_fmu.equation.catalogue import Axis
from rov_fmu.equation.parts import Curve
from rov_fmu.equation.units import in_degrees
from rov_fmu.report.plots.svg import LIGHT, LINES, name_axes, shade
from rov_fmu.vehicle.vehicle import Vehicle

Number = TypeVar("Number", float, Decimal)

_MOST = 4
"""The largest number of lines in a plot."""
_APART = 0.065
"""The least distance of the labels of lines, as a share of the height of a plot."""
_LABELS = 40.0
"""The width of the labels of lines, points."""
_DEEP = 1e4
"""The depth from which no step reaches the surface, m."""


def evenly(commands: Sequence[Number]) -> list[Number]:
    """Return up to four of the commands, evenly spaced from the first to the last."""
    return sorted({commands[round((len(commands) - 1) * n / (_MOST - 1))] for n in range(_MOST)})


def held_commands(vehicle: Vehicle) -> list[Decimal]:
    """Return up to four commands (%) for the step responses: multiples of 10, as far as the vehicle has them."""
    low, high = (max(1, round(100.0 * end)) for end in vehicle.command_range)
    tens = range(-(-low // 10) * 10, high + 1, 10)
    return evenly([Decimal(c) for c in (tens if len(tens) > 1 else range(low, high + 1))])


def from_zero(ax: Axes) -> None:
    """Let the axes of a panel begin at 0, unless a value is negative."""
    ax.set_xlim(left=0.0)
    if ax.dataLim.y0 >= 0.0:
        ax.set_ylim(bottom=0.0)


def draw_curve(ax: Axes, vehicle: Vehicle, curve: Curve) -> None:
    """Plot the steady thrust of a thruster over its command, with reverse and the dead band."""
    commands = {n / 50.0 for n in range(-50, 51)}
    if "c_0" in curve.keys:
        ends = -vehicle[curve.coefficient("c_0_reverse")], vehicle[curve.coefficient("c_0")]
        commands |= set(ends)
        low, high = (100.0 * end for end in ends)
        shade(ax, low, high, "dead band")
    c = sorted(commands)
    ax.plot([100.0 * x for x in c], [vehicle.curve_force(curve, x) for x in c], color=LIGHT["blue"], linewidth=1.8)
    name_axes(ax, f"thrust, curve {curve.name}", "N", "command (%)")
    ax.set_xlim(-100, 100)


def after_step(vehicle: Vehicle, axis: Axis, command: float, times: Sequence[float]) -> list[float]:
    """Return the velocity along an axis at each time, the first 0, under a held command from rest deep under water.

    The other axes are left without a force, so that they stay at rest and do not act on this one.
    """
    others = {
        name: 0.0
        for form in vehicle.layout.axes
        if form.axis is not axis
        for name in (form.axis.coefficient("alpha"), form.coefficient("F_0"))
        if name in vehicle.coefficients
    }
    deep = {"z": _DEEP} if vehicle.layout.surface else {}
    values = {**vehicle.held_inputs(axis, command), **others, **deep}
    velocity: list[float] = simulate(vehicle, np.array(times), values, [axis.velocity]).values[0, 0].tolist()
    return velocity


def draw_steps(ax: Axes, axis: Axis, commands: Sequence[float], vehicle: Vehicle) -> None:
    """Plot the velocity after steps of the command, and label each curve with its command."""
    Taus = [vehicle.response(axis, command)[1] for command in commands]
    end = ceil(3.3 * max((Tau for Tau in Taus if isfinite(Tau)), default=3.0))
    t = [end * (n / 45) ** 1.5 for n in range(46)]  # closer where the curve bends
    factor, unit = in_degrees(axis.unit)
    roles = dict(zip(sorted(set(map(abs, commands))), LINES, strict=False))
    ends: list[tuple[float, str, str]] = []
    for command in commands:
        color = LIGHT[roles[abs(command)]]
        v = factor * np.array(after_step(vehicle, axis, command, t))
        ax.plot(t, v, "-", color=color, linewidth=1.8)
        ends.append((float(v[-1]), f"{100.0 * command:g} %".replace("-", "−"), color))
    name_axes(ax, f"{axis.name} velocity after a step", unit, "time (s)", gap=_LABELS)
    ax.set_xlim(0, end)
    if all(command >= 0.0 for command in commands):
        ax.set_ylim(bottom=0.0)
    _label(ax, ends)


def _label(ax: Axes, ends: Sequence[tuple[float, str, str]]) -> None:
    """Label each line at its end, given its last value, its label and its colour. Labels do not cover each other."""
    low, high = ax.get_ylim()
    height, apart = low - high, _APART * (high - low)
    for value, label, color in sorted(ends):
        height = max(value, height + apart)
        right = 1.015 * ax.get_xlim()[1]
        ax.text(right, height, label, color=color, va="center", fontsize=8.5)
