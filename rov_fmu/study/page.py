"""The page about a study, one HTML file: a table of figures and of what varied, and their plots."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rov_fmu.io.messages import first_of, listed
from rov_fmu.report.templates import inline_script, page
from rov_fmu.study import plots
from rov_fmu.study.plan import REASON, STATUS
from rov_fmu.study.results import Results, statistics

_COLUMNS = {
    "Least": "min",
    **{f"{share} %": f"{share}%" for share in (5, 50, 95)},
    "Greatest": "max",
    "Mean": "mean",
    "Standard deviation": "std",
    "Runs": "count",
}
"""What the table tells of the runs, and its key in `statistics`."""
_REASONS = 50
"""The number of reasons of failures that are shown."""
_FIRST = 5
"""The number of runs that are named with a reason."""
_CONSTANT = 1e-6
"""Values that vary by less than this share of the largest one count as constant."""


def study_page(results: Results) -> str:
    """Return the page about the finished runs as HTML. It is the same for the same results. Raises FileError."""
    runs = results.runs
    told = {name: statistics(runs[name]) for name in (*results.figures, *results.parameters)}
    return page(
        "study.html.j2",
        results=results,
        told=[*results.warnings, *first_of([*_failures(results)], _REASONS)],
        columns=_COLUMNS,
        rows=[
            {
                **found,
                "name": name,
                "expression": results.plan["figures"].get(name) if name in results.figures else None,
                "unit": results.units.get(name, ""),
                "text": results.descriptions.get(name, ""),
            }
            for name, found in told.items()
        ],
        grid=_grid(results),
        plots=[
            *(plot for name in results.figures if _varies(told[name]) for plot in _plots(name, results, told[name])),
            *(plots.band(name, results) for name in results.outputs if len(results.failed) < len(runs)),
        ],
        script=inline_script("plots.js"),
    )


def _grid(results: Results) -> Sequence[str]:
    """Return the one or two variables of a grid, the one with more values first; none for any other study."""
    if results.plan["sampler"] != "grid" or len(results.parameters) not in (1, 2):
        return ()
    return sorted(results.parameters, key=lambda name: -results.runs[name].nunique())


def _plots(name: str, results: Results, told: Mapping[str, float]) -> Iterator[dict[str, Any]]:
    """Yield the plots of a figure: over the grid, or its distribution and over what varied most with it."""
    if grid := _grid(results):
        yield plots.over(name, results, grid, joined=True)
    else:
        yield plots.distribution(name, results.runs[name].dropna(), told)
        if most := _most_with(name, results):
            yield plots.over(name, results, most, joined=False)


def _most_with(name: str, results: Results) -> Sequence[str]:
    """Return what varied most with a figure, by the correlation of their ranks; none if nothing did."""
    ranks = results.runs[[name, *results.parameters]].dropna().rank()
    varied = [one for one in results.parameters if ranks[one].nunique() > 1]
    likeness = ranks.corr().abs().to_dict()[name]
    return sorted(varied, key=lambda one: -likeness[one])[:1]


def _varies(told: Mapping[str, float]) -> bool:
    """Return False for values that are practically constant, and where there are none."""
    return told["max"] - told["min"] > _CONSTANT * max(told["max"], -told["min"])


def _failures(results: Results) -> Iterator[str]:
    """Yield a line for each reason of failures, the most frequent first."""
    there = results.runs[results.runs[REASON].notna()]
    for (status, reason), some in sorted(there.groupby([STATUS, REASON]), key=lambda found: -len(found[1])):
        numbers = listed(first_of([str(n) for n in some.index], _FIRST))
        yield f"{len(some)} {'run is' if len(some) == 1 else 'runs are'} {status} ({numbers}): {reason}"
