"""Outliers in a robust fit: only the sign of an outlier counts, not its distance."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rov_fmu.identify.recordings.output_error import fit_recordings
from rov_fmu.identify.recordings.recordings_fit import FittedEffect, RecordingsFit
from rov_fmu.identify.recordings.residual_analysis import ResidualAnalysis
from rov_fmu.model.layout import HEAVE
from rov_fmu.model.rov import Rov
from rov_fmu.vehicle.vehicle import Vehicle
from tests.recordings import PLANS, clean


def _fit(k: Rov, size: float) -> RecordingsFit:
    """Fit a recording in heave; every fiftieth sample is off by so many standard deviations, on alternate sides."""
    recording = clean(k, HEAVE, PLANS["heave"][0]).noisy(np.random.default_rng(16))
    values = recording.values.copy()
    values[25::100] += 0.005 * size
    values[75::200] -= 0.005 * size
    unknowing = k.replaced({"a_d_w": 1.0, "b_d_w": 1.0, "beta_w": 1.0})
    (fit,) = fit_recordings([replace(recording, values=values)], unknowing)
    return fit


def _loads(fit: RecordingsFit) -> list[FittedEffect]:
    return [effect for effect in fit.effects if effect.kind == "load"]


@pytest.mark.long
def test_an_outlier_counts_by_its_side_not_its_size(vehicle: Vehicle) -> None:
    near, far = (_fit(vehicle.rov, size) for size in (20.0, 2000.0))
    assert near.simulations[0].outliers == far.simulations[0].outliers
    assert far.estimate.values == pytest.approx(near.estimate.values, rel=1e-5)
    assert far.estimate.covariance == pytest.approx(near.estimate.covariance, rel=1e-3)
    for one, other in zip(_loads(near), _loads(far), strict=True):
        assert other.value == pytest.approx(one.value, rel=1e-3)
        assert other.interval == pytest.approx(one.interval, rel=1e-3)


def test_outliers_lie_beyond_two_and_a_half_standard_deviations(vehicle: Vehicle) -> None:
    """With normal noise, 1.24 % of the samples count as outliers."""
    (simulation,) = _fit(vehicle.rov, 0.0).simulations
    assert simulation.outliers / len(simulation.time) == pytest.approx(0.0124, abs=0.004)
    assert simulation.noise == pytest.approx(0.005, rel=0.03)


@pytest.mark.parametrize("contaminated", [0.0, 0.05])
def test_outliers_are_counted_by_the_deviation_that_is_shown(contaminated: float) -> None:
    """Where the fit assumes less noise, such as in residuals with slow noise, normal residuals are no outliers."""
    random = np.random.default_rng(7)
    time, assumed, true = np.arange(20_000.0), 0.01, 0.023
    residuals = random.normal(0.0, true, len(time))
    jumps = random.random(len(time)) < contaminated
    residuals[jumps] += random.choice([-10.0, 10.0], jumps.sum()) * true
    none = np.zeros(len(time))
    prepared, output = SimpleNamespace(recording=None, time=time, values=residuals), SimpleNamespace(values=none)
    output.velocity = none
    model: Any = SimpleNamespace(
        count_of_tables=0, rows=[slice(0, len(time))], recordings=[[0]], data=[prepared], sigma=np.array([assumed])
    )
    model.run = lambda _: [output]
    jacobian = np.ones((len(time), 1))
    solution: Any = SimpleNamespace(x=np.zeros(1), residuals=residuals / assumed, jacobian=jacobian)
    (found,) = ResidualAnalysis(model, solution, robust=True).simulations
    assert found.noise == pytest.approx(true, rel=0.02 + 2.0 * contaminated)
    assert found.outliers / len(time) == pytest.approx(0.0124 + jumps.mean(), abs=0.007)
    assert found.outliers == np.sum(np.abs(found.residuals) > 2.5 * found.noise)
