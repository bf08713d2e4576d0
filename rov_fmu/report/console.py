"""The console that the commands print on, its tables, and the printout of the paper's tables and of a proof."""

from collections.abc import Iterable, Iterator, Sequence
from decimal import Decimal
from math import isnan
from typing import TYPE_CHECKING

from rich import box
from rich.console import Console
from rich.table import Table

from rov_fmu.vehicle.published import Cell, ResponseTable
from rov_fmu.vehicle.vehicle import Vehicle

if TYPE_CHECKING:
    from rov_fmu.fmu.proof import Finding

DEVIATION = "+.1%"
"""The format of a relative deviation."""
_WIDE = 110
"""The width of tables in a pipe or a file, and of those that a terminal is too narrow for."""


def console(*, stderr: bool = False) -> Console:
    """Return a console that prints text without markup, as wide as the terminal."""
    found = Console(stderr=stderr, markup=False, highlight=False, emoji=False)
    if not found.is_terminal:
        found.width = max(found.width, _WIDE)  # Rich assumes 80 columns
    return found


def paragraph(out: Console, words: str) -> None:
    """Print a paragraph. A terminal gets lines that end between words; a pipe or a file gets one line."""
    out.print(words, soft_wrap=not out.is_terminal)


def print_table(found: Table) -> None:
    """Print a table. It is wider than the terminal where digits would be cut off otherwise."""
    out = console()
    with out.capture() as drawn:
        out.print(found)
    if "…" in drawn.get():
        out.width = max(out.width, _WIDE)
    out.print(found)


def print_tables(vehicle: Vehicle, tables: Iterable[ResponseTable]) -> None:
    """Print Tables 6-8 of the paper beside the values computed for the vehicle."""
    out = console()
    paragraph(out, f"{vehicle.name}. {vehicle.source}")
    for t in tables:
        out.print()
        print_table(_side_by_side(vehicle, t))
    out.print(
        "\nnon-linear: every alpha and beta is 1; scaled: those of the vehicle file; computed in closed form.\n"
        "dev.: the computed value against the printed one; under test, the scaled model against the test.\n"
        "*: the printed value is not the computed one rounded to its digits. -: not printed, not measured."
    )


def print_proof(findings: "Sequence[Finding]") -> None:
    """Print how far each variable of each experiment deviates from its expected values."""
    found = table("", "experiment", (), ("variable",))
    for header in ("deviation", "tolerance"):
        found.add_column(header, justify="right", no_wrap=True)
    found.add_column("")
    for f in findings:
        found.add_row(
            f.experiment,
            f.variable,
            text(f.deviation, ".1e"),
            text(f.tolerance, ".1e"),
            "pass" if f.passed else f"FAIL {f.error}",
        )
    print_table(found)
    passed = sum(f.passed for f in findings)
    console().print(f"\n{passed} of {len(findings)} pass. Deviations are relative to the largest expected value.")


def _side_by_side(vehicle: Vehicle, t: ResponseTable) -> Table:
    """Return a published table with the printed, computed and measured values side by side."""
    values = ", ".join(f"{name} = {vehicle.rov[name]:g}" for name in map(t.axis.coefficient, ("alpha", "beta")))
    compared = [f"{model}\nprinted|\ncomputed|\ndev." for model in ("non-linear", "scaled")]
    headers = "|".join([*compared, "test\nmeasured|\ndev."]).split("|")
    result = table(f"Table {t.number}. {t.axis.name.capitalize()}, {values}", "\ncommand", headers)
    for quantity, unit in (("V_ss", t.axis.unit), ("Tau", "s")):
        result.add_section()
        result.add_row(f"{quantity} [{unit}]")
        for row in t.rows:
            scaled: Cell = getattr(row.scaled, quantity)
            result.add_row(
                f"{row.command} %",
                *_model(getattr(row.non_linear, quantity)),
                *_model(scaled),
                text(scaled.measured),
                text(scaled.from_measured, DEVIATION),
            )
    return result


def _model(cell: Cell) -> Iterator[str]:
    """Yield the printed value, the computed value and their deviation."""
    yield text(cell.printed)
    yield f"{cell.computed:.4f}"
    yield text(cell.from_printed, DEVIATION) + (" " if cell.rounds_to_printed else "*")


def table(title: str, first: str, numbers: Iterable[str], texts: Iterable[str] = ()) -> Table:
    """Return an empty table with a first column, then columns of numbers, then columns of texts."""
    result = Table(
        title=title,
        title_justify="left",
        caption_justify="left",
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
        show_edge=False,
    )
    result.add_column(first, no_wrap=True)
    for header in numbers:
        result.add_column(header, justify="right", no_wrap=True)
    for header in texts:
        result.add_column(header)
    return result


def text(value: float | Decimal | None, form: str = "") -> str:
    """Return a number in a format, or a dash for None and NaN."""
    return "-" if value is None or isnan(value) else format(value, form)
