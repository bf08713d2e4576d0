"""The identification report: one HTML file with the data, the fits, their residuals, and the warnings."""

from collections import Counter
from functools import partial
from pathlib import Path

from markupsafe import Markup

from rov_fmu.files.output import Output
from rov_fmu.identify.identification import AxisResult, Comparison, Identification, compare
from rov_fmu.identify.quadratic_fit import QuadraticFit
from rov_fmu.identify.tank_tests import ROV_FILE, THRUSTERS, TankTests
from rov_fmu.motion.rov import COEFFICIENTS, Coefficients
from rov_fmu.pages.report_plots import plot_drag, plot_recording, plot_response, plot_steps, plot_thrust
from rov_fmu.pages.svg import PALETTE, Draw, inline_svg
from rov_fmu.pages.templates import page, percent

_PLOT, _WIDE = (3.7, 3.5), (5.6, 3.1)  # inches


def report_output(results: Identification, path: Path) -> Output:
    """The report of an identification, to write."""
    return Output(path, report_page(results).encode())


def report_page(results: Identification) -> str:
    """The report as HTML, the same for the same input."""
    comparisons = compare(results)
    k = results.vehicle.coefficients
    return page(
        "report.html.j2",
        palette=PALETTE,
        vehicle=results.vehicle,
        against=results.against,
        warnings=results.warnings,
        comparisons=comparisons,
        coefficients=[(name, meta, getattr(k, name)) for name, meta in COEFFICIENTS.items()],
        thrust=[(thruster, fit, _thrust(k, thruster, fit)) for thruster, fit in results.thrust.items()],
        given=[(t, [f"{kind}_{t}" for kind in ("a_t", "b_t")]) for t in THRUSTERS if t not in results.thrust],
        axes=[(result, _plots(results, result, comparisons), _recordings(result)) for result in results.axes],
        inputs=_inputs(results.tests),
    )


def _thrust(k: Coefficients, thruster: str, fit: QuadraticFit) -> Markup:
    curve = (getattr(k, f"a_t_{thruster}"), getattr(k, f"b_t_{thruster}"))
    return inline_svg(f"Thrust: {thruster}", partial(plot_thrust, fit=fit, curve=curve), _PLOT)


def _plots(results: Identification, result: AxisResult, comparisons: tuple[Comparison, ...]) -> list[Markup]:
    k, against = results.vehicle.coefficients, results.against.coefficients if results.against else None
    by_quantity = {c.quantity: c for c in comparisons if c.result is result}
    draw: dict[str, Draw] = {
        f"{quantity} over the command": partial(
            plot_response, result=result, quantity=quantity, comparison=by_quantity.get(quantity), k=k,
            against=against, command_range=results.vehicle.command_range,
        )
        for quantity in ("V_ss", "Tau")
    }  # fmt: skip
    if result.drag:
        draw["Drag"] = partial(plot_drag, result=result, k=k, against=against)
    if result.points:
        draw["Step responses"] = partial(plot_steps, result=result, k=k)
    return [inline_svg(f"{label}: {result.axis.name}", plot, _PLOT) for label, plot in draw.items()]


def _recordings(result: AxisResult) -> list[tuple[str, str, Markup]]:
    """File, its numbers in words, plot."""
    found = []
    for s in result.recordings.simulations if result.recordings else ():
        holds = [step for step in result.steps if step.file == s.recording.file]
        plot = inline_svg(f"Recording: {s.recording.file}", partial(plot_recording, simulation=s, holds=holds), _WIDE)
        unit = result.axis.position_unit if s.recording.is_position else result.axis.unit
        words = f"{len(s.time)} samples of {s.recording.quantity}, noise {s.noise:.2g} {unit}"
        words += f"; {percent(s.outliers / len(s.time), 1)} beyond 2.5 standard deviations (normal: 1.2 %)"
        found.append((s.recording.file, words, plot))
    return found


def _inputs(tests: TankTests) -> list[tuple[str, str, str]]:
    """Name, what it holds, SHA-256."""
    holds = {ROV_FILE: "what is given beforehand: mass, geometry"}
    for one, many, rows in (
        ("force", "forces", tests.thrust),
        ("steady velocity", "steady velocities", tests.steady),
        ("time constant", "time constants", tests.time_constants),
    ):
        files = Counter(row.file for found in rows.values() for row in found)
        holds |= {file: f"{n} {one if n == 1 else many}" for file, n in files.items()}
    for recording in (r for found in tests.recordings.values() for r in found):
        holds[recording.file] = (
            f"{len(recording.time)} samples of command and {recording.quantity} in {recording.time[-1]:.4g} s"
        )
    return [(name, holds.get(name, ""), digest) for name, digest in tests.inputs.items()]
