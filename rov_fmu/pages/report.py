"""The identification report: one HTML file with the data, the fits, what they leave over, and the warnings."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from markupsafe import Markup

from rov_fmu.files.output import Output
from rov_fmu.identify.identification import AxisResult, Comparison, Identification, compare
from rov_fmu.identify.least_squares import Array, Estimate, rms
from rov_fmu.identify.quadratic_fit import QuadraticFit
from rov_fmu.identify.tank_tests import ROV_FILE, THRUSTERS, TankTests
from rov_fmu.motion.rov import COEFFICIENTS
from rov_fmu.pages.report_plots import plot_drag, plot_recording, plot_response, plot_steps, plot_thrust
from rov_fmu.pages.svg import PALETTE, inline_svg
from rov_fmu.pages.templates import page, percent

_PLOT, _WIDE = (3.7, 3.5), (5.6, 3.1)  # inches


def report_output(results: Identification, path: Path) -> Output:
    """The report of an identification, to write."""
    return Output(path, report_page(results).encode())


def report_page(results: Identification) -> str:
    """The report as HTML, the same for the same input."""
    comparisons = compare(results)
    return page(
        "report.html.j2",
        palette=PALETTE,
        vehicle=results.vehicle,
        against=results.against,
        warnings=results.warnings,
        summary=[(c, [c.rms(model) for model in _models(c, results)]) for c in comparisons],
        coefficients=[(name, meta, getattr(results.vehicle.coefficients, name)) for name, meta in COEFFICIENTS.items()],
        thrust=[_thrust(results, thruster, fit) for thruster, fit in results.thrust.items()],
        given=[(t, [f"{kind}_{t}" for kind in ("a_t", "b_t")]) for t in THRUSTERS if t not in results.thrust],
        axes=[_axis(results, axis, [c for c in comparisons if c.result is axis]) for axis in results.axes],
        inputs=_inputs(results.experiments),
    )


def _models(c: Comparison, results: Identification) -> list[Array]:
    """Of the vehicle, of the fit without the point's thrust, and of the vehicle to compare with."""
    return [c.model, c.left_out, *([c.against] if results.against else [])]


@dataclass(frozen=True)
class _Table:
    """What a fit tells of its coefficients: name, value, standard error, 95 % interval, correlations."""

    rows: list[tuple[str, float, float, tuple[float, float] | None, list[float]]]


def _table(found: Estimate) -> _Table:
    correlation = found.correlation.tolist()
    return _Table([
        (name, found[name], found.errors[name], found.interval(name), correlation[n])
        for n, name in enumerate(found.names)
    ])  # fmt: skip


@dataclass(frozen=True)
class _Fit:
    """A quadratic fit in numbers."""

    fit: QuadraticFit
    table: _Table
    used: int
    residual: float
    """RMS."""
    left_out: float


def _fit(fit: QuadraticFit) -> _Fit:
    used = fit.weights > 0.0
    return _Fit(fit, _table(fit.estimate), int(used.sum()), rms(fit.residuals[used]), fit.left_out_error)


@dataclass(frozen=True)
class _Thrust:
    thruster: str
    fit: _Fit
    plot: Markup
    rows: list[tuple[float, float, float, float, float, str]]
    """Command, measured, fitted, left, predicted by the fit without this thrust, weight as text."""


def _thrust(results: Identification, thruster: str, fit: QuadraticFit) -> _Thrust:
    k = results.vehicle.coefficients
    curve = (getattr(k, f"a_t_{thruster}"), getattr(k, f"b_t_{thruster}"))
    plot = inline_svg(f"Thrust: {thruster}", partial(plot_thrust, fit=fit, curve=curve), _PLOT)
    columns = (fit.x, fit.y, fit.value(fit.x), fit.residuals, fit.left_out)
    numbers = zip(*(column.tolist() for column in columns), strict=True)
    rows = [(*row, "" if weight else "weight 0") for row, weight in zip(numbers, fit.weights.tolist(), strict=True)]
    return _Thrust(thruster, _fit(fit), plot, rows)


@dataclass(frozen=True)
class _Axis:
    result: AxisResult
    table: _Table | None
    drag: _Fit | None
    comparisons: list[tuple[Comparison, list[list[float]]]]
    """With the columns of its models."""
    plots: list[Markup]
    recordings: list[tuple[str, str, Markup]]
    """File, its numbers in words, plot."""
    losses: Mapping[str, str]
    """Coefficients that the data do not tell, and why."""


def _axis(results: Identification, axis: AxisResult, comparisons: list[Comparison]) -> _Axis:
    name, k = axis.axis.name, results.vehicle.coefficients
    against = results.against.coefficients if results.against else None
    by_quantity = {c.quantity: c for c in comparisons}
    plots = []
    for quantity in ("V_ss", "Tau"):
        draw = partial(
            plot_response, axis=axis, quantity=quantity, comparison=by_quantity.get(quantity), k=k, against=against,
            command_range=results.vehicle.command_range,
        )  # fmt: skip
        plots.append(inline_svg(f"{quantity} over the command: {name}", draw, _PLOT))
    if axis.drag:
        plots.append(inline_svg(f"Drag: {name}", partial(plot_drag, axis=axis, k=k, against=against), _PLOT))
    if axis.points:
        plots.append(inline_svg(f"Step responses: {name}", partial(plot_steps, axis=axis, k=k), _PLOT))
    recordings = []
    for s in axis.recordings.simulations if axis.recordings else ():
        holds = [step for step in axis.steps if step.file == s.recording.file]
        plot = inline_svg(f"Recording: {s.recording.file}", partial(plot_recording, simulation=s, holds=holds), _WIDE)
        unit = axis.axis.position_unit if s.recording.is_position else axis.axis.unit
        words = f"{len(s.time)} samples of {s.recording.quantity}, noise {s.noise:.2g} {unit}"
        words += f"; {percent(s.outliers / len(s.time), 1)} beyond 2.5 standard deviations (normal: 1.2 %)"
        recordings.append((s.recording.file, words, plot))
    return _Axis(
        axis,
        _table(axis.estimate) if axis.estimate else None,
        _fit(axis.drag) if axis.drag else None,
        [(c, [model.tolist() for model in _models(c, results)]) for c in comparisons],
        plots,
        recordings,
        axis.held,
    )


def _inputs(experiments: TankTests) -> list[tuple[str, str, str]]:
    """Name, what it holds, SHA-256."""
    holds = {ROV_FILE: "what no test tells: mass, geometry"}
    tables = (
        ("force", experiments.thrust), ("steady velocity", experiments.steady),
        ("time constant", experiments.time_constants),
    )  # fmt: skip
    for what, rows in tables:
        files = [row.file for found in rows.values() for row in found]
        plural = {"steady velocity": "steady velocities"}.get(what, f"{what}s")
        holds |= {file: f"{n} {what if n == 1 else plural}" for file in files if (n := files.count(file))}
    for recording in (r for found in experiments.recordings.values() for r in found):
        holds[recording.file] = (
            f"{len(recording.time)} samples of command and {recording.quantity} in {recording.time[-1]:.4g} s"
        )
    return [(name, holds.get(name, ""), digest) for name, digest in experiments.inputs.items()]
