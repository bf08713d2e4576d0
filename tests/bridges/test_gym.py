"""The Gymnasium environments: Gymnasium's own checker, and the vector environment against the single one."""

from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import rov_fmu
from rov_fmu.bridges.gym import ID, RovEnv, RovVectorEnv
from rov_fmu.io.messages import InputError
from tests.commands import BARE

_LATE = """
[[thruster]]
name = "b"
curve = "top"
direction = {{ value = [0, 0, -1], source = "Made up" }}

[commands]
T_d = {{ value = {}, unit = "s", source = "Made up" }}
"""
"""A second thruster, and a dead time, for a vehicle that compiles in a second."""
SCALE = 1e-12
"""Many vehicles are stepped in the lanes of vectors, whose rounding errors differ from those of the FMU."""


def test_the_environment_checker_passes() -> None:
    environment = RovEnv(rov_fmu.load("videoray_refit"))
    check_env(environment, skip_render_check=True)
    assert environment.many.steps == 300
    assert (environment.states[0], environment.commands[0]) == ("u", "u_l")


def test_a_vehicle_has_a_registered_environment_of_one_and_of_many() -> None:
    one = gymnasium.make(ID, vehicle="bluerov2", draws=False, steps=20, max_episode_steps=10)
    check_env(one.unwrapped, skip_render_check=True)
    one.reset(seed=1)
    assert [one.step(np.zeros(6))[3] for _ in range(10)] == [False] * 9 + [True]
    many = gymnasium.make_vec(ID, 3, vehicle="videoray_refit", step=0.2)
    assert isinstance(many.unwrapped, RovVectorEnv)
    assert many.reset(seed=1)[0].shape == (3, 7)
    assert many.unwrapped.length == 0.2


@pytest.mark.parametrize("name", ["bluerov2", "bluerov2_heavy"])
def test_the_autopilot_is_a_baseline_that_holds_the_place(name: str) -> None:
    """After 30 s of an episode, the vehicles are within 2 cm, and a new episode begins with a new autopilot."""
    many = RovVectorEnv(rov_fmu.load(name), 3, draws=False)
    many.reset(seed=3)
    there = [many.states.index(axis) for axis in "xyz"]
    for _ in range(299):
        states, *_ = many.step(many.baseline())
    assert np.abs(states[:, there]).max() < 0.02
    for _ in range(2):
        states, *_ = many.step(many.baseline())
    one = RovEnv(rov_fmu.load(name), draws=False)
    one.reset(seed=3)
    one.many.state[:] = states[1]
    np.testing.assert_allclose(one.baseline(), many.baseline()[1], rtol=1e-12, atol=1e-12)


def test_a_vehicle_without_uncertainty_says_that_it_draws_none() -> None:
    with pytest.warns(UserWarning, match="bluerov2: its file has no uncertainty, so no coefficients are drawn"):
        RovVectorEnv(rov_fmu.load("bluerov2"), 2)


@pytest.mark.parametrize(("name", "drawn_values"), [("videoray_refit", 3), ("bluerov2_heavy", 0)])
def test_the_vector_moves_its_vehicles_as_simulate_does_and_as_a_single_environment(
    name: str, drawn_values: int
) -> None:
    """The file of the Heavy contains no uncertainty, so its coefficients are not drawn. It moves as 50 m deep."""
    vehicle = rov_fmu.load(name)
    many = RovVectorEnv(vehicle, 3, steps=5, draws=drawn_values > 0)
    start, _ = many.reset(seed=1)
    task = [name in ("x", "y", "z", "psi") for name in many.states]
    assert 1.0 < np.abs(start[:, task]).max() <= 2.0
    drawn = vehicle.with_(**{name: float(column[1, 0]) for name, column in many.coefficients.items()})
    one = RovEnv(drawn, steps=5, draws=False)
    one.reset(seed=2)
    assert all(len({*column[:, 0]}) == drawn_values for column in many.coefficients.values())
    one.many.state[:] = start[1]
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (6, 3, len(many.commands)))
    for n in range(5):
        states, rewards, terminated, truncated, _ = many.step(actions[n])
        single, *told, _ = one.step(actions[n, 1])
        np.testing.assert_allclose(single, states[1], rtol=SCALE, atol=SCALE)
        assert told == pytest.approx([rewards[1], terminated[1], truncated[1]], rel=SCALE, abs=SCALE)
        assert truncated.all() == (n == 4)
        assert rewards == pytest.approx(-np.sum(states[:, task] ** 2, axis=1) - 0.1 * np.sum(actions[n] ** 2, axis=1))
    commands = dict(zip(many.commands, actions[:, 1].T, strict=True))
    begin = dict(zip(many.states, start[1], strict=True))
    run = drawn.simulate(0.1 * np.arange(6), commands, start=begin | {"z": begin["z"] + 50.0}, record=many.states)
    expected = {name: run[name][-1] for name in many.states}
    expected["z"] -= 50.0
    np.testing.assert_allclose(states[1], [*expected.values()], rtol=1e-11, atol=1e-11)
    states, rewards, _, truncated, _ = many.step(actions[5])
    assert not rewards.any()
    assert not truncated.any()
    assert not states[:, : many.states.index("x")].any(), "a new episode begins at rest"
    over = [many.step(actions[n])[3].any() for n in range(5)]
    assert over == [False] * 4 + [True]
    assert np.array_equal(many.reset(seed=[1, 2, 3])[0], start)


def test_an_axis_that_may_not_be_trusted_is_drawn_by_force_only() -> None:
    vehicle = rov_fmu.load("videoray_refit")
    assert vehicle.provenance
    words = tuple(one.replace("heave: usable", "heave: do not use") for one in vehicle.provenance.verdicts)
    doubted = replace(vehicle, provenance=vehicle.provenance.model_copy(update={"verdicts": words}))
    with pytest.raises(InputError, match=r"these axes may be off: heave: do not use; --force \(in Python, forced\)"):
        RovVectorEnv(doubted, 2).reset(seed=1)
    drawn, usual = RovVectorEnv(doubted, 2, draws="force"), RovVectorEnv(vehicle, 2)
    assert np.array_equal(drawn.reset(seed=1)[0], usual.reset(seed=1)[0])
    assert np.array_equal(drawn.coefficients["a_d_u"], usual.coefficients["a_d_u"])


def test_an_episode_ends_where_a_state_leaves_its_bound_and_the_others_go_on() -> None:
    many = RovVectorEnv(rov_fmu.load("videoray_refit"), 3, steps=2, draws=False)
    many.reset(seed=1)
    assert not many.coefficients
    many.state[0] = [0.0, 0.0, 0.0, 999.0, -999.0, 0.0, 0.0]
    many.state[1] = [50.0, 0.0, 0.0, 999.0, 0.0, 0.0, 0.0]
    ends = [[ended.tolist() for ended in many.step(np.full((3, 3), 9.0))[2:4]] for _ in range(4)]
    assert ends == [
        [[False, True, False], [False, False, False]],
        [[False, False, False], [True, False, True]],
        [[False, False, False], [False, False, False]],
        [[False, False, False], [False, True, False]],
    ]


def _flown(env: RovVectorEnv, actions: Any, steps: int) -> Any:
    """Return the states after some steps (vehicles x states), of which none ends an episode."""
    for n in range(steps):
        states, _, terminated, truncated, _ = env.step(actions[:, n])
        assert not (terminated | truncated).any()
    return states


@pytest.mark.parametrize("dead_time", [0.03, 0.1, 0.25])
def test_commands_that_wait_for_the_dead_time_arrive_in_later_steps(dead_time: float, tmp_path: Path) -> None:
    """A new episode begins with no command on its way. A copy of the environment goes on like the environment."""
    (tmp_path / "late.toml").write_text(BARE.read_text(encoding="utf-8") + _LATE.format(dead_time), encoding="utf-8")
    vehicle = rov_fmu.load(tmp_path / "late.toml")
    env = RovVectorEnv(vehicle, 3, steps=8, draws=False)
    actions = np.random.default_rng(1).uniform(-1.0, 1.0, (3, 10, len(env.commands)))

    def expected(start: Any, steps: int, at: float = 0.0) -> Any:
        inputs = {name: actions[:, :, n] for n, name in enumerate(env.commands)}
        run = vehicle.simulate_many(
            at + 0.1 * np.arange(10), inputs, start=dict(zip(env.states, start.T, strict=True)), record=env.states
        )
        return np.array([run[name][:, steps] for name in env.states]).T

    for seed in (1, 2):
        start, _ = env.reset(seed=seed)
        np.testing.assert_allclose(_flown(env, actions, 5), expected(start, 5), rtol=1e-11, atol=1e-11)
    vehicle.step({}, {}, 0.1)  # compiles formulas, which cannot be copied
    twin = deepcopy(env)
    there, here = (_flown(one, actions[:, 5:], 2) for one in (twin, env))
    np.testing.assert_array_equal(here, there)
    np.testing.assert_allclose(here, expected(start, 7), rtol=1e-11, atol=1e-11)
    assert env.step(actions[:, 7])[3].all()
    start = env.step(actions[:, 8])[0]
    np.testing.assert_allclose(_flown(env, actions, 7), expected(start, 7), rtol=1e-11, atol=1e-11)
    env.state[1] = start[0]
    assert env.step(np.ones((3, len(env.commands))))[0][1] != pytest.approx(start[0])


@pytest.mark.parametrize(
    ("actions", "message"),
    [
        (np.zeros((2, 3)), r"must have the shape \(4, 3\), and have the shape \(2, 3\)"),
        (np.zeros(3), r"must have the shape \(4, 3\)"),
        (np.full((4, 3), np.nan), "u_l of vehicle 0 must be a finite number"),
    ],
)
def test_wrong_actions_give_one_line(actions: Any, message: str) -> None:
    env = RovVectorEnv(rov_fmu.load("videoray_refit"), 4)
    env.reset(seed=0)
    with pytest.raises(InputError, match=f"^actions: {message}"):
        env.step(actions)


def test_wrong_arguments_give_one_line() -> None:
    vehicle: Any = "videoray"
    with pytest.raises(InputError, match=r"^vehicle = 'videoray': must be a vehicle"):
        RovEnv(vehicle)
    with pytest.raises(InputError, match=r"^step = 0: must be above 0"):
        RovEnv(rov_fmu.load(vehicle), step=0)
    with pytest.raises(InputError, match=r"^action: must have the shape \(3,\), and has \(2,\)"):
        RovEnv(rov_fmu.load(vehicle), draws=False).step(np.zeros(2))
