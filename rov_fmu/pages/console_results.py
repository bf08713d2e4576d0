"""What the command line prints of an identification and of a tuning."""

from collections.abc import Iterable

import numpy as np
from rich.table import Table

from rov_fmu.identify.identification import AxisResult, Comparison, Identification, compare
from rov_fmu.identify.least_squares import Array
from rov_fmu.identify.tuning import Tuning
from rov_fmu.motion.rov import COEFFICIENTS
from rov_fmu.pages.console import console, table
from rov_fmu.vehicle.vehicle import Vehicle


def print_identification(identification: Identification) -> None:
    """Coefficients, recordings, points beside the model, and the warnings."""
    out, vehicle = console(), identification.vehicle
    out.print(f"{vehicle.name}. {vehicle.source}", soft_wrap=True)
    out.print()
    out.print(_coefficients(vehicle))
    for axis in identification.axes:
        if axis.steps:
            out.print()
            out.print(_steps(axis))
    comparisons = compare(identification)
    for comparison in comparisons:
        out.print()
        out.print(_points(comparison, identification.against))
    if comparisons:
        out.print()
        out.print(_summary(comparisons, identification.against))
    out.print(
        "\ndev.: relative to the measured value. left out: by a fit to the points without those of the same thrust.\n"
        "(weight 0): not fitted, and not counted in the RMS. interval: 95 % confidence."
    )
    if identification.warnings:
        out.print("\nWhat the data do not tell:")
    for warning in identification.warnings:
        out.print(f"- {warning}", soft_wrap=True)


def _coefficients(vehicle: Vehicle) -> Table:
    result = table("Coefficients", "name", ("value", "95 % from", "to", "unit"), ("source",))
    for name, meta in COEFFICIENTS.items():
        low, high = (f"{end:.5g}" for end in vehicle.intervals[name]) if name in vehicle.intervals else ("", "")
        value = getattr(vehicle.coefficients, name)
        result.add_row(name, f"{value:.5g}", low, high, meta.unit, vehicle.sources[name])
    return result


def _steps(axis: AxisResult) -> Table:
    unit = axis.axis.unit
    headers = ("from s", "to s", "command", f"V_ss [{unit}]", "+-", "Tau [s]", "+-")
    result = table(f"{axis.axis.name.capitalize()}: held commands of the recordings", "file", headers, ("",))
    for s in axis.steps:
        steady, Tau = (_with_error(s.V_ss, s.V_ss_error), _with_error(s.Tau, s.Tau_error))
        result.add_row(s.file, f"{s.start:.1f}", f"{s.end:.1f}", f"{s.command:.0%}", *steady, *Tau, s.note)
    return result


def _points(comparison: Comparison, against: Vehicle | None) -> Table:
    unit = "s" if comparison.quantity == "Tau" else comparison.result.axis.unit
    other = (against.name, "dev.") if against else ()
    result = table(
        f"{comparison.result.axis.name.capitalize()}: {comparison.quantity} [{unit}]",
        "command",
        ("measured", "model", "dev.", "left out", "dev.", *other),
        ("source",),
    )
    for n, p in enumerate(comparison.points):
        columns = [comparison.model, comparison.left_out, *([comparison.against] if against else [])]
        cells = [text for column in columns for text in _against(float(column[n]), p.value)]
        source = p.source + ("" if p.weight else " (weight 0)")
        result.add_row(f"{p.command:.0%}", f"{p.value:.4g}", *cells, source)
    return result


def _summary(comparisons: Iterable[Comparison], against: Vehicle | None) -> Table:
    other = (against.name,) if against else ()
    result = table("RMS relative error", "", ("model", "left out", *other))
    for c in comparisons:
        columns: list[Array] = [c.model, c.left_out, *([c.against] if against else [])]
        numbers = [c.rms(column) for column in columns]
        result.add_row(f"{c.result.axis.name} {c.quantity}", *("-" if np.isnan(n) else f"{n:.4f}" for n in numbers))
    return result


def _with_error(value: float | None, error: float | None) -> tuple[str, str]:
    return ("-" if value is None else f"{value:.4f}", "-" if error is None else f"{error:.1g}")


def _against(value: float, measured: float) -> tuple[str, str]:
    return ("-", "-") if np.isnan(value) else (f"{value:.4f}", f"{value / measured - 1.0:+.1%}")


def print_tuning(tuning: Tuning) -> None:
    """α and β, and what they give at the wanted points."""
    out, m = console(), tuning.axis
    for kind in ("alpha", "beta"):
        name = m.coefficient(kind)
        line = f"{name} = {getattr(tuning.coefficients, name):.6g}"
        interval = tuning.estimate.intervals.get(name) if tuning.estimate else None
        out.print(line + (f"   95 %: {interval[0]:.4g} ... {interval[1]:.4g}" if interval else ""))
    result = table("", "command", ("quantity", "wanted", "model", "dev."))
    for p, value in zip(tuning.points, tuning.model.tolist(), strict=True):
        result.add_row(f"{p.command:.0%}", p.quantity, f"{p.value:.4g}", *_against(value, p.value))
    out.print(result)
