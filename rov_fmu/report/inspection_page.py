"""The page of `rov-fmu inspect --report`: pictures of logs, what is recognised, and what no fit can learn from them."""

from functools import partial

from markupsafe import Markup

from rov_fmu.identify.inspection.inspected import Inspected
from rov_fmu.io.messages import first_of
from rov_fmu.report import console_log
from rov_fmu.report.plots.logs import height_of, plot_log
from rov_fmu.report.plots.svg import inline_svg, with_even_text
from rov_fmu.report.templates import page
from rov_fmu.tank.inspection.inspection import Inspection

_WIDTH = 7.2
"""The width of a picture, inches."""


def inspection_page(inspected: Inspected) -> str:
    """Return the page as HTML."""

    def plot(inspection: Inspection) -> Markup | None:
        log = inspection.log
        if log is None or not (log.commands or any(not c.unused for c in log.channels)):
            return None
        draw = with_even_text(partial(plot_log, log=log))
        return inline_svg(f"{inspection.name} over time", draw, (_WIDTH, height_of(log)), salt=str(inspection.path))

    return page(
        "inspection.html.j2",
        inspected=inspected,
        plot=plot,
        console=console_log,
        first_of=first_of,
    )
