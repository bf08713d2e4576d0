"""The independent integrator of the pool, compared with the exact step."""

import random

import numpy as np
import pytest

from tests.often import spread
from tests.vehicles import VEHICLES, at_rest, still
from verification.references.pool import Array, swim

STEP = 0.25


@pytest.mark.parametrize("name", spread([n for n, k in VEHICLES.items() if not k.layout.mix], ["VideoRay", "Heavy"]))
def test_a_swim_is_that_of_the_exact_step(name: str) -> None:
    """Every thruster has random commands of 1 s in a current; missing degrees of freedom have no effect."""
    k = VEHICLES[name]
    rng = random.Random(name)
    held = {t.name: [0.0, *(rng.uniform(-0.9, 0.9) for _ in range(5))] for t in k.layout.thrusters}
    time: Array = STEP * np.arange(25.0)
    commands = {name: np.append(np.repeat(levels, 4), 0.0) for name, levels in held.items()}
    motion = swim(k, time, commands, current=(0.1, -0.2))
    state = at_rest(k)
    flow = {"V_N": 0.1, "V_E": -0.2} if {"x", "y"} <= k.layout.pose.keys() else {}
    for n in range(len(time) - 1):
        inputs = still(k) | flow | {f"u_{name}": float(values[n]) for name, values in commands.items()}
        state = k.step(inputs, state, STEP)
        for symbol in {*k.layout.velocities, *k.layout.pose}:
            assert motion[symbol][n + 1] == pytest.approx(state[symbol], rel=1e-7, abs=1e-8), (symbol, n)
