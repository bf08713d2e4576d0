"""Logs as recordings: conditions, gaps, headings that wrap, and scales of sensors."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from rov_fmu.identify.adapter.recording import recordings_of
from rov_fmu.model.layout import HEAVE, PITCH, VehicleAxis
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.findings import SENTENCES, sentences
from rov_fmu.tank.quality import gaps, unwrapped
from rov_fmu.vehicle.shipped import PAPER
from tests.tank.logs import channel, commands, log

STEPS: Array = np.linspace(0.0, 19.9, 200)


def wrapped(heading: Array) -> Array:
    return (heading + pi) % (2.0 * pi) - pi


def test_conditions_are_interpolated_at_the_times_of_a_recording() -> None:
    """The voltage comes each 5 s, roll and pitch are no axes of this vehicle, and the distance begins at 0."""
    still: Array = np.zeros(len(STEPS))
    down = commands(STEPS, {"l": still, "r": still, "t": np.where(STEPS > 2.0, 0.5, still)})
    slow = np.array([0.0, 5.0, 10.0, 15.0])
    channels = [
        channel("depth", STEPS, 1.0 + 0.1 * STEPS),
        channel("roll angle", STEPS, wrapped(0.4 * STEPS)),
        channel("pitch angle", STEPS, np.where(STEPS < 1.0, np.nan, 0.2)),
        channel("surge distance", STEPS, 7.0 + STEPS),
        channel("voltage", slow, 16.0 - 0.1 * slow),
    ]
    recordings, _ = recordings_of(log(down, *channels), PAPER)
    (heave,) = (recording for recording in recordings if recording.axis is HEAVE)
    assert heave.context["voltage"] == pytest.approx(16.0 - 0.1 * np.minimum(STEPS, 15.0))
    assert heave.context["roll"] == pytest.approx(0.4 * STEPS)
    assert heave.context["pitch"] == pytest.approx(0.2 * np.ones(len(STEPS)))
    assert heave.context["depth"] == pytest.approx(heave.values)
    assert heave.context["distance"] == pytest.approx(STEPS)


def test_a_recording_along_an_axis_without_thrusters_is_left_out() -> None:
    """Weight rights a vehicle in pitch, and fins may turn it; the recordings of other axes are used."""
    layout = replace(PAPER, axes=(*PAPER.axes, VehicleAxis(PITCH)))
    step = commands(STEPS, {name: np.where(STEPS > 2.0, 0.5, 0.0) for name in "lrt"})
    channels = channel("depth", STEPS, STEPS), channel("pitch angle", STEPS, 0.1 * np.sin(STEPS))
    recordings, findings = recordings_of(log(step, *channels), layout)
    assert [recording.axis for recording in recordings] == [HEAVE]
    assert [finding for finding in sentences(findings, SENTENCES) if "pitch" in finding] == [
        "a.csv: the recording of pitch is left out: no thruster drives it, and the effect of fins is not fitted"
    ]


@pytest.mark.parametrize(
    ("interval", "lost", "found"),
    [(0.1, (5.0, 9.0), [(5.0, 9.0)]), (0.1, (5.0, 5.9), []), (1.0, (5.0, 14.0), []), (0.1, (19.95, 30.0), [])],
    ids=["4 s", "below 1 s", "nine of its intervals", "at the end"],
)
def test_gaps(interval: float, lost: tuple[float, float], found: list[tuple[float, float]]) -> None:
    time = interval * 10.0 * STEPS
    values = np.where((time > lost[0] + 1e-9) & (time < lost[1] - 1e-9), np.nan, 1.0)
    assert gaps(time, values) == [pytest.approx(gap) for gap in found]


def test_gaps_are_told_with_their_time_and_length() -> None:
    depth = np.where((STEPS > 4.95) & (STEPS < 9.05) | (STEPS > 12.95) & (STEPS < 15.05), np.nan, STEPS)
    step = commands(STEPS, {name: np.where(STEPS > 2.0, 0.5, 0.0) for name in "lrt"})
    _, findings = recordings_of(log(step, channel("depth", STEPS, depth)), PAPER)
    assert sentences(findings, SENTENCES) == ("a.csv: 2 gaps in heave: 4.2 s from 4.9 s on, 2.2 s from 12.9 s on",)


def test_a_wrapped_heading_is_unwrapped_and_keeps_its_blanks() -> None:
    heading = 2.0 + 0.7 * STEPS
    values = wrapped(heading)
    values[50:55] = np.nan
    found = unwrapped(channel("heading", STEPS, values))
    assert np.isnan(found[50:55]).all()
    assert np.delete(found, range(50, 55)) == pytest.approx(np.delete(heading, range(50, 55)))
    np.testing.assert_allclose(unwrapped(channel("heading", STEPS, values % (2.0 * pi))), found)


@pytest.mark.parametrize("turns", [0.05, 3.0], ids=["within a turn", "several turns"])
def test_a_continuous_heading_stays_as_it_is_over_a_gap(turns: float) -> None:
    """The vehicle turns by more than half a turn in the gap, which looks like a jump."""
    heading = turns * pi * np.where(STEPS < 8.0, 0.0, 1.0) + np.where(STEPS < 8.0, 0.0, 3.2) + 0.001 * STEPS
    there = (STEPS < 8.0) | (STEPS > 12.0)
    assert (unwrapped(channel("heading", STEPS[there], heading[there])) == heading[there]).all()


@pytest.mark.parametrize(("scale", "is_told"), [(1.0, False), (1.008, False), (1.02, True), (0.97, True)])
def test_sensors_of_other_scales_are_told(scale: float, is_told: bool) -> None:
    """A noisy depth, and the velocity of the same motion at other times, with a current of 0.05 m/s between them."""
    random = np.random.default_rng(0)
    time, at = np.arange(0.0, 120.0, 0.1), np.arange(0.03, 120.0, 0.05)
    depth = scale * (2.0 * np.sin(0.3 * time) + 0.05 * time) + 0.005 * random.standard_normal(len(time))
    speed = 0.6 * np.cos(0.3 * at) + 0.01 * random.standard_normal(len(at))
    channels = channel("depth", time, depth), channel("heave velocity", at, speed)
    down = commands(time, {"l": 0.0 * time, "r": 0.0 * time, "t": 0.5 * np.sign(np.sin(0.3 * time))})
    recordings, findings = recordings_of(log(down, *channels), PAPER)
    assert [recording.quantity for recording in recordings] == ["depth"]
    assert [f.kind for f in findings] == ["scales differ"] * is_told
    for finding in findings:
        assert finding.numbers["factor"] == pytest.approx(scale, abs=0.003)
    _, tilted = recordings_of(log(down, *channels, channel("pitch angle", time, 0.1 * time)), PAPER)
    assert not tilted
