"""Steps in Python and in C are exact: compared with 50 digits."""

import random
from collections.abc import Iterable
from itertools import islice, product

import pytest

from rov_fmu.equation.alone import AxisAlone as Axis
from rov_fmu.vehicle.vehicle import Vehicle
from tests.equation.steps import Step, errors, in_python
from tests.often import often
from tests.vehicles import (
    VEHICLES,
    VIDEORAY,
    Case,
    at_rest,
    random_case,
    random_vehicle,
    still,
)
from verification.references import reference

VELOCITY, PATH = 2e-14, 1e-13
"""The allowed errors, relative to the largest velocity and to the length of the path."""
LONG, WEEKLY = pytest.mark.long, pytest.mark.weekly


def hold(steps: Iterable[Step], cases: Iterable[Case], velocity: float = VELOCITY, path: float = PATH) -> None:
    """Compare steps with 50 digits."""
    for case in cases:
        exact = reference.step(*case)
        for step in steps:
            found = errors(step(*case), exact.state, exact.scale, case[2])
            assert found[0] <= velocity, (step, found, case)
            assert found[1] <= path, (step, found, case)


# ---- Every vehicle, random states, steps of 1 us ... 1,000 s ----


@pytest.mark.parametrize(
    ("number", "longest"), [(1, 0.3), pytest.param(2, 1.0, marks=LONG), pytest.param(15, 2.0, marks=WEEKLY)]
)
@pytest.mark.parametrize("vehicle", VEHICLES)
def test_a_step_is_exact_for_vehicles_of_every_kind(vehicle: str, number: int, longest: float) -> None:
    rng = random.Random(vehicle)
    hold([in_python], [random_case(rng, VEHICLES[vehicle], longest=longest) for _ in range(number)])


@pytest.mark.parametrize(
    ("number", "longest"), [(5, 0.0), pytest.param(6, 1.0, marks=LONG), pytest.param(300, 1.0, marks=WEEKLY)]
)
def test_a_step_is_exact_for_random_vehicles(number: int, longest: float) -> None:
    """The tolerance is larger because some forces nearly cancel, such as two opposite thrusters, or load and thrust."""
    rng = random.Random(1)
    hold([in_python], [random_case(rng, random_vehicle(rng), longest=longest) for _ in range(number)], 1e-12, 1e-12)


# ---- Reversals and spins ----

REVERSALS = [
    *((Axis(1.0, 0.0, 0.01), Axis(0.0, 1.0, r), -0.01, r) for r in (20.0, 50.0, 70.0, 100.0, 150.0, 300.0)),
    (Axis(0.144, 1e-4, 0.39), Axis(0.104, 0.0, -9173.0), -2.16, -0.87),
    (Axis(0.122, 0.15, 0.11), Axis(0.085, 0.074, 7886.0), -1.07, 80.9),
    (Axis(1.35, 0.3, 0.11), Axis(0.0079, 0.9, 2407.0), -5.84, 10.7),
    (Axis(4.16, 0.09, 0.425), Axis(8.7e-4, 1.3, 9785.0), -1.11, 6.9),
]
"""Axes of surge and yaw, u and r. Surge reverses while the vehicle spins; its third derivative jumps there."""


def of_axes(surge: Axis, yaw: Axis, u: float, r: float, h: float) -> Case:
    """Return a step of a vehicle of the paper that has these axes and is driven by loads alone."""
    ones = dict.fromkeys(VIDEORAY.coefficients, 1.0)
    rov = Vehicle(VIDEORAY.layout, {**ones, "a_d_u": surge.A, "b_d_u": surge.B, "a_d_r": yaw.A, "b_d_r": yaw.B})
    return rov, {**still(rov), "X_ext": surge.C, "N_ext": yaw.C}, {**at_rest(rov), "u": u, "r": r}, h


@often("stride", 29, 7, 1)
def test_a_reversal_while_spinning_is_exact(steps: list[Step], stride: int) -> None:
    for after, (surge, yaw, u, r) in islice(product((1.0, 1.3, 0.9, 2.5), REVERSALS), 0, None, stride):
        rest = reference.time_to_rest(surge.A, surge.B, -abs(surge.C), abs(u))
        hold(steps, [of_axes(surge, yaw, u, r, after * rest)], 3e-14, 3e-13)  # of many pieces
