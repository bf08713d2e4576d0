"""Output error: SciPy's least squares on simulated windows of 10 s, without a model of the noise."""

from itertools import pairwise

import numpy as np
from scipy.optimize import least_squares

from rov_fmu.tank.arrays import Array
from verification.identification.data import Split
from verification.identification.methods.least_squares import LeastSquares
from verification.identification.methods.motion import linear, measured, simulate

WINDOW = 200
"""The steps of a window: 10 s."""
_EVERY = 4
"""Every so many steps count."""
_EVALUATIONS = 15


class OutputError(LeastSquares):
    """The same model as that of the regression, which is its start. All windows begin at the smoothed measurements."""

    name = "output error"

    def fit(self, split: Split) -> None:
        """Minimise the errors of positions and velocities relative to their deviations."""
        super().fit(split)
        p, v, thrust = windows(split, WINDOW)
        goal = np.stack([p, v])
        scale = spreads(goal)
        ends = np.cumsum([len(w) for w in self.weights])[:-1]
        start = np.concatenate(self.weights)
        unit = np.maximum(np.abs(start), 0.01 * np.max(np.abs(start)))

        def errors(x: Array) -> Array:
            rates = linear(self.axes, np.split(x * unit, ends))
            path = np.stack(simulate(rates, p[:, 0], v[:, 0], thrust[:, :-1], self.limit))
            off = (path - goal) / scale[:, None, None]
            return np.asarray(off[:, :, ::_EVERY].ravel())

        found = least_squares(errors, start / unit, max_nfev=_EVALUATIONS, diff_step=1e-4)
        self.weights = np.split(found.x * unit, ends)
        J, degrees = found.jac, max(len(found.fun) - len(start), 1)
        C = np.linalg.pinv(J.T @ J) * 2.0 * found.cost / degrees * np.outer(unit, unit)
        bounds = [0, *ends, len(start)]
        self.covariances = [C[a:b, a:b] for a, b in pairwise(bounds)]


def spreads(goal: Array) -> Array:
    """Return the deviations of positions and velocities, 2 x axes; infinite for what no sensor measures."""
    found = np.std(goal, axis=(1, 2))
    return np.where(found > 0.0, found, np.inf)


def windows(split: Split, steps: int) -> tuple[Array, Array, Array]:
    """Return positions, velocities and thrust of all windows of the training, windows x (steps + 1) x axes."""
    found = []
    for recording in split.training:
        p, v, _, thrust = measured(recording)
        many = min(steps, len(p) - 1)
        for first in range(0, len(p) - many, max(many // 2, 1)):
            own = slice(first, first + many + 1)
            found.append([np.pad(x[own], ((0, steps - many), (0, 0)), mode="edge") for x in (p, v, thrust)])
    p, v, thrust = (np.array(some) for some in zip(*found, strict=True))
    return p, v, thrust
