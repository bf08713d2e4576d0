"""The plots of an FMU's evidence: deviations of experiments and of step sizes, and the cost of a step."""

from collections.abc import Sequence
from math import log10

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from rov_fmu.report.plots.svg import LIGHT, add_legend, name_axes
from rov_fmu.report.templates import RAISED

_ZERO = 1e-17
"""Where equal numbers stand on a logarithmic axis: below the rounding error of any other difference."""


def plot_expected(figure: Figure, deviations: Sequence[float], tolerance: Sequence[float]) -> None:
    """Plot the largest deviation of each experiment below its tolerance."""
    ax = _logarithmic(figure, "largest deviation", "experiment")
    numbers = np.arange(1, len(deviations) + 1)
    _draw_deviations(ax, numbers, deviations, tolerance)
    ax.locator_params("x", nbins=6, integer=True)
    add_legend(figure)


def plot_step_deviations(
    figure: Figure, steps: Sequence[float], deviations: Sequence[float], allowed: Sequence[float]
) -> None:
    """Plot how far runs with several communication steps end from a run with one."""
    ax = _logarithmic(figure, "deviation", "communication steps")
    _draw_deviations(ax, np.arange(len(steps)), deviations, [*allowed] * len(steps))
    ax.set_xticks(np.arange(len(steps)), [f"{n:g}" for n in steps])
    add_legend(figure)


def plot_cost(figure: Figure, edges: Sequence[float], shares: Sequence[float]) -> None:
    """Plot how many steps take how long (µs). The last bar has all that take longer."""
    ax: Axes = figure.subplots()
    ax.bar(edges[:-1], 100.0 * np.array(shares), np.diff(edges), align="edge", color=LIGHT["blue"])
    name_axes(ax, "share of the steps", "%", "duration (µs), longer ones in the last bar")
    ax.set_xlim(edges[0], edges[-1])


def _logarithmic(figure: Figure, quantity: str, x: str) -> Axes:
    ax: Axes = figure.subplots()
    name_axes(ax, quantity, "1", x)
    ax.set_yscale("log")
    ax.yaxis.set_major_locator(LogLocator(numticks=6))
    ax.yaxis.set_major_formatter(lambda value, _: f"10{str(round(log10(value))).translate(RAISED)}")
    ax.minorticks_off()
    return ax


def _draw_deviations(ax: Axes, x: object, deviations: Sequence[float], allowed: Sequence[float]) -> None:
    """Draw deviations as points, those above what is allowed in another colour and form."""
    shown, most = np.maximum(np.minimum(deviations, 1e3), _ZERO), np.array(allowed)
    is_good = np.array(deviations) <= most
    at = np.asarray(x)
    ax.plot(at, most, color=LIGHT["orange"], linestyle="--", label="allowed")
    ax.plot(at[is_good], shown[is_good], "o", color=LIGHT["blue"], markersize=4.5, label="found")
    if not is_good.all():
        ax.plot(at[~is_good], shown[~is_good], "X", color=LIGHT["orange"], markersize=7.0, label="too large")
    ax.set_ylim(min(_ZERO / 3.0, 1.0), 10.0 * max(most.max(), shown.max()))
