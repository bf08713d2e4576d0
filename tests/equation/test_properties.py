"""Laws that the step of one axis obeys for every drag, force, velocity and time, tested without a reference."""

from collections.abc import Callable, Sequence
from typing import Any

from hypothesis import strategies as st

from rov_fmu.equation.alone import steady_velocity
from tests.motions import (
    BOUNDARIES,
    CASES,
    TINY,
    Case,
    hold,
    path,
    rounding_of_distance,
    rounding_of_velocity,
    step_alone,
)
from tests.often import often


def for_every(
    *strategies: st.SearchStrategy[Any], at: Sequence[tuple[Any, ...]] = ()
) -> Callable[[Callable[..., None]], Callable[[int], None]]:
    """Make a test of a law: for the cases in `at`, and for random motions, many more of them in the long tests."""

    def decorate(law: Callable[..., None]) -> Callable[[int], None]:
        @often("motions", 15, 250, 3000)
        def test(motions: int) -> None:
            hold(law, motions, *strategies, at=at)

        test.__doc__ = law.__doc__
        return test

    return decorate


# ---- Approach to equilibrium ----


@for_every(CASES, st.floats(1.0, 10.0), at=[(case, 2.0) for case in BOUNDARIES])
def test_the_velocity_approaches_the_steady_one_and_never_passes_it(case: Case, longer: float) -> None:
    A, B, C, v0, h = case
    V = steady_velocity(A, B, C)
    early, late = (step_alone(A, B, C, v0, time)[0] for time in (h, h * longer))
    rounding = 2.0 * rounding_of_velocity(v0, early, late)
    low, high = min(v0, V) - rounding, max(v0, V) + rounding
    assert low <= early <= high
    assert low <= late <= high
    assert early <= late + rounding if v0 < V else late <= early + rounding


@for_every(CASES, at=[(case,) for case in BOUNDARIES])
def test_without_force_no_motion_gains_one_bit_of_speed_or_turns(case: Case) -> None:
    A, B, _, v0, h = case
    velocity, distance = step_alone(A, B, 0.0, v0, h)
    assert 0.0 <= velocity <= v0 or v0 <= velocity <= 0.0
    assert abs(distance) <= abs(v0) * h
    assert distance * v0 >= 0.0


# ---- Energy ----


@for_every(CASES, at=[(case,) for case in BOUNDARIES])
def test_drag_takes_no_less_energy_than_at_an_even_speed_and_gives_none(case: Case) -> None:
    """The lost energy is the work C s minus the gain of v^2/2. It is the integral of B v^2 + A |v|^3.

    Over a given path it is least at an even speed (Jensen) and at most that at the largest speed.
    """
    A, B, C, v0, h = case
    velocity, distance = step_alone(*case)
    fastest, length = max(abs(v0), abs(velocity)), path(*case)
    lost = C * distance - 0.5 * (velocity - v0) * (velocity + v0)
    even, most = (B * length / h + A * (length / h) ** 2) * length, (B + A * fastest) * fastest * length
    rounding = 2.0 * fastest * rounding_of_velocity(fastest) + abs(C) * rounding_of_distance(case)
    rounding += 4.0 * (B * length / h + A * (length / h) ** 2) * rounding_of_distance(case) + 1e-15 * most + TINY
    assert even - rounding <= lost <= most + rounding
