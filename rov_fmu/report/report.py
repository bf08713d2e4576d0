"""The identification report: one HTML file with the data, the fits, their residuals, and the warnings."""

from collections import Counter
from collections.abc import Iterator, Mapping
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

from markupsafe import Markup

from rov_fmu.identify.identification import Comparison, Identification, compare
from rov_fmu.identify.recordings.recordings_fit import count
from rov_fmu.identify.recordings.residual_analysis import Simulation
from rov_fmu.io.output import Output
from rov_fmu.io.seal import sealed
from rov_fmu.report.findings import Known, acting, effects, known, unseen, verdict
from rov_fmu.report.plots.fits import plot_drag, plot_known, plot_response, plot_steps, plot_thrust
from rov_fmu.report.plots.recordings import CommandStep, clearest_step, plot_recording, plot_step
from rov_fmu.report.plots.svg import Draw, inline_svg
from rov_fmu.report.templates import number, page
from rov_fmu.tank.given import ROV_FILE
from rov_fmu.tank.tank_tests import TankTests

_PLOT, _WIDE = (3.7, 3.5), (4.7, 3.0)  # inches
_WHITE = 1.5  # samples: residuals that are correlated over less are as good as white


def report_output(results: Identification, path: Path) -> Output:
    """The report of an identification, to write."""
    return Output(path, sealed(report_page(results), "<!-- {} -->").encode())


def report_page(results: Identification) -> str:
    """The report as HTML, the same for the same input."""
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
    """Every plot by its label."""
    draw: dict[str, Draw] = {
        f"Thrust: {name}": partial(plot_thrust, results=results, fit=fit) for name, fit in results.thrust.items()
    }
    if found:
        yield (
            "What is known",
            inline_svg("What is known", partial(plot_known, found=found), (4.6, 0.7 + 0.23 * len(found))),
        )
    for result in results.axes:
        if not (result.points or result.recordings):
            continue
        of_axis: dict[str, Any] = {"results": results, "result": result}
        for quantity in ("V_ss", "Tau"):
            comparison = next((c for c in comparisons if c.result is result and c.quantity == quantity), None)
            draw[f"{quantity} over the command: {result.axis.name}"] = partial(
                plot_response, **of_axis, quantity=quantity, comparison=comparison
            )
        if result.drag:
            draw[f"Drag: {result.axis.name}"] = partial(plot_drag, **of_axis)
        if result.points:
            draw[f"Step responses: {result.axis.name}"] = partial(plot_steps, **of_axis)
        for s in result.recordings.simulations if result.recordings else ():
            draw[f"Recording: {s.recording.file}"] = partial(plot_recording, result=result, simulation=s)
        if step := closeups.get(result.axis.name):
            draw[f"Step in {step.simulation.recording.file}"] = partial(plot_step, result=result, step=step)
    for label, plot in draw.items():
        yield label, inline_svg(label, plot, _WIDE if label.startswith(("Recording", "Step in")) else _PLOT)


def _holds(tests: TankTests) -> dict[str, str]:
    """What every input file holds, in words."""
    holds = dict.fromkeys(tests.inputs, "not used") | {ROV_FILE: "what is given beforehand: mass, geometry"}
    holds |= {tests.given.base_name: "the vehicle to begin from"} if tests.given.base else {}
    tables = {"force": tests.thrust, "steady velocity": tests.steady, "time constant": tests.time_constants}
    for what, rows in tables.items():
        files = Counter(row.file for row in chain(*rows.values()))
        holds |= {file: count(n, what) for file, n in files.items()}
    for r in chain(*tests.recordings.values()):
        holds[r.file] = f"{len(r.time)} samples of command and {r.quantity} in {r.time[-1]:.4g} s"
    return holds


def scatter(simulation: Simulation) -> str:
    """What measured less modelled is, in words: noise only where it is white."""
    size, unit = number(simulation.noise, 2), simulation.recording.unit
    if simulation.correlation_time < _WHITE:
        return f"residuals of {size} {unit}, white: the sensor’s noise"
    return f"residuals of {size} {unit}, correlated over {simulation.correlation_time:.0f} samples: more than noise"
