"""The page about a study, one HTML file: bands, distributions, sensitivities and failures."""

from collections.abc import Iterator, Sequence
from typing import Any

import pandas as pd

from rov_fmu.io.messages import FileError
from rov_fmu.report.templates import inline_script, number, page
from rov_fmu.study.plan.figures import read_expression
from rov_fmu.study.plan.plan import REASON, STATUS
from rov_fmu.study.results import plots
from rov_fmu.study.results.results import QUANTILES, Results, statistics

_NUMBERS = 6
"""The number of values of a distribution that are shown."""
_REASONS = 50
"""The number of reasons of failures that are shown."""
_ROWS = 60
"""The number of rows of a grid that are shown."""
_FEW = 16
"""With fewer blocks, even the intervals of Sobol indices are unreliable. With 2 blocks, the interval of a true index of
0.5 was 0.6 to 1.1."""
_FEW_FIGURES = 4
"""The number of figures at the head of the page; the table has all of them."""
_SURE = 0.1
"""An interval with a smaller half width is narrow enough to show that an index is small."""
_CONSTANT = 1e-6
"""Values that vary by less than this share of the largest one count as constant."""


def study_page(results: Results) -> str:
    """Return the page about the finished runs as HTML. It is the same for the same results. Raises FileError."""
    runs, plan = results.runs, results.plan
    reasons = [*_failures(runs)]
    grid = _grid(results)
    told = {name: statistics(runs[name]) for name in (*results.parameters, *results.figures)}
    figures = [_figure(name, told[name], results, grid) for name in results.figures]
    tables, no_indices = _sensitivities(results, told)
    rows = [row for found in tables.values() for row in found]
    outputs = results.outputs if len(results.failed) < len(runs) else ()
    return page(
        "study.html.j2",
        results=results,
        quantiles=QUANTILES,
        figures=figures,
        grid=grid,
        rows=runs.reset_index(drop=True).head(_ROWS).to_dict("records"),
        more_rows=len(runs[_ROWS:]),
        no_indices=no_indices,
        indices=tables,
        index_plots=[plots.indices(name, rows) for name, rows in tables.items()],
        is_vague=not all(row[f"{key}_tells"] for row in rows for key in ("S1", "ST")),
        few=_FEW,
        few_figures=_FEW_FIGURES,
        bands=[plots.band(name, results) for name in outputs],
        script=inline_script("plots.js"),
        correlated=[group for group in results.groups if len(group) > 1],
        parameters=[_parameter(name, told[name], plan, results) for name in results.parameters],
        failures=reasons[:_REASONS],
        more_failures=len(reasons[_REASONS:]),
    )


def _grid(results: Results) -> Sequence[str]:
    """Return the one or two variables of a grid, the one with more values first; none for any other study."""
    if results.plan["sampler"] != "grid" or len(results.parameters) not in (1, 2):
        return ()
    return sorted(results.parameters, key=lambda name: -results.runs[name].nunique())


def _figure(name: str, told: dict[str, float], results: Results, grid: Sequence[str]) -> dict[str, Any]:
    """Return the row about a figure, with its plot unless all runs have the same value."""
    expression = results.plan["figures"][name]
    unit, plot = read_expression(expression, results.units).unit, None
    if told["count"] and not _is_constant(told) and grid:
        plot = plots.over_grid(name, unit, expression, results, grid)
    elif told["count"] and not _is_constant(told):
        plot = plots.distribution(name, results.runs[name].dropna(), told, unit, expression)
    own = {"name": name, "expression": expression, "unit": unit, "is_still": _is_constant(told), "plot": plot}
    return {**told, **own, "quantiles": [told[f"{q:.0%}"] for q in QUANTILES]}


def _is_constant(told: dict[str, float]) -> bool:
    """True when there are values that are practically constant."""
    return told["max"] - told["min"] <= _CONSTANT * max(told["max"], -told["min"])


def _sensitivities(results: Results, told: dict[str, dict[str, float]]) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the rows of Sobol indices by figure, and for the other figures the reason why there are none."""
    found, reasons = dict[str, Any](), dict[str, str]()
    for figure in results.figures if results.plan["sampler"] == "saltelli" else ():
        if _is_constant(told[figure]):
            reasons[figure] = "does not vary"
            continue
        try:
            rows = results.sensitivity(figure).sort_values("ST", ascending=False, kind="stable")
        except FileError as error:
            reasons[figure] = str(error).removeprefix(f"{results.folder}: ")
        else:
            rows["S1_tells"], rows["ST_tells"] = (_tells(rows[key], rows[f"{key}_95"]) for key in ("S1", "ST"))
            found[figure] = (rows.round(3) + 0.0).reset_index(names="name").to_dict("records")  # without -0
    return found, reasons


def _tells(index: "pd.Series[float]", half_width: "pd.Series[float]") -> "pd.Series[bool]":
    """True for an index whose interval is narrower than the index itself, or narrower than a fixed width."""
    return (2.0 * half_width < index.abs()) | (half_width < _SURE)


def _parameter(name: str, told: dict[str, float], plan: dict[str, Any], results: Results) -> dict[str, Any]:
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
    return {
        **told,
        "name": name,
        "planned": f"{kind}: {', '.join(some)}",
        "unit": results.units[name],
        "description": results.descriptions[name],
    }


def _failures(runs: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """Yield the failures by reason, the most frequent first."""
    there = runs[runs[REASON].notna()]
    for (status, reason), some in sorted(there.groupby([STATUS, REASON]), key=lambda found: -len(found[1])):
        first = ", ".join(str(n) for n in some.index[:5])
        yield {"runs": len(some), "status": status, "reason": reason, "first": first}
