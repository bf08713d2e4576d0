"""However a run is cut into pieces, and whatever steps the vehicle, the numbers are the same.

The vehicles have a dead time, lags, tables of thrust, the attitude with its turns, drag by direction and a current.
Steps are shorter and longer than the dead time, so that changes of commands wait over several steps, arrive within one,
and are replaced.
"""

import pickle
import random
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from rov_fmu.c.simulation import simulate
from rov_fmu.c.stepper import LaneStepper, Stepper
from rov_fmu.equation.catalogue import delayed_name
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.often import often
from tests.vehicles import (
    HEAVY,
    SIX,
    SIX_AXES,
    THRUST_EFFECTS,
    VIDEORAY,
    random_body,
    random_inputs,
    random_state,
    random_vehicle,
)

Array = NDArray[np.float64]
SCALE = 1e-12
"""The allowed difference, relative to the largest size of a variable, which is at least 1 in SI units."""
STEPS = 25
"""The changes of all inputs in a run."""
VEHICLES = 3


def _late(rov: Vehicle) -> Vehicle:
    """Return the vehicle with a dead time."""
    layout = replace(rov.layout, has_dead_time=True)
    return Vehicle(layout, {name: {**rov.coefficients, "T_d": 0.1}[name] for name in layout.coefficients})


KNOWN = {"dead time, lag, tables": load_vehicle(THRUST_EFFECTS), "attitude": load_vehicle(SIX_AXES), "lag": HEAVY}
LONG = {"attitude, lag, dead time": _late(SIX), "dead time alone": _late(KNOWN["attitude"])}


class Run:
    """A run of vehicles with drawn coefficients, states and inputs, and finer times at which it is cut."""

    def __init__(self, rng: random.Random, rov: Vehicle) -> None:
        self.rov, self.layout = rov, rov.layout
        self.record = [*self.layout.state, *self.layout.continued, *self.layout.delayed]
        lengths = [rng.choice((0.013, 0.04, 0.1, 0.27)) * rng.choice((1.0, rng.random())) for _ in range(STEPS)]
        self.time = np.cumsum([0.0, *lengths])
        cuts = [rng.uniform(*rng.choice([*zip(self.time, self.time[1:], strict=False)])) for _ in range(2 * STEPS)]
        self.fine = np.union1d(self.time, cuts)
        inputs = [[random_inputs(rng, rov) for _ in self.time] for _ in range(VEHICLES)]
        self.inputs = {name: np.array([[now[name] for now in own] for own in inputs]) for name in self.layout.inputs}
        states = [random_state(rng, rov) for _ in range(VEHICLES)]
        drawn = {name: [[rov[name] * rng.uniform(0.8, 1.2)] for _ in range(VEHICLES)] for name in rov.coefficients}
        self.start = {name: np.array(value) for name, value in drawn.items()}
        self.start |= {name: np.array([[state[name]] for state in states]) for name in self.layout.state}

    def held(self, times: Array) -> dict[str, Array]:
        """Return the inputs at times, each held since the last change."""
        return {name: rows[:, np.searchsorted(self.time, times, "right") - 1] for name, rows in self.inputs.items()}

    def simulated(self, times: Array, *, lanes: bool = False) -> Array:
        """Return the recorded variables (variables x vehicles x times)."""
        values = self.start | self.held(times)
        return simulate(self.rov, times, values, self.record, vehicles=VEHICLES, lanes=lanes).values

    def own(self, vehicle: int) -> tuple[Vehicle, dict[str, float]]:
        """Return a vehicle with its coefficients, and its states at the start."""
        mine = {name: float(column[vehicle, 0]) for name, column in self.start.items()}
        own = {name: mine[name] for name in self.rov.coefficients}  # the weight of a random body may be negative
        return replace(self.rov, coefficients=own), {name: mine[name] for name in self.layout.state}


def near(found: Array, expected: Array) -> None:
    """Check numbers whose first axis is that of the variables."""
    axes = (*range(1, expected.ndim),)
    scale = np.maximum(np.max(np.abs(expected), axis=axes, keepdims=True), 1.0)
    assert np.max(np.abs(found - expected) / scale) < SCALE


def check(rng: random.Random, rov: Vehicle) -> None:
    run = Run(rng, rov)
    whole, cut = run.simulated(run.time), run.simulated(run.fine)
    assert np.isfinite(whole).all()
    kept = np.searchsorted(run.fine, run.time)
    near(cut[:, :, kept], whole)
    near(run.simulated(run.fine, lanes=True), cut)
    now, lengths = run.held(run.fine), np.diff(run.fine)
    table = np.array([*now.values()])
    many = LaneStepper(rov, VEHICLES)
    many.begin(run.start, range(VEHICLES))
    for n, h in enumerate(lengths.tolist()):
        many.inputs[:] = table[:, :, n].T
        many = deepcopy(many) if n % 7 == 0 else many
        assert not many.step(h).any()
    near(many.states.T, cut[: len(run.layout.state), :, -1])
    for vehicle in range(VEHICLES):
        mine, state = run.own(vehicle)
        stepper = Stepper(mine, state, run.record)
        rows = []
        for n, h in enumerate(lengths.tolist()):
            stepper = pickle.loads(pickle.dumps(stepper)) if n == len(lengths) // 2 else stepper
            rows.append(stepper.step(table[:, vehicle, n].tolist(), h))
        np.testing.assert_array_equal(np.array(rows).T, cut[:, vehicle, 1:])


@pytest.mark.parametrize("name", [*KNOWN, *(pytest.param(name, marks=pytest.mark.long) for name in LONG)])
def test_a_run_may_be_cut_anywhere(name: str) -> None:
    check(random.Random(name), (KNOWN | LONG)[name])


@pytest.mark.long
@often("count", 2, 4, 60)
def test_a_run_of_any_vehicle_may_be_cut_anywhere(count: int) -> None:
    rng = random.Random(count)
    for n in range(count):
        rov = random_body(rng, "uvwpqr") if n % 2 else random_vehicle(rng)
        check(rng, _late(rov) if rng.random() < 0.5 else rov)


@pytest.mark.parametrize("name", KNOWN)
def test_steps_in_python_may_be_cut_anywhere_and_are_those_of_the_engine(name: str) -> None:
    """Commands act at once, unless others are given that act after the dead time."""
    rng, rov = random.Random(name), KNOWN[name]
    inputs, before = random_inputs(rng, rov), random_state(rng, rov)
    before |= dict.fromkeys(rov.layout.continued, 0.0)
    acting = {delayed_name(name): rng.uniform(-1.0, 1.0) for name in rov.layout.commands if rov.layout.has_dead_time}
    for given in ({}, acting):
        whole = rov.step(inputs | given, before, 0.7)
        pieces = before
        for h in (0.2, 0.1, 0.4):
            pieces = rov.step(inputs | given, pieces, h)
        assert pieces == pytest.approx(whole, rel=1e-12, abs=1e-12)
        if given or not acting:
            continue
        present = {delayed_name(name): inputs[name] for name in rov.layout.commands}
        stepper = Stepper(rov, before | present, [*whole])
        assert stepper.step([*inputs.values()], 0.7) == pytest.approx([*whole.values()], rel=1e-12, abs=1e-12)


def test_a_motion_that_cannot_be_computed_is_told() -> None:
    stepper = Stepper(VIDEORAY, {"u": 1e200}, ["u"])
    with pytest.raises(OverflowError, match="from 0 s on"):
        stepper.step([0.0] * len(VIDEORAY.layout.commands), 1.0)
