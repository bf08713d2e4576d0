"""The posterior: evidence against numerical integrals, and conditional and propagated normal distributions."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal, t

from rov_fmu.identify.likelihood.parameters import Parameter, Table
from rov_fmu.identify.likelihood.posterior import QUANTILE, Posterior, around
from rov_fmu.tank.arrays import Array
from tests.vehicles import VIDEORAY

LOAD = Parameter("load", "heave", mean=0.02, deviation=0.05, null=0.0)
INERTIA = Parameter("inertia", "heave", mean=0.0, deviation=0.5, is_log=True)
QUADRATIC = Parameter("quadratic drag", "heave", mean=np.log(18.0), deviation=1.0, is_log=True)
LINEAR = Parameter("linear drag", "heave", mean=np.log(0.6), deviation=1.5, is_log=True)
OFFSET = Parameter("logging offset", "log.csv", deviation=0.1, log=0)


def table(*parameters: Parameter) -> Table:
    """Return parameters of the VideoRay."""
    k = VIDEORAY.extended({"F_0_w": 0.0})
    return Table(k.layout, k.coefficients, {"heave": 6.0}, parameters)


def conjugate(parameters: Sequence[Parameter], A: Array, y: Array, noise: float) -> Posterior:
    """Return the posterior of y = A z + white noise."""
    weight = np.diag([p.deviation**-2.0 for p in parameters])
    M = A.T @ A / noise**2 + weight
    z = np.linalg.solve(M, A.T @ y / noise**2 + weight @ np.array([p.mean for p in parameters]))
    return Posterior.of(table(*parameters), z, 2.0 * M)


@pytest.mark.parametrize("true", [0.0, 0.15])
def test_the_evidence_beside_other_numbers_is_that_of_both_models(true: float) -> None:
    """The marginal distribution of the samples is normal; the other model has no load, but the same other numbers."""
    random = np.random.default_rng(2)
    A, noise = random.standard_normal((15, 3)) + np.array([1.0, 0.5, -0.5]), 0.3
    y = A @ np.array([true, 0.3, -0.4]) + noise * random.standard_normal(15)
    parameters = [LOAD, INERTIA, OFFSET]
    posterior = conjugate(parameters, A, y, noise)

    def evidence(chosen: list[int]) -> float:
        m, s = ([getattr(parameters[n], key) for n in chosen] for key in ("mean", "deviation"))
        S = noise**2 * np.eye(15) + A[:, chosen] @ np.diag(np.square(s)) @ A[:, chosen].T
        return float(multivariate_normal.logpdf(y, A[:, chosen] @ np.array(m), S))

    assert posterior.evidence(0) == pytest.approx(2.0 * (evidence([0, 1, 2]) - evidence([1, 2])), rel=1e-6)


def posterior_of(*parameters: Parameter, seed: int = 3) -> Posterior:
    """Return a posterior with correlations, and errors of half of the prior's."""
    root = np.random.default_rng(seed).standard_normal((len(parameters), 2 * len(parameters)))
    C = root @ root.T
    s = 0.5 * np.array([p.deviation for p in parameters]) / np.sqrt(np.diag(C))
    z = np.array([p.mean for p in parameters]) + 0.1 * s
    return Posterior(table(*parameters), z, C * np.outer(s, s))


def test_without_an_effect_the_others_have_their_conditional_means() -> None:
    """The mean of the others given that the load is 0, by samples near 0."""
    posterior = posterior_of(LOAD, INERTIA, LINEAR)
    found = posterior.without([0])
    assert found.z[0] == 0.0
    draws = np.random.default_rng(4).multivariate_normal(posterior.z, posterior.covariance, 400_000)
    near = draws[np.abs(draws[:, 0]) < 0.1 * posterior.errors[0]]
    assert found.z[1:] == pytest.approx(near[:, 1:].mean(axis=0), abs=0.01 * float(np.max(posterior.errors)))
    assert np.abs(found.z[1:] - posterior.z[1:]).max() > 0.02
    assert posterior.without([]) is posterior


def test_only_optional_effects_without_evidence_are_absent() -> None:
    table_of_three = table(LOAD, replace(LOAD, of="surge"), INERTIA)
    posterior = Posterior(table_of_three, np.array([0.001, 0.1, 0.0]), np.diag(np.square([0.01, 0.01, 0.3])))
    assert posterior.evidence(0) < 0.0
    assert posterior.evidence(1) > 50.0
    assert posterior.absent == (0,)


def test_an_effect_without_evidence_widens_the_others_by_its_probability() -> None:
    """The mean and the covariance are those of the mixture of the models with and without it."""
    posterior = posterior_of(LOAD, INERTIA, LINEAR)
    assert posterior.absent == (0,)
    share = 1.0 / (1.0 + np.exp(-0.5 * posterior.evidence(0)))
    without, mixed = posterior.without([0]), posterior.averaged
    shift = posterior.z - without.z
    C = share * posterior.covariance + (1.0 - share) * without.covariance
    assert mixed.z == pytest.approx(share * posterior.z + (1.0 - share) * without.z)
    assert mixed.covariance == pytest.approx(C + share * (1.0 - share) * np.outer(shift, shift))
    assert 0.0 < share < 0.5
    assert (mixed.errors[1:] <= posterior.errors[1:] + 1e-12).all()


def test_the_errors_of_coefficients_are_those_of_their_logarithms() -> None:
    """Coefficients that are exp(z) have the relative error of z, and β is in inverse proportion to the inertia."""
    posterior = posterior_of(QUADRATIC, LINEAR, INERTIA, OFFSET)
    names = ["a_d_w", "b_d_w", "beta_w", "m_rov"]

    def values_of(z: Array) -> Array:
        coefficients = posterior.table.coefficients(z.tolist())
        return np.array([coefficients[name] for name in names])

    values, covariance, prior = posterior.numbers(values_of)
    k = posterior.table.coefficients(posterior.z.tolist())
    assert values.tolist() == [k[name] for name in names]
    signs = np.array([1.0, 1.0, -1.0])
    C = posterior.covariance[:3, :3] * np.outer(signs, signs)
    assert covariance[:3, :3] / np.outer(values[:3], values[:3]) == pytest.approx(C, rel=1e-2)
    assert np.sqrt(np.diag(prior)) == pytest.approx(values * np.array([1.0, 1.5, 0.5, 0.0]), rel=1e-2)
    assert covariance[3, 3] == 0.0
    assert posterior.of_vehicle == (0, 1, 2)


def test_intervals_are_those_of_student() -> None:
    assert pytest.approx(t.ppf(0.975, 10)) == QUANTILE
    low, high = around(3.0, 0.5)
    assert (low, high) == pytest.approx((3.0 - 0.5 * QUANTILE, 3.0 + 0.5 * QUANTILE))
    low, high = around(3.0, 2.0, positive=True)
    assert 0.0 < low < 3.0
    assert low * high == pytest.approx(9.0), "of a positive number, the logarithm has the symmetric distribution"
    assert np.isfinite(around(1e-9, 1e9, positive=True)).all()
