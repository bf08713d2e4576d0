"""The printout of an identification and of a tuning."""

from collections.abc import Iterator, Sequence

from rich.table import Table

from rov_fmu.identify.findings import (
    SHARES,
    STOPPING,
    answer_at,
    by_heading,
    driven_aside,
    effect_or_range,
    extrapolated,
    next_tests,
    prediction_name,
    repairs,
    result_sentences,
    size_in_words,
    tested_in_words,
    with_error,
    with_lag,
)
from rov_fmu.identify.result import Answer, AxisResult, Identification, Tested, is_extrapolated, relative_error
from rov_fmu.identify.tuning import Tuning
from rov_fmu.io.numbers import with_interval
from rov_fmu.report.console import DEVIATION, console, paragraph, print_table, table, text


def print_identification(identification: Identification) -> None:
    """Print the main results of an identification; the report has all of them.

    An owner's questions come first: whether to trust the model of each axis, how fast the vehicle is, how long it takes
    to get there and to stop, and how well motion is predicted that the fit had not seen.
    """
    out, vehicle = console(), identification.vehicle
    for words in result_sentences(identification.findings, "assumed vehicle"):
        paragraph(out, f"Assumed: {words}.")
    paragraph(out, f"{vehicle.name}. {vehicle.source}")
    for words in repairs(identification):
        paragraph(out, f"First: {words}")
    for axis, verdict in identification.verdicts.items():
        paragraph(out, f"- {verdict.of(axis)}{' To do: ' if verdict.remedy else ''}{verdict.remedy}")
    asides = [*with_lag(identification), *driven_aside(identification), *extrapolated(identification)]
    for shown, lines in ((_answers(identification.axes), asides), (_errors(identification.axes), [])):
        if shown.rows:
            out.print()
            print_table(shown, out)
        for line in lines:
            paragraph(out, f"- {line}")
    out.print()
    for line in _conclusions(identification):
        paragraph(out, line)


def _answers(axes: Sequence[AxisResult]) -> Table:
    """Return the table of what an owner asks about each axis."""
    numbers = ["tested", *(f"speed at {share:.0%}" for share in SHARES), "time at 50%", "stopping from 50%"]
    shown = table("What to expect, with 95% intervals", "", numbers)
    for result in axes:
        axis, half = result.axis, answer_at(result, 0.5)
        told = [(answer_at(result, share), "steady", axis.unit) for share in SHARES]
        told += [(half, "rise", "s"), (half, "stop", axis.position_unit)]
        cells = [_known(*one, result.tested) for one in told]
        tested = tested_in_words(result.tested).removeprefix("from ")
        shown.add_row(f"{axis.positive} ({axis.name})", tested, *cells)
    shown.caption = f"{STOPPING} Numbers in brackets are for commands beyond the tested ones."
    return shown


def _known(answer: Answer | None, part: str, unit: str, tested: Tested) -> str:
    """Return a number with its error, in brackets where the verdict does not judge it."""
    if not answer:
        return "-"
    words = with_error(getattr(answer, part), unit)
    return f"({words})" if is_extrapolated(answer.command, tested) else words


def _errors(axes: Sequence[AxisResult]) -> Table:
    """Return the table of the errors of predictions of data that the fit had not seen."""
    shown = table("", "Unseen data, RMS", ("error", "no change", "noise"))
    for result in axes:
        if p := result.main:
            shown.add_row(
                prediction_name(p), *(size_in_words(size, p.unit) for size in (p.error, p.unchanged, p.noise))
            )
        for quantity in () if result.main else ("V_ss", "Tau"):
            if points := [p for p in result.points if p.quantity == quantity and p.counts]:
                error = text(relative_error(points, "held_out"), ".1%")
                shown.add_row(f"{result.axis.name} {quantity}, {len(points)} points", error, "-", "-")
    return shown


def _conclusions(identification: Identification) -> Iterator[str]:
    """Yield the paragraphs about other effects, warnings, unread files, how many other findings there are, and the next
    test."""
    if kept := [effect for effect in identification.effects if effect.kept]:
        words = (f"{e.name} ({f'{e.of} {effect_or_range(e)}'.strip()})" for e in kept)
        yield f"What else acts: {', '.join(words)}."
    for kind in ("rests", "assumed thrust"):
        yield from (f"{sentence}." for sentence in result_sentences(identification.findings, kind))
    groups = by_heading(identification.findings)
    yield "Warnings:" if groups["Warnings"] else "No warnings."
    yield from (f"- {warning}" for warning in groups["Warnings"])
    others = result_sentences(identification.findings, "other files")
    yield from others
    for kind in ("rests", "assumed thrust", "assumed vehicle"):
        others += result_sentences(identification.findings, kind)
    if rest := sum(len(groups[name]) for name in ("Doubts", "Facts")) - len(others):
        yield f"--report shows {rest} more doubts and facts." if rest > 1 else "--report shows one more doubt or fact."
    yield from (f"To measure next: {test}" for test in next_tests(identification))


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
        model = p.by(tuning.vehicle, tuning.axis)
        deviation = text(model / p.value - 1.0, DEVIATION)
        result.add_row(f"{p.command:.0%}", p.quantity, f"{p.value:.4g}", text(model, ".4f"), deviation)
    print_table(result)
    layout = tuning.vehicle.layout
    for command in dict.fromkeys(p.command for p in tuning.points):
        inputs = ", ".join(f"{name} = {value:g}" for name, value in layout.commands_along(tuning.axis, command).items())
        paragraph(out, f"A command of {command:.0%} of {tuning.axis.name}: {inputs}")
    for curve in {
        thruster.curve: layout.curve_of[thruster.name] for thruster in layout.thrusters_along(tuning.axis)
    }.values():
        if curve.has_lag:
            T = tuning.vehicle[curve.coefficient("T")]
            out.print(f"Tau is that of steady thrust; the lag of curve {curve.name}, T = {T:g} s, comes on top")
