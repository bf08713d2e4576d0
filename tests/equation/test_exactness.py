"""Steps in Python and in C are exact: compared with 50 digits, SciPy's integration of the equations, and themselves."""

import random
from collections.abc import Iterable
from itertools import islice, product
from math import cos, sin
from typing import Any

import pytest
from scipy.integrate import solve_ivp

from rov_fmu.equation.alone import AxisAlone as Axis
from rov_fmu.vehicle.vehicle import Vehicle
from tests.equation.steps import Step, errors, in_python
from tests.often import often
from tests.vehicles import (
    VEHICLES,
    VIDEORAY,
    Case,
    State,
    Values,
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
    ("number", "longest"), [(3, 0.3), pytest.param(4, 1.0, marks=LONG), pytest.param(15, 2.0, marks=WEEKLY)]
)
@pytest.mark.parametrize("vehicle", VEHICLES)
def test_a_step_is_exact_for_vehicles_of_every_kind(vehicle: str, number: int, longest: float) -> None:
    rng = random.Random(vehicle)
    hold([in_python], [random_case(rng, VEHICLES[vehicle], longest=longest) for _ in range(number)])


@pytest.mark.parametrize(
    ("number", "longest"), [(10, 0.0), pytest.param(30, 1.0, marks=LONG), pytest.param(300, 1.0, marks=WEEKLY)]
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


@often("stride", 13, 1)
def test_a_reversal_while_spinning_is_exact(steps: list[Step], stride: int) -> None:
    for after, (surge, yaw, u, r) in islice(product((1.0, 1.3, 0.9, 2.5), REVERSALS), 0, None, stride):
        rest = reference.time_to_rest(surge.A, surge.B, -abs(surge.C), abs(u))
        hold(steps, [of_axes(surge, yaw, u, r, after * rest)], 3e-14, 3e-13)  # of many pieces


# ---- The VideoRay, against an integration of the equations as the paper prints them ----

AHEAD = {"u_l": 0.5, "u_r": 0.5}
MANOEUVRES: dict[str, tuple[Values, Values]] = {
    "ahead": (AHEAD, {}),
    "astern": ({"u_l": -0.7, "u_r": -0.7}, {}),
    "turning": ({"u_l": 0.6, "u_r": 0.3}, {"psi": 1.0}),
    "against loads": (
        {"u_l": 0.4, "u_r": 0.2, "u_t": -0.3, "X_ext": -3.0, "Z_ext": 1.5, "N_ext": 0.1},
        {"u": 0.5, "w": 0.2, "r": -1.0},
    ),
    "in a current": ({**AHEAD, "u_r": 0.45, "V_N": 0.3, "V_E": -0.8}, {"x": 10.0, "y": -20.0, "psi": -2.0}),
    "coasting": ({}, {"u": 1.5, "w": -0.4, "r": 3.0}),
}


def manoeuvre(name: str) -> tuple[State, State]:
    inputs, state = MANOEUVRES[name]
    return {**still(VIDEORAY), **inputs}, {**at_rest(VIDEORAY), **state}


def integrated(k: Values, i: Values, before: Values, h: float) -> State:
    """Return the states after h seconds: (18), (2), (4) and the kinematics, integrated by DOP853."""
    F_l, F_r = ((k["a_t_rear"] * abs(c) * c + k["b_t_rear"] * c) / 2.0 for c in (i["u_l"], i["u_r"]))  # half of (9)
    F_t = k["a_t_top"] * abs(i["u_t"]) * i["u_t"] + k["b_t_top"] * i["u_t"]
    torque = F_l * k["R"] * sin(k["gamma"]) + F_r * k["R"] * sin(-k["gamma"])
    X, Z, N = (
        k["alpha_u"] * (F_r + F_l) + i["X_ext"],
        k["alpha_w"] * F_t + i["Z_ext"],
        k["alpha_r"] * torque + i["N_ext"],
    )

    def rates(_t: float, state: Any) -> list[float]:
        u, w, r, _x, _y, _z, psi = state
        return [
            k["beta_u"] * (X - (k["a_d_u"] * u * abs(u) + k["b_d_u"] * u)) / k["m_rov"],
            k["beta_w"] * (Z - (k["a_d_w"] * w * abs(w) + k["b_d_w"] * w)) / k["m_rov"],
            k["beta_r"] * (N - (k["a_d_r"] * r * abs(r) + k["b_d_r"] * r)) / k["I_r"],
            u * cos(psi) + i["V_N"],
            u * sin(psi) + i["V_E"],
            w,
            r,
        ]

    solution = solve_ivp(rates, (0.0, h), list(before.values()), method="DOP853", rtol=1e-12, atol=1e-12)
    return dict(zip(before, solution.y[:, -1], strict=True))


@pytest.mark.parametrize("h", [1.0, *(pytest.param(h, marks=LONG) for h in (0.1, 20.0))])
def test_a_step_solves_the_equations_of_the_paper(steps: list[Step], h: float) -> None:
    for name in MANOEUVRES:
        inputs, before = manoeuvre(name)
        expected = integrated(VIDEORAY.coefficients, inputs, before, h)
        for step in steps:
            assert step(VIDEORAY, inputs, before, h) == pytest.approx(expected, rel=1e-10, abs=1e-10)
