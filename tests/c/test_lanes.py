"""Many vehicles in the lanes of a vector move like each of them alone, stepped by the C of the FMU."""

import random
from itertools import combinations

import numpy as np
import pytest
from numpy.typing import NDArray

from rov_fmu.c.simulation import simulate
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.vehicles import (
    EVERYTHING,
    HEAVY,
    SIX,
    SIX_AXES,
    THRUST_EFFECTS,
    VIDEORAY,
    random_body,
    random_inputs,
    random_state,
)

Array = NDArray[np.float64]
SCALE = 1e-12
VEHICLES = 19
"""Two full vectors of eight, and some lanes of a third one."""
ROVS = {"videoray": VIDEORAY, "heavy": HEAVY, "six": SIX}
ROVS |= {path.stem: load_vehicle(path) for path in (EVERYTHING, THRUST_EFFECTS, SIX_AXES)}
SUBSETS = ["".join(axes) for n in range(1, 7) for axes in combinations("uvwpqr", n)]


def drawn(rng: random.Random, rov: Vehicle, vehicles: int, times: int) -> dict[str, Array]:
    """Return coefficients, starts, and inputs that change at every third time, for each vehicle its own."""
    factors = {name: [rng.uniform(0.9, 1.1) for _ in range(vehicles)] for name in rov.coefficients}
    values = {name: rov[name] * np.array(factors[name])[:, np.newaxis] for name in rov.layout.coefficients}
    states = [random_state(rng, rov) for _ in range(vehicles)]
    values |= {name: np.array([[state[name]] for state in states]) for name in rov.layout.state}
    changes = [[random_inputs(rng, rov) for _ in range(-(-times // 3))] for _ in range(vehicles)]
    for name in rov.layout.inputs:
        values[name] = np.repeat([[inputs[name] for inputs in own] for own in changes], 3, axis=1)[:, :times]
    return values


def rising(rng: random.Random, times: int, shortest: float = -3.0, longest: float = -0.5) -> Array:
    """Return times whose differences are most often between 10^shortest and 10^longest seconds."""
    lengths = [10.0 ** rng.uniform(shortest, longest) for _ in range(times - 1)]
    return np.cumsum([0.0, *lengths])


def difference(rov: Vehicle, times: Array, values: dict[str, Array], vehicles: int = VEHICLES) -> float:
    """Return the largest difference between lanes and the vehicles alone, relative to the scale of each variable.

    The scale of a variable is its largest size in the runs of all vehicles, but at least 1 in SI units.
    """
    record = [*rov.layout.state, *rov.layout.calculated]
    alone, lanes = (simulate(rov, times, values, record, vehicles=vehicles, lanes=way) for way in (False, True))
    np.testing.assert_array_equal(lanes.failed, alone.failed)
    np.testing.assert_array_equal(np.isnan(lanes.values), np.isnan(alone.values))
    size = np.nanmax(np.abs(alone.values), axis=2, keepdims=True, initial=1.0)
    return float(np.nanmax(np.abs(lanes.values - alone.values) / size))


@pytest.mark.parametrize("name", ["videoray", "heavy", "six", "everything", "thrust_effects", "six_axes"])
def test_vehicles_in_lanes_move_like_each_of_them_alone(name: str) -> None:
    """Each has its own reversals and dead bands; some layouts have lags, dead times and voltages."""
    rov = ROVS[name]
    rng = random.Random(48)
    times = rising(rng, 40)
    assert difference(rov, times, drawn(rng, rov, VEHICLES, len(times))) < SCALE


@pytest.mark.parametrize(
    "axes",
    [pytest.param(axes, marks=pytest.mark.weekly if n % 4 else pytest.mark.long) for n, axes in enumerate(SUBSETS, 1)],
)
def test_every_subset_of_axes_moves_in_lanes_as_alone(axes: str) -> None:
    """63 subsets of 16 vehicles. The engine of each is compiled."""
    rng = random.Random(axes)
    rov, times = random_body(rng, axes), rising(rng, 60)
    assert difference(rov, times, drawn(rng, rov, 16, len(times)), 16) < SCALE


def test_neighbours_do_not_matter() -> None:
    """A vehicle has the same motion in any lane, beside any others, and for any number of threads."""
    rov, rng, vehicles = ROVS["everything"], random.Random(5), VEHICLES
    times = rising(rng, 30)
    values = drawn(rng, rov, vehicles, len(times))
    order = rng.sample(range(vehicles), vehicles)
    moved = {name: array[order] for name, array in values.items()}
    first = simulate(rov, times, values, vehicles=vehicles, lanes=True, workers=1).values
    size = np.abs(first).max(axis=2, keepdims=True, initial=1.0)
    second = simulate(rov, times, moved, vehicles=vehicles, lanes=True, workers=3).values
    assert np.abs((second - first[:, order]) / size[:, order]).max() < SCALE
    one = simulate(rov, times, {name: array[7:8] for name, array in values.items()}, lanes=True).values
    assert np.abs((one[:, 0] - first[:, 7]) / size[:, 7]).max() < SCALE


def test_a_vehicle_that_cannot_be_computed_affects_no_other_and_the_next_one_takes_its_lane() -> None:
    times, start = np.arange(0.0, 5.0, 0.01), np.full((VEHICLES, 1), 0.1)
    commands = np.full((VEHICLES, len(times)), 0.4)
    good = simulate(VIDEORAY, times, {"u_l": commands, "r": start}, vehicles=VEHICLES, lanes=True).values
    start[[3, 4, 11], 0] = np.nan, np.inf, 1e300
    commands[5, 100:] = np.nan
    found = simulate(VIDEORAY, times, {"u_l": commands, "r": start}, vehicles=VEHICLES, lanes=True)
    expected = np.full(VEHICLES, len(times))
    expected[[3, 4, 5, 11]] = 1, 1, 101, 1
    assert found.failed.tolist() == expected.tolist()
    assert np.isnan(found.values[:, 5]).any(axis=0).argmax() == 101
    others = np.flatnonzero(expected == len(times))
    np.testing.assert_allclose(found.values[:, others], good[:, others], rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("name", ["videoray", "six"])
def test_steps_of_any_length_agree(name: str) -> None:
    """From a microsecond to 1000 s: a long step has many pieces, reversals, and an end in closed form."""
    rov, rng = ROVS[name], random.Random(6)
    times = np.cumsum([0.0, 1e-6, 1e-3, 1000.0, 0.01, 30.0, 1e-3, 1.0, 0.01, 0.01, 1000.0])
    values = drawn(rng, rov, VEHICLES, len(times))
    assert difference(rov, times, values) < (1e-10 if name == "six" else SCALE)
