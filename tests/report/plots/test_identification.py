"""The plots of an identification report."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import FillBetweenPolyCollection
from matplotlib.figure import Figure

from rov_fmu.equation.catalogue import HEAVE, SURGE
from rov_fmu.identify.assess import answers_of_file
from rov_fmu.identify.result import Prediction
from rov_fmu.report.plots.identification import plot_answers, plot_prediction
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.report.results import example, prediction


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


def drawn(p: Prediction) -> Axes:
    figure = Figure()
    plot_prediction(figure, p)
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
