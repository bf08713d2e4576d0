"""The printout of what logs contain."""

from collections.abc import Iterator
from math import isfinite

from rich.table import Table

from rov_fmu.equation.units import in_degrees
from rov_fmu.identify.inspection.inspected import Inspected
from rov_fmu.io.messages import first_of, print_message
from rov_fmu.report.console import console, paragraph, print_table, table, text
from rov_fmu.tank.findings import sentences
from rov_fmu.tank.inspection.inspection import Inspection, Signal

_LEVELS = "▁▂▃▄▅▆▇█"
_ASCII_LEVELS = "_.-~=+*#"
"""The heights of a drawn signal, and what stands for them where the terminal lacks these characters."""
_MOST_GAPS = 3
"""The largest number of gaps of a signal that are listed."""

UNDETERMINED = "What no fit can learn from these logs:"
NOT_ENOUGH = (
    "Not enough is recognised: a log needs times with commands or measurements, and a table needs commands with what "
    "was measured."
)


def print_inspected(inspected: Inspected, *, with_draft: bool = True) -> None:
    """Print what logs cannot determine, and how to log it, then what they contain, and, `with_draft`, lines for
    rov.toml."""
    out = console()
    for line in inspected.warnings:
        print_message(f"rov-fmu: warning: {line}")
    if lines := inspected.undetermined:
        out.print(UNDETERMINED)
        for line in lines:
            paragraph(out, f"- {line}.")
        out.print()
    for inspection in inspected.logs:
        print_inspection(inspection)
    for line in inspected.notes:
        paragraph(out, f"{line}.")
    if with_draft and inspected.text:
        what = f"{inspected.path} lacks these lines" if inspected.own else f"A draft of {inspected.path}"
        paragraph(out, f"{what}; --draft writes them:")
        for line in inspected.text.rstrip().splitlines():
            out.print(f"  {line}", soft_wrap=True)
        out.print()


def print_inspection(inspection: Inspection) -> None:
    """Print the commands and channels of a log, what is not recognised, and what was left out."""
    out = console()
    if inspection.commands or inspection.channels:
        print_table(_rows(inspection))
    else:
        paragraph(out, str(inspection.path))
        paragraph(out, NOT_ENOUGH)
    for heading, lines in {"Not recognised": unrecognised(inspection), "Notes": notes(inspection)}.items():
        if lines:
            out.print()
            out.print(f"{heading}:")
        for line in first_of(lines):
            paragraph(out, f"- {line}")
    out.print()


def unrecognised(inspection: Inspection) -> list[str]:
    """Return a line for everything in a log that is not recognised."""
    return [f"{name}{': ' if what else ''}{what}" for name, what in inspection.unread.items()]


def notes(inspection: Inspection) -> list[str]:
    """Return what headers are taken for, and what was left out, taken or doubted."""
    told = (line.removeprefix(f"{inspection.name}: ") for line in sentences(inspection.findings))
    return [*(f"{title} is taken as {meant}" for title, meant in inspection.columns.items()), *told]


def _rows(inspection: Inspection) -> Table:
    """Return the table of the commands and channels."""
    numbers = ("unit", "samples", "rate [Hz]", "least", "largest")
    found = table(str(inspection.path.with_name(inspection.name)), "", numbers, ("course", "gaps"))
    for row in (*inspection.commands, *inspection.channels):
        *most, gaps = cells(row)
        found.add_row(*most, _drawn(row), gaps)
    return found


def cells(row: Signal) -> tuple[str, ...]:
    """Return the cells about a command or a channel: name, unit, samples, rate, least and largest value, gaps. Angles
    are in degrees."""
    factor, unit = in_degrees(row.unit)
    digits = [text(number, ".4g") for number in (row.rate, factor * row.low, factor * row.high)]
    return row.name, unit, str(row.samples), *digits, ", ".join(_gaps(row))


def _drawn(row: Signal) -> str:
    """Draw the course of a signal between its least and its largest value, with blanks in gaps."""
    means = [value for value in row.course if isfinite(value)]
    low, size = min(means, default=0.0), max(means, default=0.0) - min(means, default=0.0)
    size = 1.0 if size <= 1e-9 * abs(low) else size  # means of equal numbers differ by rounding
    heights = ((value - low) / size for value in row.course)
    levels = _LEVELS if console().encoding.startswith("utf") else _ASCII_LEVELS
    return "".join(levels[min(int(8 * height), 7)] if isfinite(height) else " " for height in heights)


def _gaps(row: Signal) -> Iterator[str]:
    """Yield the first gaps of a signal."""
    for long, start in row.gaps[:_MOST_GAPS]:
        yield f"{long:.3g} s at {start:.4g} s"
    if (more := len(row.gaps) - _MOST_GAPS) > 0:
        yield f"{more} more"
