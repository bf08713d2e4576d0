"""The plots of the identification report: predictions with their bands, and answers and forces over the command."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rov_fmu.identify.result import Answer, AxisResult, Point, Prediction
from rov_fmu.report.plots.svg import LIGHT, add_legend, draw_commands, name_axes
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.columns import in_degrees
from rov_fmu.tank.log import Log
from rov_fmu.vehicle.uncertainty import NORMAL

_MOST_SAMPLES = 400
"""More samples than this would not be visible."""


def plot_overview(figure: Figure, shown: Sequence[Prediction], log: Log | None) -> None:
    """Plot the unseen motion of one log, one panel for each axis, above the commands of its thrusters."""
    commands = log.commands if log else None
    heights = [1.0] * len(shown) + [0.6] * bool(commands)
    panels = figure.subplots(len(heights), sharex=True, squeeze=False, height_ratios=heights)[:, 0]
    for panel, p in zip(panels, shown, strict=False):
        _draw_prediction(panel, p)
    if commands:
        time = np.linspace(shown[0].time[0], shown[0].time[-1], _MOST_SAMPLES)
        names = [name if name == "command" else f"u_{name}" for name in commands.thrusters]
        draw_commands(panels[-1], time, dict(zip(names, commands.at(time).T, strict=True)))
    panels[-1].set_xlabel("time (s)")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper right", ncols=4)


def plot_prediction(figure: Figure, shown: Prediction) -> None:
    """Plot the measured and the predicted values of an unseen log, with the 95 % band."""
    ax: Axes = figure.subplots()
    _draw_prediction(ax, shown)
    ax.set_xlabel("time (s)")
    add_legend(figure)


def _draw_prediction(ax: Axes, shown: Prediction) -> None:
    factor, unit = in_degrees(shown.unit)
    some = slice(None, None, max(1, len(shown.time) // _MOST_SAMPLES))
    time, half = shown.time[some], factor * NORMAL * shown.deviation[some]
    predicted = factor * shown.predicted[some]
    _band(ax, time, predicted - half, predicted + half)
    ax.plot(time, factor * shown.measured[some], color=LIGHT["orange"], linewidth=2.6, alpha=0.6, label="measured")
    ax.plot(time, predicted, color=LIGHT["blue"], linewidth=1.3, label="predicted, with 95 % band")
    if shown.compared is not None:
        ax.plot(time, factor * shown.compared[some], "--", color=LIGHT["grey"], label="compared")
    ax.set(xlim=(time[0], time[-1]))
    ax.margins(y=0.12)
    name_axes(ax, shown.quantity, unit)


def plot_answers(figure: Figure, result: AxisResult, quantity: Literal["V_ss", "Tau"]) -> None:
    """Plot V_ss or Tau over the command with its band, the points of tables, and the vehicle to compare with."""
    axis, is_steady = result.axis, quantity == "V_ss"
    factor, unit = in_degrees(axis.unit) if is_steady else (1.0, "s")
    ax: Axes = figure.subplots()
    _curve(ax, factor, result.answers, quantity, "blue", "this fit, with 95 % band")
    points = [p for p in result.points if p.quantity == quantity]
    _points(ax, factor, points)
    if points and not is_steady:  # a measured time contains the lag of the thrusters, and the curve does not
        expected = [p.model for p in points]
        ax.plot([100.0 * p.command for p in points], expected, "x", color=LIGHT["blue"], label="this fit, with the lag")
    _curve(ax, factor, result.compared, quantity, "grey", "compared")
    name_axes(ax, "steady velocity" if is_steady else "time to 63 %", unit, "command (%)")
    add_legend(figure)


def plot_forces(figure: Figure, points: Sequence[Point], compared: Sequence[float | None] | None = None) -> None:
    """Plot the measured forces of a thrust curve over the command, and those of the model."""
    order = sorted(range(len(points)), key=lambda n: points[n].command)
    shown = [points[n] for n in order]
    commands = [100.0 * p.command for p in shown]
    ax: Axes = figure.subplots()
    ax.plot(commands, [p.model for p in shown], color=LIGHT["blue"], linewidth=1.3, label="this fit")
    if compared:
        other = np.array([compared[n] for n in order], float)
        ax.plot(commands, other, "--", color=LIGHT["grey"], label="compared")
    _points(ax, 1.0, shown)
    name_axes(ax, "force", points[0].unit, "command (%)")
    add_legend(figure)


def _curve(ax: Axes, factor: float, answers: Sequence[Answer], quantity: str, color: str, label: str | None) -> None:
    """Draw values over the command with their intervals, apart for each direction."""
    for sign in (-1.0, 1.0):
        own = sorted((a for a in answers if a.command * sign > 0.0), key=lambda a: a.command)
        if own:
            known = [a.steady if quantity == "V_ss" else a.rise for a in own]
            values, low, high = factor * np.array([(value, *interval) for value, interval in known]).T
            commands = np.array([100.0 * a.command for a in own])
            _band(ax, commands, low, high, color)
            style = ".-" if color == "blue" else ".--"
            ax.plot(commands, values, style, color=LIGHT[color], linewidth=1.3, label=label)
            label = None


def _band(ax: Axes, x: Array, low: Array, high: Array, color: str = "blue") -> None:
    ax.fill_between(x, low, high, color=LIGHT[color], alpha=0.25, linewidth=0.0)


def _points(ax: Axes, factor: float, points: Sequence[Point]) -> None:
    """Draw measured points. Those that do not count are hollow."""
    for counts, face, label in ((True, LIGHT["orange"], "measured"), (False, "none", "measured, not counted")):
        if some := [(100.0 * p.command, factor * p.measured) for p in points if p.counts is counts]:
            x, y = zip(*some, strict=True)
            ax.plot(x, y, "o", color=LIGHT["orange"], markerfacecolor=face, markersize=4.5, zorder=5, label=label)
