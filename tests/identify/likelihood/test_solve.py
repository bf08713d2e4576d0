"""The search finds the minimum where it is known: with bounds, outliers, and motion that diverges."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from rov_fmu.c.filter import DivergedError, Run
from rov_fmu.identify.likelihood.objective import Data, Objective, cost
from rov_fmu.identify.likelihood.parameters import Parameter, Table
from rov_fmu.identify.likelihood.solve import minimise
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


def linear(z: Array) -> Array:
    return np.asarray(Y - A @ z)


@pytest.mark.parametrize(("low", "at_the_bound"), [(-10.0, []), (-0.1, [1, 3])])
def test_a_linear_fit_is_that_of_least_squares_with_its_prior_and_bounds(low: float, at_the_bound: list[int]) -> None:
    found = minimise(Small(linear, np.zeros(4), 10.0, low=low), np.full(4, 3.0))
    M = np.vstack([A, np.eye(4) / 10.0])
    exact = lsq_linear(M, np.concatenate([Y, np.zeros(4)]), (low, np.inf))
    assert np.flatnonzero(exact.active_mask).tolist() == at_the_bound
    assert found.z[at_the_bound] == pytest.approx(low, abs=1e-12)
    assert np.abs(found.z - exact.x).max() < 0.05
    assert found.has_converged
    assert -1e-6 <= found.value - 2.0 * exact.cost < 0.6, "twice a log likelihood"
    assert found.information == pytest.approx(2.0 * M.T @ M, rel=1e-6, abs=1e-4)


TIME = np.linspace(0.0, 3.0, 80)
DECAY = 2.0 * np.exp(-1.3 * TIME)


def decay(z: Array) -> Array:
    return np.asarray(50.0 * (DECAY - z[0] * np.exp(-np.exp(z[1]) * TIME)))


@pytest.mark.parametrize("start", [(0.1, 2.0), (4.0, -1.5)])
def test_a_nonlinear_fit_converges_from_afar(start: tuple[float, float]) -> None:
    steps: list[int] = []
    found = minimise(Small(decay, np.array([1.0, 0.0]), 3.0), np.array(start), on_step=steps.append)
    assert [found.z[0], np.exp(found.z[1])] == pytest.approx([2.0, 1.3], rel=0.02)
    assert found.has_converged
    assert steps == [*range(1, found.steps + 1)]


def test_places_where_motion_diverges_are_avoided() -> None:
    def cliff(z: Array) -> Array:
        if z[1] > 0.8:
            raise DivergedError
        return decay(z)

    found = minimise(Small(cliff, np.array([1.0, 0.0]), 3.0), np.array([0.2, -2.0]))
    assert [found.z[0], np.exp(found.z[1])] == pytest.approx([2.0, 1.3], rel=0.02)
    with pytest.raises(DivergedError):
        minimise(Small(cliff, np.array([1.0, 0.0]), 3.0), np.array([0.2, 2.0]))
