"""The printout of an identification and of a tuning."""

from collections.abc import Iterable, Iterator, Sequence

from rich.table import Table

from rov_fmu.identify.identification import Comparison, Identification, compare
from rov_fmu.identify.next_test import REPEATED, NextTest
from rov_fmu.identify.recordings.recordings_fit import FittedEffect
from rov_fmu.identify.tuning import Tuning
from rov_fmu.report.console import DEVIATION, console, paragraph, print_table, table, text
from rov_fmu.report.findings import Unseen, acting, effects, unseen
from rov_fmu.vehicle.uncertainty import with_interval
from rov_fmu.vehicle.vehicle import Vehicle


def print_identification(identification: Identification) -> None:
    """Print the results of an identification, the most important first; the report has all of them.

    These are the prediction errors, the identified coefficients, the other effects, the next tests, and the findings.
    """
    out, vehicle = console(), identification.vehicle
    paragraph(out, f"{vehicle.name}. {vehicle.source}")
    for found in _tables(identification, compare(identification)):
        out.print()
        print_table(found)
    given = [name for name in vehicle.layout.coefficients if name not in vehicle.intervals]
    if given:
        paragraph(out, f"\nGiven or assumed: {', '.join(given)}.")
    if identification.next_tests:
        out.print("\nTo measure next:")
    for test in identification.next_tests:
        for line in _next_test(test, vehicle.rov[test.coefficient]):
            paragraph(out, f"- {test.axis.name}: {line}")
    if identification.warnings:
        out.print("\nNot identifiable, or against the model:")
    for warning in identification.warnings:
        paragraph(out, f"- {warning}")


def _tables(identification: Identification, comparisons: Sequence[Comparison]) -> Iterator[Table]:
    """Yield the tables of the predictions, of the coefficients, of the other effects, and of the points."""
    predicted = list(unseen(identification, comparisons))
    if of_recordings := [row for row in predicted if row.error is None]:
        yield _predicted(of_recordings)
    if of_points := [row for row in predicted if row.error is not None]:
        yield _predicted_points(of_points)
    yield _coefficients(identification.vehicle)
    kept = dict.fromkeys(e for result in identification.axes for e in effects(result) if e.kept)  # axes share a lag
    if kept:
        yield _effects(kept)
    if comparisons:
        yield _summary(comparisons, [identification.against.name] if identification.against else [])


def _next_test(test: NextTest, value: float) -> Iterator[str]:
    """Yield the lines about a test to make next, or that none is needed; `value` is that of its coefficient."""
    _, low, high = with_interval(value, test.interval)
    now = f"now {low} ... {high}" if test.interval else "not identifiable yet"
    if test.is_known:
        yield f"enough is known; the widest interval is that of {test.coefficient}, {now}"
    elif not test.is_useful:
        yield f"no step within the limits would narrow the widest interval by a tenth ({test.coefficient}, {now})"
    else:
        then = f"; then {1.0 - test.narrowed:.0%} narrower" if test.interval else ""
        yield f"{test.words} ({test.coefficient}, {now}{then})"
    if test.repeat:
        yield REPEATED


def _predicted(found: Iterable[Unseen]) -> Table:
    """Return the table of how far predictions of recordings are off that the model was not fitted to."""
    numbers = ("off by", "no change", "noise", "explained")
    result = table("Prediction of recordings by fits to the others, RMS", "", numbers, ("of",))
    result.caption = (
        "no change: by a model whose position or velocity stays. noise: the sensor's own. explained: of the change "
        "beyond the noise."
    )
    for row in found:
        if not row.errors:
            result.add_row(row.axis.name, *("-" for _ in numbers), f"{row.what}: {row.by}")
        for e in row.errors:
            values = (f"{float(f'{value:.2g}'):g} {e.unit}" for value in (e.predicted, e.unchanged, e.noise))
            span = e.span.removesuffix(" recording")
            result.add_row(f"{row.axis.name} {e.of}, {span}", *values, text(e.explained, ".1%"), row.what)
    return result


def _predicted_points(found: Iterable[Unseen]) -> Table:
    """Return the table of how far predictions of points are off that the model was not fitted to."""
    result = table("Prediction of points that were not fitted, relative RMS", "axis", ("off by",), ("of",))
    for row in found:
        result.add_row(row.axis.name, text(row.error, ".1%"), f"{row.what}, {row.by}")
    return result


def _effects(kept: Iterable[FittedEffect]) -> Table:
    """Return the table of the other effects that were kept."""
    found = table("What else acts", "of", ("value", "95 % from", "to", "unit"), ("",))
    for effect in kept:
        unit = "" if effect.unit == "1" else effect.unit
        found.add_row(effect.of, *with_interval(effect.value, effect.interval), unit, acting(effect))
    return found


def _coefficients(vehicle: Vehicle) -> Table:
    """Return the table of the identified coefficients with their intervals."""
    result = table("Identified coefficients", "name", ("value", "95 % from", "to", "unit"))
    for name, interval in vehicle.intervals.items():
        unit = vehicle.layout.coefficients[name].unit
        result.add_row(name, *with_interval(vehicle.rov[name], interval), "" if unit == "1" else unit)
    return result


def _summary(comparisons: Iterable[Comparison], other: Sequence[str]) -> Table:
    """Return the table of the RMS errors of all points, by each model."""
    found = table("Points, RMS of the relative errors", "", ("model", "leave-\none-out", *other))
    found.caption = "leave-one-out: by a fit without the points of the same thrust."
    for c in comparisons:
        found.add_row(f"{c.result.axis.name} {c.quantity}", *(text(c.rms(column), ".4f") for column in c.columns))
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
