"""The plots of the identification report: predictions with their bands, and answers and forces over the command."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text

from rov_fmu.identify.result import AxisResult, Identification, Interval, Point, Prediction
from rov_fmu.report.plots.svg import LIGHT, with_formulas
from rov_fmu.report.templates import pretty_unit
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.columns import in_degrees
from rov_fmu.vehicle.uncertainty import quantile

_MOST_SAMPLES = 400
"""More samples than this would not be visible."""


def plot_prediction(figure: Figure, shown: Prediction) -> None:
    """Plot the measured and the predicted values of an unseen log, with the 95 % band."""
    factor, unit = in_degrees(shown.unit)
    some = slice(None, None, max(1, len(shown.time) // _MOST_SAMPLES))
    time, half = shown.time[some], factor * quantile(np.inf) * shown.deviation[some]
    measured, predicted = factor * shown.measured[some], factor * shown.predicted[some]
    ax: Axes = figure.subplots()
    _band(ax, time, predicted - half, predicted + half)
    ax.plot(time, measured, color=LIGHT["orange"], linewidth=2.6, alpha=0.6, label="measured")
    ax.plot(time, predicted, color=LIGHT["blue"], linewidth=1.3, label="predicted")
    ax.set(xlim=(time[0], time[-1]), xlabel="time (s)")
    ax.margins(y=0.12)
    _finish(figure, f"{shown.quantity.capitalize()} ({pretty_unit(unit)})")


def plot_answers(figure: Figure, results: Identification, result: AxisResult, quantity: Literal["V_ss", "Tau"]) -> None:
    """Plot V_ss or Tau over the command with its band, the points of tables, and the vehicle to compare with."""
    axis, is_steady = result.axis, quantity == "V_ss"
    factor, unit = in_degrees(axis.unit) if is_steady else (1.0, "s")
    answers = sorted(result.answers, key=lambda answer: answer.command)
    found = [answer.steady if is_steady else answer.rise for answer in answers]
    commands = np.array([answer.command for answer in answers])
    ax: Axes = figure.subplots()
    _curve(ax, factor, commands, found)
    _points(ax, factor, [p for p in result.points if p.quantity == quantity])
    if results.against and results.against.layout.has(axis):
        other = [results.against.response(axis, c)[0 if is_steady else 1] for c in commands.tolist()]
        ax.plot(100.0 * commands, factor * np.array(other), "--", color=LIGHT["grey"], label="compared")
    ax.set_xlabel("command (%)")
    symbol = "$V_{ss}$" if is_steady else "$Tau$"
    with_formulas(_finish(figure, f"{symbol} ({pretty_unit(unit)})"))


def plot_forces(figure: Figure, points: Sequence[Point]) -> None:
    """Plot the measured forces of a thrust curve over the command, and those of the model."""
    shown = sorted(points, key=lambda p: p.command)
    ax: Axes = figure.subplots()
    model = [p.model for p in shown]
    ax.plot([100.0 * p.command for p in shown], model, color=LIGHT["blue"], linewidth=1.3, label="model")
    _points(ax, 1.0, shown)
    ax.set_xlabel("command (%)")
    _finish(figure, f"Force ({points[0].unit})")


def _curve(ax: Axes, factor: float, commands: Array, found: Sequence[tuple[float, Interval]]) -> None:
    """Draw values over the command with their intervals, apart for each direction."""
    numbers = factor * np.array([(value, *interval) for value, interval in found]).reshape(-1, 3)
    label: str | None = "model"
    for side in (commands < 0.0, commands > 0.0):
        if side.any():
            values, low, high = numbers[side].T
            _band(ax, 100.0 * commands[side], low, high)
            ax.plot(100.0 * commands[side], values, ".-", color=LIGHT["blue"], linewidth=1.3, label=label)
            label = None


def _band(ax: Axes, x: Array, low: Array, high: Array) -> None:
    ax.fill_between(x, low, high, color=LIGHT["blue"], alpha=0.25, linewidth=0.0)


def _points(ax: Axes, factor: float, points: Sequence[Point]) -> None:
    """Draw measured points. Those that do not count are hollow."""
    for counts, face, label in ((True, LIGHT["orange"], "measured"), (False, "none", "not counted")):
        if some := [(100.0 * p.command, factor * p.measured) for p in points if p.counts is counts]:
            x, y = zip(*some, strict=True)
            ax.plot(x, y, "o", color=LIGHT["orange"], markerfacecolor=face, markersize=4.5, zorder=5, label=label)


def _finish(figure: Figure, title: str) -> Text:
    """Add the title, and a legend below the plot, where it hides nothing."""
    (ax,) = figure.axes
    ax.locator_params(nbins=6)
    figure.legend(loc="outside lower center", ncols=4, columnspacing=1.0)
    return ax.set_title(title, loc="left")
