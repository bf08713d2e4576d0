"""Smoothed velocities of sensors with noise and spikes (section 4.1)."""

import numpy as np
import pytest

from rov_fmu.identify.adapter.smoothing import Method, velocity, without_spikes
from rov_fmu.tank.arrays import Array


@pytest.mark.parametrize("method", ["savitzky-golay", "moving average"])
def test_velocity_of_a_ramp(method: Method) -> None:
    time = np.sort(np.random.default_rng(3).uniform(0.0, 10.0, 1000))  # a logger without a steady clock
    even, v = velocity(time, 0.3 * time, is_position=True, method=method)
    assert np.ptp(np.diff(even)) < 1e-9
    inner = slice(80, -80)  # the moving average has spikes at its ends, as the paper says of Figure 11
    assert v[inner] == pytest.approx(0.3, abs=1e-9)
    _, same = velocity(time, np.full_like(time, 0.3), is_position=False, method=method)
    assert same == pytest.approx(0.3, abs=1e-12)


def test_without_spikes_leaves_the_rest_alone() -> None:
    values = np.sin(np.arange(500) / 30.0) + 0.01 * np.random.default_rng(0).standard_normal(500)
    spiked = values.copy()
    spiked[[50, 51, 200]] += 2.0
    found = without_spikes(spiked)
    assert found[[50, 51, 200]] == pytest.approx(values[[50, 51, 200]], abs=0.1)
    assert np.mean(found != spiked) < 0.02
    assert without_spikes(np.zeros(30)).tolist() == [0.0] * 30


def test_rows_in_bursts_take_no_longer_than_others() -> None:
    """The usual interval within a burst is 1 us; a window of 0.5 s would have half a million of them."""
    time: Array = np.sort(np.concatenate([10.0 * np.arange(5) + 1e-6 * k for k in range(10)]))
    even, v = velocity(time, 0.3 * time, is_position=True)
    assert len(even) < 200_000
    assert v == pytest.approx(0.3, abs=1e-6)
    ramp: Array = np.linspace(0.0, 999.0, 1000)
    even, _ = velocity(0.01 * ramp, ramp, is_position=True)
    assert len(even) == 1000
