"""The plots of the evidence about an FMU."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rov_fmu.report.plots.proof import plot_cost, plot_expected, plot_step_deviations


def lines(ax: Axes) -> dict[str, tuple[list[float], list[float]]]:
    """The data of each line with a label."""
    return {str(line.get_label()): tuple(np.asarray(part).tolist() for part in line.get_data()) for line in ax.lines}


def bars(ax: Axes) -> list[tuple[float, float, float]]:
    """Where each bar or shaded range begins, its width and its height."""
    patches: Any = ax.patches
    return [(patch.get_x(), patch.get_width(), patch.get_height()) for patch in patches]


def test_deviations_are_shown_below_or_above_what_is_allowed_and_steps_by_their_duration() -> None:
    expected, steps, cost = (Figure() for _ in range(3))
    plot_expected(expected, [0.0, 1e-12, 1e-6], [1e-9] * 3)
    (ax,) = expected.axes
    assert lines(ax)["found"] == ([1, 2], [1e-17, 1e-12]), "0 stands below all others"
    assert lines(ax)["too large"] == ([3], [1e-6])
    assert lines(ax)["allowed"] == ([1, 2, 3], [1e-9] * 3)
    low, high = ax.get_ylim()
    assert low < 1e-17
    assert high > 1e-6
    assert ax.yaxis.get_major_formatter()(1e-9) == "10⁻⁹"
    plot_step_deviations(steps, [1.0, 10.0], [1e-15, 1e-16], [1e-14])
    (ax,) = steps.axes
    assert [text.get_text() for text in ax.get_xticklabels()] == ["1", "10"]
    assert (lines(ax)["found"], lines(ax)["allowed"][1]) == (([0, 1], [1e-15, 1e-16]), [1e-14] * 2)
    plot_cost(cost, [1.0, 2.0, 4.0], [0.75, 0.25])
    (ax,) = cost.axes
    assert bars(ax) == [(1, 1, 75), (2, 2, 25)]
    assert ax.get_xlim() == (1.0, 4.0)
