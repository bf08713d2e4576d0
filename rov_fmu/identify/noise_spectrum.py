"""The spectrum of a recording's noise, estimated from the residuals of a fit.

Slow noise looks like slow motion, so the fit absorbs part of it, and the residuals are less correlated than the noise.
Restricted likelihood uses only the part that the fit could not absorb.
"""

import numpy as np
from scipy.fft import dct

from rov_fmu.tank.arrays import Array

_SLOWEST = 256
"""The number of coefficients of the cosine transform that are used; faster ones contain no motion."""
_FEWEST = 10
"""The smallest number of coefficients beyond those that the fit absorbs."""
_CORNERS = 1.5 ** np.arange(14.0)
_WHITE = (0.0, 0.003, 0.01, 0.03, 0.1, 0.3)


def noise_spectrum(residuals: Array, jacobian: Array) -> Array | None:
    """Return the variance of the noise in each of n coefficients of its cosine transform; None for too few samples.

    The noise is of first order, with white noise added. The standard deviations are averaged over corner frequencies
    and shares of white noise, weighted by likelihood. Long time constants that the data do not exclude therefore count,
    too.
    """
    n = len(residuals)
    y, taken = cosines(residuals)[:_SLOWEST], _span(cosines(jacobian)[:_SLOWEST])
    remaining = len(y) - taken.shape[1]
    if remaining < _FEWEST:
        return None
    coloured = 1.0 / (1.0 + (np.arange(len(y)) / _CORNERS[:, None]) ** 2)
    shapes = np.concatenate([coloured + white for white in _WHITE])
    weights = 1.0 / shapes
    grams = np.einsum("sk,ki,kj->sij", weights, taken, taken, optimize=True)
    b = weights @ (taken * y[:, None])
    squares = weights @ (y * y) - np.sum(b * np.linalg.solve(grams, b[..., None])[..., 0], axis=1)
    logs = remaining * np.log(squares) + np.log(shapes).sum(axis=1) + np.linalg.slogdet(grams)[1]
    likelihood = np.exp(-0.5 * (logs - logs.min()))
    deviation = likelihood / likelihood.sum() @ np.sqrt(shapes * (squares / remaining)[:, None])
    return np.pad(deviation**2, (0, n - len(y)), mode="edge")


def cosines(values: Array) -> Array:
    """Return the cosine transform along the samples, which almost decorrelates stationary noise."""
    return np.asarray(dct(values, axis=0, norm="ortho"))


def _span(columns: Array) -> Array:
    """Return an orthonormal basis of the space that the columns span."""
    size = np.linalg.norm(columns, axis=0)
    U, s, _ = np.linalg.svd(columns[:, size > 0.0] / size[size > 0.0], full_matrices=False)
    return np.asarray(U[:, s > 1e-6 * s.max(initial=0.0)])
