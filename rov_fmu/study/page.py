"""The page about a study, one HTML file: bands, distributions, sensitivities and failures."""

from collections.abc import Iterator, Sequence
from typing import Any

import pandas as pd

from rov_fmu.report.templates import inline_script, number, page
from rov_fmu.study import plots
from rov_fmu.study.plan import REASON, STATUS
from rov_fmu.study.results import QUANTILES, Results, statistics

_NUMBERS = 6
"""The number of values of a distribution that are shown."""
_REASONS = 50
"""The number of reasons of failures that are shown."""
_ROWS = 60
"""The number of rows of a grid that are shown."""
_FEW_FIGURES = 4
"""The number of figures at the head of the page; the table has all of them."""
_CONSTANT = 1e-6
"""Values that vary by less than this share of the largest one count as constant."""


def study_page(results: Results) -> str:
    """Return the page about the finished runs as HTML. It is the same for the same results. Raises FileError."""
    runs, plan = results.runs, results.plan
    reasons = [*_failures(runs)]
    grid = _grid(results)
    told = {name: statistics(runs[name]) for name in (*results.parameters, *results.figures)}
    figures = [_figure(name, told[name], results, grid) for name in results.figures]
    outputs = results.outputs if len(results.failed) < len(runs) else ()
    return page(
        "study.html.j2",
        results=results,
        quantiles=QUANTILES,
        figures=figures,
        grid=grid,
        rows=runs.reset_index(drop=True).head(_ROWS).to_dict("records"),
        more_rows=len(runs[_ROWS:]),
        few_figures=_FEW_FIGURES,
        bands=[plots.band(name, results) for name in outputs],
        script=inline_script("plots.js"),
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
    plot = None
    if told["count"] and not _is_constant(told) and grid:
        plot = plots.over_grid(name, expression, results, grid)
    elif told["count"] and not _is_constant(told):
        plot = plots.distribution(name, results.runs[name].dropna(), told, expression)
    own = {"name": name, "expression": expression, "is_still": _is_constant(told), "plot": plot}
    return {**told, **own, "quantiles": [told[f"{q:.0%}"] for q in QUANTILES]}


def _is_constant(told: dict[str, float]) -> bool:
    """True when there are values that are practically constant."""
    return told["max"] - told["min"] <= _CONSTANT * max(told["max"], -told["min"])


def _parameter(name: str, told: dict[str, float], plan: dict[str, Any], results: Results) -> dict[str, Any]:
    """Return the row about a varied variable: how it varies, and the values that it had."""
    ((kind, given),) = plan.get("vary", {}).get(name, {"drawn": []}).items()
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
