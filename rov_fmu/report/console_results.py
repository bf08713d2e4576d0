"""What the command line prints of an identification and of a tuning."""

from collections.abc import Iterable, Sequence

from rich.table import Table

from rov_fmu.identify.identification import AxisResult, Comparison, Identification, compare
from rov_fmu.identify.recordings.recordings_fit import Effect
from rov_fmu.identify.tuning import Tuning
from rov_fmu.report.console import DEVIATION, console, table, text
from rov_fmu.report.findings import Unseen, acting, effects, unseen
from rov_fmu.vehicle.vehicle import Vehicle

_OUT = "leave-\none-out"
_MOST_STEPS = 20


def print_identification(identification: Identification) -> None:
    """How well it predicts, coefficients, what else acts, what to measure next; then steps, points and warnings."""
    out, vehicle = console(), identification.vehicle
    out.print(f"{vehicle.name}. {vehicle.source}", soft_wrap=True)
    comparisons, other = compare(identification), [identification.against.name] if identification.against else []
    if predicted := [*unseen(identification, comparisons)]:
        out.print()
        out.print(_predicted(predicted))
    acts = dict.fromkeys(e for result in identification.axes for e in effects(result) if e.kept)  # axes share a lag
    for found in [_coefficients(vehicle), *([_effects(acts)] if acts else [])]:
        out.print()
        out.print(found)
    if identification.next_tests:
        out.print("\nTo measure next:")
    for test in identification.next_tests:
        now = f"now {test.interval[0]:.3g} ... {test.interval[1]:.3g}" if test.interval else "not identifiable yet"
        narrowed = f"; then {1.0 - test.narrowed:.0%} narrower" if test.interval else ""
        words = f"- {test.axis.name}: {test.words} ({test.coefficient}, {now}{narrowed})"
        out.print(words, soft_wrap=True)
    tables = [_steps(result) for result in identification.axes if result.steps]
    tables += [_points(comparison, other) for comparison in comparisons]
    for found in [*tables, *([_summary(comparisons, other)] if comparisons else [])]:
        out.print()
        out.print(found)
    out.print(
        "\ndev.: relative to the measured value. leave-one-out: by a fit without the points of the same thrust.\n"
        "(weight 0): not fitted, and not counted in the RMS. interval: 95 % confidence."
    )
    if identification.warnings:
        out.print("\nNot identifiable, or against the model:")
    for warning in identification.warnings:
        out.print(f"- {warning}", soft_wrap=True)


def _predicted(found: Iterable[Unseen]) -> Table:
    result = table("Prediction of what a fit has not seen", "axis", ("fit", "RMS error"), ("of",))
    for row in found:
        fit = "" if row.fit is None else text(row.fit / 100.0, ".1%")
        error = "" if row.error is None else text(row.error, ".1%")
        result.add_row(row.axis.name, fit, error, f"{row.what}, {row.by}")
    return result


def _effects(kept: Iterable[Effect]) -> Table:
    found = table("What else acts", "of", ("value", "95 % from", "to", "unit"), ("",))
    for effect in kept:
        low, high = (f"{end:.4g}" for end in effect.interval) if effect.interval else ("", "")
        unit = "" if effect.unit == "1" else effect.unit
        found.add_row(effect.of, f"{effect.value:.4g}", low, high, unit, acting(effect))
    return found


def _coefficients(vehicle: Vehicle) -> Table:
    result = table("Coefficients", "name", ("value", "95 % from", "to", "unit"), ("source",))
    for name, meta in vehicle.layout.coefficients.items():
        low, high = (f"{end:.5g}" for end in vehicle.intervals[name]) if name in vehicle.intervals else ("", "")
        result.add_row(name, f"{vehicle.rov[name]:.5g}", low, high, meta.unit, vehicle.sources[name])
    return result


def _steps(result: AxisResult) -> Table:
    headers = ("from s", "to s", "command", f"V_ss [{result.axis.unit}]", "+-", "Tau [s]", "+-")
    found = table(f"{result.axis.name.capitalize()}: held commands of the recordings", "file", headers, ("",))
    for s in result.steps[:_MOST_STEPS]:
        responses = [
            text(n, form)
            for n, form in (
                (s.V_ss, ".4f"),
                (s.V_ss_error, ".1g"),
                (s.Tau, ".4f"),
                (s.Tau_error, ".1g"),
            )
        ]
        found.add_row(s.file, f"{s.start:.1f}", f"{s.end:.1f}", f"{s.command:.0%}", *responses, s.note)
    if (more := len(result.steps) - _MOST_STEPS) > 0:
        found.add_row(f"and {more} more: --report lists them all")
    return found


def _points(comparison: Comparison, other: Sequence[str]) -> Table:
    axis, quantity = comparison.result.axis, comparison.quantity
    names = [name for model in ("model", _OUT, *other) for name in (model, "dev.")]
    title = f"{axis.name.capitalize()}: {quantity} [{'s' if quantity == 'Tau' else axis.unit}]"
    found = table(title, "command", ("measured", *names), ("source",))
    for n, p in enumerate(comparison.points):
        cells = [cell for column in comparison.columns for cell in _against(float(column[n]), p.value)]
        source = p.source + ("" if p.weight else " (weight 0)")
        found.add_row(f"{p.command:.0%}", f"{p.value:.4g}", *cells, source)
    return found


def _summary(comparisons: Iterable[Comparison], other: Sequence[str]) -> Table:
    found = table("RMS relative error", "", ("model", _OUT, *other))
    for c in comparisons:
        found.add_row(f"{c.result.axis.name} {c.quantity}", *(text(c.rms(column), ".4f") for column in c.columns))
    return found


def _against(value: float, measured: float) -> tuple[str, str]:
    return text(value, ".4f"), text(round(value / measured - 1.0, 3) + 0.0, DEVIATION)  # and no -0.0


def print_tuning(tuning: Tuning) -> None:
    """α and β, and what they give at the wanted points."""
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
        inputs = ", ".join(f"{name} = {command * sign:g}" for name, sign in layout.signs(tuning.axis).items())
        out.print(f"A command of {command:.0%} of {tuning.axis.name}: {inputs}", soft_wrap=True)
    for curve in {thruster.curve: layout.curve_of[thruster.name] for thruster in layout.drivers(tuning.axis)}.values():
        if curve.has_lag:
            T = tuning.rov[curve.coefficient("T")]
            out.print(f"Tau is that of steady thrust; the lag of curve {curve.name}, T = {T:g} s, comes on top")
