"""A step in C agrees with the step in Python and with 50 digits, with and without lag and coupling."""

import random
from collections.abc import Callable

import pytest

from rov_fmu.model.rov import Rov
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.model.steps import Motion
from verification.references import reference

Values = dict[str, float]
Step = Callable[[Rov, Values, Values, float], Values]
VEHICLES = ("videoray", "bluerov2_heavy")


@pytest.fixture(scope="module", params=VEHICLES)
def vehicle(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Rov, Step]:
    rov = load_vehicle(SHIPPED[request.param]).rov
    return rov, Motion(rov, tmp_path_factory.mktemp("step")).step


def case(rov: Rov, rng: random.Random, longest: float = 3.0) -> tuple[Values, Values, float]:
    """Inputs, states and a step; some velocities and forces are 0, commands reach into the dead band and beyond ±1."""

    def number(scale: float) -> float:
        return 0.0 if rng.random() < 0.15 else rng.gauss(0.0, scale)

    layout = rov.layout
    inputs = {name: rng.uniform(-1.1, 1.1) if rng.random() < 0.8 else 0.0 for name in layout.commands}
    inputs |= {name: number(0.3) for name in layout.inputs if name not in inputs}
    from_rest = rng.random() < 0.15  # there the direction shows by the first term that is not 0
    state = {name: 0.0 if from_rest else number(5.0 if name in layout.lagging else 0.7) for name in layout.state}
    return inputs, state, 10.0 ** rng.uniform(-6.0, longest)


@pytest.mark.parametrize(
    ("seed", "cases"),
    [(1, 60), pytest.param(2, 250, marks=pytest.mark.long), pytest.param(2, 1000, marks=pytest.mark.weekly)],
)
def test_a_step_in_c_is_that_in_python(vehicle: tuple[Rov, Step], seed: int, cases: int) -> None:
    rov, step = vehicle
    rng = random.Random(seed)
    for _ in range(cases):
        inputs, state, h = case(rov, rng)
        found, expected = step(rov, inputs, state, h), rov.step(inputs, state, h)
        for name, value in expected.items():
            room = 1e-13 * (1.0 + 10.0 * h) if name in rov.layout.pose else 1e-13 * (1.0 + abs(value))
            assert abs(found[name] - value) <= room, (name, inputs, state, h)


@pytest.mark.parametrize(
    ("seed", "cases", "longest", "velocity", "path"),
    [
        (3, 8, 0.3, 1e-14, 1e-13),
        pytest.param(4, 10, 2.0, 1e-12, 1e-12, marks=pytest.mark.long),
        pytest.param(4, 40, 2.0, 1e-12, 1e-12, marks=pytest.mark.weekly),
    ],
)
def test_a_step_in_c_is_exact(
    vehicle: tuple[Rov, Step], seed: int, cases: int, longest: float, velocity: float, path: float
) -> None:
    """Against 50 digits, by what the error of a velocity and of a pose is measured; of many cases there are some whose
    forces nearly cancel, and with them the scale."""
    rov, step = vehicle
    rng = random.Random(seed)
    for _ in range(cases):
        inputs, state, h = case(rov, rng, longest)
        found, exact = step(rov, inputs, state, h), reference.step(rov, inputs, state, h)
        for name, value in exact.state.items():
            pose = name in rov.layout.pose
            room = (path if pose else velocity) * exact.scale[name] + 2.0**-51 * abs(state[name]) * pose
            assert abs(found[name] - value) <= room, (name, inputs, state, h, float(found[name] - value))


def test_the_smallest_velocity_is_turned_back(vehicle: tuple[Rov, Step]) -> None:
    """A product of it and of the force against it is 0, and yet it changes its direction at once."""
    rov, step = vehicle
    inputs = dict.fromkeys(rov.layout.inputs, 0.0) | {"X_ext": -5.0}
    rest = dict.fromkeys(rov.layout.state, 0.0)
    assert step(rov, inputs, rest | {"u": 5e-324}, 0.1) == pytest.approx(step(rov, inputs, rest, 0.1), rel=1e-13)


@pytest.mark.parametrize("h", [1e20, 1e28, 1e35])
def test_a_tiny_force_carries_a_vehicle_no_further_than_its_steady_velocity(
    vehicle: tuple[Rov, Step], h: float
) -> None:
    """The coefficients of such a series differ by more than the range of a double."""
    rov, step = vehicle
    inputs = dict.fromkeys(rov.layout.inputs, 0.0) | {"X_ext": 1e-250}
    found = step(rov.replaced({"b_d_u": 3.0}), inputs, dict.fromkeys(rov.layout.state, 0.0), h)
    steady = 1e-250 / 3.0
    assert found["u"] == pytest.approx(steady, rel=1e-13, abs=0.0)
    assert found["x"] == pytest.approx(steady * h, rel=1e-13, abs=0.0)


def test_a_step_of_too_many_pieces_is_refused(vehicle: tuple[Rov, Step]) -> None:
    rov, step = vehicle
    still = dict.fromkeys(rov.layout.inputs, 0.0)
    state = dict.fromkeys(rov.layout.state, 0.0) | {"u": 1.0, "r": 1e30}
    frictionless = rov.replaced({"a_d_r": 0.0, "b_d_r": 0.0})
    with pytest.raises(AssertionError):
        step(frictionless, still, state, 1.0)
