"""A plot with a lower one below it for residuals."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rov_fmu.report.plots.svg import LIGHT


def with_residuals(figure: Figure, ratio: float) -> tuple[Axes, Axes]:
    """Return a plot, and a lower one below it for residuals. The upper one is `ratio` times as high."""
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(ratio, 1.0))
    below.axhline(0.0, color=LIGHT["muted"], linewidth=0.8)
    return above, below


def finish_residuals(below: Axes, label: str) -> None:
    """Add the label of the residuals, and make their limits symmetric."""
    below.set_ylabel(label)
    below.locator_params(axis="y", nbins=3)
    reach = 1.15 * max(map(abs, below.get_ylim()))
    below.set_ylim(-reach, reach)
