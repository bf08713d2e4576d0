"""The plots of a study's page. Each function declares one: its label, what stands above it, and how it is drawn."""

from collections.abc import Callable, Sequence
from textwrap import shorten, wrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from rov_fmu.report.plots.steps import evenly
from rov_fmu.report.plots.svg import LIGHT, LINES, inline_svg, shade, with_even_text, with_formulas
from rov_fmu.report.templates import number, with_unit
from rov_fmu.study.results.results import Results

_WIDTH = 3.7  # inches
_HEIGHT = 2.6  # inches
_POINTS = 400
"""The number of points of a band that are drawn; more would not be visible."""
_BINS = 40
_MARKED = 40
"""A line with at most this many points has markers."""
_NARROW = 1e-3
"""Below this relative variation, the numbers at an axis are long, so there are fewer of them."""
_SHOWN_INDICES = 12
"""The number of variables in a plot of Sobol indices; the other variables have smaller indices."""
_NAME_WIDTH = 22
"""The number of characters in a line of a variable's name; correlated variables are named together."""
_KINDS = {"blue": "$S_1$: alone", "teal": "$S_T$: with others"}
"""The kinds of Sobol indices by their colour."""
_BAR = 0.34
"""The height of a bar, as a share of the distance between two variables."""


def distribution(name: str, values: Any, told: dict[str, float], unit: str, expression: str) -> dict[str, Any]:
    """Plot a histogram of the values of a figure with their median, and with the range from 5 to 95 % of the runs."""

    def draw(ax: Axes) -> None:
        shade(ax, told["5%"], told["95%"])
        shares = np.full(len(values), 100.0 / len(values))
        bins = min(_BINS, max(5, round(len(values) ** 0.5)))
        _, _, bars = ax.hist(values, bins=bins, weights=shares, color=LIGHT["blue"], alpha=0.75)
        bars.set_label("share")  # type: ignore[union-attr]
        ax.axvline(told["50%"], color=LIGHT["orange"], linewidth=1.4)
        ax.set(xlabel=with_unit("", unit), ylabel="runs (%)")
        _set_ticks(ax, 3 if np.ptp(values) < _NARROW * np.abs(values).max() else 6)

    return _plot(f"Distribution of {name}", draw, name, expression)


def over_grid(name: str, unit: str, expression: str, results: Results, grid: Sequence[str]) -> dict[str, Any]:
    """Plot a figure over the variable with more values, with a line for some values of the other one."""
    along, *others = grid
    runs = results.runs.sort_values(along, kind="stable")

    def draw(ax: Axes) -> None:
        lines = [("", runs)]
        for other in others:
            some = evenly(np.unique(runs[other]).tolist())
            lines = [(number(value, 4), runs[runs[other] == value]) for value in some]
        for (label, line), color in zip(lines, LINES, strict=False):
            marker = "o" if len(line) <= _MARKED else ""
            ax.plot(
                line[along], line[name], color=LIGHT[color], marker=marker, markersize=3.5, linewidth=1.4, label=label
            )
        for other in others:
            title = with_unit(other, results.units[other])
            ax.figure.legend(title=title, handlelength=1.0, loc="outside right upper")
        ax.set(xlabel=with_unit(along, results.units[along]), ylabel=with_unit("", unit))
        _set_ticks(ax)

    return _plot(f"{name} over {' and '.join(grid)}", draw, name, expression)


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


def indices(figure: str, rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Plot the Sobol indices of a figure as bars with their 95 % intervals; unreliable ones are grey.

    A row has `name`, `S1`, `S1_95`, `S1_tells` and the same for ST, and the largest ST comes first.
    """
    shown = rows[:_SHOWN_INDICES]

    def draw(ax: Axes) -> None:
        ends = [0.0, 1.0]
        for key, color, offset in (("S1", "blue", -0.5), ("ST", "teal", 0.5)):
            at = np.arange(len(shown)) + offset * _BAR
            values, half_widths = (np.array([row[name] for row in shown], float) for name in (key, f"{key}_95"))
            colors = [LIGHT[color if row[f"{key}_tells"] else "grey"] for row in shown]
            ax.barh(at, values, _BAR, color=colors, alpha=0.75)
            ax.errorbar(values, at, xerr=half_widths, fmt="none", ecolor=LIGHT["ink"], elinewidth=1.0, capsize=2.0)
            ends += [*(values - half_widths), *(values + half_widths)]
        ax.set(xlim=(max(min(ends), -0.3) - 0.02, min(max(ends), 1.3) + 0.02), ylim=(len(shown) - 0.4, -0.6))
        ax.set_yticks(range(len(shown)), ["\n".join(_name_lines(row["name"])) for row in shown])
        ax.tick_params("y", labelcolor=LIGHT["ink"])
        ax.grid(visible=False, axis="y")
        ax.axvline(0.0, color=LIGHT["muted"], linewidth=0.8)
        ax.set_xlabel("share of the variance")
        looks = [Patch(color=LIGHT[color], alpha=0.75, label=label) for color, label in _KINDS.items()]
        legend = ax.figure.legend(
            handles=looks, loc="outside upper right", ncols=2, handlelength=1.0, columnspacing=1.2
        )
        with_formulas(*legend.get_texts())

    return _plot(f"Sobol indices of {figure}", draw, figure, height=1.0 + 0.45 * len(shown))


def _plot(
    label: str, draw: Callable[[Axes], None], name: str, text: str = "", height: float = _HEIGHT
) -> dict[str, Any]:
    """Return a plot with the name and the text above it. `label` is for screen readers; the height is in inches."""

    def drawn(figure: Figure) -> None:
        draw(figure.subplots())

    return {"name": name, "text": text, "svg": inline_svg(label, with_even_text(drawn), (_WIDTH, height), marked=True)}


def _name_lines(name: str) -> list[str]:
    """Return the name of a variable, or of several that are correlated, in at most two lines."""
    lines = wrap(name, _NAME_WIDTH)
    return lines if len(lines) <= 2 else [lines[0], shorten(" ".join(lines[1:]), _NAME_WIDTH, placeholder=" …")]


def _set_ticks(ax: Axes, along: int = 6) -> None:
    """Print the full numbers at the axes, without an offset."""
    ax.ticklabel_format(useOffset=False)
    ax.locator_params("x", nbins=along)
    ax.locator_params("y", nbins=6)
