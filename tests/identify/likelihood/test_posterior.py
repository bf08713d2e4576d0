"""The posterior: evidence by marginal likelihoods, and intervals."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal, t

from rov_fmu.identify.likelihood.kinds import KINDS
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


@pytest.mark.parametrize(("true", "noise"), [(0.0, 0.3), (0.15, 0.1)])
def test_an_effect_is_weighed_against_the_model_without_it(true: float, noise: float) -> None:
    """The other model has no load, but the same other numbers, and the samples have a normal distribution in both."""
    random = np.random.default_rng(2)
    A = random.standard_normal((15, 3)) + np.array([1.0, 0.5, -0.5])
    y = A @ np.array([true, 0.3, -0.4]) + noise * random.standard_normal(15)
    parameters = [LOAD, INERTIA, OFFSET]
    posterior = conjugate(parameters, A, y, noise)

    def likelihood(chosen: slice) -> float:
        m, s = (np.array([getattr(p, key) for p in parameters[chosen]]) for key in ("mean", "deviation"))
        S = noise**2 * np.eye(15) + A[:, chosen] @ np.diag(s**2) @ A[:, chosen].T
        return float(multivariate_normal.logpdf(y, A[:, chosen] @ m, S))

    ratio = likelihood(slice(3)) - likelihood(slice(1, 3))
    assert posterior.evidence(0) == pytest.approx(2.0 * ratio, rel=1e-6)


@pytest.mark.parametrize("kind", [kind for kind, one in KINDS.items() if one.finest])
def test_what_is_below_the_finest_size_is_no_effect_however_exact_the_data_are(kind: str) -> None:
    table = Table(VIDEORAY.layout, VIDEORAY.coefficients, {}, (replace(LOAD, kind=kind, mean=0.0),))
    for size, is_effect in ((0.5, False), (20.0, True)):
        exact = Posterior(table, np.array([size * KINDS[kind].finest]), np.array([[1e-20]]))
        assert (exact.evidence(0) > 0.0) == is_effect


def test_an_absent_effect_has_no_error_and_the_others_have_those_of_the_model_without_it() -> None:
    A = np.random.default_rng(2).standard_normal((15, 3))
    weight = np.diag([1.0 / p.deviation**2 for p in (LOAD, INERTIA, OFFSET)])
    full, other = (A[:, n:].T @ A[:, n:] + weight[n:, n:] for n in (0, 1))
    table = conjugate([LOAD, INERTIA, OFFSET], A, A[:, 0], 1.0).table
    found = Posterior.of(table, np.zeros(3), 2.0 * full, {0})
    assert found.covariance[1:, 1:] == pytest.approx(np.linalg.inv(other))
    assert found.errors[0] == 0.0


def test_intervals_are_those_of_student() -> None:
    assert pytest.approx(t.ppf(0.975, 10)) == QUANTILE
    low, high = around(3.0, 0.5)
    assert (low, high) == pytest.approx((3.0 - 0.5 * QUANTILE, 3.0 + 0.5 * QUANTILE))
    low, high = around(3.0, 2.0, positive=True)
    assert 0.0 < low < 3.0
    assert low * high == pytest.approx(9.0), "of a positive number, the logarithm has the symmetric distribution"
    assert np.isfinite(around(1e-9, 1e9, positive=True)).all()
