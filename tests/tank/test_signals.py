"""Headings that wrap, and scales of sensors."""

from math import pi

import numpy as np
import pytest

from rov_fmu.tank.arrays import Array
from rov_fmu.tank.log import Log
from rov_fmu.tank.quality import checked, gaps, scales_differ, unwrapped
from tests.tank.logs import channel

STEPS: Array = np.linspace(0.0, 19.9, 200)


def test_a_heading_is_unwrapped_keeps_its_blanks_and_noise_beyond_its_range_is_no_second_turn() -> None:
    heading = 5.8 + 0.7 * STEPS
    values = heading % (2.0 * pi)
    values[50:55] = np.nan
    values += np.radians(2.0) * np.sign(values - pi) * (np.abs(values - pi) > 3.0)
    found = unwrapped(channel("heading", STEPS, values))
    there = np.isfinite(values)
    assert np.isnan(found[~there]).all()
    assert found[there] == pytest.approx(heading[there], abs=np.radians(2.1))


def test_an_angle_that_ranges_over_clearly_more_than_a_turn_is_no_wrapped_one() -> None:
    values = np.tile(np.linspace(-3.4, 3.4, 100), 2)
    assert unwrapped(channel("heading", STEPS, values)).tolist() == values.tolist()


def test_a_gap_is_longer_than_1_s_and_than_ten_usual_intervals() -> None:
    for usual, within, beyond in ((0.05, 0.99, 1.01), (0.2, 1.99, 2.01)):
        time = np.cumsum([0.0, *[usual] * 5, within, *[usual] * 5, beyond, *[usual] * 5])
        assert gaps(time, time) == [pytest.approx((time[11], time[12]))]


@pytest.mark.parametrize(("scale", "is_told"), [(1.0, False), (1.008, False), (1.02, True), (0.97, True)])
def test_sensors_of_other_scales_are_told(scale: float, is_told: bool) -> None:
    """A noisy depth, and the velocity of the same motion at other times, with a current of 0.05 m/s between them."""
    random = np.random.default_rng(0)
    time, at = np.arange(0.0, 120.0, 0.1), np.arange(0.03, 120.0, 0.05)
    depth = scale * (2.0 * np.sin(0.3 * time) + 0.05 * time) + 0.005 * random.standard_normal(len(time))
    speed = 0.6 * np.cos(0.3 * at) + 0.01 * random.standard_normal(len(at))
    channels = channel("depth", time, depth), channel("heave velocity", at, speed)
    findings = scales_differ("a.csv", channels[0], channels)
    assert [f.kind for f in findings] == ["scales differ"] * is_told
    for finding in findings:
        assert finding.numbers["factor"] == pytest.approx(scale, abs=0.003)
    assert not scales_differ("a.csv", channels[0], (*channels, channel("pitch angle", time, 0.1 * time)))
    told = {f.kind for f in checked(Log("a.csv", None, channels)).findings}
    assert ("scales differ" in told) is is_told
