"""Gaps, headings that wrap, and scales of sensors."""

from math import pi

import numpy as np
import pytest

from rov_fmu.tank.arrays import Array
from rov_fmu.tank.log import Log
from rov_fmu.tank.quality import checked, gaps, scales_differ, unwrapped
from tests.tank.logs import channel

STEPS: Array = np.linspace(0.0, 19.9, 200)


def wrapped(heading: Array) -> Array:
    return (heading + pi) % (2.0 * pi) - pi


@pytest.mark.parametrize(
    ("interval", "lost", "found"),
    [(0.1, (5.0, 9.0), [(5.0, 9.0)]), (0.1, (5.0, 5.9), []), (1.0, (5.0, 14.0), []), (0.1, (19.95, 30.0), [])],
    ids=["4 s", "below 1 s", "nine of its intervals", "at the end"],
)
def test_gaps(interval: float, lost: tuple[float, float], found: list[tuple[float, float]]) -> None:
    time = interval * 10.0 * STEPS
    values = np.where((time > lost[0] + 1e-9) & (time < lost[1] - 1e-9), np.nan, 1.0)
    assert gaps(time, values) == [pytest.approx(gap) for gap in found]


def test_a_wrapped_heading_is_unwrapped_and_keeps_its_blanks() -> None:
    heading = 2.0 + 0.7 * STEPS
    values = wrapped(heading)
    values[50:55] = np.nan
    found = unwrapped(channel("heading", STEPS, values))
    assert np.isnan(found[50:55]).all()
    assert np.delete(found, range(50, 55)) == pytest.approx(np.delete(heading, range(50, 55)))
    np.testing.assert_allclose(unwrapped(channel("heading", STEPS, values % (2.0 * pi))), found)


def test_noise_beyond_the_end_of_the_range_is_no_second_turn() -> None:
    heading = 5.8 + 0.7 * STEPS
    values = heading % (2.0 * pi)
    values[np.abs(values - pi) > 3.0] += np.radians(2.0) * np.sign(values - pi)[np.abs(values - pi) > 3.0]
    assert values.min() < 0.0
    assert values.max() > 2.0 * pi
    found = unwrapped(channel("heading", STEPS, values))
    assert found == pytest.approx(heading, abs=np.radians(2.1))


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
