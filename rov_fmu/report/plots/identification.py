"""The plots of the identification report over the command: answers with their bands, and forces."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rov_fmu.equation.units import in_degrees
from rov_fmu.identify.result import Answer, AxisResult, MeasuredPoint
from rov_fmu.report.plots.logs import fill_band
from rov_fmu.report.plots.svg import LIGHT, add_legend, name_axes


def plot_answers(figure: Figure, result: AxisResult, quantity: Literal["V_ss", "Tau"]) -> None:
    """Plot V_ss or Tau over the command with its band, and the points of tables."""
    axis, is_steady = result.axis, quantity == "V_ss"
    factor, unit = in_degrees(axis.unit) if is_steady else (1.0, "s")
    ax: Axes = figure.subplots()
    _curve(ax, factor, result.answers, quantity, "this fit, with 95 % band")
    points = [p for p in result.points if p.quantity == quantity]
    _points(ax, factor, points)
    if points and not is_steady:  # a measured time contains the lag of the thrusters, and the curve does not
        expected = [p.model for p in points]
        ax.plot([100.0 * p.command for p in points], expected, "x", color=LIGHT["blue"], label="this fit, with the lag")
    name_axes(ax, "steady velocity" if is_steady else "time to 63 %", unit, "command (%)")
    add_legend(figure)


def plot_forces(figure: Figure, points: Sequence[MeasuredPoint]) -> None:
    """Plot the measured forces of a thrust curve over the command, and those of the model."""
    shown = sorted(points, key=lambda p: p.command)
    commands = [100.0 * p.command for p in shown]
    ax: Axes = figure.subplots()
    ax.plot(commands, [p.model for p in shown], color=LIGHT["blue"], linewidth=1.3, label="this fit")
    _points(ax, 1.0, shown)
    name_axes(ax, "force", points[0].unit, "command (%)")
    add_legend(figure)


def _curve(ax: Axes, factor: float, answers: Sequence[Answer], quantity: str, label: str | None) -> None:
    """Draw values over the command with their intervals, apart for each direction."""
    for sign in (-1.0, 1.0):
        own = sorted((a for a in answers if a.command * sign > 0.0), key=lambda a: a.command)
        if own:
            known = [a.steady if quantity == "V_ss" else a.rise for a in own]
            values, low, high = factor * np.array([(value, *interval) for value, interval in known]).T
            commands = np.array([100.0 * a.command for a in own])
            fill_band(ax, commands, low, high)
            ax.plot(commands, values, ".-", color=LIGHT["blue"], linewidth=1.3, label=label)
            label = None


def _points(ax: Axes, factor: float, points: Sequence[MeasuredPoint]) -> None:
    """Draw measured points. Those that do not count are hollow."""
    for counts, face, label in ((True, LIGHT["orange"], "measured"), (False, "none", "measured, not counted")):
        if some := [(100.0 * p.command, factor * p.measured) for p in points if p.counts is counts]:
            x, y = zip(*some, strict=True)
            ax.plot(x, y, "o", color=LIGHT["orange"], markerfacecolor=face, markersize=4.5, zorder=5, label=label)
