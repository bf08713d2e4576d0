"""A step of the FMU agrees with the step in Python, with and without lag and coupling, also in special cases."""

import random
from functools import partial

import pytest

from rov_fmu.model.rov import Rov
from tests.fmi2 import Fmu
from tests.model.steps import Step, in_fmu
from tests.vehicles import HEAVY, VIDEORAY

Values = dict[str, float]


@pytest.fixture(scope="module", params=["videoray", "heavy"])
def vehicle(request: pytest.FixtureRequest) -> tuple[Rov, Step]:
    """A vehicle, and the step of its FMU."""
    rov = {"videoray": VIDEORAY, "heavy": HEAVY}[request.param]
    return rov, partial(in_fmu, Fmu(request.getfixturevalue(f"{request.param}_dir")))


def case(rov: Rov, rng: random.Random, longest: float = 3.0) -> tuple[Values, Values, float]:
    """Return random inputs, states and a step size. Commands reach into the dead band and beyond ±1."""

    def number(scale: float) -> float:
        return 0.0 if rng.random() < 0.15 else rng.gauss(0.0, scale)

    layout = rov.layout
    inputs = {name: rng.uniform(-1.1, 1.1) if rng.random() < 0.8 else 0.0 for name in layout.commands}
    inputs |= {name: number(0.3) for name in layout.inputs if name not in inputs}
    from_rest = rng.random() < 0.15  # at rest, the direction follows from the first term that is not 0
    state = {name: 0.0 if from_rest else number(5.0 if name in layout.lagging else 0.7) for name in layout.state}
    return inputs, state, 10.0 ** rng.uniform(-6.0, longest)


@pytest.mark.parametrize(
    ("seed", "cases"),
    [(1, 25), pytest.param(2, 250, marks=pytest.mark.long), pytest.param(2, 1000, marks=pytest.mark.weekly)],
)
def test_a_step_in_c_agrees_with_the_step_in_python(vehicle: tuple[Rov, Step], seed: int, cases: int) -> None:
    rov, step = vehicle
    rng = random.Random(seed)
    for _ in range(cases):
        inputs, state, h = case(rov, rng)
        found, expected = step(rov, inputs, state, h), rov.step(inputs, state, h)
        for name, value in expected.items():
            room = 1e-13 * (1.0 + 10.0 * h) if name in rov.layout.pose else 1e-13 * (1.0 + abs(value))
            assert abs(found[name] - value) <= room, (name, inputs, state, h)


def test_the_smallest_velocity_is_turned_back(vehicle: tuple[Rov, Step]) -> None:
    """The product of such a velocity and the force against it underflows to 0, but the velocity reverses at once."""
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
