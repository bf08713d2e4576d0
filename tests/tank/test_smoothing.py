"""Smoothed velocities of sensors with noise and spikes (section 4.1)."""

import numpy as np
import pytest

from rov_fmu.tank.smoothing import Method, velocity, without_spikes


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
