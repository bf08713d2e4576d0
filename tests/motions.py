"""Random motions of one axis over the whole range of doubles, and bounds of their rounding errors."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import copysign
from typing import Any

from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from rov_fmu.c.stepper import Stepper
from tests.vehicles import VEHICLES, still
from verification.references import reference
from verification.references.reference import time_to_rest

Case = tuple[float, float, float, float, float]
"""The coefficients A, B, C of an axis, the initial velocity v0, and the step size h."""

# Over 100,000 random cases, the largest errors are 5.7e-16 of the velocity and 1.1e-15 of the distance.
VELOCITY = 2e-15
"""The allowed error of a velocity, relative to the largest velocity of the motion."""
DISTANCE = 4e-15
"""The allowed error of a distance, relative to the length of the path (without a reversal, this is the distance)."""
SMALLEST = 5e-324
TINY = 2.0 * SMALLEST


def hold(
    law: Callable[..., None], examples: int, *strategies: st.SearchStrategy[Any], at: Sequence[tuple[Any, ...]] = ()
) -> None:
    """Check a law for the arguments in `at` and for a number of random examples."""
    check = given(*strategies)(law)
    for arguments in at:
        check = example(*arguments)(check)
    slow = [HealthCheck.too_slow, HealthCheck.filter_too_much]
    settings(max_examples=examples, suppress_health_check=slow)(check)()


# ---- Motions ----


def _spread(n: int) -> float:
    """Map an integer to [0, 1) so that neighbours are far apart. Hypothesis prefers small integers."""
    return abs(n) * 0.6180339887498949 % 1.0


_NUMBERS = st.integers(0, 2**16)


def power(low: float, high: float) -> st.SearchStrategy[float]:
    """Return numbers from 10^low to 10^high with evenly distributed logarithms."""
    return _NUMBERS.map(lambda n: 10.0 ** (low + (high - low) * _spread(n)))


def size(low: float, high: float) -> st.SearchStrategy[float]:
    """Return numbers from 10^low to 10^high, and sometimes zero."""
    return _NUMBERS.map(lambda n: 10.0 ** (low + (high - low) * _spread(n)) if n % 10 else 0.0)


def signed(low: float, high: float) -> st.SearchStrategy[float]:
    """Return numbers of both signs with sizes from 10^low to 10^high, and sometimes zero."""
    return st.integers(-(2**16), 2**16).map(
        lambda n: copysign(10.0 ** (low + (high - low) * _spread(n)), n) if n % 10 else 0.0
    )


PURE, SIGNED = size(-3.0, 3.0), signed(-3.0, 3.0)
OFFSET = st.sampled_from((0.0, 2.0**-52, -(2.0**-52), 1e-12, -1e-12, 1e-9, -1e-9, 1e-6, -1e-6))

# The smallest double is about 10^-323.
WIDE = st.tuples(size(-323.0, 15.0), size(-323.0, 15.0), signed(-323.0, 18.0), signed(-323.0, 18.0), power(-9.0, 9.0))


@st.composite
def similar(draw: st.DrawFn) -> Case:
    """Draw motions in which drag, force and initial velocity all matter within the time, for any size of the units."""
    V, h = draw(power(-3.0, 3.0)), draw(power(-9.0, 9.0))
    A, B, C, v0 = draw(PURE), draw(PURE), draw(SIGNED), draw(SIGNED)
    return A / (V * h), B / h, C * V / h, v0 * V, h


@st.composite
def faint(draw: st.DrawFn) -> Case:
    """Draw motions whose drag affects only the last digits."""
    (A, B, C, v0, h), share = draw(similar()), draw(power(-18.0, -3.0))
    return A * share, B * share, C, v0, h


@st.composite
def coinciding(draw: st.DrawFn) -> Case:
    """Draw motions at and near D^2 = 0, where tanh becomes tan. The force -B^2/(4 A) has no rounding error."""
    A, B = 2.0 ** draw(st.integers(-20, 20)), draw(st.integers(1, 1023)) * 2.0 ** draw(st.integers(-20, 20))
    C = -B * B / (4.0 * A) * (1.0 + draw(OFFSET))
    return A, B, C, draw(PURE) * B / A, draw(power(-3.0, 3.0)) / B


@st.composite
def turning(draw: st.DrawFn) -> Case:
    """Draw motions against the force that last until the reversal, or multiples of that, or slightly less or more."""
    A, B, C, v0, h = draw(similar())
    C, v0 = -(abs(C) or 1.0 / h), abs(v0) or 1.0
    h = time_to_rest(A, B, C, v0) * draw(st.sampled_from((1.0, 2.0, 2.0**10))) * (1.0 + draw(OFFSET))
    return A, B, C, v0, h


CASES: st.SearchStrategy[Case] = st.one_of(similar(), faint(), WIDE, coinciding(), turning())
BOUNDARIES: list[Case] = [
    (1.0, 2.0, -1.0, 1.0, 1.0),  # D^2 = 0, and reverses at half the time
    (0.0, 0.0, -1.0, 1.0, 2.0),  # no drag, and reverses at half the time
    (0.3, 1.7, 0.0, 0.0, 1.0),
    (0.3, 1.7, 0.0, 2.0, 1e9),
    (0.3, 1.7, -2.0, 0.0, 1.0),
    (SMALLEST, SMALLEST, -SMALLEST, SMALLEST, 1.0),
    (1e15, 1e15, -1e18, 1e18, 1e9),
]


# ---- The step of a vehicle ----


def step_alone(A: float, B: float, C: float, v0: float, h: float) -> tuple[float, float]:
    """Return the velocity and the distance after h seconds by a step in C of a vehicle that has only this axis."""
    rov = VEHICLES["heave only"]
    drag = {"a_d_w": A, "b_d_w": B, "a_d_w_reverse": A, "b_d_w_reverse": B}
    rov = replace(rov, coefficients=dict.fromkeys(rov.coefficients, 1.0) | drag)
    stepper = Stepper(rov, still(rov) | {"Z_ext": C, "w": v0}, ["w", "z"])
    velocity, distance = stepper.step([0.0] * len(rov.layout.commands), h)[-2:]
    return velocity, distance


# ---- Rounding errors ----


def path(A: float, B: float, C: float, v0: float, h: float) -> float:
    """Return the length of the path, on which the motion may reverse."""
    return float(reference.axis(A, B, C, v0, h).path)


def rounding_of_velocity(*velocities: float) -> float:
    """Return the error that test_alone.py allows for a velocity. The largest is the first or the last one."""
    return VELOCITY * max(map(abs, velocities)) + TINY


def rounding_of_distance(case: Case) -> float:
    """Return the error that test_alone.py allows for a distance. A subnormal velocity always has the error TINY."""
    return DISTANCE * path(*case) + TINY * max(1.0, case[4])
