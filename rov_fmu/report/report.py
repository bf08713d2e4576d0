"""The identification report: one HTML file with the data, the fits, their residuals, and the warnings."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from itertools import chain
from pathlib import Path

from markupsafe import Markup

from rov_fmu.identify.identification import AxisResult, Comparison, Identification, compare
from rov_fmu.identify.recordings.recordings_fit import count
from rov_fmu.identify.recordings.residual_analysis import Simulation
from rov_fmu.io.output import Output
from rov_fmu.io.seal import sealed
from rov_fmu.report.findings import Known, acting, effects, known, unseen, verdict
from rov_fmu.report.plots.fits import plot_drag, plot_known, plot_response, plot_steps, plot_thrust
from rov_fmu.report.plots.recordings import CommandStep, clearest_step, plot_recording, plot_step
from rov_fmu.report.plots.svg import Draw, inline_svg
from rov_fmu.report.templates import number, page
from rov_fmu.tank.description import ROV_FILE
from rov_fmu.tank.tank_tests import TankTests

_PLOT, _WIDE = (3.7, 3.5), (4.7, 3.0)  # inches
_WHITE = 1.5  # samples; residuals that are correlated over fewer count as white noise


def report_output(results: Identification, path: Path) -> Output:
    """Return the file of the report of an identification."""
    return Output(path, sealed(report_page(results), "<!-- {} -->").encode())


def report_page(results: Identification) -> str:
    """Return the report as HTML. The same identification always gives the same text."""
    comparisons, found = compare(results), known(results)
    predicted = tuple(unseen(results, comparisons))
    fits = [result.recordings for result in results.axes if result.recordings]
    closeups = {fit.axis.name: step for fit in fits if (step := clearest_step(fit))}
    return page(
        "report.html.j2",
        vehicle=results.vehicle,
        results=results,
        comparisons=comparisons,
        curves=results.vehicle.layout.curves,
        unseen=predicted,
        unseen_fit=dict(part for row in predicted for part in row.parts),
        known=found,
        closeups=closeups,
        plots=dict(_plots(results, comparisons, found, closeups)),
        holds=_holds(results.tests),
        effects=effects,
        acting=acting,
        verdict=verdict,
        scatter=scatter,
    )


def _plots(
    results: Identification,
    comparisons: tuple[Comparison, ...],
    found: tuple[Known, ...],
    closeups: Mapping[str, CommandStep],
) -> Iterator[tuple[str, Markup]]:
    """Yield the label and the SVG of each plot."""
    if found:
        label, size = "What is known", (4.6, 0.7 + 0.23 * len(found))
        yield label, inline_svg(label, partial(plot_known, found=found), size)
    for name, fit in results.thrust.items():
        label = f"Thrust: {name}"
        yield label, inline_svg(label, partial(plot_thrust, results=results, fit=fit), _PLOT)
    for result in results.axes:
        if result.points or result.recordings:
            own = [c for c in comparisons if c.result is result]
            for label, draw in _plots_of_points(results, result, own).items():
                yield label, inline_svg(label, draw, _PLOT)
            for label, draw in _plots_of_recordings(result, closeups.get(result.axis.name)).items():
                yield label, inline_svg(label, draw, _WIDE)


def _plots_of_points(results: Identification, result: AxisResult, comparisons: Iterable[Comparison]) -> dict[str, Draw]:
    """Return the functions that draw V_ss, Tau, drag and step responses of an axis, by label."""
    name, by_quantity = result.axis.name, {c.quantity: c for c in comparisons}
    draw: dict[str, Draw] = {}
    for quantity in ("V_ss", "Tau"):
        draw[f"{quantity} over the command: {name}"] = partial(
            plot_response, results=results, result=result, quantity=quantity, comparison=by_quantity.get(quantity)
        )
    if result.drag:
        draw[f"Drag: {name}"] = partial(plot_drag, results=results, result=result)
    if result.points:
        draw[f"Step responses: {name}"] = partial(plot_steps, results=results, result=result)
    return draw


def _plots_of_recordings(result: AxisResult, step: CommandStep | None) -> dict[str, Draw]:
    """Return the functions that draw the recordings of an axis and its clearest step, by label."""
    draw: dict[str, Draw] = {}
    if result.recordings:
        for s in result.recordings.simulations:
            draw[f"Recording: {s.recording.file}"] = partial(plot_recording, result=result, simulation=s)
    if step:
        draw[f"Step in {step.simulation.recording.file}"] = partial(plot_step, result=result, step=step)
    return draw


def _holds(tests: TankTests) -> dict[str, str]:
    """Return the content of each input file, in words."""
    holds = dict.fromkeys(tests.inputs, "not used")
    holds[ROV_FILE] = "what is given beforehand: mass, geometry"
    if tests.given.description.base:
        holds[tests.given.description.base_name] = "the vehicle to begin from"
    tables = {"force": tests.thrust, "steady velocity": tests.steady, "time constant": tests.time_constants}
    for what, rows in tables.items():
        files = Counter(row.file for row in chain(*rows.values()))
        holds.update({file: count(n, what) for file, n in files.items()})
    for r in chain(*tests.recordings.values()):
        holds[r.file] = f"{len(r.time)} samples of command and {r.quantity} in {r.time[-1]:.4g} s"
    return holds


def scatter(simulation: Simulation) -> str:
    """Return the size of the residuals in words, and whether they are white noise."""
    size, unit = number(simulation.noise, 2), simulation.recording.unit
    if simulation.correlation_time < _WHITE:
        return f"residuals of {size} {unit}, white: the sensor’s noise"
    return f"residuals of {size} {unit}, correlated over {simulation.correlation_time:.0f} samples: more than noise"
