"""The parts of a report, from results made by hand: what is known, steps close up, effects, noise that is none."""

from dataclasses import replace
from math import degrees, exp, log

import numpy as np
import pytest
from matplotlib.figure import Figure

from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.identification import AxisResult
from rov_fmu.identify.least_squares import Estimate
from rov_fmu.identify.recordings.held_out import HeldOut
from rov_fmu.identify.recordings.recordings_fit import FittedEffect, RecordingsFit
from rov_fmu.identify.recordings.residual_analysis import Simulation
from rov_fmu.model.layout import HEAVE, YAW
from rov_fmu.model.rov import Rov
from rov_fmu.report.console_results import acting_words
from rov_fmu.report.findings import Known, acting, effects, verdict
from rov_fmu.report.plots.fits import plot_known
from rov_fmu.report.plots.overview import plot_correlation
from rov_fmu.report.plots.recordings import clearest_step, modelled, plot_recording, plot_step
from rov_fmu.report.report import scatter
from rov_fmu.report.templates import number, two_digits, with_error
from rov_fmu.vehicle.shipped import VIDEORAY
from rov_fmu.vehicle.vehicle import load_vehicle

DELAY_TIME = 0.4  # s, between commands and motion
LOAD = FittedEffect("load", "heave", "N", 0.0, (-0.1, 0.1), kept=False)
DELAY = FittedEffect("delay", "heave", "s", DELAY_TIME, (0.39, 0.41), kept=True)
OF_FILE = FittedEffect("delay", "b.csv", "s", 0.1, None, kept=True)


@pytest.fixture(scope="module")
def k() -> Rov:
    return load_vehicle(VIDEORAY).rov


def recorded(
    file: str, changes: dict[float, float], *, delay: float = 0.0, by_thrusters: bool = False, white: float = 1.0
) -> Simulation:
    """20 s of depth at 20 Hz: the command at each change, and a velocity that follows with 1 s, half of it."""
    time = np.arange(400) / 20.0
    command, velocity = np.zeros(400), np.zeros(400)
    for at, value in changes.items():
        command[time >= at - 1e-9] = value
        after = time >= at + delay
        velocity[after] += (0.5 * value - velocity[after]) * (1.0 - np.exp(-(time[after] - at - delay)))
    depth = np.cumsum(velocity) / 20.0
    of_axis, of_thrusters = (None, {"t": command}) if by_thrusters else (command, {})
    recording = Recording(file, HEAVE, "depth", time, of_axis, depth, of_thrusters)
    noise = 1e-5 * np.random.default_rng(0).standard_normal(400)
    return Simulation(recording, time, depth + noise, depth, velocity, 1e-5, white, 3)


def result_of(k: Rov, *simulations: Simulation, acts: tuple[FittedEffect, ...] = ()) -> AxisResult:
    estimate = Estimate((), np.zeros(0), np.zeros((0, 0)), 1.0, 1.0)

    fit = RecordingsFit(HEAVE, k, estimate, estimate, simulations, acts, lambda: HeldOut((), by_halves=False))
    return AxisResult(HEAVE, (), (), None, None, fit, {}, ())


# ---- What is known ---------------------------------------------------------------------------------------------------


def bars(figure: Figure) -> list[list[float]]:
    """The ends of the intervals as drawn, in the plot's numbers."""
    return [np.asarray(line.get_xdata()).tolist() for line in figure.axes[0].lines if line.get_linewidth() == 6.0]


def test_intervals_stand_side_by_side_by_their_ratio_to_the_value() -> None:
    figure = Figure()
    plot_known(figure, [Known("a_d_w", 2.0, (1.0, 4.0), "1", False), Known("F_0_w", -0.5, (-0.6, -0.4), "N", False)])
    assert bars(figure) == [pytest.approx([-log(2.0), log(2.0)]), pytest.approx([log(0.8), log(1.2)])]
    assert [label.get_text() for label in figure.axes[0].get_yticklabels()] == ["a_d_w", "F_0_w"]
    shown = {
        label.get_text(): at
        for label, at in zip(figure.axes[0].get_xticklabels(), figure.axes[0].get_xticks(), strict=True)
    }
    assert shown["value"] == 0.0
    assert shown["+100 %"] == pytest.approx(log(2.0))
    assert shown["−50 %"] == pytest.approx(-log(2.0))


@pytest.mark.parametrize(
    ("value", "interval"), [(1.0, (0.0, 40.0)), (1.0, None), (0.0, (0.0, 0.3)), (0.2, (-0.3, 0.7))]
)
def test_a_wide_interval_goes_beyond_the_plot(value: float, interval: tuple[float, float] | None) -> None:
    figure = Figure()
    plot_known(figure, [Known("b_d_w", value, interval, "N.s/m", False)])
    low, high = figure.axes[0].get_xlim()
    assert bars(figure)[0][0] == pytest.approx(low)
    assert exp(high) <= 5.0 + 1e-9
    assert {line.get_marker() for line in figure.axes[0].lines} >= {"<"}


# ---- One step close up -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("by_thrusters", [False, True])
def test_the_clearest_step_is_the_strongest_preferably_from_rest(k: Rov, by_thrusters: bool) -> None:
    weak = recorded("a.csv", {3.0: 0.3}, by_thrusters=by_thrusters)
    strong = recorded("b.csv", {4.0: 0.7, 12.0: 0.0}, by_thrusters=by_thrusters)
    fit = result_of(k, weak, strong).recordings
    assert fit
    step = clearest_step(fit)
    assert step
    assert (step.simulation.recording.file, step.at) == ("b.csv", 4.0)
    force = f"0 → {k.force(HEAVE, 0.7):.3g} N"
    assert step.words == (force if by_thrusters else "0 → 70 %")
    if not by_thrusters:
        assert step.Tau == pytest.approx(k.response(HEAVE, 0.7)[1])


def test_a_recording_that_only_begins_with_a_command_has_no_step(k: Rov) -> None:
    fit = result_of(k, recorded("a.csv", {0.0: 0.5}), recorded("b.csv", {19.9: 0.5})).recordings
    assert fit
    assert clearest_step(fit) is None


def test_the_delay_is_marked_and_seen(k: Rov) -> None:
    result = result_of(k, recorded("b.csv", {4.0: 0.7}, delay=DELAY_TIME), acts=(LOAD, DELAY))
    assert result.recordings
    step = clearest_step(result.recordings)
    assert step
    figure = Figure()
    plot_step(figure, result, step)
    (ax,) = figure.axes
    (span,) = ax.patches
    box = span.get_path().get_extents(span.get_patch_transform())
    assert (box.x0, box.x1) == pytest.approx((0.0, DELAY_TIME))
    low, high = ax.get_xlim()
    assert low == -1.0
    assert high == pytest.approx(max(3.0 * step.Tau, 1.0) + DELAY_TIME)
    (model,) = [line for line in ax.lines if line.get_label() == "model"]
    time, v = (np.asarray(data) for data in model.get_data())
    assert np.interp(DELAY_TIME - 0.25, time, v) < 0.02, "it rests until the delay is over"
    assert np.interp(DELAY_TIME + 0.6, time, v) > 0.1


def test_the_model_is_drawn_as_the_sensor_would_measure_it(k: Rov) -> None:
    simulation = recorded("b.csv", {4.0: 0.7})
    time, v = modelled(simulation)
    assert v == pytest.approx(np.interp(time, simulation.time, simulation.velocity), abs=0.03)
    figure = Figure()
    plot_recording(figure, result_of(k, simulation), simulation)
    assert [line.get_label() for line in figure.axes[0].lines] == ["measured", "model"]


# ---- In words --------------------------------------------------------------------------------------------------------


def test_effects_kept_come_first_and_the_others_are_left_at_nothing(k: Rov) -> None:
    ratio = FittedEffect("reverse thrust", "top", "1", 0.98, (0.9, 1.1), kept=False)
    result = result_of(k, recorded("b.csv", {4.0: 0.7}), acts=(LOAD, ratio, DELAY))
    assert effects(result) == (DELAY, LOAD, ratio)
    assert [verdict(effect) for effect in effects(result)] == ["kept", "left at 0", "left at 1"]
    assert acting(DELAY) == "delay from the commands to the motion"


def test_the_delay_of_a_recording_is_that_of_the_axis_and_its_own(k: Rov) -> None:
    result = result_of(k, acts=(DELAY, OF_FILE, LOAD))
    assert result.recordings
    assert result.recordings.delay_of("a.csv") == DELAY_TIME
    assert result.recordings.delay_of("b.csv") == pytest.approx(DELAY_TIME + 0.1)


def test_residuals_are_noise_only_where_they_are_white() -> None:
    assert scatter(recorded("a.csv", {1.0: 0.3})) == "residuals of 10⁻⁵ m, white: the sensor’s noise"
    found = scatter(recorded("a.csv", {1.0: 0.3}, white=12.3))
    assert found == "residuals of 10⁻⁵ m, correlated over 12 samples: more than noise"
    heave = recorded("a.csv", {1.0: 0.3})
    yaw = replace(heave, recording=replace(heave.recording, axis=YAW, quantity="heading"))
    assert scatter(yaw) == f"residuals of {number(degrees(yaw.noise), 2)} °, white: the sensor’s noise"


def test_the_printout_tells_more_or_less_of_a_recording() -> None:
    effects = [
        FittedEffect("delay", of, "s", value, (value - 0.01, value + 0.01), kept=True, axis=axis)
        for of, value, axis in (("surge", 0.2, ""), ("a.csv", 0.05, "surge"), ("b.csv", -0.05, "yaw"))
    ]
    whole, more, less = acting_words(effects).split(", ")
    assert "more" not in whole
    assert more == "surge in a.csv 0.050 s more"
    assert less == "yaw in b.csv 0.050 s less)"


def test_errors_keep_two_digits() -> None:
    """0.010 m beside a noise of 0.0099 m does not look like a coarser number."""
    assert [two_digits(value) for value in (0.0099, 0.01, 0.4, 1.0, 417.0, -0.5)] == [
        *("0.0099", "0.010", "0.40", "1.0", "420", "−0.50")
    ]
    assert two_digits(np.inf) == "–"


def test_a_value_has_the_digits_that_suit_its_error() -> None:
    assert with_error(0.24512345, 0.00042) == ("0.2451", "0.00042")
    assert with_error(1.5, 0.31) == ("1.5", "0.31")
    assert with_error(-0.3, None) == ("−0.3", "–")
    assert with_error(None, None) == ("–", "–")


def test_correlations_have_the_same_decimals_unless_they_are_near_1() -> None:
    figure = Figure()
    correlation = np.array([[1.0, -0.9, 0.9994], [-0.9, 1.0, 0.046], [0.9994, 0.046, 1.0]])
    plot_correlation(figure, ("a_d_u", "b_d_u", "beta_u"), correlation)
    assert [text.get_text() for text in figure.axes[0].texts] == ["−0.90", "0.9994", "0.05"]
