"""The identification report: one HTML file with the verdicts, the answers, the predictions, and all that is known."""

import os
from collections.abc import Callable, Mapping
from datetime import date, datetime, timezone
from functools import partial
from itertools import count
from pathlib import Path

from markupsafe import Markup

from rov_fmu.identify.findings import answer_at, by_heading, relative_error
from rov_fmu.identify.result import Identification
from rov_fmu.io.messages import Progress, silent
from rov_fmu.io.output import Output, sealed
from rov_fmu.report.plots.identification import plot_answers, plot_forces, plot_prediction
from rov_fmu.report.plots.svg import inline_svg, with_even_text
from rov_fmu.report.templates import page
from rov_fmu.tank.columns import in_degrees

_SIZE = 3.7, 2.7
"""The size of every plot, inches. All plots of a page are as wide, so that their text has the same size."""
_PLOTS: Mapping[str, Callable[..., None]] = {
    "prediction": plot_prediction,
    "answers": plot_answers,
    "forces": plot_forces,
}


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
    mains = [result.main for result in results.axes if result.main]
    curves = {p.subject: [q for q in results.forces if q.subject == p.subject] for p in results.forces}
    drawn = count()
    total = len(curves) + sum(2 + len(result.predictions) for result in results.axes) + bool(mains)

    def plot(label: str, kind: str, **content: object) -> Markup:
        on_progress(f"drawing: {label}", next(drawn) / total)
        return inline_svg(label, with_even_text(partial(_PLOTS[kind], **content)), _SIZE)

    return page(
        "report.html.j2",
        vehicle=results.vehicle,
        results=results,
        made=made or _today(),
        findings=by_heading(results.findings),
        shown=max(mains, key=lambda p: p.error / max(p.unchanged, 1e-12), default=None),
        forces=curves,
        plot=plot,
        answer_at=answer_at,
        relative_error=relative_error,
        in_degrees=in_degrees,
    )
