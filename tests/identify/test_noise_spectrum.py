"""The spectrum of noise from the residuals of a fit that absorbed its slow part."""

import numpy as np
import pytest
from scipy.signal import lfilter

from rov_fmu.identify.noise_spectrum import cosines, noise_spectrum
from rov_fmu.identify.points.step_responses import correlation_time

N = 1200
SLOW = np.asarray(np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, N), 8), dtype=np.float64)
"""The derivatives by nine parameters of a model."""
BASIS = np.linalg.qr(SLOW)[0]


def left(rho: float, white: float, seed: int) -> np.ndarray:
    """Return the residuals of a fit to first-order noise of variance 1, with white noise added."""
    random = np.random.default_rng(seed)
    noise = lfilter([np.sqrt(1.0 - rho**2)], [1.0, -rho], random.standard_normal(N + 500))[500:]
    noise = noise + white * random.standard_normal(N)
    return np.asarray(noise - BASIS @ (BASIS.T @ noise))


@pytest.mark.parametrize(("rho", "white"), [(0.8, 0.5), (0.9, 0.0)])
def test_the_noise_before_the_fit_is_found(rho: float, white: float) -> None:
    """The variance of the residuals alone is at least a quarter too small."""
    residuals = [left(rho, white, seed) for seed in range(40)]
    truth = (1.0 + rho) / (1.0 - rho) + white**2
    found = [noise_spectrum(r, SLOW) for r in residuals]
    assert np.median([spectrum[0] for spectrum in found if spectrum is not None]) == pytest.approx(truth, rel=0.2)
    assert np.median([correlation_time(r) * np.mean(r**2) for r in residuals]) < 0.75 * truth


def test_slow_noise_hardly_disturbs_what_swings_tell() -> None:
    """The variance of a parameter from 20 oscillations agrees with many seeds, despite much stronger slow noise."""
    rho, swings = 0.98, np.sin(np.linspace(0.0, 40.0 * np.pi, N))
    found = [noise_spectrum(left(rho, 0.0, seed), SLOW) for seed in range(20)]
    told = [float(cosines(swings) ** 2 @ spectrum) for spectrum in found if spectrum is not None]
    assert np.median(told) == pytest.approx(np.var([swings @ left(rho, 0.0, seed) for seed in range(500)]), rel=0.3)
    assert np.median(told) < 0.3 * (1.0 + rho) / (1.0 - rho) * float(swings @ swings)


def test_repeated_and_empty_columns_are_no_more_to_take() -> None:
    residuals = left(0.95, 0.0, 0)
    more = np.column_stack([SLOW, 1e6 * SLOW[:, 3], np.zeros(N)])
    one, other = noise_spectrum(residuals, SLOW), noise_spectrum(residuals, more)
    assert one == pytest.approx(other, rel=1e-6)


def test_few_samples_tell_no_spectrum() -> None:
    assert noise_spectrum(left(0.95, 0.0, 0)[:8], SLOW[:8]) is None
