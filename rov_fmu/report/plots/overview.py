"""The plots of the opening screen of the identification report, and the correlation of coefficients."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from rov_fmu.report.overview import ShownPrediction
from rov_fmu.report.plots.svg import LIGHT
from rov_fmu.report.templates import pretty_unit, text
from rov_fmu.tank.arrays import Array

_MOST_SAMPLES = 400
"""More samples would not be visible."""
_MOST_NUMBERS = 5
"""With more coefficients than this, the squares of a correlation matrix are too small for numbers."""


def plot_predicted(figure: Figure, shown: ShownPrediction) -> None:
    """Plot the measured and the predicted values of an unseen recording, with the 95 % band."""
    some = _places(shown.time)
    ax = figure.subplots()
    if shown.half_band is not None:
        low, high = shown.predicted - shown.half_band, shown.predicted + shown.half_band
        ax.fill_between(shown.time[some], low[some], high[some], color=LIGHT["blue"], alpha=0.25, linewidth=0.0)
    ax.plot(shown.time[some], shown.measured[some], color=LIGHT["orange"], linewidth=2.6, alpha=0.6, label="measured")
    later = some[shown.time[some] >= shown.start]
    ax.plot(shown.time[later], shown.predicted[later], color=LIGHT["blue"], linewidth=1.3, label="predicted")
    _finish(figure, shown, f"{shown.quantity.capitalize()} ({pretty_unit(shown.unit)})")
    ax.margins(y=0.12)
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.2, columnspacing=1.2)


def plot_error(figure: Figure, shown: ShownPrediction) -> None:
    """Plot the measured less the predicted values of an unseen recording, with the 95 % band."""
    some = shown.later[_places(shown.later)]
    ax = figure.subplots()
    if shown.half_band is not None:
        half = shown.half_band[some]
        ax.fill_between(
            shown.time[some], -half, half, color=LIGHT["blue"], alpha=0.25, linewidth=0.0, label="95 % band"
        )
        ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)
    ax.axhline(0.0, color=LIGHT["blue"], linewidth=1.3)
    off = (shown.measured - shown.predicted)[some]
    ax.plot(shown.time[some], off, ".", color=LIGHT["orange"], markersize=3.0)
    reach = 1.3 * float(np.quantile(np.abs(off), 0.995)) if off.size else 1.0
    if shown.half_band is not None:
        reach = max(reach, 1.3 * float(shown.half_band[some].max()))
    ax.set_ylim(-reach, reach)
    _finish(figure, shown, f"Error ({pretty_unit(shown.unit)})")


def _finish(figure: Figure, shown: ShownPrediction, title: str) -> None:
    (ax,) = figure.axes
    ax.axvline(shown.start, color=LIGHT["muted"], linewidth=0.8, linestyle=":")
    ax.set(xlim=(shown.time[0], shown.time[-1]), xlabel="time (s)")
    ax.set_title(title, loc="left")
    ax.locator_params(nbins=6)


def _places(samples: Array | NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the places of as many samples as can be seen in a plot."""
    return np.arange(0, len(samples), max(1, len(samples) // _MOST_SAMPLES))


def plot_correlation(figure: Figure, names: Sequence[str], correlation: Array) -> None:
    """Plot a p x p matrix of correlations below its diagonal: the stronger, the darker; orange is negative."""
    ax = figure.subplots()
    for row in range(len(names)):
        for column in range(row):
            value = float(correlation[row, column])
            if not np.isfinite(value):
                continue
            color = LIGHT["blue" if value >= 0.0 else "orange"]
            square = Rectangle((column - 0.5, row - 0.5), 1.0, 1.0, facecolor=color, alpha=0.6 * abs(value))
            ax.add_patch(square)
            if len(names) <= _MOST_NUMBERS:
                digits = 2 if abs(value) < 0.995 else 4  # a correlation near 1 tells by how much it differs from 1
                ax.text(column, row, text(value, f".{digits}f"), ha="center", va="center")
    ax.set(xlim=(-0.5, len(names) - 1.5), ylim=(len(names) - 0.5, 0.5))
    ax.set_xticks(range(len(names) - 1), names[:-1], rotation=90 if len(names) > 3 else 0)
    ax.set_yticks(range(1, len(names)), names[1:])
    ax.tick_params(labelcolor=LIGHT["ink"])
    ax.grid(visible=False)
