"""The Gymnasium environments: Gymnasium's own checker, and the vector environment against the single one."""

from typing import Any

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import rov_fmu
from rov_fmu.bridges.gym import RovEnv, RovVectorEnv
from rov_fmu.io.messages import InputError

SCALE = 1e-12
"""Many vehicles are stepped in the lanes of vectors, whose rounding errors differ from those of the FMU."""


def test_the_environment_checker_passes() -> None:
    check_env(RovEnv(rov_fmu.load("videoray_refit")), skip_render_check=True)


@pytest.mark.parametrize(("name", "drawn_values"), [("videoray_refit", 3), ("bluerov2_heavy", 0)])
def test_the_vector_agrees_with_single_environments_and_with_simulate(name: str, drawn_values: int) -> None:
    """The file of the Heavy contains no uncertainty, so its coefficients are not drawn."""
    vehicle = rov_fmu.load(name)
    many, one = RovVectorEnv(vehicle, 3, steps=5), RovEnv(vehicle, steps=5)
    start, _ = many.reset(seed=1)
    one.reset(seed=2)
    column = next(iter(many.coefficients.values()), np.empty((0, 1)))
    assert len({*column[:, 0].tolist()}) == drawn_values, "each vehicle has coefficients of its own"
    one.many.coefficients = {name: column[1:2] for name, column in many.coefficients.items()}
    one.many.state[:] = state = start[1]
    drawn = vehicle.with_(**{name: float(column[1, 0]) for name, column in many.coefficients.items()})
    for n, actions in enumerate(np.random.default_rng(0).uniform(-1.0, 1.0, (5, 3, len(many.commands)))):
        states, rewards, terminated, truncated, _ = many.step(actions)
        single, *told, _ = one.step(actions[1])
        np.testing.assert_allclose(states[1], single, rtol=SCALE, atol=SCALE)
        assert [rewards[1], terminated[1], truncated[1]] == pytest.approx(told, rel=SCALE, abs=SCALE)
        begin, commands = (
            dict(zip(*pair, strict=True)) for pair in ((many.states, state), (many.commands, actions[1]))
        )
        run = drawn.simulate([0.0, 0.1], commands, start=begin, record=many.states)
        state = np.array([run[name][-1] for name in many.states])
        np.testing.assert_allclose(state, single, rtol=SCALE, atol=SCALE)
        assert truncated.all() == (n == 4)
    states, rewards, _, truncated, _ = many.step(actions)
    assert not rewards.any()
    assert not truncated.any()
    assert not states[:, : many.states.index("x")].any(), "a new episode begins at rest"


@pytest.mark.parametrize("actions", [np.zeros((2, 3)), np.zeros(3), np.full((4, 3), np.nan)])
def test_wrong_actions_give_one_line(actions: Any) -> None:
    env = RovVectorEnv(rov_fmu.load("videoray_refit"), 4)
    env.reset(seed=0)
    with pytest.raises(InputError, match=r"^actions: must be finite numbers of the shape \(4, 3\)"):
        env.step(actions)
