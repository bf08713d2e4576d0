"""Teach a BlueROV2 to hold its place, and compare what it learned with its autopilot.

    python -m examples.hold_station

The policy has eight numbers: for surge, sway, heave and yaw the command per error of the position (m, rad, in the body
frame) and per velocity (m/s, rad/s). The cross-entropy method (Rubinstein and Kroese 2004) draws them, flies each draw
from the same eight starts, and goes on from the best ones.
"""

from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

import rov_fmu
from rov_fmu.bridges import gym

Array = NDArray[np.float64]
DRAWS, STARTS, BEST, ROUNDS = 32, 8, 6, 12
AXES = ("surge", "sway", "heave", "yaw")


def actions(gains: Array, states: Array, names: tuple[str, ...], mix: Array) -> Array:
    """Return the commands (vehicles x commands) of policies (vehicles x 8) in some states (vehicles x states)."""
    x, y, z, psi, u, v, w, r = (states[:, names.index(name)] for name in ("x", "y", "z", "psi", "u", "v", "w", "r"))
    ahead, aside = np.cos(psi) * x + np.sin(psi) * y, np.cos(psi) * y - np.sin(psi) * x
    errors, rates = np.stack([ahead, aside, z, psi], axis=1), np.stack([u, v, w, r], axis=1)
    return np.clip(-(gains[:, :4] * errors + gains[:, 4:] * rates) @ mix, -1.0, 1.0)


def returns(env: rov_fmu.RovVectorEnv, policies: Array | None, seed: int, mix: Array) -> Array:
    """Return the sum of the rewards of an episode for each vehicle, by a policy each, or by the autopilot."""
    states, _ = env.reset(seed=seed)
    # Each draw begins where the others do.
    env.state[:] = states = np.tile(states[:STARTS], (env.num_envs // STARTS, 1))
    total = np.zeros(env.num_envs)
    for _ in range(env.steps):
        given = env.baseline() if policies is None else actions(policies, states, env.states, mix)
        states, rewards, *_ = env.step(given)
        total += rewards
    return total


def main() -> None:
    """Learn, and print the mean returns over starts that were not flown before."""
    gymnasium.register_envs(gym)
    random = np.random.default_rng(0)
    options: dict[str, Any] = {"vehicle": "bluerov2", "draws": False}
    many = gymnasium.make_vec("rov_fmu/HoldStation-v0", DRAWS * STARTS, **options).unwrapped
    assert isinstance(many, rov_fmu.RovVectorEnv)
    layout = many.vehicle.layout
    mix = np.array(
        [[layout.signs(layout.by_name[name].axis).get(command, 0.0) for command in many.commands] for name in AXES]
    )
    middle, width = np.full(8, 0.5), np.full(8, 0.5)
    for n in range(ROUNDS):
        drawn = middle + width * random.standard_normal((DRAWS, 8))
        found = returns(many, np.repeat(drawn, STARTS, axis=0), n, mix).reshape(DRAWS, STARTS).mean(axis=1)
        best = drawn[np.argsort(-found)[:BEST]]
        middle, width = best.mean(axis=0), best.std(axis=0) + 0.02
    few = gymnasium.make_vec("rov_fmu/HoldStation-v0", STARTS, **options).unwrapped
    assert isinstance(few, rov_fmu.RovVectorEnv)
    learned = returns(few, np.tile(middle, (STARTS, 1)), 1000, mix).mean()
    print(f"mean return: {learned:.1f} by the policy, {returns(few, None, 1000, mix).mean():.1f} by the autopilot")


if __name__ == "__main__":
    main()
