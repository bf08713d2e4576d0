"""The shape of thrust curves: how a command is warped, its prior, and the quadratic curve that a vehicle file has."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from rov_fmu.identify.likelihood.curves import COUNT, KNOTS, NO_SHAPES, Shapes, nearest
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.vehicles import VIDEORAY

REAR, _ = VIDEORAY.layout.curves


def test_a_published_curve_is_met_within_a_thousandth_of_full_thrust() -> None:
    """The thrust of another maker's propeller, 51.5 N ((c - 0.06) / 0.94)^1.45, from the curve of the BlueROV2."""
    k = load_vehicle(SHIPPED["bluerov2"])
    (curve,) = k.layout.curves
    commands = np.linspace(0.02, 0.8, 40)
    truth = 51.5 * np.maximum(commands - 0.06, 0.0) ** 1.45 / 0.94**1.45

    def errors(p: np.ndarray) -> np.ndarray:
        rov = k.replaced({"c_0_t200": float(p[0])})
        shape = Shapes({curve.name: np.concatenate([p[2:], np.zeros(len(KNOTS))])}, {curve.name: (float(p[0]), 0.0)})
        return np.asarray(np.exp(p[1]) * shape.forces(rov, curve, commands) - truth)

    best = least_squares(errors, [0.06, *np.zeros(1 + len(KNOTS))], diff_step=1e-5)
    assert np.abs(best.fun).max() < 0.05
    assert best.x[0] == pytest.approx(0.06, abs=0.015)


def test_the_prior_of_a_shape_is_that_which_is_stated() -> None:
    """The force deviates by 10 % at weak commands, less towards full command, smoothly, and half alike astern."""
    random = np.random.default_rng(2)
    at = np.array([*KNOTS, -KNOTS[0]])
    forces = []
    for _ in range(4000):
        shape = Shapes({"rear": 0.1 * random.standard_normal(COUNT)})
        forces.append(1.5 * (shape.commands("rear", at) / at - 1.0))  # thrust grows about with this power
    spread, correlation = np.std(forces, axis=0), np.corrcoef(np.transpose(forces))
    to_full = np.exp(-0.5 * ((1.0 - np.array(KNOTS)) / 0.3) ** 2)
    assert spread[:4] == pytest.approx(0.1 * np.sqrt(1.0 - to_full**2), rel=0.05)
    assert correlation[0, 1] == pytest.approx(np.exp(-0.5 * (0.15 / 0.3) ** 2), abs=0.03)
    assert correlation[0, 4] == pytest.approx(0.5, abs=0.05)


def test_a_shape_is_fitted_where_it_was_tested() -> None:
    """No other quadratic curve has smaller relative errors over the tested commands, (6)."""
    shape = Shapes({"rear": 0.1 * np.random.default_rng(5).standard_normal(COUNT)})
    commands = np.linspace(0.2, 0.7, 40)
    (curve,) = nearest(REAR, lambda c: shape.forces(VIDEORAY, REAR, c), (0.0, 0.0), 0.2, 0.7)
    found = dict(curve.coefficients)

    def error(coefficients: dict[str, float]) -> float:
        near = VIDEORAY.replaced(coefficients)
        off = NO_SHAPES.forces(near, REAR, commands) / shape.forces(VIDEORAY, REAR, commands) - 1.0
        return float(np.sqrt(np.mean(np.square(off))))

    assert error(found) < 0.05 < error({})
    for name, value in found.items():
        assert error({**found, name: 1.01 * value}) > error(found) < error({**found, name: 0.99 * value})
