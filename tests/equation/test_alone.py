"""The motion of one axis agrees with 50 digits: the step in C, V_ss and Tau."""

import random
from collections.abc import Iterable
from itertools import islice, product
from math import e, inf, nextafter

import pytest
from mpmath import mp
from scipy.integrate import quad

from rov_fmu.equation.alone import RISE, AxisAlone, steady_velocity, time_constant
from tests.motions import DISTANCE, SMALLEST, VELOCITY, Case, step_alone
from tests.often import often
from verification.references.reference import axis, time_to_rest


@pytest.fixture(params=[29, pytest.param(1, marks=pytest.mark.long)], ids=["every 29th case", "every case"])
def stride(request: pytest.FixtureRequest) -> int:
    """The distance between the cases of a list that are tested."""
    return int(request.param)


def check(cases: Iterable[Case], stride: int = 1) -> None:
    for case in islice(cases, 0, None, stride):
        exact, (velocity, distance) = axis(*case), step_alone(*case)
        assert abs(velocity - exact.velocity) <= 2.0 * VELOCITY * exact.scale + 1e-310, case
        assert abs(distance - exact.distance) <= 2.0 * DISTANCE * exact.path + 1e-310, case


def random_case(rng: random.Random) -> Case:
    def zero_or(low: float, high: float, signs: tuple[int, ...] = (1,)) -> float:
        return 0.0 if rng.random() < 0.1 else rng.choice(signs) * float(10.0 ** rng.uniform(low, high))

    A, B, C, v0 = zero_or(-4, 3), zero_or(-4, 3), zero_or(-4, 4, (-1, 1)), zero_or(-4, 2, (-1, 1))
    return A, B, C, v0, 10.0 ** rng.uniform(-5, 3)


@often("cases", 100, 3_000, 20_000)
def test_velocity_and_distance_are_exact_over_random_motions(cases: int) -> None:
    rng = random.Random(cases)
    check(random_case(rng) for _ in range(cases))


# ---- Where the formulas change ----


def decelerations_near_coinciding_equilibria() -> list[tuple[float, float, float, float]]:
    """Motions with C at -B^2/(4 A) and on both sides of it. There D^2 = 0, and tanh becomes tan."""
    offsets = [0.0, *(sign * 10.0**-n for n in range(2, 16) for sign in (1, -1))]
    return [
        (A, B, -B * B / (4.0 * A) * (1.0 + offset), v0)
        for A, B, v0, offset in product((1e-4, 0.3, 1e3), (1e-4, 1.7, 1e3), (0.01, 30.0), offsets)
    ]


def test_exact_where_the_equilibria_coincide(stride: int) -> None:
    motions = [(motion, time_to_rest(*motion)) for motion in decelerations_near_coinciding_equilibria()]
    check(((*motion, h) for motion, rest in motions for h in (1e-3, 0.5 * rest, 3.0 * rest)), stride)


def test_exact_at_and_around_the_reversal(stride: int) -> None:
    cases: list[Case] = []
    for motion in product((0.0, 1e-4, 0.3, 1e3), (0.0, 1e-4, 1.7, 1e3), (-1e-4, -0.1, -1e4), (0.001, 1.0, 100.0)):
        rest = time_to_rest(*motion)
        times = nextafter(rest, 0.0), rest, nextafter(rest, inf), *(rest * (1.0 + d) for d in (-1e-9, 1e-9, 1e-4))
        cases += [(*motion, h) for h in times]
    check(cases, stride)


# ---- Far outside what an ROV does ----


def test_tiny_and_subnormal_numbers_are_exact_to_the_last_subnormal_digit(stride: int) -> None:
    cases: list[Case] = []
    for tiny in (1e-12, 1e-300, SMALLEST):
        small = 0.0, tiny, 1.0
        cases += product(small, small, (-1.0, -tiny, tiny), small, (tiny, 1.0))
    check(cases, min(stride, 5))


# ---- Steady velocity and time constant ----

DRAGS = [
    case for case in product((0.0, 1e-4, 0.3, 1e3, 1e15), (0.0, 1e-4, 1.7, 1e3), (1e-4, 0.1, 1e4)) if any(case[:2])
]


def test_drag_balances_the_force_at_the_steady_velocity() -> None:
    for A, B, C in DRAGS:
        V = steady_velocity(A, B, C)
        assert steady_velocity(A, B, -C) == -V
        with mp.workdps(50):
            # a relative error of V is at most that of the drag (with linear drag alone), and at least half of it
            assert abs((A * mp.mpf(V) + B) * V / C - 1) <= 1e-15, (A, B, C)


def test_after_the_time_constant_the_velocity_is_that_of_17() -> None:
    for A, B, C in DRAGS:
        Tau = time_constant(A, B, C)
        assert time_constant(A, B, -C) == Tau
        fraction = axis(A, B, C, 0.0, Tau).velocity / steady_velocity(A, B, C)
        assert abs(fraction - (1.0 - 1.0 / e)) <= 1e-15, (A, B, C)


@pytest.mark.parametrize("drag", [(2.0, 3.0), (2.0, 0.0), (0.0, 3.0)])
def test_the_stopping_distance_is_the_integral_over_the_velocities(drag: tuple[float, float]) -> None:
    A, B = drag
    distance = quad(lambda v: 1.0 / (A * v + B), 0.05 * 1.5, 1.5)[0]
    assert AxisAlone(A, B, 1.0).stopping_distance(1.5, 0.05) == pytest.approx(distance, rel=1e-9)
    assert AxisAlone(A, B, 1.0).stopping_distance(inf, 0.05) == inf
    assert AxisAlone(0.0, 0.0, 1.0).stopping_distance(1.5, 0.05) == inf


def test_drag_of_its_own_in_reverse_holds_for_negative_velocities_and_forces() -> None:
    ahead, astern = AxisAlone(2.0, 3.0, 5.0, (0.5, 1.0)), AxisAlone(2.0, 3.0, -1.5, (0.5, 1.0))
    assert [ahead.acceleration(v) for v in (-2.0, 0.0, 0.5)] == [5.0 + (1.0 + 0.5 * 2.0) * 2.0, 5.0, 5.0 - 2.0]
    assert [ahead.drag(sign) for sign in (-1.0, 0.0, 1.0)] == [(0.5, 1.0), (2.0, 3.0), (2.0, 3.0)]
    assert (ahead.steady_velocity(), astern.steady_velocity()) == (1.0, -1.0)
    assert ahead.time_constant() == time_constant(2.0, 3.0, 5.0)
    assert astern.time_constant() == time_constant(0.5, 1.0, -1.5)
    assert AxisAlone(2.0, 3.0, -5.0).drag(-1.0) == (2.0, 3.0)
    assert astern.stopping_distance(-1.5, 0.1) == pytest.approx(quad(lambda v: 1.0 / (0.5 * v + 1.0), 0.15, 1.5)[0])
    assert pytest.approx(0.6321205588285577, rel=1e-15) == RISE
