"""Rotors that lag in speed: compared with closed forms, and with equations written out separately in many digits."""

import random
from dataclasses import replace

import numpy as np
import pytest
from mpmath import mp

from rov_fmu.c.simulation import simulate
from rov_fmu.equation.parts import Curve
from rov_fmu.vehicle.vehicle import Vehicle
from tests.equation.steps import in_engine
from tests.often import spread
from tests.vehicles import (
    SIX,
    VEHICLES,
    State,
    Values,
    at_rest,
    numbered,
    random_inputs,
    random_state,
    still,
    with_rotors,
)
from verification.references import rigid_vehicle
from verification.references.rigid_vehicle import compared, places

TOLERANCE = 5e-12
FORCES = {"four axes": VEHICLES["drag by direction, coupled, late"], "six axes": SIX}
"""Vehicles with dead bands, reverse thrust and drag by direction. That with six axes also loses thrust with speed."""
ROTORS = {name: with_rotors(rov) for name, rov in FORCES.items()}
WEAK = with_rotors(SIX).with_(health_a=0.6, health_b=1.2)
SLOW = {name: rov.with_(T_t200=2.5) for name, rov in ROTORS.items()}
"""The same with large rotors, which take a second to reverse."""


def turning(rng: random.Random, rov: Vehicle, h: float) -> tuple[State, State]:
    """Return inputs and a state from which a rotor and a velocity reverse within h seconds."""
    while True:
        inputs, state = random_inputs(rng, rov), random_state(rng, rov)
        if h < 0.1:  # they begin slowly
            state |= {name: 0.3 * h * state[name] for name in (*rov.layout.velocities, *rov.layout.lagging)}
        after = rov.step(inputs, state, h)
        kinds = rov.layout.velocities, rov.layout.lagging
        if all(any(after[name] * state[name] < 0.0 for name in kind) for kind in kinds):
            return inputs, state


def error(rov: Vehicle, found: Values, exact: list[float]) -> float:
    """Return the largest error of a state, relative to the velocities, the attitude, the way and the speeds of rotors.

    Each number counts relative to the largest of its kind.
    """
    pairs = [*zip(compared(rov, places(rov, found)), compared(rov, exact), strict=True)]
    n, lags = len(rov.layout.velocities), len(rov.layout.lagging)
    kinds = pairs[:n], pairs[n : n + 9], pairs[n + 9 : -lags], pairs[-lags:]
    return max(
        float(max(abs(x - y) for x, y in kind) / (max(abs(y) for _, y in kind) or 1.0))
        for kind in kinds
        if kind  # not all vehicles have all
    )


def errors(rov: Vehicle, inputs: Values, state: Values, h: float) -> list[float]:
    """Return the errors of a step in Python and in C."""
    exact = rigid_vehicle.step(rov, inputs, state, h)
    return [error(rov, step(rov, inputs, state, h), exact) for step in (Vehicle.step, in_engine)]


# ---- Against equations written out separately ----


def test_the_motion_is_that_of_dop853_between_reversals() -> None:
    rng = random.Random(4)
    for rov, h in ((ROTORS["six axes"], 0.01), (WEAK, 0.5)):
        inputs, state = turning(rng, rov, h)
        expected = rigid_vehicle.integrate(rov, inputs, places(rov, state), h).tolist()
        assert error(rov, rov.step(inputs, state, h), expected) <= 1e-10


@pytest.mark.parametrize("name", ROTORS)
@pytest.mark.parametrize("h", spread([1e-3, 1e-2, 1.0, 100.0], (), [1e-2]))
def test_a_step_with_reversals_of_rotors_and_velocities_is_exact(name: str, h: float) -> None:
    rov = (SLOW if h > 10.0 else ROTORS)[name]
    rov = rov.with_(**{rov.layout.health[rov.layout.thrusters[0].name]: 0.8})
    inputs, state = turning(random.Random(f"{name} {h}"), rov, h)
    assert max(errors(rov, inputs, state, h)) <= TOLERANCE, (inputs, state)


@pytest.mark.long
def test_commands_that_arrive_after_the_dead_time_turn_rotors_back_within_steps() -> None:
    commands = 4
    rov = ROTORS["six axes"]
    late = Vehicle(replace(rov.layout, has_dead_time=True), {**rov.coefficients, "T_d": 0.013})
    rng = random.Random(commands)
    times = [0.02 * n for n in range(commands + 1)]
    inputs = [still(rov) | {name: rng.uniform(-1.0, 1.0) for name in rov.layout.commands} for _ in times]
    y = places(rov, at_rest(rov))
    for n in range(commands):
        before = inputs[n - 1] if n else still(rov)
        for held, h in ((before, 0.013), (inputs[n], 0.02 - 0.013)):
            state = dict(zip((*"uvwpqr", *rigid_vehicle.QUATERNION, *"xyz", *rov.layout.lagging), y, strict=True))
            y = rigid_vehicle.step(rov, held, state, h)
    tables = {name: np.array([one[name] for one in inputs]) for name in rov.layout.inputs}
    in_c = simulate(late, np.array(times), tables, workers=1).values[:, 0, -1].tolist()
    line, state = late.memory(), at_rest(late)
    for t, held in zip(times[:-1], inputs, strict=False):
        state = line.step(late, held, state, t, 0.02)
    for found in (dict(zip(rov.layout.state, in_c, strict=True)), state):
        assert error(rov, found, y) <= TOLERANCE


# ---- Against closed forms ----

SURGE = numbered(
    replace(VEHICLES["surge without drag"].layout, curves=(Curve("t200", ("a_t", "b_t", "T"), lag="speed"),)),
    a_d_u=0.0,
    b_d_u=0.0,
    T_t200=0.3,
)
"""A vehicle without drag in surge, so that its velocity is the integral of the thrust of its two thrusters."""


@pytest.mark.parametrize("h", [1e-3, 0.1, 0.2, 1.0, 100.0])
def test_the_velocity_without_drag_is_the_integral_of_the_thrust(h: float) -> None:
    """The rotors reverse after T ln((n_c - n_0)/n_c), 0.15 s and 0.27 s."""
    inputs, state = still(SURGE) | {"u_l": 0.6, "u_r": -0.2}, at_rest(SURGE) | {"n_l": -0.4, "n_r": 0.3}
    push, a, b, T = mp.mpf(0), mp.mpf(SURGE["a_t_t200"]), mp.mpf(SURGE["b_t_t200"]), mp.mpf(SURGE["T_t200"])
    for name in "lr":
        n_c, n_0 = mp.mpf(inputs[f"u_{name}"]), mp.mpf(state[f"n_{name}"])
        reversal = T * mp.log((n_c - n_0) / n_c)

        def impulse(start: mp.mpf, t: mp.mpf, n_c: mp.mpf = n_c) -> mp.mpf:
            """Return the integral of (a |n| + b) n while n has one sign; that of n is n_c t + s T."""
            left, sign = start - n_c, mp.sign(start) if start else mp.sign(n_c)
            s, square = -left * mp.expm1(-t / T), -(left**2) * mp.expm1(-2 * t / T) / 2
            return sign * a * (n_c**2 * t + 2 * n_c * T * s + T * square) + b * (n_c * t + T * s)

        push += impulse(n_0, min(h, reversal)) + (impulse(mp.mpf(0), h - reversal) if h > reversal else 0)
    expected = float(push / mp.mpf(SURGE["m_rov"]))
    for step in (Vehicle.step, in_engine):
        found = step(SURGE, inputs, state, h)
        assert found["u"] == pytest.approx(expected, rel=2e-14)
        for name, n_c in (("n_l", 0.6), ("n_r", -0.2)):
            assert found[name] == pytest.approx(n_c + (state[name] - n_c) * np.exp(-h / 0.3), rel=1e-14, abs=1e-15)


def test_the_steady_motion_is_that_of_the_law_of_the_force() -> None:
    for name, rotor in ROTORS.items():
        for axis in (form.axis for form in rotor.layout.axes):
            for command in (0.6, -0.4):
                assert rotor.force(axis, command) == pytest.approx(FORCES[name].force(axis, command), rel=1e-14)
    four, force = (vehicles["four axes"] for vehicles in (ROTORS, FORCES))
    for axis in (form.axis for form in four.layout.axes):
        assert four.response(axis, 0.5) == pytest.approx(force.response(axis, 0.5), rel=1e-14)


# ---- Next to nothing ----


@pytest.mark.parametrize("n", [1e-17, -1e-17, 1e-300, -5e-324, 30.0])
def test_a_speed_that_is_next_to_nothing_or_large_is_a_speed(n: float) -> None:
    inputs = still(SURGE) | {"u_l": 0.5, "u_r": -0.5}
    starts = at_rest(SURGE) | {"n_l": n, "n_r": n}
    near = at_rest(SURGE) if abs(n) < 1.0 else starts
    found, expected = in_engine(SURGE, inputs, starts, 0.5), SURGE.step(inputs, near, 0.5)
    assert found == pytest.approx({name: expected[name] for name in found}, rel=1e-12, abs=1e-12)
