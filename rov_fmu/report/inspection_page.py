"""The page of `rov-fmu inspect --report`: pictures of logs, what is recognised, and what no fit can learn from them."""

from collections.abc import Iterator, Sequence
from functools import partial

from markupsafe import Markup

from rov_fmu.equation.layout import Layout
from rov_fmu.identify.inspection.inspected import Inspected
from rov_fmu.io.messages import first_of
from rov_fmu.report import console_log
from rov_fmu.report.plots.logs import height_of, plot_log
from rov_fmu.report.plots.svg import in_both_widths, inline_svg, with_even_text
from rov_fmu.report.templates import inline_script, page
from rov_fmu.tank.inspection.inspection import Inspection

_WHOLE = 13.0
"""The width of a plot as broad as the page, inches."""


def inspection_page(inspected: Inspected, steps: Sequence[str] = ()) -> str:
    """Return the page as HTML. `steps` are what to do next, each in words or as a command line."""

    def plot(inspection: Inspection) -> Markup | None:
        log = inspection.log
        if log is None or not (log.commands or any(not c.unused for c in log.channels)):
            return None
        draw = with_even_text(partial(plot_log, log=log))

        def drawn(size: tuple[float, float], salt: str) -> Markup:
            label = f"{inspection.name} over time"
            return inline_svg(label, draw, size, salt=f"{salt}{inspection.path}", marked=True)

        return in_both_widths(drawn, height_of(log), _WHOLE)

    description = inspected.description
    return page(
        "inspection.html.j2",
        inspected=inspected,
        steps=steps,
        motions=[*_motions(description.layout)] if description else [],
        plot=plot,
        console=console_log,
        first_of=first_of,
        script=inline_script("plots.js"),
    )


def _motions(layout: Layout) -> Iterator[tuple[str, str, str]]:
    """Yield the positive direction of each axis, with the thrusters that push there by a positive command, and those
    that do by a negative one."""
    for axis in layout.bare_axes:
        effects = {thruster.name: thruster.effect(axis) for thruster in layout.thrusters_along(axis)}
        if effects:
            forth, back = ([name for name, effect in effects.items() if sign * effect > 0.0] for sign in (1.0, -1.0))
            yield axis.positive, ", ".join(forth), ", ".join(back)
