"""The motion of many steps at once, compared with another integrator, and its derivatives with differences."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rov_fmu.identify.recordings.trajectory import MotionError, Slopes, Steps, motion
from rov_fmu.tank.arrays import Array

LENGTHS = (1e-4, 0.005, 0.02)


def some_steps(seed: int, number: int = 60, lags: int = 1) -> Steps:
    """Return two runs with reversals, drag by direction and lagging forces."""
    random = np.random.default_rng(seed)
    A, B = (np.outer(10.0 ** random.uniform(-2.0, 0.5, 2), np.ones(number)) for _ in range(2))
    return Steps(
        random.choice(LENGTHS, number),
        np.array([0, number // 3]),
        A,
        B,
        np.repeat(random.normal(size=number // 6), 6),
        0.3 * random.normal(size=(lags, number)),
        np.outer(10.0 ** random.uniform(-0.5, 0.7, lags), np.ones(number)),
    )


def by_dop853(steps: Steps, n: int, v: float) -> tuple[float, float]:
    """Return velocity and distance after one step."""

    def rates(t: float, y: Array) -> list[float]:
        side = 0 if y[0] > 0.0 else 1
        force = steps.C[n] + float((steps.D[:, n] * np.exp(-steps.kappa[:, n] * t)).sum())
        return [force - (steps.B[side, n] + steps.A[side, n] * abs(y[0])) * y[0], y[0]]

    found = solve_ivp(rates, (0.0, steps.h[n]), (v, 0.0), method="DOP853", rtol=1e-12, atol=1e-15)
    return float(found.y[0, -1]), float(found.y[1, -1])


@pytest.mark.parametrize("lags", [0, 1, 2])
@pytest.mark.parametrize("seed", range(2))
def test_motion_is_that_of_another_integrator(seed: int, lags: int) -> None:
    steps, starts = some_steps(seed, lags=lags), np.array([0.4, -0.2])
    found = motion(steps, starts, np.zeros(len(steps.h)))
    v = 0.0
    for n in range(len(steps.h)):
        if n in steps.first:
            v = starts[list(steps.first).index(n)]
        assert found.v[n] == pytest.approx(v, rel=1e-9, abs=1e-10)
        v, way = by_dop853(steps, n, v)
        assert found.distance[n] == pytest.approx(way, rel=1e-8, abs=1e-10)
    assert found.end[-1] == pytest.approx(v, rel=1e-9, abs=1e-10)


def test_slopes_are_those_of_differences() -> None:
    steps = some_steps(11, 90, lags=2)
    v = motion(steps, np.array([0.4, -0.2]), np.zeros(len(steps.h))).v
    alone = replace(steps, first=np.arange(len(v)))  # each step by itself, from the velocity that it has

    def at(of: Steps, start: Array) -> tuple[Array, Array]:
        found = motion(of, start, start)
        return found.end, found.distance

    slopes = motion(alone, v, v).slopes()
    for key in ("v", "A", "B", "C", "D", "kappa"):
        lines = 1 if key in ("v", "C") else 2
        for line in range(lines):
            up, down = (at(*changed(alone, v, key, line, h)) for h in (1e-6, -1e-6))
            for of, high, low in zip(slopes, up, down, strict=True):
                expected = (high - low) / 2e-6
                assert np.abs(slope(of, key, line) - expected).max() < 2e-9, key


def changed(steps: Steps, v: Array, key: str, line: int, by: float) -> tuple[Steps, Array]:
    if key == "v":
        return steps, v + by
    values = getattr(steps, key).copy()
    values[line if values.ndim == 2 else slice(None)] += by
    return replace(steps, **{key: values}), v


def slope(slopes: Slopes, key: str, line: int) -> Array:
    found = getattr(slopes, key)
    return np.asarray(found[line] if found.ndim == 2 else found)


def test_a_step_that_begins_at_rest_goes_where_the_force_pushes() -> None:
    steps = Steps(
        np.full(3, 0.02),
        np.array([0, 1, 2]),
        np.array([[1.0] * 3, [9.0] * 3]),
        np.array([[0.5] * 3, [2.0] * 3]),
        np.array([1.0, -1.0, 0.0]),
        np.zeros((0, 3)),
        np.zeros((0, 3)),
    )
    end = motion(steps, np.zeros(3), np.zeros(3)).end
    assert end[0] == pytest.approx(by_dop853(steps, 0, 0.0)[0], rel=1e-10)
    assert end[1] == pytest.approx(by_dop853(steps, 1, -1e-300)[0], rel=1e-10)
    assert end[2] == 0.0


def test_what_cannot_be_computed_is_an_error() -> None:
    steps = some_steps(0)
    with pytest.raises(MotionError):
        motion(replace(steps, A=steps.A + 1e300), np.array([1.0, 1.0]), np.zeros(len(steps.h)))
