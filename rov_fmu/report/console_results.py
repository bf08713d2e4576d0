"""The printout of an identification and of a tuning."""

from collections.abc import Iterator, Sequence
from math import inf

from rich.table import Table

from rov_fmu.identify.findings import answer_at, by_heading, in_words, relative_error, size_in_words
from rov_fmu.identify.result import AxisResult, Identification, Interval, Prediction
from rov_fmu.identify.tuning import Tuning
from rov_fmu.io.messages import listed
from rov_fmu.report.console import DEVIATION, console, paragraph, print_table, table, text
from rov_fmu.vehicle.uncertainty import with_interval

_SCREEN = 24
"""The height of the printout on a terminal of 80 columns, in lines, including what follows it."""
_FOLLOWING = 2
"""The lines of what follows: the files that were written, and what to do next."""
_MOST_WARNINGS = (4, 3, 2, 1)
"""The numbers of warnings that are tried until the printout fits a screen."""


def print_identification(identification: Identification) -> None:
    """Print the main results of an identification on one screen; the report has all of them.

    An owner's questions come first: whether to trust the model of each axis, how fast the vehicle is, how long it takes
    to get there and to stop, and how well motion is predicted that the fit had not seen.
    """
    out, vehicle = console(), identification.vehicle
    with out.capture() as before:
        paragraph(out, f"{vehicle.name}. {vehicle.source}")
        for found in (_answers(identification.axes), _errors(identification.axes)):
            if found.rows:
                out.print()
                print_table(found, out)
        out.print()
    for most in _MOST_WARNINGS:
        with out.capture() as after:
            for line in _conclusions(identification, most):
                paragraph(out, line)
        if (before.get() + after.get()).count("\n") + _FOLLOWING <= _SCREEN:
            break
    out.file.write(before.get() + after.get())  # it has been laid out and escaped already


def _answers(axes: Sequence[AxisResult]) -> Table:
    """Return the table of what an owner asks about each axis."""
    found = _plain("", "V_ss at 30%", "V_ss at 50%", "time to it", "way to stop")
    for result in axes:
        axis, weak, half = result.axis, answer_at(result, 0.3), answer_at(result, 0.5)
        speeds = [_with_error(answer.steady if answer else None, axis.unit) for answer in (weak, half)]
        rise, stop = (half.rise, half.stop) if half else (None, None)
        others = [_with_error(rise, "s"), _with_error(stop, axis.position_unit)]
        found.add_row(f"{axis.name}: {result.verdict.word}", *speeds, *others)
    found.caption = "Time to 63% of V_ss at 50%; way from it to a tenth without thrust; ±: 95%."
    return found


def _errors(axes: Sequence[AxisResult]) -> Table:
    """Return the table of the errors of predictions of data that the fit had not seen."""
    found = _plain("Unseen data, RMS", "error", "no change", "noise", "in 95% bands")
    for result in axes:
        if p := result.main:
            sizes = (size_in_words(size, p.unit) for size in (p.error, p.unchanged, p.noise))
            found.add_row(_name(p), *sizes, text(result.coverage, ".0%"))
        for quantity in () if result.main else ("V_ss", "Tau"):
            if points := [p for p in result.points if p.quantity == quantity and p.counts]:
                error = text(relative_error(points, "held_out"), ".1%")
                found.add_row(f"{result.axis.name} {quantity}, {len(points)} points", error, "-", "-", "-")
    return found


def _plain(first: str, *numbers: str) -> Table:
    """Return an empty table without lines, which saves rows of the screen."""
    found = table("", first, numbers)
    found.box, found.padding = None, (0, 2, 0, 0)
    return found


def _with_error(known: tuple[float, Interval] | None, unit: str) -> str:
    """Return a value with half the width of its interval relative to it, such as `0.62 m/s ±2%`."""
    if not (known and 0.0 < abs(known[0]) < inf):
        return "-"
    value, interval = known
    half = max(0.01, *(abs(end / value - 1.0) for end in interval))
    words, _, _ = in_words(value, (value * (1.0 - half), value * (1.0 + half)), unit).partition(" (")
    return f"{words} ±{half:.0%}" if half < 1.0 else f"{words} ±>100%"


def _name(p: Prediction) -> str:
    """Return the name of a prediction: `heave depth, 10 s ahead`."""
    quantity = p.quantity if p.axis.name in p.quantity else f"{p.axis.name} {p.quantity}"
    return quantity if p.span == inf else f"{quantity}, {p.span:g} s ahead"


def _conclusions(identification: Identification, most: int) -> Iterator[str]:
    """Yield the paragraphs about other effects, the first warnings, the number of further findings in the report, and
    the next test."""
    if kept := [effect for effect in identification.effects if effect.kept]:
        words = (f"{e.name} ({f'{e.of} {size_in_words(e.value, e.unit)}'.strip()})" for e in kept)
        yield f"What else acts: {', '.join(words)}."
    groups = by_heading(identification.findings)
    warnings = groups["Warnings"]
    rest = {"warning": warnings[most:], "doubt": groups["Doubts"], "fact": groups["Facts"]}
    more = listed([f"{len(some)} {what}{'s' * (len(some) > 1)}" for what, some in rest.items() if some])
    if warnings:
        yield f"Warnings ({more} more in the report):" if more else "Warnings:"
    elif more:
        yield f"No warnings; {more} in the report."
    yield from (f"- {warning}" for warning in warnings[:most])
    tests = [result.next_test for result in identification.axes if result.next_test]
    if useful := [test for test in tests if test.is_useful]:
        best = max(useful, key=lambda test: test.now)
        narrows = f"{best.target}, now ±{best.now:.0%}, becomes ±{best.then:.0%}"
        yield f"To measure next: {best.axis.name}: {best.words} ({narrows})."
    elif tests:
        yield "To measure next: no test would narrow an interval by a tenth."


def _against(value: float, measured: float) -> tuple[str, str]:
    """Return the cells for a value of a model and its deviation from the measured value."""
    return text(value, ".4f"), text(round(value / measured - 1.0, 3) + 0.0, DEVIATION)  # + 0.0 makes 0.0 of -0.0


def print_tuning(tuning: Tuning) -> None:
    """Print α and β, the response at the wanted points, and the inputs of these commands."""
    out = console()
    for kind in ("alpha", "beta"):
        name = tuning.axis.coefficient(kind)
        interval = tuning.intervals.get(name)
        value, low, high = with_interval(tuning.vehicle[name], interval, digits=6)
        out.print(f"{name} = {value}" + (f"   95 %: {low} ... {high}" if interval else ""))
    result = table("", "command", ("quantity", "wanted", "model", "dev."))
    for p in tuning.points:
        result.add_row(
            f"{p.command:.0%}", p.quantity, f"{p.value:.4g}", *_against(p.by(tuning.vehicle, tuning.axis), p.value)
        )
    print_table(result)
    layout = tuning.vehicle.layout
    for command in dict.fromkeys(p.command for p in tuning.points):
        inputs = ", ".join(f"{name} = {value:g}" for name, value in layout.driving(tuning.axis, command).items())
        paragraph(out, f"A command of {command:.0%} of {tuning.axis.name}: {inputs}")
    for curve in {thruster.curve: layout.curve_of[thruster.name] for thruster in layout.drivers(tuning.axis)}.values():
        if curve.has_lag:
            T = tuning.vehicle[curve.coefficient("T")]
            out.print(f"Tau is that of steady thrust; the lag of curve {curve.name}, T = {T:g} s, comes on top")
