"""What each output moves, by regression: the thrusters of vehicles that are known, found from their motion alone."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rov_fmu.equation.catalogue import HEAVE, SURGE, SWAY, YAW, Axis
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.inspection.outputs import moved
from rov_fmu.tank.log import Log
from tests.tank.logs import channel, commands, log

TIME = np.arange(0.0, 90.0, 0.1)
RATES = {SURGE: "surge velocity", SWAY: "sway velocity", YAW: "yaw velocity"}
NOISE = {"depth": 0.01, "heading": 0.01, "surge velocity": 0.02, "sway velocity": 0.02, "yaw velocity": 0.01}


def held(rng: np.random.Generator, count: int) -> Array:
    """Return commands that hold for 3 s each, and rest now and then: n x count."""
    some = rng.uniform(-0.9, 0.9, (len(TIME) // 30, count)) * (rng.uniform(size=(len(TIME) // 30, 1)) > 0.2)
    return np.repeat(some, 30, axis=0)


def dive(effects: dict[Axis, list[float]], names: str, inputs: Array, seed: int, shown: list[str]) -> Log:
    """Return a log of a vehicle with drag, whose axes accelerate by these effects of the outputs at full command."""
    rng = np.random.default_rng(seed)
    quantities: dict[str, Array] = {}
    for axis, by in effects.items():
        push = (0.7 * np.abs(inputs) + 0.3) * inputs @ np.array(by)
        drag = 4.0 if axis is YAW else 1.0

        def slope(t: float, y: Array, push: Array = push, drag: float = drag) -> list[float]:
            return [y[1], push[min(int(t / 0.1 + 1e-9), len(push) - 1)] - drag * y[1] - 2.0 * abs(y[1]) * y[1] - 0.02]

        solved = solve_ivp(slope, (0.0, TIME[-1]), [1.0, 0.0], "RK45", TIME, max_step=0.1).y
        quantities |= {axis.position if axis.position != "distance" else "": solved[0], RATES.get(axis, ""): solved[1]}
    channels = (channel(name, TIME, quantities[name] + rng.normal(0.0, NOISE[name], len(TIME))) for name in shown)
    return log(commands(TIME, dict(zip(names, inputs.T, strict=True))), *channels)


@pytest.mark.parametrize("shown", [["depth", "heading"], ["depth", "yaw velocity"]])
def test_four_thrusters_without_a_velocity_sensor(shown: list[str]) -> None:
    """Two turn the vehicle, one pushes down and one up at a positive command. They push ahead, as no log tells."""
    effects = {YAW: [3.0, -3.0, 0.0, 0.0], HEAVE: [0.0, 0.0, 0.6, -0.6]}
    found = moved([dive(effects, "abcd", held(np.random.default_rng(1), 4), 1, shown)])
    assert {name: {*by} for name, by in found.by_output.items()} == {"a": {YAW}, "b": {YAW}, "c": {HEAVE}, "d": {HEAVE}}
    assert found.by_output["c"][HEAVE] == pytest.approx(0.6, rel=0.4)
    thrusters = found.thrusters
    assert [thrusters[name].direction.value for name in "abcd"] == [(1, 0, 0), (1, 0, 0), (0, 0, 1), (0, 0, -1)]
    assert [np.sign(thrusters[name].effect(YAW)) for name in "abcd"] == [1.0, -1.0, 0.0, 0.0]
    assert found.pushed == {SURGE, HEAVE, YAW}
    assert found.undriven == [SWAY]
    assert all(one.direction.source.startswith("A guess: ") for one in thrusters.values())


def test_directions_of_vectored_thrusters_follow_from_velocities() -> None:
    """Also where three commands are mixed to four outputs, so that one combination never occurs."""
    signs = np.array([[1.0, 1.0, -1.0, -1.0], [-1.0, 1.0, -1.0, 1.0], [1.0, -1.0, -1.0, 1.0]])
    effects = {
        axis: [*(size * row)] for axis, row, size in zip((SURGE, SWAY, YAW), signs, (0.5, 0.5, 3.0), strict=True)
    }
    inputs = held(np.random.default_rng(2), 3) @ signs / 3.0
    found = moved([dive(effects, "abcd", inputs, 2, [*RATES.values()])])
    for n, name in enumerate("abcd"):
        thruster = found.thrusters[name]
        assert np.sign(thruster.direction.value).tolist() == [*signs[:2, n], 0.0]
        assert np.sign(thruster.effect(YAW)) == signs[2, n]
    assert found.undriven == [HEAVE]


def test_what_moves_nothing_is_not_guessed_and_equal_commands_share() -> None:
    inputs = held(np.random.default_rng(3), 3)[:, [0, 0, 1]]
    found = moved([dive({HEAVE: [0.5, 0.5, 0.0]}, "abl", inputs, 3, ["depth"])])
    assert found.by_output["l"] == {}
    assert "l" not in found.thrusters
    assert found.by_output["a"][HEAVE] == pytest.approx(found.by_output["b"][HEAVE])
    assert found.shown == {HEAVE}
    assert moved([log(None, channel("depth", TIME, TIME))]).by_output == {}


def test_vertical_thrusters_are_found_in_a_dive_that_rests() -> None:
    """Pushes on deck for 20 s, and on the bottom for half a minute, drown what they do between."""
    rng, time = np.random.default_rng(12), np.arange(0.0, 180.0, 0.1)
    inputs = np.vstack([held(rng, 2), held(rng, 2)])
    inputs[200:240], inputs[-250:, 0] = 0.0, 0.6
    depths, rate = [-0.8], 0.0
    for now, (down, _) in zip(time, inputs, strict=True):
        rate = (now > 24.0) * (rate + 0.1 * (1.2 * down * abs(down) - 0.3 * rate - 2.0 * abs(rate) * rate))
        depths.append(min(depths[-1] + 0.1 * rate + 0.1 * (20.0 < now < 24.0), 6.0))  # lowered by hand from 20 to 24 s
        rate = min(rate, 0.0) if depths[-1] == 6.0 else rate
    shown = channel("depth", time, np.array(depths[1:]) + rng.normal(0.0, 0.005, len(time)))
    found = moved([log(commands(time, dict(zip("vl", inputs.T, strict=True))), shown)])
    assert found.by_output["v"][HEAVE] == pytest.approx(1.2, rel=0.2)
    assert found.by_output["l"] == {}
