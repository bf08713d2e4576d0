"""The plots of an identification report, and of the evidence about an FMU."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import FillBetweenPolyCollection
from matplotlib.figure import Figure

from rov_fmu.equation.catalogue import HEAVE, SURGE
from rov_fmu.identify.assess import answers_of_file
from rov_fmu.identify.result import Prediction
from rov_fmu.report.plots.identification import plot_answers, plot_forces
from rov_fmu.report.plots.logs import plot_log
from rov_fmu.report.plots.proof import plot_cost, plot_expected, plot_steps
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.report.results import FILES, example, log, prediction


def lines(ax: Axes) -> dict[str, tuple[list[float], list[float]]]:
    """The data of each line with a label."""
    return {str(line.get_label()): tuple(np.asarray(part).tolist() for part in line.get_data()) for line in ax.lines}


def bands(ax: Axes) -> list[Array]:
    """The corners of each shaded band."""
    return [
        np.asarray(band.get_paths()[0].vertices)
        for band in ax.collections
        if isinstance(band, FillBetweenPolyCollection)
    ]


def bars(ax: Axes) -> list[tuple[float, float, float]]:
    """Where each bar or shaded range begins, its width and its height."""
    patches: Any = ax.patches
    return [(patch.get_x(), patch.get_width(), patch.get_height()) for patch in patches]


def drawn(p: Prediction) -> Axes:
    figure = Figure()
    plot_log(figure, None, [p])
    (ax,) = figure.axes
    return ax


# ---- Predictions -----------------------------------------------------------------------------------------------------


def test_a_prediction_has_its_measured_and_predicted_values_and_the_band() -> None:
    p = prediction(HEAVE, "depth")
    ax = drawn(p)
    shown = lines(ax)
    assert shown["measured"][1] == pytest.approx(p.measured[:: len(p.time) // 400].tolist())
    assert shown["predicted, with 95 % band"][1] == pytest.approx(p.predicted[:: len(p.time) // 400].tolist())
    (band,) = bands(ax)
    assert band[:, 1].max() == pytest.approx((p.predicted + 1.96 * p.deviation).max(), rel=1e-3)
    assert band[:, 1].min() == pytest.approx((p.predicted - 1.96 * p.deviation).min(), rel=1e-3)
    assert ax.get_title(loc="left") == "Depth (m)"


def test_the_overview_has_a_panel_for_each_axis_above_the_commands() -> None:
    shown = [prediction(HEAVE, "depth"), prediction(SURGE, "distance")]
    figure = Figure()
    plot_log(figure, log(FILES[1], full=0.5), shown, measured=False)
    upper, _, commands = figure.axes
    assert [ax.get_title(loc="left") for ax in figure.axes] == ["Depth (m)", "Distance (m)", "Commands (%)"]
    assert [ax.get_xlabel() for ax in figure.axes] == ["", "", "time (s)"]
    time, values = lines(commands)["u_t"]
    assert [values[time.index(end)] for end in (time[0], time[-1])] == [100.0, 50.0]
    assert {*lines(upper)} == {"measured", "predicted, with 95 % band"}
    plot_log(without := Figure(), None, shown)
    assert [ax.get_xlabel() for ax in without.axes] == ["", "time (s)"]


# ---- Over the command ------------------------------------------------------------------------------------------------


def test_answers_have_a_curve_and_a_band_for_each_direction_and_the_measured_points() -> None:
    other = load_vehicle(VIDEORAY)
    surge = replace(example().axes[0], compared=answers_of_file(other, SURGE))
    figure = Figure()
    plot_answers(figure, surge, "V_ss")
    (ax,) = figure.axes
    assert len(bands(ax)) == 4
    commands, values = lines(ax)["this fit, with 95 % band"]
    assert commands == pytest.approx([-100, -50, -30])
    assert values == pytest.approx([-1.0, -0.5, -0.3])
    assert lines(ax)["measured"] == ([30.0, 50.0], [0.29, 0.51])
    assert lines(ax)["compared"][1][0] == pytest.approx(other.response(SURGE, -1.0)[0])
    assert ax.get_title(loc="left") == "Steady velocity (m/s)"
    plot_answers(times := Figure(), surge, "Tau")
    (ax,) = times.axes
    assert lines(ax)["this fit, with 95 % band"][1] == pytest.approx([0.5, 1.0, 0.5 / 0.3])
    assert lines(ax)["measured, not counted"] == ([50.0], [1.1])
    (measured,) = (point for point in surge.points if point.quantity == "Tau")
    assert lines(ax)["this fit, with the lag"] == ([50.0], [measured.model])
    assert ax.get_title(loc="left") == "Time to 63 % (s)"
    plot_forces(forces := Figure(), example().forces[::-1], [6.0, None, 2.0])
    (ax,) = forces.axes
    assert lines(ax)["this fit"][0] == [20.0, 40.0, 60.0]
    assert lines(ax)["this fit"][1] == pytest.approx([2.1, 4.2, 6.3])
    assert lines(ax)["compared"][1] == pytest.approx([2.0, np.nan, 6.0], nan_ok=True)
    assert (lines(ax)["measured"][0], ax.get_title(loc="left")) == ([40.0, 60.0], "Force (N)")


# ---- Evidence about an FMU -------------------------------------------------------------------------------------------


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
    plot_steps(steps, [1.0, 10.0], [1e-15, 1e-16], [1e-14])
    (ax,) = steps.axes
    assert [text.get_text() for text in ax.get_xticklabels()] == ["1", "10"]
    assert (lines(ax)["found"], lines(ax)["allowed"][1]) == (([0, 1], [1e-15, 1e-16]), [1e-14] * 2)
    plot_cost(cost, [1.0, 2.0, 4.0], [0.75, 0.25])
    (ax,) = cost.axes
    assert bars(ax) == [(1, 1, 75), (2, 2, 25)]
    assert ax.get_xlim() == (1.0, 4.0)
