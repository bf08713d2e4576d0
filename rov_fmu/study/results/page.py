"""The page about a study, one HTML file: bands, distributions, sensitivities and failures."""

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rov_fmu.io.messages import FileError
from rov_fmu.io.output import Output
from rov_fmu.report.plots.steps import LINES, evenly
from rov_fmu.report.plots.svg import LIGHT, Draw, inline_svg
from rov_fmu.report.templates import number, page, pretty_unit
from rov_fmu.study.results.results import QUANTILES, Results
from rov_fmu.study.run.worker import REASON, STATUS

PAGE = "study.html"
_KIND = b'<p class="kind">Study</p>'
"""A line that every page about a study contains."""
_THIRD, _HALF = (3.7, 2.6), (5.0, 2.8)
"""The sizes of plots that fill a third and a half of a row, in inches. In both, text has about the same size."""
_BARS = 12
"""The number of variables whose Sobol indices are drawn; the table has all of them."""
_BINS = 40
_POINTS = 400
"""The number of points of a band that are drawn; more would not be visible."""
_NUMBERS = 6
"""The number of values of a distribution that are shown."""
_REASONS = 50
"""The number of reasons of failures that are shown."""
_ROWS = 60
"""The number of rows of a grid that are shown."""
_MARKED = 40
"""A line with at most so many points has markers."""
_FEW = 16
"""Below so many blocks, even the intervals of Sobol indices are unreliable: with 2, that of 0.5 was 0.6 to 1.1."""
_SURE = 0.1
"""An interval with a smaller half width is narrow enough to show that an index is small."""
_CONSTANT = 1e-6
"""Values that vary by less than this share of the largest one count as constant."""
_NARROW = 1e-3
"""Below this relative variation, the numbers at an axis are long, so there are fewer of them."""


def page_output(results: Results) -> Output:
    """Return the page about the finished runs as a file in the folder of the study. Raises FileError."""
    return Output(results.folder / PAGE, study_page(results).encode())


def check_place(folder: Path) -> None:
    """Raise FileError if the page would overwrite another file."""
    path = folder / PAGE
    if path.exists() and _KIND not in path.read_bytes():
        raise FileError(f"{path}: is no page of this tool and would be overwritten: choose another folder")


def study_page(results: Results) -> str:
    """Return the page as HTML. It is the same for the same results."""
    runs, plan = results.runs, results.plan
    reasons = [*_failures(runs)]
    grid = _grid(results)
    indices = _sensitivities(results) if plan["sampler"] == "saltelli" else {}
    rows = [row for found in indices.values() if not isinstance(found, str) for row in found]
    figures = [_figure(name, results, grid) for name in results.figures]
    bands = [_band(results, name) for name in results.outputs] if len(results.failed) < len(runs) else []
    _draw_in_rows(figures)
    _draw_in_rows(bands)
    return page(
        "study.html.j2",
        title=results.title,
        fmu=results.fmu,
        made_by=results.made_by,
        done=len(runs),
        planned=results.planned,
        failed=len(results.failed),
        incomplete=len(results.incomplete),
        sampler=plan["sampler"],
        seed=plan["seed"],
        quantiles=QUANTILES,
        figures=figures,
        grid=grid,
        rows=runs.reset_index(drop=True).head(_ROWS).to_dict("records"),
        more_rows=len(runs[_ROWS:]),
        sensitivities=indices,
        charts={name: _chart(name, found) for name, found in indices.items() if not isinstance(found, str)},
        most_bars=_BARS,
        is_vague=not all(row[f"{key}_tells"] for row in rows for key in ("S1", "ST")),
        blocks=results.planned // (len(results.groups) + 2),
        few=_FEW,
        bands=bands,
        descriptions=results.descriptions,
        warnings=results.warnings,
        parameters=[_parameter(name, runs[name], plan, results) for name in results.parameters],
        failures=reasons[:_REASONS],
        more_failures=len(reasons[_REASONS:]),
    )


def _grid(results: Results) -> Sequence[str]:
    """Return the one or two variables of a grid, the one with more values first; none for any other study."""
    if results.plan["sampler"] != "grid" or len(results.parameters) not in (1, 2):
        return ()
    return sorted(results.parameters, key=lambda name: -results.runs[name].nunique())


def _draw_in_rows(shown: Sequence[dict[str, Any]]) -> None:
    """Add the plots, in sizes that fill every row of the page: three to a row, and two in the last rows."""
    drawn = [found for found in shown if found["draw"]]
    halves = {0: 0, 1: 4, 2: 2}[len(drawn) % 3]
    for n, found in enumerate(drawn):
        is_half = n >= len(drawn) - halves
        found["width"] = "half" if is_half else "third"
        found["plot"] = inline_svg(found["label"], found["draw"], _HALF if is_half else _THIRD)


def _figure(name: str, results: Results, grid: Sequence[str]) -> dict[str, Any]:
    """Return the row about a figure, and how its plot is drawn."""
    values = results.runs[name].to_numpy(float)
    there, unit = values[np.isfinite(values)], results.figure_units[name]
    found = {"name": name, "expression": results.plan["figures"][name], "unit": unit, "runs": there.size}
    if not there.size:
        return {
            **found,
            "quantiles": [None] * len(QUANTILES),
            "mean": None,
            "sd": None,
            "draw": None,
            "is_still": False,
        }
    quantiles = np.quantile(there, QUANTILES).tolist()
    sd = float(there.std(ddof=1)) if there.size > 1 else None
    found |= {"quantiles": quantiles, "mean": float(there.mean()), "sd": sd}
    if _is_constant(there):
        return {**found, "draw": None, "is_still": True}
    if grid:
        draw: Draw = partial(_draw_lines, name=name, results=results, grid=grid)
        label = f"{name} over {' and '.join(grid)}"
    else:
        draw = partial(_draw_distribution, values=there, quantiles=quantiles, label=axis_label("", unit))
        label = f"Distribution of {name}"
    return {**found, "label": label, "draw": draw, "is_still": False}


def _is_constant(values: Any) -> bool:
    """True when values are practically constant."""
    return bool(np.ptp(values) <= _CONSTANT * np.abs(values).max())


def axis_label(name: str, unit: str) -> str:
    """Return a name with its unit; either of them may be missing."""
    if unit in ("", "1"):
        return name
    return f"{name} ({pretty_unit(unit)})" if name else pretty_unit(unit)


def _draw_distribution(figure: Figure, values: Any, quantiles: list[float], label: str) -> None:
    ax = figure.subplots()
    low, median, high = quantiles[0], quantiles[len(quantiles) // 2], quantiles[-1]
    ax.axvspan(low, high, facecolor=LIGHT["band"], edgecolor="none", zorder=0)
    shares = np.full(len(values), 100.0 / len(values))
    ax.hist(values, bins=min(_BINS, max(5, round(len(values) ** 0.5))), weights=shares, color=LIGHT["blue"], alpha=0.75)
    ax.axvline(median, color=LIGHT["orange"], linewidth=1.4)
    ax.set(xlabel=label, ylabel="runs (%)")
    _set_ticks(ax, 3 if np.ptp(values) < _NARROW * np.abs(values).max() else 6)


def _draw_lines(figure: Figure, name: str, results: Results, grid: Sequence[str]) -> None:
    """Draw a figure over the variable with more values, with a line for some values of the other one."""
    ax = figure.subplots()
    along, *others = grid
    runs = results.runs.sort_values(along, kind="stable")
    lines = [("", runs)]
    for other in others:
        some = evenly(np.unique(runs[other]).tolist())
        lines = [(number(value, 4), runs[runs[other] == value]) for value in some]
    for (label, line), color in zip(lines, LINES, strict=False):
        marker = "o" if len(line) <= _MARKED else ""
        ax.plot(line[along], line[name], color=LIGHT[color], marker=marker, markersize=3.5, linewidth=1.4, label=label)
    for other in others:
        title = axis_label(other, results.units[other])
        figure.legend(title=title, title_fontsize=8.5, handlelength=1.0, loc="outside right upper")
    ax.set(xlabel=axis_label(along, results.units[along]), ylabel=axis_label("", results.figure_units[name]))
    _set_ticks(ax)


def _set_ticks(ax: Axes, along: int = 6) -> None:
    """Print the full numbers at the axes, without an offset."""
    ax.ticklabel_format(useOffset=False)
    ax.locator_params("x", nbins=along)
    ax.locator_params("y", nbins=6)


def _band(results: Results, output: str) -> dict[str, Any]:
    """Return an output, and how its trajectories are drawn."""
    bands = results.bands(output)
    shown = bands.iloc[:: max(1, len(bands) // _POINTS)]
    draw = partial(_draw_band, bands=shown, unit=results.units[output])
    return {"name": output, "label": f"Trajectories of {output}", "draw": draw}


def _draw_band(figure: Figure, bands: pd.DataFrame, unit: str) -> None:
    ax = figure.subplots()
    t = bands.index.to_numpy()
    low, below, median, above, high = (bands[q].to_numpy(float) for q in QUANTILES)
    ax.fill_between(t, low, high, color=LIGHT["blue"], alpha=0.16, linewidth=0.0)
    ax.fill_between(t, below, above, color=LIGHT["blue"], alpha=0.28, linewidth=0.0)
    ax.plot(t, median, color=LIGHT["blue"], linewidth=1.6)
    ax.set(xlabel="time (s)", ylabel=axis_label("", unit))
    _set_ticks(ax)


def _sensitivities(results: Results) -> dict[str, Any]:
    """Return the rows of Sobol indices by figure, or the reason why there are none."""
    found: dict[str, Any] = {}
    for figure in results.figures:
        there = results.runs[figure].dropna().to_numpy(float)
        if there.size and _is_constant(there):
            found[figure] = "does not vary"
            continue
        try:
            rows = results.sensitivity(figure).sort_values("ST", ascending=False, kind="stable")
        except FileError as error:
            found[figure] = str(error).removeprefix(f"{results.folder}: ")
        else:
            rows["S1_tells"], rows["ST_tells"] = (_tells(rows[key], rows[f"{key}_95"]) for key in ("S1", "ST"))
            found[figure] = (rows.round(3) + 0.0).reset_index(names="name").to_dict("records")  # without -0
    return found


def _chart(name: str, rows: Sequence[dict[str, Any]]) -> Markup:
    """Return the Sobol indices of a figure as a bar chart."""
    shown = rows[:_BARS]
    size = _HALF[0], 0.9 + 0.36 * len(shown)  # inches
    return inline_svg(f"Sobol indices of {name}", partial(_draw_indices, rows=shown), size)


def _draw_indices(figure: Figure, rows: Sequence[dict[str, Any]]) -> None:
    """Draw a bar for S_1 and one for S_T of each variable, with their 95 % intervals."""
    ax = figure.subplots()
    places = np.arange(len(rows), dtype=float)
    for key, shift, color, label in (("S1", -0.19, "blue", "$S_1$: alone"), ("ST", 0.19, "grey", "$S_T$: with others")):
        values, errors = ([row[f"{key}{end}"] for row in rows] for end in ("", "_95"))
        ax.barh(places + shift, values, 0.36, color=LIGHT[color], label=label)
        ax.errorbar(values, places + shift, xerr=errors, fmt="none", ecolor=LIGHT["ink"], elinewidth=1.0, capsize=2.5)
    ax.set_yticks(places, [row["name"] for row in rows])
    ax.set_ylim(len(rows) - 0.5, -0.5)
    ax.grid(visible=False, axis="y")
    ax.set_xlim(min(0.0, ax.get_xlim()[0]), max(1.0, ax.get_xlim()[1]))
    figure.legend(loc="outside lower left", ncols=2)


def _tells(index: "pd.Series[float]", half_width: "pd.Series[float]") -> "pd.Series[bool]":
    """True for an index whose interval is narrower than the index itself, or narrower than a fixed width."""
    return (2.0 * half_width < index.abs()) | (half_width < _SURE)


def _parameter(name: str, column: "pd.Series[float]", plan: dict[str, Any], results: Results) -> dict[str, Any]:
    """Return the row about a varied variable: how it varies, and the values that it had."""
    distributions = dict(plan["vary"])
    if name in distributions:
        ((kind, given),) = distributions[name].items()
    else:
        kind, given = "estimate", plan["vary_from"]["estimates"][name]
    pairs = given.items() if isinstance(given, dict) else [("", value) for value in given]
    some = [f"{key} {number(value, 4)}".strip() for key, value in pairs]
    if len(some) > _NUMBERS:
        some[_NUMBERS:] = ["…"]
    others = [other for group in results.groups if name in group for other in group if other != name]
    values = column.to_numpy(float)
    return {
        "name": name,
        "planned": f"{kind}: {', '.join(some)}",
        "others": others,
        "least": float(values.min()),
        "median": float(np.median(values)),
        "greatest": float(values.max()),
        "unit": results.units[name],
        "description": results.descriptions[name],
    }


def _failures(runs: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """Yield the failures by reason, the most frequent first."""
    there = runs[runs[REASON].notna()]
    for (status, reason), some in sorted(there.groupby([STATUS, REASON]), key=lambda found: -len(found[1])):
        first = ", ".join(str(n) for n in some.index[:5])
        yield {"runs": len(some), "status": status, "reason": reason, "first": first}
