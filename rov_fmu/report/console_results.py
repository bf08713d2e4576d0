"""The printout of an identification and of a tuning."""

from collections.abc import Iterable, Iterator, Sequence

from rich.table import Table

from rov_fmu.identify.identification import AxisResult, Comparison, Identification, compare
from rov_fmu.identify.next_test import REPEATED, NextTest
from rov_fmu.identify.recordings.recordings_fit import Effect
from rov_fmu.identify.tuning import Tuning
from rov_fmu.report.console import DEVIATION, console, table, text
from rov_fmu.report.findings import Unseen, acting, effects, unseen
from rov_fmu.vehicle.vehicle import Vehicle

_LEAVE_ONE_OUT = "leave-\none-out"
_MOST_STEPS = 20
"""The most held commands of an axis in the printout."""


def print_identification(identification: Identification) -> None:
    """Print the results of an identification, the most important first.

    These are the prediction errors, the coefficients, the other effects and the next tests; then the held commands, the
    points and the warnings.
    """
    out, vehicle = console(), identification.vehicle
    out.print(f"{vehicle.name}. {vehicle.source}", soft_wrap=True)
    comparisons = compare(identification)
    other = [identification.against.name] if identification.against else []
    for found in _first_tables(identification, comparisons):
        out.print()
        out.print(found)
    if identification.next_tests:
        out.print("\nTo measure next:")
    for test in identification.next_tests:
        for line in _next_test(test):
            out.print(f"- {test.axis.name}: {line}", soft_wrap=True)
    for found in _detailed_tables(identification, comparisons, other):
        out.print()
        out.print(found)
    out.print(
        "\nno change: by a model whose position or velocity stays. noise: the sensor's own. explained: of the change "
        "beyond the noise.\n"
        "dev.: relative to the measured value. leave-one-out: by a fit without the points of the same thrust.\n"
        "(weight 0): not fitted, and not counted in the RMS. interval: 95 % confidence."
    )
    if identification.warnings:
        out.print("\nNot identifiable, or against the model:")
    for warning in identification.warnings:
        out.print(f"- {warning}", soft_wrap=True)


def _first_tables(identification: Identification, comparisons: Sequence[Comparison]) -> Iterator[Table]:
    """Yield the tables of the predictions, of the coefficients and of the other effects."""
    predicted = list(unseen(identification, comparisons))
    if of_recordings := [row for row in predicted if row.error is None]:
        yield _predicted(of_recordings)
    if of_points := [row for row in predicted if row.error is not None]:
        yield _predicted_points(of_points)
    yield _coefficients(identification.vehicle)
    kept = dict.fromkeys(e for result in identification.axes for e in effects(result) if e.kept)  # axes share a lag
    if kept:
        yield _effects(kept)


def _next_test(test: NextTest) -> Iterator[str]:
    """Yield the lines about a test to make next, or that none is needed."""
    now = "now {:.3g} ... {:.3g}".format(*test.interval) if test.interval else "not identifiable yet"
    if test.is_known:
        yield f"enough is known; the widest interval is that of {test.coefficient}, {now}"
    elif not test.is_useful:
        yield f"no step within the limits would narrow the widest interval by a tenth ({test.coefficient}, {now})"
    else:
        then = f"; then {1.0 - test.narrowed:.0%} narrower" if test.interval else ""
        yield f"{test.words} ({test.coefficient}, {now}{then})"
    if test.repeat:
        yield REPEATED


def _detailed_tables(
    identification: Identification, comparisons: Sequence[Comparison], other: Sequence[str]
) -> Iterator[Table]:
    """Yield the tables of the held commands, of the points, and of the RMS errors."""
    for result in identification.axes:
        if result.steps:
            yield _steps(result)
    for comparison in comparisons:
        yield _points(comparison, other)
    if comparisons:
        yield _summary(comparisons, other)


def _predicted(found: Iterable[Unseen]) -> Table:
    """Return the table of how far predictions of recordings are off that the model was not fitted to."""
    numbers = ("off by", "no change", "noise", "explained")
    result = table("Prediction of recordings by fits to the others, RMS", "", numbers, ("of",))
    for row in found:
        if not row.errors:
            result.add_row(row.axis.name, *("-" for _ in numbers), f"{row.what}: {row.by}")
        for e in row.errors:
            values = (f"{float(f'{value:.2g}'):g} {e.unit}" for value in (e.predicted, e.unchanged, e.noise))
            result.add_row(f"{row.axis.name} {e.of}, {e.span}", *values, text(e.explained, ".1%"), row.what)
    return result


def _predicted_points(found: Iterable[Unseen]) -> Table:
    """Return the table of how far predictions of points are off that the model was not fitted to."""
    result = table("Prediction of points that were not fitted, relative RMS", "axis", ("off by",), ("of",))
    for row in found:
        result.add_row(row.axis.name, text(row.error, ".1%"), f"{row.what}, {row.by}")
    return result


def _effects(kept: Iterable[Effect]) -> Table:
    """Return the table of the other effects that were kept."""
    found = table("What else acts", "of", ("value", "95 % from", "to", "unit"), ("",))
    for effect in kept:
        low, high = (f"{end:.4g}" for end in effect.interval) if effect.interval else ("", "")
        unit = "" if effect.unit == "1" else effect.unit
        found.add_row(effect.of, f"{effect.value:.4g}", low, high, unit, acting(effect))
    return found


def _coefficients(vehicle: Vehicle) -> Table:
    """Return the table of all coefficients with their intervals and sources."""
    result = table("Coefficients", "name", ("value", "95 % from", "to", "unit"), ("source",))
    for name, meta in vehicle.layout.coefficients.items():
        low, high = (f"{end:.5g}" for end in vehicle.intervals[name]) if name in vehicle.intervals else ("", "")
        result.add_row(name, f"{vehicle.rov[name]:.5g}", low, high, meta.unit, vehicle.sources[name])
    return result


def _steps(result: AxisResult) -> Table:
    """Return the table of the held commands in the recordings of an axis."""
    headers = ("from s", "to s", "command", f"V_ss [{result.axis.unit}]", "+-", "Tau [s]", "+-")
    found = table(f"{result.axis.name.capitalize()}: held commands of the recordings", "file", headers, ("",))
    for s in result.steps[:_MOST_STEPS]:
        held = s.file, f"{s.start:.1f}", f"{s.end:.1f}", f"{s.command:.0%}"
        V_ss, Tau = (text(s.V_ss, ".4f"), text(s.V_ss_error, ".1g")), (text(s.Tau, ".4f"), text(s.Tau_error, ".1g"))
        found.add_row(*held, *V_ss, *Tau, s.note)
    if (more := len(result.steps) - _MOST_STEPS) > 0:
        found.add_row(f"and {more} more: --report lists them all")
    return found


def _points(comparison: Comparison, other: Sequence[str]) -> Table:
    """Return the table of the measured points of one quantity beside the models."""
    axis, quantity = comparison.result.axis, comparison.quantity
    names = [name for model in ("model", _LEAVE_ONE_OUT, *other) for name in (model, "dev.")]
    title = f"{axis.name.capitalize()}: {quantity} [{'s' if quantity == 'Tau' else axis.unit}]"
    found = table(title, "command", ("measured", *names), ("source",))
    for n, p in enumerate(comparison.points):
        cells = [cell for column in comparison.columns for cell in _against(float(column[n]), p.value)]
        source = p.source + ("" if p.weight else " (weight 0)")
        found.add_row(f"{p.command:.0%}", f"{p.value:.4g}", *cells, source)
    return found


def _summary(comparisons: Iterable[Comparison], other: Sequence[str]) -> Table:
    """Return the table of the RMS errors of all quantities."""
    found = table("RMS relative error", "", ("model", _LEAVE_ONE_OUT, *other))
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
        line = f"{name} = {tuning.rov[name]:.6g}"
        interval = tuning.estimate.intervals.get(name) if tuning.estimate else None
        out.print(line + (f"   95 %: {interval[0]:.4g} ... {interval[1]:.4g}" if interval else ""))
    result = table("", "command", ("quantity", "wanted", "model", "dev."))
    for p, value in zip(tuning.points, tuning.model.tolist(), strict=True):
        result.add_row(f"{p.command:.0%}", p.quantity, f"{p.value:.4g}", *_against(value, p.value))
    out.print(result)
    layout = tuning.rov.layout
    for command in dict.fromkeys(p.command for p in tuning.points):
        inputs = ", ".join(f"{name} = {value:g}" for name, value in layout.driving(tuning.axis, command).items())
        out.print(f"A command of {command:.0%} of {tuning.axis.name}: {inputs}", soft_wrap=True)
    for curve in {thruster.curve: layout.curve_of[thruster.name] for thruster in layout.drivers(tuning.axis)}.values():
        if curve.has_lag:
            T = tuning.rov[curve.coefficient("T")]
            out.print(f"Tau is that of steady thrust; the lag of curve {curve.name}, T = {T:g} s, comes on top")
