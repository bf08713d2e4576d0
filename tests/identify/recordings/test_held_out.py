"""Predictions of data that was not fitted: their errors are in units, beside the noise and a model without change."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from math import degrees

import numpy as np
import pytest

from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.adapter.smoothing import sensor_noise
from rov_fmu.identify.diagnostics import on_axis
from rov_fmu.identify.findings import sentences
from rov_fmu.identify.identification import AxisResult
from rov_fmu.identify.least_squares import Estimate
from rov_fmu.identify.recordings import held_out
from rov_fmu.identify.recordings.held_out import HeldOut, hold_out
from rov_fmu.identify.recordings.prediction_errors import Errors, shown_in
from rov_fmu.identify.recordings.recordings_fit import RecordingsFit
from rov_fmu.identify.simulation.limits import MotionError
from rov_fmu.identify.simulation.prepared import PreparedRecording, prepare
from rov_fmu.identify.simulation.simulator import Simulator
from rov_fmu.model.layout import HEAVE, SURGE, YAW, Axis
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.findings import Finding
from tests.recordings import NOISE, PLANS, clean
from tests.vehicles import VIDEORAY

RATE = 20.0
SPANS, QUANTITIES = ("10 s", "whole recording"), ("position", "velocity")


def recorded(axis: Axis, noise: float | None = None) -> list[Recording]:
    """Return two recordings of 60 s of an axis."""
    random = np.random.default_rng(0)
    plans = PLANS[axis.name][:2]
    return [clean(VIDEORAY, axis, plan, RATE).noisy(random, f"log_{n}.csv", noise) for n, plan in enumerate(plans)]


def predicted(recordings: list[Recording], vehicle: Rov = VIDEORAY) -> HeldOut:
    """Return the predictions by a vehicle, of which nothing is fitted."""
    data = tuple(prepare(recording, vehicle) for recording in recordings)
    model = Simulator(data, vehicle, (), (), np.full(len(data), NOISE[data[0].axis.name]))
    return hold_out(model, model.start({}, {}))[data[0].axis.name]


@pytest.mark.parametrize("axis", [SURGE, HEAVE, YAW], ids=lambda axis: axis.name)
def test_the_true_vehicle_is_as_far_off_as_the_sensor_and_others_are_further(axis: Axis) -> None:
    """Surge has the sensor of a velocity, the others that of a position."""
    recordings = recorded(axis)
    drag = axis.coefficient("a_d")
    true, wrong, worse = (
        predicted(recordings, VIDEORAY.replaced({drag: factor * VIDEORAY[drag]})).errors for factor in (1.0, 1.5, 3.0)
    )
    assert {*true} == {(span, quantity) for span in SPANS for quantity in QUANTITIES}
    for key, errors in true.items():
        error, unchanged, noise = errors.rms
        assert noise == pytest.approx(error, rel=0.5)
        assert error < 0.3 * unchanged
        assert errors.explained > 0.99
        assert error < wrong[key].rms[0] < worse[key].rms[0]
        assert errors.explained > wrong[key].explained > worse[key].explained
        assert errors.rms[1:] == pytest.approx(wrong[key].rms[1:], rel=0.1), "neither depends on the vehicle"
    assert true["10 s", "velocity" if axis is SURGE else "position"].rms[2] == pytest.approx(NOISE[axis.name], rel=0.05)


def test_a_model_without_change_stays_where_it_is_and_as_fast() -> None:
    """The vehicle sinks steadily after 20 s at 30 %; then its velocity is no change, and its depth is one."""
    whole = clean(VIDEORAY, HEAVE, ((0.3, 60.0),), RATE)
    late = whole.time >= 20.0
    recording = Recording("log.csv", HEAVE, "depth", whole.time[late] - 20.0, whole.command[late], whole.position[late])
    errors = predicted([recording, replace(recording, file="other.csv")]).errors
    V_ss = VIDEORAY.response(HEAVE, 0.3)[0]
    assert errors["10 s", "position"].rms[1] == pytest.approx(V_ss * 10.0 / np.sqrt(3.0), rel=0.02)
    assert errors["10 s", "velocity"].rms[1] == pytest.approx(0.0, abs=1e-4)
    assert errors["10 s", "position"].rms[0] == pytest.approx(0.0, abs=1e-4)


def test_predictions_of_10_s_leave_out_gaps_and_short_recordings() -> None:
    (recording, _) = recorded(HEAVE)
    assert recording.command is not None
    there = (recording.time < 12.0) | (recording.time > 38.0)
    gap = replace(
        recording, time=recording.time[there], command=recording.command[there], values=recording.values[there]
    )
    counts = [
        len(predicted([r, replace(r, file="other.csv")]).predictions[0].errors["10 s", "position"].noise)
        for r in (recording, gap)
    ]
    assert counts[0] == 5 * (round(10.0 * RATE) - 1)
    assert 0 < counts[1] < counts[0]
    short = replace(
        recording, time=recording.time[:200], command=recording.command[:200], values=recording.values[:200]
    )
    errors = predicted([short, replace(short, file="other.csv")]).errors
    assert {span for span, _ in errors} == {"whole recording"}


def test_a_prediction_that_cannot_be_computed_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    predict = held_out._predictions

    def failing(
        model: Simulator, x: Array, *data: Sequence[PreparedRecording], on_step: Callable[[], None] | None
    ) -> Iterator[held_out.Prediction]:
        if data[0][0].recording.file == "log_1.csv":
            raise MotionError
        yield from predict(model, x, *data, on_step=on_step)

    monkeypatch.setattr(held_out, "_predictions", failing)
    found = predicted(recorded(HEAVE))
    assert [p.recording.file for p in found.predictions] == ["log_0.csv"]
    assert found.failed == ("log_1.csv",)


def test_a_single_recording_is_predicted_in_halves_with_as_many_samples() -> None:
    found = predicted(recorded(HEAVE)[:1])
    assert found.by_halves
    assert not predicted(recorded(HEAVE)).by_halves
    early, late = (prediction.time for prediction in found.predictions)
    whole = recorded(HEAVE)[0].time
    assert np.concatenate([early, late]).tolist() == whole.tolist()
    assert len(early) == len(late)


def test_the_error_of_a_prediction_is_relative_to_that_without_change() -> None:
    """It is the mean square over 10 s; nothing moves in a log of rest, where it is 0."""
    prediction = predicted(recorded(HEAVE)).predictions[0]
    error, unchanged, _ = prediction.errors["10 s", "velocity"].rms
    assert prediction.error == pytest.approx((error / unchanged) ** 2)
    nothing = Errors(np.ones(3), np.zeros(3), np.ones(3))
    prediction.__dict__["errors"] = {("whole recording", "velocity"): nothing}
    assert prediction.error == 0.0


def test_what_is_explained_is_the_change_beyond_the_noise() -> None:
    change, noise = np.full(100, 5.0), np.full(100, 3.0)
    assert Errors(noise, change, noise).explained == 1.0
    assert Errors(change, change, noise).explained == 0.0
    assert Errors(np.full(100, np.sqrt(17.0)), change, noise).explained == pytest.approx(0.5)
    assert np.isnan(Errors(noise, noise, noise).explained)


def test_angles_are_shown_in_degrees() -> None:
    assert shown_in(YAW, "position") == (degrees(1.0), "deg")
    assert shown_in(YAW, "velocity") == (degrees(1.0), "deg/s")
    assert shown_in(SURGE, "velocity") == (1.0, "m/s")


def test_the_noise_of_a_sensor_is_at_least_its_rounding() -> None:
    time = np.arange(1000) / RATE
    rounded = np.round(0.02 * time, 2)
    assert sensor_noise(rounded) == pytest.approx(0.01 / np.sqrt(12.0))
    noisy = 0.02 * time + 0.005 * np.random.default_rng(0).standard_normal(1000)
    assert sensor_noise(noisy) == pytest.approx(0.005, rel=0.1)


def test_poor_and_failed_predictions_are_warned_of() -> None:
    recordings, alpha = recorded(YAW), YAW.coefficient("alpha")
    good, poor = (predicted(recordings, VIDEORAY.replaced({alpha: x * VIDEORAY[alpha]})) for x in (1.0, 0.1))
    nothing = Estimate((), np.zeros(0), np.zeros((0, 0)), 1.0, 1.0)

    def warned(found: HeldOut) -> list[Finding]:
        fit = RecordingsFit(YAW, VIDEORAY, nothing, nothing, (), (), lambda: found)
        return [*on_axis(AxisResult(YAW, (), (), None, None, fit, {}, ()), VIDEORAY, {})]

    assert warned(good) == []
    (finding,) = warned(poor)
    assert finding.kind == "poor prediction"
    assert finding.numbers["predicted"] == degrees(poor.errors["10 s", "velocity"].rms[0])
    assert "deg/s, and the sensor's noise is 3 deg/s" in sentences([finding])[0]
    (failed,) = warned(replace(good, failed=("log_9.csv",)))
    assert (failed.kind, failed.file) == ("failed prediction", "log_9.csv")
    assert sentences([failed])[0].startswith("yaw: the motion of log_9.csv cannot be computed with a fit to the others")
