"""The tables that are printed, and the plots."""

from functools import partial
from itertools import cycle
from math import inf
from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from rov_fmu.report.console import console, print_table, table
from rov_fmu.report.plots.svg import LIGHT, svg_file
from verification.identification.scores import Table, relative_errors

OURS = "rov-fmu"
_LOOKS = (("grey", "--"), ("grey", ":"), *((role, "-") for role in ("blue", "teal", "violet", "steel", "orange")))
_RATIOS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0)


def _span(span: float) -> str:
    return "open loop" if span == inf else f"{span:g} s"


def print_scores(rows: Table, numbers: Table) -> None:
    """Print a summary of the methods and their errors by quantity for each data set, and the coefficients."""
    out = console()
    for data, own in rows.groupby("data", sort=False):
        errors = relative_errors(own)
        heads = [*map(_span, errors), "in 50%", "in 95%", "least", "CPU s", "edits"]
        title = f"{data}: error relative to that of no change (geometric mean), samples in the bands"
        found = table(title, "method", heads, ["of the 95% bands, the one with the least"])
        for method, some in own.groupby("method", sort=False):
            least = some.loc[some.inside_95.idxmin()]
            shares = (some.inside_50.mean(), some.inside_95.mean(), least.inside_95)
            cells = [*(f"{error:.3g}" for error in errors.loc[method]), *(f"{share:.0%}" for share in shares)]
            where = f"{least.quantity}, {_span(least.span)}"
            found.add_row(method, *cells, f"{least.seconds:.1f}", str(least.edits), where)
        print_table(found, out)
        out.print()
        found = table(f"{data}: RMS error, SI units", "quantity", ["noise", *errors.index])
        for (quantity, unit, span), same in own.groupby(["quantity", "unit", "span"], sort=False):
            cells = [f"{same.noise.iloc[0]:.2g}", *(f"{error:.3g}" for error in same.error)]
            found.add_row(f"{quantity} [{unit}], {_span(span)}", *cells)
        print_table(found, out)
        out.print()
    if len(numbers):
        heads = ["in 95%", "median error", "median half-width"]
        found = table("Coefficients with a known truth", "data, method", heads)
        for (data, method), own in numbers.groupby(["data", "method"], sort=False):
            inside = own.true.between(own.low, own.high).sum()
            error, half = (own.value / own.true - 1.0).abs(), 0.5 * (own.high - own.low) / own.true.abs()
            cells = [f"{inside} of {len(own)}", f"{error.median():.1%}", f"{half.median():.1%}"]
            found.add_row(f"{data}, {method}", *cells)
        print_table(found, out)


def picture(rows: Table) -> str:
    """Draw errors and shares in the 95 % bands over the span, a row of panels for each, as SVG."""
    size = 2.6 * rows.data.nunique() + 1.6, 5.2
    return svg_file(partial(_draw, rows), size, salt="identification") + "\n"


def _draw(rows: Table, figure: Figure) -> None:
    panels = figure.subplots(2, rows.data.nunique(), squeeze=False, sharex=True, sharey="row")
    methods = [str(name) for name in rows.method.unique()]
    looks: dict[str, dict[str, Any]] = {
        name: {"color": LIGHT[role], "linestyle": line, "marker": ".", "linewidth": 2.2 if name == OURS else 1.2}
        for name, (role, line) in zip(methods, cycle(_LOOKS), strict=False)
    }
    for (data, own), upper, lower in zip(rows.groupby("data", sort=False), *panels, strict=True):
        errors = relative_errors(own)
        inside = 100.0 * own.pivot_table(index="method", columns="span", values="inside_95")
        places = range(errors.shape[1])
        for method in errors.index:
            upper.plot(places, errors.loc[method], **looks[method])
            lower.plot(places, inside.loc[method], **looks[method])
        upper.set_yscale("log")
        upper.set_yticks(_RATIOS, [f"{ratio:g}" for ratio in _RATIOS])
        upper.minorticks_off()
        upper.set_title(data, loc="left")
        lower.axhline(95.0, color=LIGHT["muted"], linestyle=":", linewidth=1.0)
        lower.set_xlabel("predicted over")
        lower.set_xticks(places, [_span(span).replace("open loop", "open") for span in errors])
    panels[0, 0].set_ylabel("error / that of no change")
    panels[1, 0].set_ylabel("samples in the 95 % bands (%)")
    lines = [Line2D([], [], **looks[name]) for name in methods]
    figure.legend(lines, methods, loc="outside lower center", ncols=4)
