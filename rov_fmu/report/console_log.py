"""The printout of the content of a log."""

from collections.abc import Iterator

from rich.table import Table

from rov_fmu.io.messages import first_of
from rov_fmu.report.console import console, paragraph, print_table, table, text
from rov_fmu.tank.columns import in_degrees
from rov_fmu.tank.findings import SENTENCES, sentences
from rov_fmu.tank.inspection.inspection import Inspection, Row

_MOST_GAPS = 3
"""The largest number of gaps of a signal that are listed."""

_NOT_ENOUGH = (
    "Not enough is recognised: a log needs times with commands or measurements, and a table needs commands with what "
    "was measured."
)


def print_inspection(inspection: Inspection) -> None:
    """Print the commands and channels of a log, what is not recognised, and what was left out."""
    out = console()
    if inspection.commands or inspection.channels:
        print_table(_rows(inspection))
    else:
        paragraph(out, str(inspection.path))
        paragraph(out, _NOT_ENOUGH)
    for heading, lines in {
        "Not recognised": [f"{name}{': ' if what else ''}{what}" for name, what in inspection.unread.items()],
        "Notes": [
            *(f"{title} is taken as {meant}" for title, meant in inspection.columns.items()),
            *(line.removeprefix(f"{inspection.name}: ") for line in sentences(inspection.findings, SENTENCES)),
        ],
    }.items():
        if lines:
            out.print()
            out.print(f"{heading}:")
        for line in first_of(lines):
            paragraph(out, f"- {line}")
    out.print()


def _rows(inspection: Inspection) -> Table:
    """Return the table of the commands and channels; angles are in degrees."""
    numbers = ("unit", "samples", "rate [Hz]", "least", "largest")
    found = table(str(inspection.path.with_name(inspection.name)), "", numbers, ("gaps",))
    for row in (*inspection.commands, *inspection.channels):
        factor, unit = in_degrees(row.unit)
        digits = [text(number, ".4g") for number in (row.rate, factor * row.low, factor * row.high)]
        found.add_row(row.name, unit, str(row.samples), *digits, ", ".join(_gaps(row)))
    return found


def _gaps(row: Row) -> Iterator[str]:
    """Yield the first gaps of a signal, with times from its first sample."""
    for start, end in row.gaps[:_MOST_GAPS]:
        yield f"{end - start:.3g} s at {start - row.start:.4g} s"
    if (more := len(row.gaps) - _MOST_GAPS) > 0:
        yield f"{more} more"
