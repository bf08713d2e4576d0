"""Thrust by tables, by the voltage, with a dead time, and fins: compared with equations written out separately."""

import csv
import math
import random
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from mpmath import mp
from scipy.interpolate import PchipInterpolator

from rov_fmu.c.simulation import simulate
from rov_fmu.equation.catalogue import HEAVE, SURGE, SWAY, YAW
from rov_fmu.equation.parts import SourcedVector
from rov_fmu.equation.python.step import Change
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle, without_surface
from tests.equation.steps import in_engine
from tests.vehicles import (
    EVERYTHING,
    FINNED,
    SIX,
    THRUST_EFFECTS,
    VIDEORAY,
    at_rest,
    extended,
    random_inputs,
    random_state,
)
from verification.references import rigid_vehicle
from verification.references.equations import steady_forces
from verification.references.rigid_vehicle import compared, places

ROV = load_vehicle(THRUST_EFFECTS)


def immediate(rov: Vehicle) -> Vehicle:
    """Return a vehicle whose commands act at once."""
    layout = replace(rov.layout, has_dead_time=False)
    return Vehicle(layout, {name: rov[name] for name in layout.coefficients})


NOW = immediate(ROV)


def inputs_of(rng: random.Random, rov: Vehicle) -> dict[str, float]:
    """Return random inputs. The voltage may lie beyond the tables."""
    found = random_inputs(rng, rov)
    return found | ({"voltage": rng.uniform(10.0, 18.0)} if "voltage" in found else {})


# ---- Forces ----


def test_the_forces_are_those_of_the_tables_and_of_the_voltage() -> None:
    rng = random.Random(1)
    for _ in range(200):
        inputs = inputs_of(rng, NOW)
        expected = steady_forces(NOW, inputs, mp)
        for name, force in NOW.commanded(inputs).items():
            assert force == pytest.approx(float(expected[name]), rel=1e-14, abs=1e-13), (name, inputs)


def test_a_table_gives_the_measured_forces_and_rises_between_them() -> None:
    with THRUST_EFFECTS.with_name("thrust_16_v.csv").open(encoding="utf-8") as file:
        points = [(float(row["command [%]"]) / 100.0, float(row["thrust [N]"])) for row in csv.DictReader(file)]
    _, bow, _ = ROV.layout.curves
    (table,) = bow.tables
    for command, force in points:
        assert table.value(command) == pytest.approx(force, rel=1e-15)
    commands = np.linspace(-1.0, 1.0, 2001)
    forces = [table.value(c) for c in commands]
    assert forces == pytest.approx(PchipInterpolator(*zip(*points, strict=True))(commands), rel=1e-13, abs=1e-13)
    assert (np.diff(forces) >= 0.0).all()
    assert {table.value(c) for c in (-0.07, -0.03, 0.0, 0.05)} == {0.0}


@pytest.mark.parametrize("rov", [VIDEORAY, SIX, NOW], ids=["one curve for two", "by coefficients", "by tables"])
def test_the_health_of_a_thruster_multiplies_its_force_alone(rov: Vehicle) -> None:
    whole = rov.with_(**dict.fromkeys(rov.layout.health.values(), 1.0))
    inputs = rov.layout.usual_inputs | dict.fromkeys(rov.layout.commands, -0.6)
    forces = whole.commanded(inputs)
    for thruster, name in rov.layout.health.items():
        for health in (0.0, 0.5, 2.0):
            ill = whole.with_(**{name: health}).commanded(inputs)
            assert ill == forces | {thruster: health * forces[thruster] + 0.0}
            assert math.copysign(1.0, ill[thruster]) == (1.0 if health == 0.0 else math.copysign(1.0, forces[thruster]))


def test_the_health_comes_after_all_variables_that_were_there_before_it() -> None:
    """Otherwise, the value references of FMI would change."""
    for layout in (VIDEORAY.layout, SIX.layout, ROV.layout):
        first = len(layout.variables) - len(layout.added) - len(layout.thrusters)
        healths = [f"health_{thruster.name}" for thruster in layout.thrusters]
        assert layout.variables[first:] == (*healths, *layout.added)
        assert not any(name.startswith("health_") for name in layout.variables[:first])


def test_a_fin_steers_by_the_square_of_the_speed_and_in_reverse_backwards() -> None:
    def effect(u: float, command: float) -> dict[str, float]:
        state = at_rest(NOW) | {"u": u}
        inputs = NOW.layout.usual_inputs
        with_fin, without = (NOW.derivatives(inputs | {"u_rudder": c}, state) for c in (command, 0.0))
        return {name: with_fin[name] - without[name] for name in ("u", "v", "r")}

    m, I_r = (NOW.effective_inertia(axis) for axis in (SWAY, YAW))
    angle = 0.4 * 0.5
    ahead = effect(2.0, 0.5)
    assert ahead["v"] == pytest.approx(9.0 * angle * 4.0 / m, rel=1e-13)
    assert ahead["r"] == pytest.approx(-0.6 * 9.0 * angle * 4.0 / I_r, rel=1e-13)
    surge = NOW.effective_inertia(SURGE)
    assert ahead["u"] == pytest.approx(-4.0 * angle**2 * 4.0 / surge, rel=1e-12)
    assert effect(-2.0, 0.5) == pytest.approx({name: -x for name, x in ahead.items()}, rel=1e-12)
    assert effect(2.0, 5.0) == effect(2.0, 1.0)
    assert effect(0.0, 1.0) == {"u": 0.0, "v": 0.0, "r": 0.0}


def test_v_ss_is_the_velocity_at_which_the_loss_of_thrust_and_the_net_weight_balance() -> None:
    heavy, by_direction = without_surface(load_vehicle(SHIPPED["bluerov2_heavy"])), load_vehicle(EVERYTHING)
    for rov, axis, command in (
        (NOW, SURGE, 0.6),
        (heavy, HEAVE, -0.3),
        (by_direction, HEAVE, 0.4),
        (by_direction, HEAVE, -0.4),
    ):
        V_ss, _ = rov.response(axis, command)
        moved = in_engine(rov, rov.held_inputs(axis, command), at_rest(rov), 100.0)
        assert moved[axis.velocity] == pytest.approx(V_ss, rel=1e-9)


def test_the_speed_of_advance_of_an_arm_is_that_of_its_place() -> None:
    """The arm R sin γ of the VideoRay is the distance of its thrusters from the middle."""
    rov = extended(VIDEORAY, d_rear=5.0, d_top=2.0)
    distance = rov["R"] * math.sin(rov["gamma"])
    thrusters = [
        replace(t, arm=None, position=SourcedVector((0.0, -t.side * distance, 0.0), "drawn"))
        for t in rov.layout.thrusters
    ]
    layout = replace(rov.layout, thrusters=tuple(thrusters))
    placed = Vehicle(layout, {name: rov[name] for name in layout.coefficients})
    rng = random.Random(4)
    for _ in range(20):
        inputs, state = random_inputs(rng, rov), random_state(rng, rov)
        assert rov.step(inputs, state, 0.5) == pytest.approx(placed.step(inputs, state, 0.5), rel=1e-12, abs=1e-12)


# ---- Motion ----


@pytest.mark.parametrize("rov", [NOW, FINNED], ids=["four axes", "six axes"])
def test_a_step_is_exact(rov: Vehicle) -> None:
    rng = random.Random(2)
    for h in (0.003, 0.04):
        inputs, state = inputs_of(rng, rov), random_state(rng, rov)
        found = compared(rov, places(rov, rov.step(inputs, state, h)))
        for x, y in zip(found, compared(rov, rigid_vehicle.step(rov, inputs, state, h)), strict=True):
            assert abs(x - y) <= 1e-13 * (1.0 + abs(y)), h


# ---- Dead time ----


def commands_of(rng: random.Random, rov: Vehicle, times: int) -> list[dict[str, float]]:
    """Return random inputs, of which each holds for one or several steps."""
    found: list[dict[str, float]] = []
    while len(found) < times:
        found += [inputs_of(rng, rov) | {"voltage": 14.8}] * rng.choice((1, 1, 3))
    return found[:times]


def shifted(
    inputs: list[dict[str, float]], times: list[float], dead: float
) -> tuple[list[float], list[dict[str, float]]]:
    """Return the times and inputs of a vehicle without dead time that moves as the one with it."""
    arrivals = {t + dead: values for t, values in zip(times, inputs, strict=True)}
    union = sorted({*times, *(t for t in arrivals if t < times[-1])})
    found = []
    for t in union:
        present = max(n for n, time in enumerate(times) if time <= t)
        arrived = [values for arrival, values in arrivals.items() if arrival <= t]
        commands = {name: arrived[-1][name] if arrived else 0.0 for name in ROV.layout.commands}
        found.append({**inputs[present], **commands})
    return union, found


def test_commands_act_exactly_after_the_dead_time() -> None:
    """The steps are shorter and longer than the dead time, and changes arrive within them."""
    rng = random.Random(5)
    times = [0.0]
    for _ in range(60):
        times.append(times[-1] + rng.choice((0.013, 0.04, 0.1, 0.27)))
    inputs = commands_of(rng, ROV, len(times))
    union, immediate_inputs = shifted(inputs, times, ROV["T_d"])
    state = at_rest(NOW)
    for t, following, values in zip(union, union[1:], immediate_inputs, strict=False):
        state = NOW.step(values, state, following - t)
    line, delayed = ROV.memory(), at_rest(ROV)
    for t, following, values in zip(times, times[1:], inputs, strict=False):
        delayed = line.step(ROV, values, delayed, t, following - t)
    tables = {name: np.array([values[name] for values in inputs]) for name in ROV.layout.inputs}
    in_c = simulate(ROV, np.array(times), tables, workers=1).values[:, 0, -1]
    assert delayed == pytest.approx(state, rel=1e-12, abs=1e-13)
    assert in_c.tolist() == pytest.approx([delayed[name] for name in ROV.layout.state], rel=1e-13, abs=1e-14)


@pytest.mark.parametrize(("units", "waits"), [(-1, False), (0, False), (8, False), (9, True)])
def test_a_change_acts_at_its_time_to_within_the_rounding_of_the_times(units: int, waits: bool) -> None:
    inputs = ROV.layout.usual_inputs | {"u_l": 0.5}
    line = ROV.memory()
    line.waiting = [Change(0.5 + units * 2.0**-52, {name: inputs[name] for name in ROV.layout.commands})]
    line.step(ROV, inputs, at_rest(ROV), 0.5, 0.5)
    assert (bool(line.waiting), line.acting["u_l"]) == (waits, 0.0 if waits else 0.5)


def test_no_more_changes_wait_than_the_fmu_has_room_for() -> None:
    inputs, line = ROV.layout.usual_inputs, ROV.memory()
    line.waiting = [Change(0.09, dict.fromkeys(ROV.layout.commands, 1.0))] * 1023
    line.step(ROV, inputs, at_rest(ROV), 0.0, 1e-3)
    assert len(line.waiting) == 1024
    with pytest.raises(ValueError, match=r"^more than 1024 changes of commands wait for the dead time; "):
        line.step(ROV, inputs | {"u_l": 0.5}, at_rest(ROV), 1e-3, 1e-3)


def test_a_dead_time_that_ends_inside_a_step_is_as_exact_late_in_a_run() -> None:
    """Times near a million seconds have ten digits after the point, which the motion must not feel."""
    inputs = ROV.layout.usual_inputs | {"u_l": 0.5, "u_r": 0.5}
    ends = []
    for start in (0.0, 2.0**20):
        times = start + np.array([0.0, 0.03125, 0.28125, 0.78125])  # late times of these lengths are exact
        line, state = ROV.memory(), at_rest(ROV)
        for t, following in pairwise(times.tolist()):
            state = line.step(ROV, inputs, state, t, following - t)
        in_c = simulate(ROV, times, inputs, [*state], workers=1).values[:, 0, -1].tolist()
        ends.append([*state.values(), *in_c])
    assert ends[1] == ends[0]
    line, h = ROV.memory(), ROV["T_d"] / 300
    acting = simulate(ROV, h * np.arange(301), inputs, ["delayed_u_l"]).values[0, 0]
    assert acting.tolist() == [0.0] * 300 + [
        0.5
    ]  # rounding does not add up: the change acts at the end of the last step
    for n in range(300):
        assert line.acting["u_l"] == 0.0
        state = line.step(ROV, inputs, state, n * h, h)
    assert (line.waiting, line.acting["u_l"]) == ([], 0.5)
