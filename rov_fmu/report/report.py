"""The identification report: one HTML file with the verdicts, the answers, the predictions, and all that is known."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import count

from markupsafe import Markup

from rov_fmu.equation.units import in_degrees
from rov_fmu.fmu.card import card
from rov_fmu.identify import findings
from rov_fmu.identify.result import (
    AxisResult,
    Identification,
    Prediction,
    half_width,
    is_known,
    relative_error,
    with_stop,
)
from rov_fmu.io.messages import Progress, silent
from rov_fmu.report.plots.identification import plot_answers, plot_forces
from rov_fmu.report.plots.logs import height_of, plot_log
from rov_fmu.report.plots.svg import KNOTS, NARROW, in_both_widths, inline_svg, with_even_text
from rov_fmu.report.templates import inline_script, page
from rov_fmu.tank.log import Log
from rov_fmu.vehicle.steady import speed_table

_SIZE = NARROW, 2.7
"""The size of a plot, inches."""
_PLOTS: Mapping[str, Callable[..., None]] = {
    "log": plot_log,
    "answers": plot_answers,
    "forces": plot_forces,
}


def report_page(results: Identification, on_progress: Progress = silent) -> str:
    """Return the report as HTML."""
    curves = {p.subject: [q for q in results.forces if q.subject == p.subject] for p in results.forces}
    shown = _shown(results.axes)
    drawn = count()
    pictures = [*_of_logs(results)]
    total = len(curves) + sum(2 * bool(r.answers) for r in results.axes) + len(pictures) + 2 * bool(shown)

    def plot(label: str, kind: str, size: tuple[float, float] = _SIZE, salt: str = "", **content: object) -> Markup:
        on_progress(f"drawing: {label}", next(drawn) / total)
        return inline_svg(label, with_even_text(partial(_PLOTS[kind], **content)), size, salt=salt, marked=True)

    return page(
        "report.html.j2",
        vehicle=results.vehicle,
        results=results,
        findings=findings,
        shown=shown,
        forces=curves,
        plot=plot,
        pictures=pictures,
        height_of=height_of,
        WIDTH=NARROW,
        picture=_picture(results, shown, partial(plot, "Main prediction", "log")) if shown else None,
        script=inline_script("plots.js"),
        card=card(results.vehicle),
        speeds=[*speed_table(results.vehicle)],
        layout=results.vehicle.layout,
        KNOTS=KNOTS,
        relative_error=relative_error,
        with_stop=with_stop,
        is_known=lambda estimate: is_known(half_width(estimate)),
        in_degrees=in_degrees,
    )


def _shown(axes: Sequence[AxisResult]) -> list[Prediction]:
    """Return the predictions of one log, one of each axis: of the log whose main prediction is the least accurate."""
    mains = [result.main for result in axes if result.main]
    if not mains:
        return []
    file = max(mains, key=lambda p: p.error / max(p.unchanged, 1e-12)).file
    found = []
    for result in axes:
        own = [p for p in result.predictions if p.file == file and p.is_judged]
        found += sorted(own, key=lambda p: not p.is_position)[:1]
    return found or [p for p in mains if p.file == file]


def _of_logs(results: Identification) -> Iterator[tuple[str, Log | None, list[Prediction]]]:
    """Yield each log with its name and the predictions of it, those that are judged first."""
    logs = {log.file: log for log in results.folder.logs}
    predictions = [p for result in results.axes for p in result.predictions]
    for file in dict.fromkeys([*logs, *(p.file for p in predictions)]):
        yield file, logs.get(file), sorted((p for p in predictions if p.file == file), key=lambda p: not p.is_judged)


def _picture(results: Identification, shown: Sequence[Prediction], plot: Callable[..., Markup]) -> Markup:
    """Return the large picture, of the log of these predictions."""
    log = next((log for log in results.folder.logs if log.file == shown[0].file), None)
    height = height_of(log, shown, measured=False)
    return in_both_widths(partial(plot, predictions=shown, log=log, measured=False), height)
