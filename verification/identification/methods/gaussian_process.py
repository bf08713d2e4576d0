"""A Gaussian process on the residuals of the regression (scikit-learn)."""

from warnings import catch_warnings, simplefilter

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

from rov_fmu.tank.arrays import Array
from verification.identification.data import Split
from verification.identification.methods.least_squares import BeyondRegression
from verification.identification.methods.motion import linear, measured

_POINTS = 300
"""The number of points of the training that are kept, at random."""


class GaussianProcess(BeyondRegression):
    """The acceleration of each axis is that of the regression plus a process over all velocities and thrusts."""

    name = "Gaussian process"

    def fit(self, split: Split) -> None:
        """Fit the regression, and the process to what it leaves, whose mean is added."""
        super().fit(split)
        p, v, a, thrust = (np.concatenate(some) for some in zip(*map(measured, split.training), strict=True))
        rest = a - linear(self.axes, self.weights)(p, v, thrust)
        inputs = np.concatenate([v, thrust], axis=1)
        mean, scale = inputs.mean(axis=0), inputs.std(axis=0) + 1e-9
        kept = np.random.default_rng(1).choice(len(p), min(_POINTS, len(p)), replace=False)
        X = ((inputs - mean) / scale)[kept]
        sizes = rest.std(axis=0) + 1e-12
        kernel = ConstantKernel(0.3) * RBF(np.full(X.shape[1], 2.0), (0.3, 30.0)) + WhiteKernel(0.7)
        with catch_warnings():
            simplefilter("ignore", ConvergenceWarning)  # a quantity without an effect has an endless length
            processes = [GaussianProcessRegressor(kernel, random_state=1).fit(X, y) for y in (rest[kept] / sizes).T]
        base = linear(self.axes, self.weights)

        def rates(p: Array, v: Array, thrust: Array) -> Array:
            X = (np.concatenate([v, thrust], axis=1) - mean) / scale
            return np.asarray(base(p, v, thrust) + np.column_stack([one.predict(X) for one in processes]) * sizes)

        self.rates = rates
