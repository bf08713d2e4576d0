"""The tables that are printed."""

from math import inf

from rov_fmu.report.console import console, print_table, table
from verification.identification.scores import Table, relative_errors


def _span(span: float) -> str:
    return "open loop" if span == inf else f"{span:g} s"


def print_scores(rows: Table, numbers: Table) -> None:
    """Print a summary of the methods and their errors by quantity for each data set, and the coefficients."""
    out = console()
    for data, own in rows.groupby("data", sort=False):
        errors = relative_errors(own)
        heads = [*map(_span, errors), "in 50%", "in 95%", "least", "CPU s"]
        title = f"{data}: error relative to that of no change (geometric mean), samples in the bands"
        found = table(title, "method", heads, ["of the 95% bands, the one with the least"])
        for method, some in own.groupby("method", sort=False):
            least = some.loc[some.inside_95.idxmin()]
            shares = (some.inside_50.mean(), some.inside_95.mean(), least.inside_95)
            cells = [*(f"{error:.3g}" for error in errors.loc[method]), *(f"{share:.0%}" for share in shares)]
            where = f"{least.quantity}, {_span(least.span)}"
            found.add_row(method, *cells, f"{least.seconds:.1f}", where)
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
