"""The tables that are printed, and the plots."""

from collections.abc import Sequence
from functools import partial
from itertools import cycle
from math import inf
from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from rov_fmu.report.console import console, print_table, table
from rov_fmu.report.plots.svg import LIGHT, svg_file
from verification.identification.scores import Number, Score, summary

REFERENCE = "no change"
OURS = "rov-fmu"
_LOOKS = (("grey", "--"), ("grey", ":"), *((role, "-") for role in ("blue", "teal", "violet", "steel", "orange")))
_RATIOS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0)


def _of(rows: Sequence[Score], name: str) -> list[str]:
    return [*dict.fromkeys(getattr(row, name) for row in rows)]


def _span(span: float) -> str:
    return "open loop" if span == inf else f"{span:g} s"


def print_scores(rows: Sequence[Score], numbers: Sequence[Number]) -> None:
    """Print a summary of the methods and their errors by quantity for each data set, and the coefficients."""
    out = console()
    for data in _of(rows, "data"):
        own = [row for row in rows if row.data == data]
        spans = [*dict.fromkeys(row.span for row in own)]
        heads = [*map(_span, spans), "in 50%", "in 95%", "least", "CPU s", "edits"]
        title = f"{data}: error relative to that of no change (geometric mean), samples in the bands"
        found = table(title, "method", heads, ["of the 95% bands, the one with the least"])
        for method in _of(own, "method"):
            s = summary(rows, data, method, REFERENCE)
            share, quantity, span = s.lowest
            cells = [f"{s.errors[span]:.3g}" for span in spans]
            shares = [f"{100 * x:.0f}%" for x in (s.inside_50, s.inside_95, share)]
            found.add_row(method, *cells, *shares, f"{s.seconds:.1f}", str(s.edits), f"{quantity}, {_span(span)}")
        print_table(found, out)
        out.print()
        methods = _of(own, "method")
        found = table(f"{data}: RMS error, SI units", "quantity", ["noise", *methods])
        for quantity in _of(own, "quantity"):
            for span in spans:
                some = {row.method: row for row in own if (row.quantity, row.span) == (quantity, span)}
                first = next(iter(some.values()))
                errors = [f"{some[method].error:.3g}" for method in methods]
                found.add_row(f"{quantity} [{first.unit}], {_span(span)}", f"{first.noise:.2g}", *errors)
        print_table(found, out)
        out.print()
    if numbers:
        listed = table(
            "Coefficients with a known truth", "data, method", ["in 95%", "median error", "median half-width"]
        )
        for data, method in dict.fromkeys((row.data, row.method) for row in numbers):
            own_numbers = [row for row in numbers if (row.data, row.method) == (data, method)]
            inside = sum(row.low <= row.true <= row.high for row in own_numbers)
            middle = len(own_numbers) // 2
            error = sorted(abs(row.value / row.true - 1.0) for row in own_numbers)[middle]
            half = sorted(0.5 * (row.high - row.low) / abs(row.true) for row in own_numbers)[middle]
            listed.add_row(f"{data}, {method}", f"{inside} of {len(own_numbers)}", f"{error:.1%}", f"{half:.1%}")
        print_table(listed, out)


def picture(rows: Sequence[Score]) -> str:
    """Draw errors and shares in the 95 % bands over the span, a row of panels for each, as SVG."""
    sets = _of(rows, "data")
    return svg_file(partial(_draw, rows, sets), (2.6 * len(sets) + 1.6, 5.2), salt="identification") + "\n"


def _draw(rows: Sequence[Score], sets: Sequence[str], figure: Figure) -> None:
    panels = figure.subplots(2, len(sets), squeeze=False, sharex=True, sharey="row")
    methods = _of(rows, "method")
    looks: dict[str, dict[str, Any]] = {
        name: {"color": LIGHT[role], "linestyle": line, "marker": ".", "linewidth": 2.2 if name == OURS else 1.2}
        for name, (role, line) in zip(methods, cycle(_LOOKS), strict=False)
    }
    for data, upper, lower in zip(sets, *panels, strict=True):
        for method in _of([row for row in rows if row.data == data], "method"):
            own = [row for row in rows if (row.data, row.method) == (data, method)]
            spans = [*dict.fromkeys(row.span for row in own)]
            errors = summary(rows, data, method, REFERENCE).errors
            inside = [[row.inside_95 for row in own if row.span == span] for span in spans]
            upper.plot(range(len(spans)), [errors[span] for span in spans], **looks[method])
            lower.plot(range(len(spans)), [100.0 * sum(some) / len(some) for some in inside], **looks[method])
        upper.set_yscale("log")
        upper.set_yticks(_RATIOS, [f"{ratio:g}" for ratio in _RATIOS])
        upper.minorticks_off()
        upper.set_title(data, loc="left")
        lower.axhline(95.0, color=LIGHT["muted"], linestyle=":", linewidth=1.0)
        lower.set_xlabel("predicted over")
        lower.set_xticks(range(len(spans)), [_span(span).replace("open loop", "open") for span in spans])
    panels[0, 0].set_ylabel("error / that of no change")
    panels[1, 0].set_ylabel("samples in the 95 % bands (%)")
    lines = [Line2D([], [], **looks[name]) for name in methods]
    figure.legend(lines, methods, loc="outside lower center", ncols=4)
