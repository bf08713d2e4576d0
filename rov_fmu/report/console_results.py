"""The printout of an identification and of a tuning."""

from collections.abc import Container, Iterable, Iterator, Sequence
from math import inf

from rich.console import Console
from rich.table import Table

from rov_fmu.identify.effects.catalogue import EFFECTS
from rov_fmu.identify.findings import by_heading, heading, sentences
from rov_fmu.identify.identification import Comparison, Identification, compare
from rov_fmu.identify.next_test import REPEATED, NextTest
from rov_fmu.identify.recordings.recordings_fit import FittedEffect, count
from rov_fmu.identify.tuning import Tuning
from rov_fmu.io.messages import listed
from rov_fmu.model.layout import AXES
from rov_fmu.report.console import DEVIATION, console, paragraph, print_table, table, text
from rov_fmu.report.findings import Unseen, acting, effects, unseen
from rov_fmu.report.overview import main_errors
from rov_fmu.vehicle.uncertainty import significant, with_interval
from rov_fmu.vehicle.vehicle import Vehicle

_SCREEN = 24
"""The height of the printout on a terminal of 80 columns, in lines, including the line "Next"."""
_FEWEST_COEFFICIENTS, _FEWEST_LINES = 4, 2
"""The least number of printed coefficients, and the number of lines that they need."""
_MOST_WARNINGS = (3, 2, 1)
"""The numbers of warnings that are tried until the printout fits a screen."""
_GAP = (0, 2, 0, 0)
"""The padding of the tables, in columns to the right of each cell."""


def print_identification(identification: Identification) -> None:
    """Print the main results of an identification on one screen; the report has all of them.

    These are the prediction errors, the coefficients with the widest intervals, the other effects, the next test, and
    the warnings.
    """
    out, vehicle = console(), identification.vehicle
    with out.capture() as before:
        paragraph(out, f"{vehicle.name}. {vehicle.source}")
        for found in _predictions(identification):
            out.print()
            print_table(found, out)
    for most in _MOST_WARNINGS:
        with out.capture() as after:
            for line in _conclusions(identification, most):
                paragraph(out, line)
        remaining = _SCREEN - (before.get() + after.get()).count("\n") - 5  # 2 blank lines, a heading, what is next
        if remaining >= _FEWEST_LINES:
            break
    out.file.write(f"{before.get()}\n")  # it has been laid out and escaped already
    _print_coefficients(out, vehicle, remaining)
    out.file.write(f"\n{after.get()}")


def _predictions(identification: Identification) -> Iterator[Table]:
    """Yield the tables of the predictions: of recordings, and of points where an axis has only these."""
    comparisons = compare(identification)
    predicted = [row for row in unseen(identification, comparisons) if row.error is None]
    if predicted:
        yield _of_recordings(predicted)
    if of_points := [c for c in comparisons if not c.result.recordings]:
        yield _of_points(of_points, [identification.against.name] if identification.against else [])


def _print_coefficients(out: Console, vehicle: Vehicle, lines: int) -> None:
    """Print the coefficients with the widest intervals, in columns, on about `lines` lines."""

    def width(name: str) -> float:
        (low, high), value = vehicle.intervals[name], abs(vehicle.rov[name])
        return (high - low) / value if value else inf

    texts = []
    for name in sorted(vehicle.intervals, key=width, reverse=True):
        unit = vehicle.layout.coefficients[name].unit
        value, low, high = with_interval(vehicle.rov[name], vehicle.intervals[name])
        texts.append(f"{name} {value} ({low} to {high}) {'' if unit == '1' else unit}".rstrip())
    lines_of = {n: lines + (n == len(texts)) for n in range(len(texts), _FEWEST_COEFFICIENTS, -1)}  # one more for all
    fitting = (n for n, most in lines_of.items() if n <= most * _columns(texts[:n], out.width))
    shown = texts[: next(fitting, _FEWEST_COEFFICIENTS)]
    columns = _columns(shown, out.width)
    of = f", the {len(shown)} widest of {len(texts)}" if len(shown) < len(texts) else ""
    paragraph(out, f"Identified coefficients with 95 % intervals{of}:" if texts else "No coefficient was identified.")
    grid = Table.grid(padding=_GAP)
    for first in range(0, len(shown), columns):
        grid.add_row(*shown[first : first + columns])
    out.print(grid)


def _columns(texts: Sequence[str], width: int) -> int:
    """Return the largest number of columns in which texts fit side by side, with gaps between them."""
    counts = range(len(texts), 1, -1)
    return next((n for n in counts if sum(2 + max(map(len, texts[k::n])) for k in range(n)) - 2 <= width), 1)


def _conclusions(identification: Identification, most: int) -> Iterator[str]:
    """Yield the paragraphs about other effects, the next test, the first warnings, and the number of further findings
    in the report."""
    kept = dict.fromkeys(e for result in identification.axes for e in effects(result) if e.kept)  # axes share a lag
    if kept:
        yield f"What else acts: {acting_words(kept)}."
    if line := " ".join(_next_tests(identification.next_tests, axes_with_warnings(identification))):
        yield line
    yield from sentences(f for f in identification.findings if f.kind == "axis left out")
    groups = by_heading(identification.findings)
    warnings = groups["Warnings"]
    rest = {"warning": warnings[most:], "doubt": groups["Doubts"], "fact": groups["Facts"]}
    more = listed([count(len(some), what) for what, some in rest.items() if some])
    where = f"{'is' if sum(map(len, rest.values())) == 1 else 'are'} in the report"
    if warnings:
        yield f"Warnings ({more} more {where}):" if more else "Warnings:"
    elif more:
        yield f"{more} {where}."
    for warning in warnings[:most]:
        yield f"- {warning}"


def axes_with_warnings(identification: Identification) -> set[str]:
    """Return the names of the axes that warnings are about; an empty name stands for a warning about no axis."""
    return {finding.axis for finding in identification.findings if heading(finding) == "Warnings"}


def _next_tests(tests: Sequence[NextTest], warned: Container[str]) -> Iterator[str]:
    """Yield sentences about the most useful test, and about axes of which enough is known. `warned` has the axes with
    warnings."""
    if unknown := [test for test in tests if not test.is_known]:
        widest = unknown[0]
        if useful := next((test for test in unknown if test.is_useful), None):
            narrows = f"narrows {useful.coefficient} by {min(1.0 - useful.narrowed, 0.99):.0%}"
            why = narrows if useful.interval else f"determines {useful.coefficient}"
            once = ", once the warnings are settled" if useful.axis.name in warned else ""
            yield f"To measure next{once}: {useful.axis.name}: {useful.words} ({why})."
        else:
            yield "To measure next: no step within the limits would narrow an interval by a tenth; the widest"
            yield f"is that of {widest.coefficient}."
    if known := [test.axis.name for test in tests if test.is_known and test.axis.name not in warned]:
        yield f"Enough is known of {listed(known)}."
    if doubtful := [test.axis.name for test in tests if test.is_known and test.axis.name in warned]:
        yield f"The intervals of {listed(doubtful)} are narrow enough, but check the warnings first."
    if drifting := [test.axis.name for test in tests if test.repeat]:
        yield f"In {listed(drifting)}: {REPEATED}."


def acting_words(kept: Iterable[FittedEffect]) -> str:
    """Return the other effects that were kept, in words, with the value along each axis and in single recordings."""
    values: dict[str, list[str]] = {}
    for effect in kept:
        value, *_ = with_interval(effect.value, effect.interval)
        unit = "" if effect.unit == "1" else f" {effect.unit}"
        amount = f"{value}{unit}"
        if EFFECTS[effect.kind].sentence_of_file and effect.of not in AXES:  # it adds to the value of the axis
            amount = f"{value.lstrip('-')}{unit} {'less' if effect.value < 0.0 else 'more'}"
        of = f"{effect.axis} in {effect.of}" if effect.axis else effect.of
        values.setdefault(acting(effect), []).append(f"{of} {amount}")
    return "; ".join(f"{words} ({', '.join(some)})" for words, some in values.items())


def _of_recordings(found: Sequence[Unseen]) -> Table:
    """Return the table of the errors of predictions of recordings that the model was not fitted to."""
    numbers = ("error", "no change", "noise")
    title = (
        "RMS errors of predictions of unseen data, compared with a prediction of no change and with the sensor's noise"
    )
    result = table(title, "", numbers, ("of",))
    result.box, result.padding = None, _GAP
    for row in found:
        if not row.errors:
            result.add_row(row.axis.name, *("-" for _ in numbers), f"{row.what}: {row.by}")
    for row, e in main_errors(found):
        values = (f"{significant(value, 2)} {e.unit}" for value in (e.predicted, e.unchanged, e.noise))
        result.add_row(f"{row.axis.name} {e.of}, {e.span.removesuffix(' recording')}", *values, row.what)
    return result


def _of_points(comparisons: Iterable[Comparison], other: Sequence[str]) -> Table:
    """Return the table of the RMS errors of points, by each model."""
    found = table("Relative errors of the points, RMS", "", ("model", "leave-one-out", *other))
    found.box, found.padding = None, _GAP
    found.caption = "leave-one-out: prediction by a fit without the points of the same thrust."
    for c in comparisons:
        found.add_row(f"{c.result.axis.name} {c.quantity}", *(text(c.rms(column), ".1%") for column in c.columns))
    return found


def _against(value: float, measured: float) -> tuple[str, str]:
    """Return the cells for a value of a model and its deviation from the measured value."""
    return text(value, ".4f"), text(round(value / measured - 1.0, 3) + 0.0, DEVIATION)  # + 0.0 makes 0.0 of -0.0


def print_tuning(tuning: Tuning) -> None:
    """Print α and β, the response at the wanted points, and the inputs of these commands."""
    out = console()
    for kind in ("alpha", "beta"):
        name = tuning.axis.coefficient(kind)
        interval = tuning.estimate.intervals.get(name) if tuning.estimate else None
        value, low, high = with_interval(tuning.rov[name], interval, digits=6)
        out.print(f"{name} = {value}" + (f"   95 %: {low} ... {high}" if interval else ""))
    result = table("", "command", ("quantity", "wanted", "model", "dev."))
    for p, value in zip(tuning.points, tuning.model.tolist(), strict=True):
        result.add_row(f"{p.command:.0%}", p.quantity, f"{p.value:.4g}", *_against(value, p.value))
    print_table(result)
    layout = tuning.rov.layout
    for command in dict.fromkeys(p.command for p in tuning.points):
        inputs = ", ".join(f"{name} = {value:g}" for name, value in layout.driving(tuning.axis, command).items())
        paragraph(out, f"A command of {command:.0%} of {tuning.axis.name}: {inputs}")
    for curve in {thruster.curve: layout.curve_of[thruster.name] for thruster in layout.drivers(tuning.axis)}.values():
        if curve.has_lag:
            T = tuning.rov[curve.coefficient("T")]
            out.print(f"Tau is that of steady thrust; the lag of curve {curve.name}, T = {T:g} s, comes on top")
