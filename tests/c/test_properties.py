"""However a run is cut, and whatever steps the vehicle alone or beside others, the numbers are the same.

The vehicles have a dead time, lags, tables of thrust, the attitude with its turns, drag by direction and a current.
Steps are shorter and longer than the dead time, so that changes of commands wait over several steps, arrive within one,
and are replaced.
"""

import pickle
import random
from copy import deepcopy
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import pytest

from rov_fmu.c.simulation import Array, simulate
from rov_fmu.c.stepper import LaneStepper, Stepper
from rov_fmu.equation.catalogue import delayed_name
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.often import often, spread
from tests.vehicles import (
    EVERYTHING,
    FINNED,
    HEAVY,
    SIX,
    SIX_AXES,
    THRUST_EFFECTS,
    VIDEORAY,
    passed,
    random_body,
    random_case,
    random_inputs,
    random_state,
    random_vehicle,
    surfaced,
    tied,
    with_rotors,
)

SCALE = 1e-12
"""The allowed difference, relative to the largest size of a variable of a vehicle, which is at least 1 in SI units."""
VEHICLES = 19
"""Two full vectors of eight, and some lanes of a third one."""
CHANGES = 20
"""The changes of all inputs in a run."""


def late(rov: Vehicle) -> Vehicle:
    """Return the vehicle with a dead time."""
    layout = replace(rov.layout, has_dead_time=True)
    return Vehicle(layout, {name: {**rov.coefficients, "T_d": 0.1}[name] for name in layout.coefficients})


KNOWN = {
    "VideoRay": VIDEORAY,
    "lag, current passes": passed(HEAVY),
    "six axes": SIX,
    "everything": load_vehicle(EVERYTHING),
}
KNOWN |= {"dead time, lag, tables": load_vehicle(THRUST_EFFECTS), "attitude": load_vehicle(SIX_AXES), "fins": FINNED}
KNOWN |= {
    "tied": tied(SIX, tether=(-0.3, 0.1, -0.2)),
    "tied, surface, current passes": tied(passed(surfaced(SIX)), tether=(-0.3, 0.1, -0.2)),
    "rotors": with_rotors(SIX),
    "slow rotors": with_rotors(SIX).with_(T_t200=2.5),
}
LONG = {"attitude, lag, dead time, current passes": late(passed(SIX)), "dead time alone": late(KNOWN["attitude"])}
USUAL = ("VideoRay", "everything", "dead time, lag, tables", "tied, surface, current passes", "slow rotors")
"""Those of the default tests, which have every part."""
SUBSETS = ["".join(axes) for n in range(1, 7) for axes in combinations("uvwpqr", n)]


class Run:
    """A run of vehicles with drawn coefficients, states and inputs, and finer times at which it is cut."""

    def __init__(self, rng: random.Random, rov: Vehicle, lengths: list[float] | None = None) -> None:
        """`lengths` are those of the times between two changes of the inputs, s, unless they are drawn, too."""
        self.rov, self.layout = rov, rov.layout
        self.moving = [*self.layout.state, *self.layout.continued, *self.layout.memory]
        calculated = self.layout.calculated.keys() - self.layout.over_ground.keys()  # a large heading has few digits
        self.record = [*self.moving, *sorted(calculated)]  # which follow the new inputs at once
        lengths = lengths or [
            rng.choice((0.013, 0.04, 0.1, 0.27)) * rng.choice((1.0, rng.random())) for _ in range(CHANGES)
        ]
        self.time = np.cumsum([0.0, *lengths])
        cuts = [rng.uniform(*rng.choice([*zip(self.time, self.time[1:], strict=False)])) for _ in range(2 * CHANGES)]
        self.fine = np.union1d(self.time, cuts)
        inputs = [[random_inputs(rng, rov) for _ in self.time] for _ in range(VEHICLES)]
        back = {name: np.array([[now[name] for now in own[::-1]] for own in inputs]) for name in self.layout.inputs}
        self.inputs = {name: rows[:, ::-1] for name, rows in back.items()}  # with negative strides
        states = [random_state(rng, rov) for _ in range(VEHICLES)]
        drawn = {name: [[rov[name] * rng.uniform(0.8, 1.2)] for _ in range(VEHICLES)] for name in rov.coefficients}
        self.start = {name: np.array(value) for name, value in drawn.items()}
        self.start |= {name: np.array([[state[name]] for state in states]) for name in self.layout.state}

    def held(self, times: Array) -> dict[str, Array]:
        """Return the inputs at times, each held since the last change."""
        return {name: rows[:, np.searchsorted(self.time, times, "right") - 1] for name, rows in self.inputs.items()}

    def simulated(self, times: Array, order: Any = slice(None), **how: Any) -> Array:
        """Return the recorded variables (variables x vehicles x times), of some vehicles in any order."""
        values = {name: rows[order] for name, rows in (self.start | self.held(times)).items()}
        vehicles = len(next(iter(values.values())))
        found = simulate(self.rov, times, values, self.record, vehicles=vehicles, **how)
        assert set(found.failed.tolist()) == {len(times)}
        return found.values

    def own(self, vehicle: int) -> tuple[Vehicle, dict[str, float]]:
        """Return a vehicle with its coefficients, and its states at the start."""
        mine = {name: float(column[vehicle, 0]) for name, column in self.start.items()}
        own = {name: mine[name] for name in self.rov.coefficients}  # the weight of a random body may be negative
        return replace(self.rov, coefficients=own), {name: mine[name] for name in self.layout.state}


def near(found: Array, expected: Array, scale: float = SCALE) -> None:
    """Check numbers whose last axis is that of the times, or of the vehicles."""
    assert np.isfinite(expected).all()
    assert np.max(np.abs(found - expected) / np.abs(expected).max(axis=-1, keepdims=True, initial=1.0)) < scale


def check(rng: random.Random, rov: Vehicle) -> None:
    run = Run(rng, rov)
    alone = run.simulated(run.fine)
    np.testing.assert_array_equal(run.simulated(run.fine, workers=1), alone)
    near(alone[:, :, np.searchsorted(run.fine, run.time)], run.simulated(run.time))
    order = rng.sample(range(VEHICLES), VEHICLES)
    for some in (order, order[:1]):
        near(run.simulated(run.fine, some, lanes=True, workers=3), alone[:, some])
    now, lengths = run.held(run.fine), np.diff(run.fine)
    table = np.array([*now.values()])
    many = LaneStepper(rov, VEHICLES)
    many.begin(run.start, range(VEHICLES))
    for n, h in enumerate(lengths.tolist()):
        many.inputs[:] = table[:, :, n].T
        many = deepcopy(many) if n % 7 == 0 else many
        assert not many.step(h).any()
    near(many.states.T, alone[: len(run.layout.state), :, -1])
    for vehicle in order[:2]:
        mine, state = run.own(vehicle)
        stepper = Stepper(mine, state, run.moving)
        rows = []
        for n, h in enumerate(lengths.tolist()):
            stepper = pickle.loads(pickle.dumps(stepper)) if n == len(lengths) // 2 else stepper
            rows.append(stepper.step(table[:, vehicle, n].tolist(), h))
        np.testing.assert_array_equal(np.array(rows).T, alone[: len(run.moving), vehicle, 1:])


@pytest.mark.parametrize("name", spread(KNOWN | LONG, USUAL, ("attitude", "fins", "rotors", *LONG)))
def test_a_run_is_the_same_in_pieces_and_in_lanes(name: str) -> None:
    check(random.Random(name), (KNOWN | LONG)[name])


@pytest.mark.parametrize(
    "axes",
    [pytest.param(axes, marks=pytest.mark.weekly if n % 32 else pytest.mark.long) for n, axes in enumerate(SUBSETS, 1)],
)
def test_a_run_of_any_vehicle_is_the_same_in_pieces_and_in_lanes(axes: str) -> None:
    """63 subsets of the axes. The engine of each is compiled."""
    rng = random.Random(axes)
    for rov in (random_body(rng, axes), *([random_vehicle(rng)] if len(axes) == 3 else [])):
        check(rng, late(rov) if rng.random() < 0.5 else rov)


@pytest.mark.parametrize("name", ["VideoRay", "six axes"])
def test_steps_of_any_length_agree(name: str) -> None:
    """From a microsecond to 1000 s: a long step has many pieces, reversals, and an end in closed form."""
    run = Run(random.Random(6), KNOWN[name], [1e-6, 1e-3, 1000.0, 0.01, 30.0, 1e-3, 1.0, 0.01, 0.01, 1000.0])
    lanes, alone = (run.simulated(run.time, lanes=way) for way in (True, False))
    near(lanes, alone, 1e-10 if name == "six axes" else SCALE)


@pytest.mark.parametrize("lanes", [True, False])
def test_a_vehicle_that_cannot_be_computed_affects_no_other_and_the_next_one_takes_its_lane(lanes: bool) -> None:
    times, start = np.arange(0.0, 5.0, 0.01), np.full((VEHICLES, 1), 0.1)
    commands = np.full((VEHICLES, len(times)), 0.4)
    good = simulate(VIDEORAY, times, {"u_l": commands, "r": start}, vehicles=VEHICLES, lanes=lanes).values
    start[[3, 4, 11], 0] = np.nan, np.inf, 1e300
    commands[5, 100:] = np.nan
    found = simulate(VIDEORAY, times, {"u_l": commands, "r": start}, vehicles=VEHICLES, lanes=lanes)
    expected = np.full(VEHICLES, len(times))
    expected[[3, 4, 5, 11]] = 1, 1, 101, 1
    assert found.failed.tolist() == expected.tolist()
    assert np.isnan(found.values[:, 5]).any(axis=0).argmax() == 101
    others = np.flatnonzero(expected == len(times))
    np.testing.assert_allclose(found.values[:, others], good[:, others], rtol=1e-12, atol=1e-14)


@often("cases", 4, 20, 1000)
@pytest.mark.parametrize("name", spread(KNOWN, USUAL, KNOWN))
def test_a_step_in_python_may_be_cut_and_is_that_of_the_engine(name: str, cases: int) -> None:
    """Commands act at once, unless others are given that act after the dead time."""
    rng, rov = random.Random(name), KNOWN[name]
    late = rov.layout.commands if rov.layout.has_dead_time else ()
    names = [*rov.layout.calculated, *(f"der({name})" for name in rov.layout.state)]
    for _ in range(cases):
        _, inputs, before, h = random_case(rng, rov, longest=0.0)
        before |= dict.fromkeys(rov.layout.continued, 0.0)
        acting = {delayed_name(name): inputs[name] for name in late}
        rates = {f"der({name})": rate for name, rate in rov.derivatives(inputs, before).items()}
        found = simulate(rov, [0.0, h], inputs | before | acting, names).values[:, 0, 0]
        now = rov.calculated(inputs, before) | rates
        assert found == pytest.approx(np.array([now[name] for name in names]), rel=1e-12, abs=1e-12)
        for given in ({}, {delayed_name(name): rng.uniform(-1.0, 1.0) for name in late}):
            whole, half = rov.step(inputs | given, before, h), rov.step(inputs | given, before, 0.3 * h)
            assert rov.step(inputs | given, half, 0.7 * h) == pytest.approx(whole, rel=1e-12, abs=1e-12)
            if not given:
                engine = Stepper(rov, before | acting, [*whole])
                assert engine.step([*inputs.values()], h) == pytest.approx([*whole.values()], rel=1e-12, abs=1e-12)


def test_a_motion_that_cannot_be_computed_is_told() -> None:
    stepper = Stepper(VIDEORAY, {"u": 1e200}, ["u"])
    with pytest.raises(OverflowError, match="from 0 s on"):
        stepper.step([0.0] * len(VIDEORAY.layout.commands), 1.0)
