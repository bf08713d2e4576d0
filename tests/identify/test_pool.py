"""The independent integrator of the pool, compared with the exact step."""

import random

import numpy as np
import pytest

from rov_fmu.model.layout import HEAVE
from rov_fmu.model.rov import Rov
from tests.pool import run, with_more
from tests.vehicles import VEHICLES, VIDEORAY, at_rest, still
from verification.references.pool import Array, swim

STEP, PLAN = 0.25, ((0.0, 1.0), (0.6, 2.0), (-0.4, 2.0))


@pytest.mark.parametrize("name", [name for name, k in VEHICLES.items() if not k.layout.mix])
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


def late(k: Rov, delay: float) -> Array:
    return run(k, HEAVE, PLAN, 20.0, delay=delay).velocity


def test_a_delay_moves_the_motion_in_time() -> None:
    k = with_more(VIDEORAY, T_top=0.3, F_0_w=0.0)
    assert late(k, 0.2)[4:] == pytest.approx(late(k, 0.0)[:-4], abs=1e-9)
    assert np.abs(late(k, 0.2) - late(k, 0.0)).max() > 0.01
