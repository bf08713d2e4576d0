"""The posterior: evidence by marginal likelihoods, and the mixture of models with and without an effect."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.stats import multivariate_normal, t

from rov_fmu.identify.likelihood.parameters import Parameter, Table
from rov_fmu.identify.likelihood.posterior import QUANTILE, Posterior, around
from rov_fmu.tank.arrays import Array
from tests.vehicles import VIDEORAY, extended

LOAD = Parameter("load", "heave", mean=0.02, deviation=0.05, null=0.0)
INERTIA = Parameter("inertia", "heave", mean=0.0, deviation=0.5, is_log=True)
OFFSET = Parameter("logging offset", "log.csv", deviation=0.1, log=0)


def conjugate(parameters: Sequence[Parameter], A: Array, y: Array, noise: float) -> Posterior:
    """Return the posterior of y = A z + white noise, of parameters of the VideoRay."""
    weight = np.diag([p.deviation**-2.0 for p in parameters])
    M = A.T @ A / noise**2 + weight
    z = np.linalg.solve(M, A.T @ y / noise**2 + weight @ np.array([p.mean for p in parameters]))
    k = extended(VIDEORAY, F_0_w=0.0)
    return Posterior.of(Table(k.layout, k.coefficients, {"heave": 6.0}, tuple(parameters)), z, 2.0 * M)


@pytest.mark.parametrize(("true", "noise", "absent"), [(0.0, 0.3, (0,)), (0.15, 0.1, ())])
def test_an_effect_is_weighed_against_the_model_without_it(true: float, noise: float, absent: tuple[int, ...]) -> None:
    """The other model has no load, but the same other numbers, and the samples have a normal distribution in both.

    An effect without evidence widens the others: the result is the mixture of both models.
    """
    random = np.random.default_rng(2)
    A = random.standard_normal((15, 3)) + np.array([1.0, 0.5, -0.5])
    y = A @ np.array([true, 0.3, -0.4]) + noise * random.standard_normal(15)
    parameters = [LOAD, INERTIA, OFFSET]
    posterior, other = conjugate(parameters, A, y, noise), conjugate(parameters[1:], A[:, 1:], y, noise)

    def likelihood(chosen: slice) -> float:
        m, s = (np.array([getattr(p, key) for p in parameters[chosen]]) for key in ("mean", "deviation"))
        S = noise**2 * np.eye(15) + A[:, chosen] @ np.diag(s**2) @ A[:, chosen].T
        return float(multivariate_normal.logpdf(y, A[:, chosen] @ m, S))

    ratio = likelihood(slice(3)) - likelihood(slice(1, 3))
    assert posterior.evidence(0) == pytest.approx(2.0 * ratio, rel=1e-6)
    assert posterior.absent == absent
    without, mixed = posterior.without([0]), posterior.averaged
    assert without.z == pytest.approx([0.0, *other.z])
    assert without.covariance[1:, 1:] == pytest.approx(other.covariance)
    if absent:
        share, shift = 1.0 / (1.0 + np.exp(-ratio)), posterior.z - without.z
        C = share * posterior.covariance + (1.0 - share) * without.covariance
        assert mixed.z == pytest.approx(share * posterior.z + (1.0 - share) * without.z)
        assert mixed.covariance == pytest.approx(C + share * (1.0 - share) * np.outer(shift, shift))


def test_without_an_effect_the_others_stay_within_their_bounds() -> None:
    """The vehicle without a load is the best one within the bounds, and its evidence is that of this vehicle."""
    random, noise = np.random.default_rng(1), 0.1
    A = random.standard_normal((15, 3))
    A[:, 1] += 3.0 * A[:, 0]
    y = A @ np.array([0.15, 0.3, -0.4]) + noise * random.standard_normal(15)
    parameters = [LOAD, replace(INERTIA, high=0.335), OFFSET]
    posterior = conjugate(parameters, A, y, noise)
    mean, deviation = (np.array([getattr(p, key) for p in parameters]) for key in ("mean", "deviation"))
    rows, values = np.vstack([A / noise, np.diag(1.0 / deviation)]), np.array([*y / noise, *mean / deviation])
    best = lsq_linear(rows[:, 1:], values, ([-np.inf, -np.inf], [0.335, np.inf]), tol=1e-14)
    assert posterior.z[1] < best.x[0] == pytest.approx(0.335), "only without the load, it is at its bound"
    assert posterior.without([0]).z == pytest.approx([0.0, *best.x])
    worse = 2.0 * best.cost - np.sum((rows @ posterior.z - values) ** 2)
    ratio = worse - (mean[0] / deviation[0]) ** 2 + 2.0 * np.log(posterior.errors[0] / deviation[0])
    assert posterior.evidence(0) == pytest.approx(ratio, rel=1e-6)


def test_intervals_are_those_of_student() -> None:
    assert pytest.approx(t.ppf(0.975, 10)) == QUANTILE
    low, high = around(3.0, 0.5)
    assert (low, high) == pytest.approx((3.0 - 0.5 * QUANTILE, 3.0 + 0.5 * QUANTILE))
    low, high = around(3.0, 2.0, positive=True)
    assert 0.0 < low < 3.0
    assert low * high == pytest.approx(9.0), "of a positive number, the logarithm has the symmetric distribution"
    assert np.isfinite(around(1e-9, 1e9, positive=True)).all()
