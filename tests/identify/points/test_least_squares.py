"""Estimates with their intervals, covariances and correlations, against formulas of their own."""

from math import exp, inf, log, sqrt

import numpy as np
import pytest
from scipy.stats import t as student

from rov_fmu.identify.least_squares import (
    Estimate,
    Solution,
    bounds,
    covariance,
    estimate,
    estimate_alike,
    external,
    fit_named,
    gain,
    internal,
    kind_of,
    leave_one_out,
    minimize,
    propagated,
    rms,
)
from rov_fmu.tank.arrays import Array, Flags

BETA = kind_of("beta_u")
REACH = float(student.ppf(0.975, 5.0))


def of(names: tuple[str, ...], values: list[float], variances: list[float], degrees: float = 5.0) -> Estimate:
    return Estimate(names, np.array(values), np.diag(variances), degrees, 0.1)


def test_an_interval_ends_at_a_physical_bound_and_that_of_a_factor_is_a_ratio() -> None:
    found = of(("a_d_u", "b_d_u", "beta_u"), [20.0, 0.1, 0.8], [4.0, 1.0, 0.01])
    assert found.interval("a_d_u") == pytest.approx((20.0 - 2.0 * REACH, 20.0 + 2.0 * REACH))
    assert found.interval("b_d_u") == pytest.approx((0.0, 0.1 + REACH))
    ratio = exp(REACH * 0.1 / 0.8)
    assert found.interval("beta_u") == pytest.approx((0.8 / ratio, 0.8 * ratio))
    assert {*found.intervals} == {*found.names}
    wide = of(("beta_u",), [0.5], [1e6]).interval("beta_u")
    assert wide
    assert wide[0] == pytest.approx(0.5 / exp(100.0)), "a ratio that would overflow is cut"


@pytest.mark.parametrize(("variance", "degrees"), [(inf, 5.0), (1.0, 0.0), (1.0, -1.0)])
def test_there_is_no_interval_without_an_error_or_without_freedom(variance: float, degrees: float) -> None:
    found = of(("a_d_u",), [20.0], [variance], degrees)
    assert found.interval("a_d_u") is None
    assert found.intervals == {}
    assert np.isposinf(found.half_band(np.ones((3, 1)))).all()


def test_few_data_widen_an_interval_as_student_says() -> None:
    found = of(("a_d_u",), [20.0], [4.0])
    assert found.student == pytest.approx(REACH / 1.959964, rel=1e-6)
    assert found.as_normal().errors["a_d_u"] * 1.959964 == pytest.approx(REACH * 2.0, rel=1e-6)
    free = of(("a_d_u",), [20.0], [4.0], 0.0)
    assert free.as_normal() is free


def test_a_band_is_that_of_a_linear_function() -> None:
    found = Estimate(("a_d_u", "b_d_u"), np.ones(2), np.array([[4.0, -1.0], [-1.0, 9.0]]), 5.0, 1.0)
    reach = found.half_band(np.array([[1.0, 0.0], [1.0, 2.0]]))
    assert reach == pytest.approx([REACH * 2.0, REACH * sqrt(4.0 - 4.0 + 36.0)])
    assert found.correlation == pytest.approx(np.array([[1.0, -1.0 / 6.0], [-1.0 / 6.0, 1.0]]))
    assert found.part(["b_d_u"]).named == {"b_d_u": 1.0}
    assert found.part(["b_d_u"]).covariance == pytest.approx(9.0)


def test_what_is_not_identifiable_correlates_with_nothing() -> None:
    correlation = of(("a_d_u", "b_d_u"), [20.0, 5.0], [4.0, inf]).correlation
    assert correlation[0, 0] == 1.0
    assert np.isnan([correlation[0, 1], correlation[1, 0], correlation[1, 1]]).all()


def test_coefficients_at_a_bound_are_named() -> None:
    found = of(("a_d_u", "b_d_u", "beta_u"), [0.0, 1e-9, 0.8], [1.0, 1.0, 1.0])
    assert found.at_bound == ("a_d_u",)


def test_factors_are_fitted_by_their_logarithms() -> None:
    names = ("a_d_u", "beta_u")
    x = internal(names, {"a_d_u": 20.0, "beta_u": 0.8})
    assert x == pytest.approx([20.0, log(0.8)])
    assert external(names, np.append(x, 7.0)) == pytest.approx({"a_d_u": 20.0, "beta_u": 0.8})
    low, high = bounds(names, free=1)
    assert low == pytest.approx([0.0, log(1e-6), -inf])
    assert high == pytest.approx([1e6, log(BETA.maximum), inf])
    found = estimate(names, x, np.array([[4.0, 0.2], [0.2, 0.01]]), 5.0, 1.0)
    assert found.covariance == pytest.approx(np.array([[4.0, 0.16], [0.16, 0.0064]]))


def test_the_covariance_is_the_inverse_or_the_sandwich() -> None:
    gram, meat = np.array([[4.0, 1.0], [1.0, 9.0]]), np.array([[1.0, 0.5], [0.5, 2.0]])
    inverse = np.linalg.inv(gram)
    assert covariance(gram) == pytest.approx(inverse)
    assert covariance(gram, meat) == pytest.approx(inverse @ meat @ inverse)


@pytest.mark.parametrize(("small", "is_known"), [(1.2e-6, True), (0.8e-6, False)])
def test_parameters_below_a_millionth_of_the_largest_singular_value_are_unknown(small: float, is_known: bool) -> None:
    """Columns of unit length at an angle with the cosine c have the singular values sqrt(1 ± c)."""
    c = (1.0 - small**2) / (1.0 + small**2)
    found = covariance(np.array([[1.0, c, 0.0], [c, 1.0, 0.0], [0.0, 0.0, 4.0]]))
    assert np.isfinite(np.diag(found)).tolist() == [is_known, is_known, True]
    assert found[2] == pytest.approx([0.0, 0.0, 0.25])


def test_a_parameter_without_effect_is_unknown_and_leaves_the_others() -> None:
    found = covariance(np.diag([0.0, 4.0]))
    assert found[0, 0] == inf
    assert (found[0, 1], found[1, 0]) == (0.0, 0.0)
    assert found[1, 1] == pytest.approx(0.25)


def test_the_error_of_known_numbers_moves_the_fit() -> None:
    """The mean of y - k moves by -1 per k, whose variance is 0.09; one of 4 measurements has 0.01."""
    J, y = np.ones((4, 1)), np.array([0.1, -0.1, 0.1, -0.1])
    by_known = propagated(J, np.ones((4, 1)), np.array([[0.09]]))
    assert gain(J, np.ones((4, 1))) == pytest.approx(-1.0)
    assert by_known == pytest.approx(0.09)
    solution = Solution(np.array([20.0]), y, J)
    found = estimate_alike(("a_d_u",), solution, 4)
    assert found.degrees_of_freedom == 3.0
    assert found.noise == pytest.approx(sqrt(0.04 / 3.0))
    assert found.covariance == pytest.approx(0.04 / 3.0 / 4.0)
    assert estimate_alike(("a_d_u",), solution, 4, (np.ones((4, 1)), np.array([[0.09]]))).covariance == pytest.approx(
        0.01 / 3.0 + 0.09
    )
    none = estimate_alike(("a_d_u",), solution, 1)
    assert (none.degrees_of_freedom, np.isnan(none.noise), none.covariance[0, 0]) == (0.0, True, inf)


def test_residuals_beyond_the_threshold_pull_with_a_constant_force() -> None:
    """Of 0, 0, 0, 10 the Huber estimate with the threshold k is k/3: three pull with x, one with k."""
    y = np.array([0.0, 0.0, 0.0, 10.0])
    for threshold in (1.0, 1.5):
        found = minimize(
            lambda x: x[0] - y, np.array([5.0]), (np.array([-inf]), np.array([inf])), loss="huber", threshold=threshold
        )
        assert found.x == pytest.approx(threshold / 3.0, rel=1e-4)
        assert found.residuals == pytest.approx(threshold / 3.0 - y, rel=1e-4), "those without the loss"
        assert found.jacobian == pytest.approx(np.ones((4, 1)))


def test_a_fit_stays_within_the_bounds() -> None:
    found = fit_named(lambda k: np.array([k["b_d_u"] + 3.0, k["beta_u"] - 0.5]), {"b_d_u": 2.0, "beta_u": 1.0})
    assert external(("b_d_u", "beta_u"), found.x) == pytest.approx({"b_d_u": 0.0, "beta_u": 0.5}, abs=1e-9)


def test_each_group_is_predicted_without_itself() -> None:
    values, groups = np.array([1.0, 2.0, 4.0, 9.0]), np.array([1, 1, 2, 3])

    def mean_of_others(out: Flags) -> Array | None:
        return np.full(out.sum(), values[~out].mean()) if not out[3] else None

    assert leave_one_out(groups, mean_of_others) == pytest.approx([6.5, 6.5, 4.0, np.nan], nan_ok=True)


def test_the_root_mean_square_of_nothing_is_no_number() -> None:
    assert rms(np.array([3.0, -4.0])) == pytest.approx(sqrt(12.5))
    assert np.isnan(rms(np.zeros(0)))
