"""The search finds the minimum where it is known: with bounds, outliers, and motion that diverges."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from scipy.optimize import least_squares, lsq_linear

from rov_fmu.c.filter import DivergedError, Run
from rov_fmu.identify.likelihood.objective import Data, Objective, cost
from rov_fmu.identify.likelihood.parameters import Parameter, Table
from rov_fmu.identify.likelihood.solve import Minimum, minimise
from rov_fmu.tank.arrays import Array
from tests.vehicles import VIDEORAY


class Small(Objective):
    """An objective whose innovations are a function of the parameters. There is no filter and no log."""

    def __init__(
        self,
        innovations: Callable[[Array], Array],
        mean: Array,
        deviation: float = 1.0,
        low: float = -np.inf,
    ) -> None:
        parameters = tuple(Parameter("number", str(n)) for n in range(len(mean)))
        self.table = Table(VIDEORAY.layout, {}, {}, parameters)
        self.mean, self.deviation = mean, np.full(len(mean), deviation)
        self.low, self.high = np.full(len(mean), low), np.full(len(mean), np.inf)
        self.innovations = innovations

    def runs(self, z: Array, earlier: Sequence[Run] | None = None) -> list[Run]:  # noqa: ARG002
        off, none = self.innovations(z), np.zeros(0, np.intc)
        return [Run(off, np.ones(len(off)), none, np.zeros(0))]

    def value(self, z: Array, runs: Sequence[Run]) -> float:
        off = runs[0].innovations
        return float(np.sum(((z - self.mean) / self.deviation) ** 2)) + cost(off, np.ones(len(off)))

    def data(
        self,
        z: Array,
        runs: Sequence[Run],
        earlier: Sequence[Data] | None = None,  # noqa: ARG002
        *,
        with_noise: bool = True,  # noqa: ARG002
        exact: bool = True,  # noqa: ARG002
    ) -> list[Data]:
        off, step = runs[0].innovations, 1e-6
        slopes = np.column_stack([(self.innovations(z + row) - off) / step for row in step * np.eye(len(z))])
        return [Data(off, np.ones(len(off)), slopes, np.zeros_like(slopes))]


RANDOM = np.random.default_rng(0)
A = RANDOM.standard_normal((200, 4)) * np.array([1.0, 3.0, 0.3, 1.0])
TRUE = np.array([0.5, -0.2, 1.0, -0.4])
Y = A @ TRUE + 0.5 * RANDOM.standard_normal(200)
WIDE = 10.0


def linear(z: Array) -> Array:
    return np.asarray(Y - A @ z)


def least(found: Minimum, best: float) -> None:
    """Check that the minimum is reached to what counts: J is twice a log likelihood."""
    assert found.has_converged
    assert best - 1e-6 <= found.value < best + 0.6


def penalised(z: Array, deviation: float = WIDE) -> Array:
    return np.concatenate([linear(z), z / deviation])


def test_a_linear_fit_is_that_of_least_squares_with_its_prior() -> None:
    objective = Small(linear, np.zeros(4), WIDE)
    found = minimise(objective, np.full(4, 3.0))
    M = A.T @ A + np.eye(4) / WIDE**2
    exact = np.linalg.solve(M, A.T @ Y)
    least(found, float(np.sum(penalised(exact) ** 2)))
    assert np.abs(found.z - exact).max() < 0.05
    assert found.information == pytest.approx(2.0 * M, rel=1e-6, abs=1e-4)


def test_bounds_hold_and_the_others_move_on() -> None:
    """Two of the parameters end at the bound, as SciPy's linear least squares with bounds says."""
    objective = Small(linear, np.zeros(4), WIDE, low=-0.1)
    found = minimise(objective, np.full(4, 0.3))
    bounded = lsq_linear(np.vstack([A, np.eye(4) / WIDE]), np.concatenate([Y, np.zeros(4)]), (-0.1, np.inf))
    assert np.flatnonzero(bounded.active_mask).tolist() == [1, 3]
    assert (found.z > -0.1 - 1e-12).all()
    assert found.z[[1, 3]] == pytest.approx([-0.1, -0.1], abs=1e-12)
    least(found, 2.0 * bounded.cost)


TIME = np.linspace(0.0, 3.0, 80)
DECAY = 2.0 * np.exp(-1.3 * TIME)


def decay(z: Array, off: float | Array = 0.0) -> Array:
    return np.asarray(50.0 * (DECAY + off - z[0] * np.exp(-np.exp(z[1]) * TIME)))


@pytest.mark.parametrize("start", [(0.1, 2.0), (4.0, -1.5)])
def test_a_nonlinear_fit_converges_from_afar(start: tuple[float, float]) -> None:
    steps: list[int] = []
    found = minimise(Small(decay, np.array([1.0, 0.0]), 3.0), np.array(start), on_step=steps.append)
    assert [found.z[0], np.exp(found.z[1])] == pytest.approx([2.0, 1.3], rel=0.02)
    assert found.has_converged
    assert steps == [*range(1, found.steps + 1)]


def test_outliers_hardly_move_the_minimum() -> None:
    """They count by their distance and not by its square."""
    wrong = np.where(np.arange(80) % 10 == 3, 2.0, 0.0)
    robust = minimise(Small(lambda z: decay(z, wrong), np.array([1.0, 0.0]), 3.0), np.array([1.0, 0.0]))
    plain = least_squares(lambda z: decay(z, wrong), robust.z).x
    errors = [np.abs(z - [2.0, np.log(1.3)]).max() for z in (robust.z, plain)]
    assert errors[0] < 0.1 * errors[1]


def test_places_where_motion_diverges_are_avoided() -> None:
    def cliff(z: Array) -> Array:
        if z[1] > 0.8:
            raise DivergedError
        return decay(z)

    found = minimise(Small(cliff, np.array([1.0, 0.0]), 3.0), np.array([0.2, -2.0]))
    assert [found.z[0], np.exp(found.z[1])] == pytest.approx([2.0, 1.3], rel=0.02)
    with pytest.raises(DivergedError):
        minimise(Small(cliff, np.array([1.0, 0.0]), 3.0), np.array([0.2, 2.0]))
