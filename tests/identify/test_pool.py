"""The independent integrators of the pool, compared with the exact step and with what follows without integration."""

import random
from collections.abc import Callable

import numpy as np
import pytest

from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.vehicles import VEHICLES, VIDEORAY, at_rest, still
from verification.references import pool, rigid_pool
from verification.references.pool import Array, Commands, Conditions, swim

STEP = 0.25


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


# ---- Commands that switch at any time, and conditions ----------------------------------------------------------------

HEAVY = load_vehicle(SHIPPED["bluerov2_heavy"])
SWITCHES = np.array([0.0, 0.613, 0.977, 1.0142, 1.3])
TIME: Array = np.array([0.0, 0.3, 0.7, 0.9, 1.0, 1.35, 1.4])
Simulate = Callable[..., dict[str, Array]]


@pytest.mark.parametrize(("simulate", "k"), [(pool.motion, VIDEORAY), (rigid_pool.motion, HEAVY)])
def test_conditions_of_thrust(simulate: Simulate, k: Vehicle) -> None:
    """Thrust at 70 % is that of a weaker curve; saturated commands are smaller ones; a delay moves the switches."""
    rng = np.random.default_rng(0)
    levels = {t.name: rng.uniform(-0.5, 0.5, len(SWITCHES)) for t in k.layout.thrusters}
    weaker = k.replaced({name: 0.7 * value for name, value in k.coefficients.items() if name[:4] in ("a_t_", "b_t_")})
    clipped = {name: np.clip(values, -0.3, 0.3) for name, values in levels.items()}
    for conditions, other, commands in (
        (Conditions(thrust=lambda _: 0.7), weaker, Commands(SWITCHES, levels)),
        (Conditions(saturation=0.3), k, Commands(SWITCHES, clipped)),
        (Conditions(delay=0.25), k, Commands(SWITCHES + 0.25, levels)),
    ):
        motion = simulate(k, Commands(SWITCHES, levels), TIME, conditions)
        expected = simulate(other, commands, TIME)
        for name in (*k.layout.velocities, "x", "y", "z", "psi"):
            assert motion[name] == pytest.approx(expected[name], rel=1e-6, abs=1e-8), (conditions, name)
