"""Linear least squares on derivatives: the textbook's regression of smoothed accelerations."""

import numpy as np

from rov_fmu.equation.catalogue import Axis
from rov_fmu.tank.arrays import Array
from verification.identification.data import Recording, Split
from verification.identification.methods.motion import (
    Accelerations,
    features,
    largest,
    linear,
    measured,
    predicted,
    solved,
)
from verification.identification.protocol import Known

_DRAWS = 20
"""The number of vehicles drawn from the covariance for the bands."""


class LeastSquares:
    """A regression for each axis, with its covariance as if the residuals were white."""

    name, uses_thrust, has_bands = "least squares", True, False
    split: Split
    axes: list[Axis]
    weights: list[Array]
    covariances: list[Array]

    def fit(self, split: Split) -> None:
        """Regress the accelerations of all training recordings."""
        self.split, self.axes, self.limit = split, [*split.training[0].axes], largest(split)
        p, v, a, thrust = (np.concatenate(some) for some in zip(*map(measured, split.training), strict=True))
        self.weights, self.covariances = [], []
        for n in range(len(self.axes)):
            X = features(self.axes, n, p, v, thrust)
            inverse = np.linalg.pinv(X.T @ X)
            w = inverse @ X.T @ a[:, n]
            self.weights.append(w)
            self.covariances.append(inverse * np.sum((a[:, n] - X @ w) ** 2) / max(len(X) - len(w), 1))

    def predict(self, recording: Recording, begin: float, span: float) -> tuple[Array, Array]:
        """Simulate the mean, and some vehicles of the covariance for the variance."""
        random = np.random.default_rng(1)
        weights = [
            np.vstack([w, random.multivariate_normal(w, C, _DRAWS, method="svd")])
            for w, C in zip(self.weights, self.covariances, strict=True)
        ]
        found = predicted(linear(self.axes, weights), recording, begin, span, self.limit, 1 + _DRAWS)
        return found[0], np.mean((found[1:] - found[0]) ** 2, axis=0)

    def coefficients(self, axis: Axis) -> Known:
        """Return what follows from the weights."""
        n = self.axes.index(axis)
        return solved(self.split, axis, self.weights[n], self.covariances[n])


class BeyondRegression(LeastSquares):
    """The accelerations of the regression plus what another method learns, which has no coefficients."""

    rates: Accelerations

    def predict(self, recording: Recording, begin: float, span: float) -> tuple[Array, Array]:
        """Simulate the mean."""
        values = predicted(self.rates, recording, begin, span, self.limit)[0]
        return values, np.zeros(len(values))

    def coefficients(self, axis: Axis) -> Known:  # noqa: ARG002
        """There are none."""
        return {}
