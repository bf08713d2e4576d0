"""The spectrum of a recording's noise, by what a fit leaves of it.

Slow noise looks like slow motion: the fit takes part of it away, so the residuals are less correlated than the noise
was. Restricted likelihood asks only what the fit could not take.
"""

import numpy as np
from scipy.fft import dct

from rov_fmu.tank.arrays import Array

_SLOWEST = 256  # coefficients of the cosine transform: the motion is slow, and what is faster tells nothing of it
_FEWEST = 10  # of them, beyond what the fit takes
_CORNERS = 1.5 ** np.arange(14.0)
_WHITE = (0.0, 0.003, 0.01, 0.03, 0.1, 0.3)


def noise_spectrum(residuals: Array, jacobian: Array) -> Array | None:
    """Variance of noise in each coefficient of its cosine transform, n; None where there are too few.

    Noise of first order with white noise on top. Standard deviations are averaged over corner frequencies and shares of
    white noise by their likelihood, so long time constants that cannot be excluded count.
    """
    n = len(residuals)
    y, taken = cosines(residuals)[:_SLOWEST], _span(cosines(jacobian)[:_SLOWEST])
    left = len(y) - taken.shape[1]
    if left < _FEWEST:
        return None
    coloured = 1.0 / (1.0 + (np.arange(len(y)) / _CORNERS[:, None]) ** 2)
    shapes = np.concatenate([coloured + white for white in _WHITE])
    weights = 1.0 / shapes
    grams = np.einsum("sk,ki,kj->sij", weights, taken, taken, optimize=True)
    b = weights @ (taken * y[:, None])
    squares = weights @ (y * y) - np.sum(b * np.linalg.solve(grams, b[..., None])[..., 0], axis=1)
    logs = left * np.log(squares) + np.log(shapes).sum(axis=1) + np.linalg.slogdet(grams)[1]
    likelihood = np.exp(-0.5 * (logs - logs.min()))
    deviation = likelihood / likelihood.sum() @ np.sqrt(shapes * (squares / left)[:, None])
    return np.pad(deviation**2, (0, n - len(y)), mode="edge")


def cosines(values: Array) -> Array:
    """The cosine transform along the samples; it hardly leaves stationary noise correlated."""
    return np.asarray(dct(values, axis=0, norm="ortho"))


def _span(columns: Array) -> Array:
    """An orthonormal basis of what columns, of whatever size, span."""
    size = np.linalg.norm(columns, axis=0)
    U, s, _ = np.linalg.svd(columns[:, size > 0.0] / size[size > 0.0], full_matrices=False)
    return np.asarray(U[:, s > 1e-6 * s.max(initial=0.0)])
