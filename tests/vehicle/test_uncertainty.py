"""[estimates] of a vehicle file: writing, reading, checking and drawing vehicles."""

from collections.abc import Callable
from dataclasses import replace
from math import log
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.stats import kstest, norm, qmc, spearmanr

import rov_fmu
from rov_fmu.cli import main
from rov_fmu.equation.catalogue import HEAVE
from rov_fmu.identify.beginning import load_tests
from rov_fmu.identify.identify import identify
from rov_fmu.vehicle.schema import Estimated
from rov_fmu.vehicle.uncertainty import Uncertainty
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from rov_fmu.vehicle.writer import write_tuned, write_vehicle
from tests.commands import ALONE, FROZEN_REFIT, Capsys
from tests.often import spread
from tests.recordings import SHOWN, dive, write_dives
from tests.vehicles import with_intervals

TEXT = FROZEN_REFIT.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def refit() -> Vehicle:
    return load_vehicle(FROZEN_REFIT)


def of(values: list[float], errors: list[float], correlation: list[list[float]]) -> Uncertainty:
    """Return the distribution of some drag coefficients, which are never negative."""
    p = len(values)
    bounds = np.column_stack([np.zeros(p), np.full(p, np.inf)])
    names = ("a_d_u", "b_d_u", "a_d_w")[:p]
    return Uncertainty(names, np.array(values), np.array(errors), np.array(correlation), bounds)


# ---- Draws against a dive --------------------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize("seed", spread(range(3), (), [0]))
def test_the_range_of_200_draws_contains_the_samples_of_an_unseen_dive(seed: int, tmp_path: Path) -> None:
    """A VideoRay is identified from two dives of 20 s. A third one, with the noise of the sensors, is not seen.

    The range of each sample is that of 90 % of the draws, with the same noise. It contains more of them, because the
    intervals of the file contain those of the fit with all effects, among them the power of drag.
    """
    vehicle = identify(load_tests(write_dives(tmp_path / "dives", seed, count=2, seconds=20.0))).vehicle
    random = np.random.default_rng(1000 + seed)
    unseen = dive(random, 20.0)
    drawn = vehicle.draws(200, np.random.default_rng(1))
    inputs = {f"u_{name}": values for name, values in unseen.commands.items()}
    write_vehicle(vehicle, tmp_path / "found.toml")
    many = rov_fmu.load(tmp_path / "found.toml")
    runs = many.simulate_many(unseen.time, inputs, coefficients=drawn)
    inside = []
    for name, sample in unseen.noisy(random).items():
        noisy = runs[name] + SHOWN[name] * random.standard_normal(runs[name].shape)
        low, high = np.quantile(noisy, [0.05, 0.95], axis=0)
        inside.append(np.mean((low <= sample) & (sample <= high)))
    assert 0.85 <= min(inside) <= max(inside) <= 0.99


# ---- Writing, reading and checking -----------------------------------------------------------------------------------


def test_estimates_read_back_as_they_were_written(refit: Vehicle, tmp_path: Path) -> None:
    rows = {
        "a_d_u": Estimated(error=4.0),
        "b_d_u": Estimated(error=1234.5049, correlation={"a_d_u": -1.0}),
        "beta_w": Estimated(error=0.5, correlation={"a_d_u": 0.123456, "b_d_u": -0.123456}),
    }
    rows["b_d_w"] = Estimated(error=4.0, correlation={"a_d_u": -4e-7})
    write_vehicle(with_intervals(refit, refit.intervals, rows), tmp_path / "made.toml")
    assert load_vehicle(tmp_path / "made.toml").estimates == rows
    write_vehicle(with_intervals(refit, refit.intervals), tmp_path / "none.toml")
    assert "estimates" not in (tmp_path / "none.toml").read_text(encoding="utf-8")


def test_tuning_removes_the_estimate_and_keeps_the_others(refit: Vehicle, tmp_path: Path) -> None:
    path = tmp_path / "tuned.toml"
    write_tuned(FROZEN_REFIT, path, {"a_d_u": 9.0}, "a test")
    others = load_vehicle(path).estimates
    assert {*refit.estimates} - {*others} == {"a_d_u"}
    assert others["b_d_u"] == refit.estimates["b_d_u"].model_copy(update={"correlation": {}})
    assert others["beta_w"] == refit.estimates["beta_w"]
    by_hand = refit.with_(a_d_u=9.0)
    assert (by_hand.estimates, {*refit.intervals} - {*by_hand.intervals}) == (others, {"a_d_u"})
    axes = tuple(one for one in refit.layout.axes if one.axis is not HEAVE)
    flat = refit.with_(replace(refit.layout, axes=axes))
    assert flat.coefficients == {name: x for name, x in refit.coefficients.items() if not name.endswith("_w")}
    assert flat.sources.keys() == flat.coefficients.keys() > flat.intervals.keys() == flat.estimates.keys()
    assert flat.estimates["b_d_u"] == refit.estimates["b_d_u"]
    assert all(row.correlation.keys() <= flat.estimates.keys() for row in flat.estimates.values())
    write_tuned(FROZEN_REFIT, path, {name: 1.01 * refit[name] + 0.1 for name in refit.estimates}, "a test")
    assert "estimates" not in path.read_text(encoding="utf-8")


BAD: dict[str, tuple[Callable[[str], str], str]] = {
    "of no estimate": (
        lambda text: text.replace("beta_r = { err", "m_rov = { err"),
        "estimates.m_rov: m_rov has no interval, so it is not an estimate",
    ),
    "with no estimate": (
        lambda text: text.replace("{ a_d_u =", "{ m_rov ="),
        "estimates.b_d_u.correlation.m_rov = -0.883478: there is no such coefficient in this table",
    ),
    "with itself": (
        lambda text: text.replace("{ a_d_u =", "{ b_d_u ="),
        "estimates.b_d_u.correlation.b_d_u = -0.883478: of a coefficient with itself is 1 and is not given",
    ),
    "given twice": (
        lambda text: text.replace("2.00458 }", "2.00458, correlation = { b_d_u = -0.883478 } }"),
        "estimates.b_d_u.correlation.a_d_u = -0.883478: estimates.a_d_u gives it already",
    ),
    "above 1": (
        lambda text: text.replace("-0.883478", "-1.5"),
        "estimates.b_d_u.correlation.a_d_u = -1.5: must be greater than or equal to -1",
    ),
    "that contradicts others": (
        lambda text: text.replace("a_d_w = -0.652272", "a_d_w = 0.9"),
        "estimates: these correlations contradict each other: the least eigenvalue is -0.441, not 0",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_estimate_is_one_clear_line(case: str, tmp_path: Path, capsys: Capsys) -> None:
    change, words = BAD[case]
    path = tmp_path / "bad.toml"
    text = change(TEXT)
    assert text != TEXT
    path.write_text(text, encoding="utf-8")
    assert main(["build", str(path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"rov-fmu: {path}: {words}")


def test_a_correlation_of_1_is_allowed(tmp_path: Path) -> None:
    """Drag in reverse is identified as a multiple of drag ahead, so their correlation is 1 before rounding."""
    path = tmp_path / "one.toml"
    third = " a_d_w = -0.652272, b_d_w = 0.366024"
    text = TEXT.replace("-0.860225", "1.0").replace(third, " a_d_w = 0.5, b_d_w = 0.50001")
    path.write_text(text, encoding="utf-8")
    found = load_vehicle(path).uncertainty
    drawn = found.drawn(np.random.default_rng(0).random((500, len(found.names))))
    a_d, b_d = (drawn[:, found.names.index(name)] for name in ("a_d_w", "b_d_w"))
    both = (a_d > 0.0) & (b_d > 0.0)
    assert both.sum() > 200
    assert spearmanr(a_d[both], b_d[both]).statistic > 0.999


# ---- The distribution and its draws ----------------------------------------------------------------------------------


def test_an_interval_without_estimates_is_normal_and_uncorrelated(tmp_path: Path) -> None:
    path = tmp_path / "with.toml"
    text = ALONE.replace('6.57, unit = "kg"', '6.57, unit = "kg", interval = [6.374, 6.766]')
    text = text.replace("value = 0.6324,", "value = 0.6324, interval = [0.0, 1.0244],")  # which ends at a bound
    text = text.replace("value = 1.1,", "value = 1.1, interval = [1.0, 1.331],")
    path.write_text(text, encoding="utf-8")
    found = load_vehicle(path).uncertainty
    assert found.names == ("m_rov", "b_d_w", "alpha_u")
    assert found.errors == pytest.approx([0.1, 0.2, 1.1 * log(1.331) / 3.92], rel=1e-4)
    vehicle = load_vehicle(path)
    gamma = vehicle.layout.coefficients["gamma"]
    between_bounds = with_intervals(vehicle, {"gamma": (gamma.minimum, gamma.maximum)}).uncertainty
    assert between_bounds.errors == pytest.approx([(gamma.maximum - vehicle["gamma"]) / 1.96], rel=1e-4)
    drawn = found.drawn(qmc.Sobol(3, scramble=False).random(1024))
    assert kstest(drawn[1:, 0], norm(6.57, 0.1).cdf).statistic < 0.002
    assert np.isfinite(drawn).all(), "the first number of Sobol's sequence is 0"


def test_draws_are_normal_with_the_given_correlations() -> None:
    """The rank correlation of normal numbers is 6/π arcsin(ρ/2)."""
    found = of([50.0, 80.0, 60.0], [1.0, 2.0, 3.0], [[1.0, -0.9, 0.3], [-0.9, 1.0, 0.0], [0.3, 0.0, 1.0]])
    drawn = found.drawn(qmc.Sobol(3, seed=0).random(4096))
    for n in range(3):
        assert kstest(drawn[:, n], norm(found.values[n], found.errors[n]).cdf).statistic < 0.01
    ranks = spearmanr(drawn).statistic
    assert ranks == pytest.approx(6.0 / np.pi * np.arcsin(found.correlation / 2.0), abs=0.01)


@pytest.mark.parametrize("b", [0.0, 0.5])
def test_draws_at_a_bound_agree_with_bounded_fits(b: float) -> None:
    """y = a x² + b x + noise with b >= 0: compare the draws with as many bounded fits (SciPy) of noisy data."""
    x = np.linspace(0.2, 1.0, 8)
    M = np.column_stack([x * x, x])
    random, noise, n = np.random.default_rng(1), 0.4, 2000
    data = M @ [8.0, b] + noise * random.standard_normal((n, 8))
    fits = np.array([lsq_linear(M, y, bounds=([0.0, 0.0], np.inf), method="bvls").x for y in data])
    covariance = noise**2 * np.linalg.inv(M.T @ M)
    error = np.sqrt(np.diag(covariance))
    drawn = of([8.0, b], [*error], (covariance / np.outer(error, error)).tolist()).drawn(random.random((n, 2)))
    for numbers in ([1.0, 0.0], [0.0, 1.0], [0.36, 0.6]):  # a, b, and the force at x = 0.6
        assert kstest(drawn @ numbers, fits @ numbers).statistic < 0.06
    assert np.mean(drawn[:, 1] == 0.0) == pytest.approx(np.mean(fits[:, 1] < 1e-12), abs=0.05)
