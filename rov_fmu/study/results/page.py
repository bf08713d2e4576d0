"""The page on a study: bands, distributions, sensitivities, failures; one HTML file."""

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
"""Which every page has."""
_PLOT = (3.7, 2.6)  # inches
_BINS = 40
_POINTS = 400
"""Points of a band that are drawn; more are not seen."""
_REASONS = 50
_ROWS = 60
"""Of a grid, that are shown."""
_MARKED = 40
"""Points of a line that are marked."""
_FEW = 16
"""Blocks of runs from which not even the intervals of indices are known: of 2, that of 0.5 was 0.6 to 1.1."""
_SURE = 0.1
"""Half width of an interval that tells that an index is small."""
_STILL = 1e-6
"""Of the greatest number: what varies by less does not vary."""
_NARROW = 1e-3
"""Where numbers vary by less, those at an axis are long, and so fewer."""


def page_output(results: Results) -> Output:
    """The page of what is done of a study, to write into its folder. Raises FileError."""
    return Output(results.folder / PAGE, study_page(results).encode())


def see_place(folder: Path) -> None:
    """That the page overwrites nothing else in a folder. Raises FileError."""
    path = folder / PAGE
    if path.exists() and _KIND not in path.read_bytes():
        raise FileError(f"{path}: is no page of this tool and would be overwritten: choose another folder")


def study_page(results: Results) -> str:
    """The page as HTML, the same for the same results."""
    runs, plan = results.runs, results.plan
    reasons = [*_failures(runs)]
    grid = _grid(results)
    indices = _sensitivities(results) if plan["sampler"] == "saltelli" else {}
    rows = [row for told in indices.values() if not isinstance(told, str) for row in told]
    return page(
        "study.html.j2",
        title=results.model.removesuffix(".fmu"),
        fmu=results.fmu,
        made_by=results.made_by,
        done=len(runs),
        planned=results.planned,
        failed=len(results.failed),
        incomplete=len(results.incomplete),
        sampler=plan["sampler"],
        seed=plan["seed"],
        quantiles=QUANTILES,
        figures=[_figure(name, results, grid) for name in results.figures],
        grid=grid,
        rows=runs.reset_index(drop=True).head(_ROWS).to_dict("records"),
        more_rows=len(runs[_ROWS:]),
        sensitivities=indices,
        is_vague=not all(row[f"{key}_tells"] for row in rows for key in ("S1", "ST")),
        blocks=results.planned // (len(results.groups) + 2),
        few=_FEW,
        bands={name: _band(results, name) for name in results.outputs} if len(results.failed) < len(runs) else {},
        descriptions=results.descriptions,
        warnings=results.warnings,
        parameters=[_parameter(name, runs[name], plan, results) for name in results.parameters],
        failures=reasons[:_REASONS],
        more_failures=len(reasons[_REASONS:]),
    )


def _grid(results: Results) -> Sequence[str]:
    """The one or two variables of a grid, that with more values first; nothing of what is no such grid."""
    if results.plan["sampler"] != "grid" or len(results.parameters) not in (1, 2):
        return ()
    return sorted(results.parameters, key=lambda name: -results.runs[name].nunique())


def _figure(name: str, results: Results, grid: Sequence[str]) -> dict[str, Any]:
    values = results.runs[name].to_numpy(float)
    there, unit = values[np.isfinite(values)], results.figure_units[name]
    found = {"name": name, "expression": results.plan["figures"][name], "unit": unit, "runs": there.size}
    if not there.size:
        return {**found, "quantiles": [None] * len(QUANTILES), "mean": None, "sd": None, "plot": "", "is_still": False}
    quantiles = np.quantile(there, QUANTILES).tolist()
    sd = float(there.std(ddof=1)) if there.size > 1 else None
    told = {**found, "quantiles": quantiles, "mean": float(there.mean()), "sd": sd}
    if _is_still(there):
        return {**told, "plot": "", "is_still": True}
    if grid:
        draw: Draw = partial(_draw_lines, name=name, results=results, grid=grid)
        title = f"{name} over {' and '.join(grid)}"
    else:
        draw = partial(_draw_distribution, values=there, quantiles=quantiles, label=_axis("", unit))
        title = f"Distribution of {name}"
    return {**told, "plot": inline_svg(title, draw, _PLOT), "is_still": False}


def _is_still(values: Any) -> bool:
    """Whether numbers are the same, but for what no one sees."""
    return bool(np.ptp(values) <= _STILL * np.abs(values).max())


def _axis(name: str, unit: str) -> str:
    """What is written at an axis."""
    return name if unit in ("", "1") else f"{name} ({pretty_unit(unit)})" if name else pretty_unit(unit)


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
    """Over what has more values; a line for some values of the other."""
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
        title = _axis(other, results.units[other])
        figure.legend(title=title, title_fontsize=8.5, handlelength=1.0, loc="outside right upper")
    ax.set(xlabel=_axis(along, results.units[along]), ylabel=_axis("", results.figure_units[name]))
    _set_ticks(ax)


def _set_ticks(ax: Axes, along: int = 6) -> None:
    """Numbers as they are, and not what they are above another."""
    ax.ticklabel_format(useOffset=False)
    ax.locator_params("x", nbins=along)
    ax.locator_params("y", nbins=6)


def _band(results: Results, output: str) -> Markup:
    bands = results.bands(output)
    shown = bands.iloc[:: max(1, len(bands) // _POINTS)]
    return inline_svg(f"Trajectories of {output}", partial(_draw_band, bands=shown, unit=results.units[output]), _PLOT)


def _draw_band(figure: Figure, bands: pd.DataFrame, unit: str) -> None:
    ax = figure.subplots()
    t = bands.index.to_numpy()
    low, below, median, above, high = (bands[q].to_numpy(float) for q in QUANTILES)
    ax.fill_between(t, low, high, color=LIGHT["blue"], alpha=0.16, linewidth=0.0)
    ax.fill_between(t, below, above, color=LIGHT["blue"], alpha=0.28, linewidth=0.0)
    ax.plot(t, median, color=LIGHT["blue"], linewidth=1.6)
    ax.set(xlabel="time (s)", ylabel=_axis("", unit))
    _set_ticks(ax)


def _sensitivities(results: Results) -> dict[str, Any]:
    """Rows by figure, or why there are none."""
    found: dict[str, Any] = {}
    for figure in results.figures:
        there = results.runs[figure].dropna().to_numpy(float)
        if there.size and _is_still(there):
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


def _tells(index: "pd.Series[float]", half_width: "pd.Series[float]") -> "pd.Series[bool]":
    """Whether an index is known: its interval is narrower than itself, or narrow anyway, as that of a small one is."""
    return (2.0 * half_width < index.abs()) | (half_width < _SURE)


def _parameter(name: str, column: "pd.Series[float]", plan: dict[str, Any], results: Results) -> dict[str, Any]:
    ways = dict(plan["vary"])
    ((kind, told),) = (ways[name] if name in ways else {"estimate": plan["vary_from"]["estimates"][name]}).items()
    numbers = told.items() if isinstance(told, dict) else [("", value) for value in told]
    some = [f"{key} {number(value, 4)}".strip() for key, value in numbers]
    words = ", ".join([*some[:6], *(["…"] if len(some) > 6 else [])])
    others = [other for group in results.groups if name in group for other in group if other != name]
    values = column.to_numpy(float)
    return {
        "name": name,
        "planned": f"{kind}: {words}",
        "others": others,
        "least": float(values.min()),
        "median": float(np.median(values)),
        "greatest": float(values.max()),
        "unit": results.units[name],
        "description": results.descriptions[name],
    }


def _failures(runs: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """By reason, the most frequent first."""
    there = runs[runs[REASON].notna()]
    for (status, reason), some in sorted(there.groupby([STATUS, REASON]), key=lambda found: -len(found[1])):
        first = ", ".join(str(n) for n in some.index[:5])
        yield {"runs": len(some), "status": status, "reason": reason, "first": first}
