"""The identification report: one HTML file with the data, the fits, their residuals, and the warnings."""

from collections import Counter
from collections.abc import Iterator
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

from markupsafe import Markup

from rov_fmu.files.output import Output
from rov_fmu.identify.identification import Comparison, Identification, compare, count
from rov_fmu.identify.tank_tests import ROV_FILE, THRUSTERS, TankTests
from rov_fmu.pages.report_plots import plot_drag, plot_recording, plot_response, plot_steps, plot_thrust
from rov_fmu.pages.svg import Draw, inline_svg
from rov_fmu.pages.templates import page

_PLOT, _WIDE = (3.7, 3.5), (5.6, 3.1)  # inches


def report_output(results: Identification, path: Path) -> Output:
    """The report of an identification, to write."""
    return Output(path, report_page(results).encode())


def report_page(results: Identification) -> str:
    """The report as HTML, the same for the same input."""
    comparisons = compare(results)
    return page(
        "report.html.j2",
        vehicle=results.vehicle,
        results=results,
        comparisons=comparisons,
        thrusters=THRUSTERS,
        plots=dict(_plots(results, comparisons)),
        holds=_holds(results.tests),
    )


def _plots(results: Identification, comparisons: tuple[Comparison, ...]) -> Iterator[tuple[str, Markup]]:
    """Every plot by its label."""
    draw: dict[str, Draw] = {
        f"Thrust: {name}": partial(plot_thrust, results=results, fit=fit) for name, fit in results.thrust.items()
    }
    for result in results.axes:
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
    for label, plot in draw.items():
        yield label, inline_svg(label, plot, _WIDE if label.startswith("Recording") else _PLOT)


def _holds(tests: TankTests) -> dict[str, str]:
    """What every input file holds, in words."""
    holds = {ROV_FILE: "what is given beforehand: mass, geometry"}
    tables = {"force": tests.thrust, "steady velocity": tests.steady, "time constant": tests.time_constants}
    for what, rows in tables.items():
        files = Counter(row.file for row in chain(*rows.values()))
        holds |= {file: count(n, what) for file, n in files.items()}
    for r in chain(*tests.recordings.values()):
        holds[r.file] = f"{len(r.time)} samples of command and {r.quantity} in {r.time[-1]:.4g} s"
    return holds
