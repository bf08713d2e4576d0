"""The plots of a study's page. Each function declares one: its label, what stands above it, and how it is drawn."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rov_fmu.report.plots.steps import evenly
from rov_fmu.report.plots.svg import LIGHT, LINES, inline_svg, shade, with_even_text
from rov_fmu.report.templates import number, with_unit
from rov_fmu.study.results import Results

_WIDTH = 3.7  # inches
_HEIGHT = 2.6  # inches
_POINTS = 400
"""The number of points of a band that are drawn; more would not be visible."""
_BINS = 40
_MARKED = 40
"""A line with at most this many points has markers."""
_NARROW = 1e-3
"""Below this relative variation, the numbers at an axis are long, so there are fewer of them."""


def distribution(name: str, values: Any, told: Mapping[str, float]) -> dict[str, Any]:
    """Plot a histogram of the values of a figure with their median, and with the range from 5 to 95 % of the runs."""

    def draw(ax: Axes) -> None:
        shade(ax, told["5%"], told["95%"])
        shares = np.full(len(values), 100.0 / len(values))
        bins = min(_BINS, max(5, round(len(values) ** 0.5)))
        _, _, bars = ax.hist(values, bins=bins, weights=shares, color=LIGHT["blue"], alpha=0.75)
        bars.set_label("share")  # type: ignore[union-attr]
        ax.axvline(told["50%"], color=LIGHT["orange"], linewidth=1.4)
        ax.set(ylabel="runs (%)")
        _set_ticks(ax, 3 if np.ptp(values) < _NARROW * np.abs(values).max() else 6)

    return _plot(f"Distribution of {name}", draw, name)


def over(name: str, results: Results, grid: Sequence[str], *, joined: bool) -> dict[str, Any]:
    """Plot a figure over the first variable, with a line for some values of the other one; `joined`: by lines."""
    along, *others = grid
    runs = results.runs.sort_values(along, kind="stable")

    def draw(ax: Axes) -> None:
        lines = [("", runs)]
        for other in others:
            some = evenly(np.unique(runs[other]).tolist())
            lines = [(number(value, 4), runs[runs[other] == value]) for value in some]
        for (label, line), color in zip(lines, LINES, strict=False):
            marker = "o" if len(line) <= _MARKED or not joined else ""
            style: dict[str, Any] = {"color": LIGHT[color], "marker": marker, "markersize": 3.5, "label": label}
            ax.plot(line[along], line[name], linewidth=1.4 * joined, **style)
        for other in others:
            title = with_unit(other, results.units[other])
            ax.figure.legend(title=title, handlelength=1.0, loc="outside right upper")
        ax.set(xlabel=with_unit(along, results.units[along]))
        _set_ticks(ax)

    return _plot(f"{name} over {' and '.join(grid)}", draw, name)


def band(output: str, results: Results) -> dict[str, Any]:
    """Plot the median of an output over time, and the bands between its quantiles."""
    bands = results.bands(output)
    shown = bands.iloc[:: max(1, len(bands) // _POINTS)]

    def draw(ax: Axes) -> None:
        t = shown.index.to_numpy()
        values = shown.to_numpy(float)
        low, below, median, above, high = np.where(np.isfinite(values), values, np.nan).T
        ax.fill_between(t, low, high, color=LIGHT["blue"], alpha=0.16, linewidth=0.0)
        ax.fill_between(t, below, above, color=LIGHT["blue"], alpha=0.28, linewidth=0.0)
        for edge, label in ((low, "5 %"), (high, "95 %")):
            ax.plot(t, edge, color=LIGHT["blue"], linewidth=0.5, alpha=0.5, label=label)
        ax.plot(t, median, color=LIGHT["blue"], linewidth=1.6, label="median")
        ax.set(xlabel="time (s)", ylabel=with_unit("", results.units[output]))
        _set_ticks(ax)

    return _plot(f"Trajectories of {output}", draw, output, results.descriptions[output])


def _plot(label: str, draw: Callable[[Axes], None], name: str, text: str = "") -> dict[str, Any]:
    """Return a plot with the name and the text above it. `label` is for screen readers."""

    def drawn(figure: Figure) -> None:
        draw(figure.subplots())

    return {"name": name, "text": text, "svg": inline_svg(label, with_even_text(drawn), (_WIDTH, _HEIGHT), marked=True)}


def _set_ticks(ax: Axes, along: int = 6) -> None:
    """Print the full numbers at the axes, without an offset."""
    ax.ticklabel_format(useOffset=False)
    ax.locator_params("x", nbins=along)
    ax.locator_params("y", nbins=6)
