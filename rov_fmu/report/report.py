"""The identification report: one HTML file with the data, the fits, their residuals, and the warnings."""

import os
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from datetime import date, datetime, timezone
from functools import partial
from itertools import chain
from pathlib import Path

from rov_fmu.identify.adapter.recording import Recording, signal_name
from rov_fmu.identify.adapter.tank_tests import TankTests, kind_of_data
from rov_fmu.identify.findings import by_heading
from rov_fmu.identify.identification import AxisResult, Comparison, Identification, compare
from rov_fmu.identify.next_test import REPEATED
from rov_fmu.identify.recordings.prediction_errors import shown_in
from rov_fmu.identify.recordings.recordings_fit import count
from rov_fmu.identify.recordings.residual_analysis import Simulation
from rov_fmu.io.messages import Progress, silent
from rov_fmu.io.output import Output, sealed
from rov_fmu.report.findings import (
    EXPLAINED,
    Known,
    acting,
    effects,
    inertias,
    known,
    measured_and_fitted,
    unseen,
    verdict,
)
from rov_fmu.report.overview import (
    ShownPrediction,
    amount_of_data,
    legend,
    main_coefficients,
    main_errors,
    shown_prediction,
)
from rov_fmu.report.plots.fits import plot_drag, plot_known, plot_response, plot_steps, plot_thrust
from rov_fmu.report.plots.overview import plot_correlation, plot_error, plot_predicted
from rov_fmu.report.plots.recordings import CommandStep, clearest_step, plot_recording, plot_step
from rov_fmu.report.plots.svg import Draw, inline_svg, with_even_text
from rov_fmu.report.templates import number, page
from rov_fmu.tank.description import ROV_FILE

_WIDTH = 3.7
"""The width of every plot, inches. All plots of a page are as wide, so that their text has the same size."""
_LOW, _HIGH = (_WIDTH, 2.7), (_WIDTH, 3.5)
_WHITE = 1.5  # samples; residuals that are correlated over fewer count as white noise


def report_output(results: Identification, path: Path, on_progress: Progress = silent) -> Output:
    """Return the file of the report of an identification."""
    return Output(path, sealed(report_page(results, on_progress), "<!-- {} -->").encode())


def _today() -> date:
    """Return today's date (UTC), or the date of SOURCE_DATE_EPOCH, which makes builds reproducible."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    now = datetime.fromtimestamp(int(epoch), timezone.utc) if epoch.isdecimal() else datetime.now(timezone.utc)
    return now.date()


def report_page(results: Identification, on_progress: Progress = silent, *, made: date | None = None) -> str:
    """Return the report as HTML. The same identification and date (today by default) always give the same text."""
    comparisons, found, shown = compare(results), known(results), shown_prediction(results)
    main_known = main_coefficients(results, found)
    predicted = tuple(unseen(results, comparisons))
    fits = [result.recordings for result in results.axes if result.recordings]
    closeups = {fit.axis.name: step for fit in fits if (step := clearest_step(fit))}
    of_points = {result.axis.name: [*_plots_of_points(results, result, comparisons)] for result in results.axes}
    overview = [*_plots_of_overview(shown, of_points.values())]
    plots = [*overview, *_plots(results, found, closeups), *chain(*of_points.values())]

    def drawn(n: int, label: str, draw: Draw, size: tuple[float, float]) -> str:
        on_progress(f"drawing: {label}", n / len(plots))
        return inline_svg(label, with_even_text(draw), size)

    return page(
        "report.html.j2",
        vehicle=results.vehicle,
        results=results,
        made=made or _today(),
        kind=kind_of_data(results.tests),
        data=amount_of_data(results.tests),
        shown=shown,
        overview=[label for label, _, _ in overview],
        main_errors=[*main_errors(predicted)],
        main_known=main_known,
        legend=legend(results, main_known),
        findings=by_heading(results.findings),
        explained=EXPLAINED,
        comparisons=comparisons,
        curves=results.vehicle.layout.curves,
        unseen=predicted,
        unseen_parts={(row.axis.name, file): errors for row in predicted for file, errors in row.parts.items()},
        both=tuple(measured_and_fitted(results)),
        known=found,
        inertias=[*inertias(results)],
        repeated=REPEATED,
        closeups=closeups,
        plots={plot[0]: drawn(n, *plot) for n, plot in enumerate(plots)},
        of_points={name: [label for label, _, _ in some] for name, some in of_points.items()},
        holds=_holds(results.tests),
        effects=effects,
        acting=acting,
        verdict=verdict,
        scatter=scatter,
    )


Plot = tuple[str, Draw, tuple[float, float]]
"""The label of a plot, the function that draws it, and its size in inches."""


def _plots_of_overview(shown: ShownPrediction | None, of_points: Iterable[list[Plot]]) -> Iterator[Plot]:
    """Yield the plots of the opening screen: a prediction, or without recordings the points of an axis."""
    if shown:
        yield "Prediction of an unseen recording", partial(plot_predicted, shown=shown), _LOW
        yield "Error of this prediction", partial(plot_error, shown=shown), _LOW
    else:
        first: list[Plot] = next((some for some in of_points if some), [])
        yield from ((f"Overview: {label}", draw, size) for label, draw, size in first[:2])


def _plots_of_points(
    results: Identification, result: AxisResult, comparisons: tuple[Comparison, ...]
) -> Iterator[Plot]:
    """Yield the plots of an axis that show its measured points."""
    name = result.axis.name
    if result.points or result.recordings:
        compared = {c.quantity: c for c in comparisons if c.result is result}
        for quantity in ("V_ss", "Tau"):
            response = partial(plot_response, quantity=quantity, comparison=compared.get(quantity))
            yield f"{quantity} over the command: {name}", partial(response, results=results, result=result), _HIGH
        if result.drag:
            yield f"Drag: {name}", partial(plot_drag, results=results, result=result), _HIGH
    if result.points:
        yield f"Step responses: {name}", partial(plot_steps, results=results, result=result), _HIGH


def _plots(results: Identification, found: tuple[Known, ...], closeups: Mapping[str, CommandStep]) -> Iterator[Plot]:
    """Yield the plots of the report besides those of `_plots_of_points`."""
    if found:
        yield "What is known", partial(plot_known, found=found), (_WIDTH, 0.7 + 0.23 * len(found))
    estimates = [(name, fit.estimate) for name, fit in results.thrust.items()]
    estimates += [(result.axis.name, result.estimate) for result in results.axes if result.estimate]
    for name, estimate in estimates:
        if (p := len(estimate.names)) > 1:
            matrix = partial(plot_correlation, names=estimate.names, correlation=estimate.correlation)
            yield f"Correlation: {name}", matrix, (_WIDTH, 1.0 + 0.23 * p)
    for name, fit in results.thrust.items():
        yield f"Thrust: {name}", partial(plot_thrust, results=results, fit=fit), _HIGH
    for result in results.axes:
        for s in result.recordings.simulations if result.recordings else ():
            yield (
                f"Recording of {result.axis.name}: {s.recording.file}",
                partial(plot_recording, result=result, simulation=s),
                _LOW,
            )
        if step := closeups.get(result.axis.name):
            yield f"Step of {result.axis.name}", partial(plot_step, result=result, step=step), _LOW


def _holds(tests: TankTests) -> dict[str, str]:
    """Return the content of each input file, in words."""
    holds = dict.fromkeys(tests.inputs, "not used")
    holds[ROV_FILE] = "what is given beforehand: mass, geometry"
    if tests.given.description.base_name:
        holds[tests.given.description.base_name] = "the vehicle to begin from"
    tables = {"force": tests.thrust, "steady velocity": tests.steady, "time constant": tests.time_constants}
    for what, rows in tables.items():
        files = Counter(row.file for row in chain(*rows.values()))
        holds.update({file: count(n, what) for file, n in files.items()})
    logs: dict[str, list[Recording]] = {}
    for recording in chain(*tests.recordings.values()):
        logs.setdefault(recording.file, []).append(recording)
    for file, recordings in logs.items():
        samples, seconds = max(len(r.time) for r in recordings), max(r.time[-1] for r in recordings)
        names = ["command", *dict.fromkeys(signal_name(r.axis, r.quantity) for r in recordings)]
        holds[file] = f"{samples} samples of {', '.join(names[:-1])} and {names[-1]} in {seconds:.4g} s"
    return holds


def scatter(simulation: Simulation) -> str:
    """Return the size of the residuals in words, and whether they are white noise."""
    recording = simulation.recording
    factor, unit = shown_in(recording.axis, "position" if recording.is_position else "velocity")
    size, unit = number(factor * simulation.noise, 2), unit.replace("deg", "°")
    if simulation.correlation_time < _WHITE:
        return f"residuals of {size} {unit}, white: the sensor’s noise"
    return f"residuals of {size} {unit}, correlated over {simulation.correlation_time:.0f} samples: more than noise"
