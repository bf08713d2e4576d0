"""Vehicles with roll or pitch, and any coefficients between axes, move as rigid_body.py says."""

import random
from itertools import combinations
from math import pi

import numpy as np
import pytest
from numpy.typing import ArrayLike

from rov_fmu.c.simulation import Array, simulate
from rov_fmu.equation.attitude import QUATERNION
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.often import spread
from tests.vehicles import (
    SIX,
    Values,
    at_rest,
    random_body,
    random_inputs,
    random_state,
    still,
    with_axes,
)
from verification.references import rigid_vehicle
from verification.references.rigid_vehicle import compared, places

HEAVY = load_vehicle(SHIPPED["bluerov2_heavy"])
SUBSETS = ["".join(axes) for n in range(1, 7) for axes in combinations("uvwpqr", n) if {"p", "q"} & {*axes}]
"""The sets of axes with roll or pitch."""
_OFTEN = ("uvwpqr", "upr")


@pytest.mark.parametrize("axes", spread(SUBSETS, _OFTEN, SUBSETS[::8]))
def test_a_step_is_exact(axes: str) -> None:
    rng = random.Random(axes + "step")
    rov = random_body(rng, axes)
    inputs, state, h = random_inputs(rng, rov), random_state(rng, rov), 10.0 ** rng.uniform(-4.0, -1.3)
    found, exact = (
        compared(rov, y) for y in (places(rov, rov.step(inputs, state, h)), rigid_vehicle.step(rov, inputs, state, h))
    )
    for x, y in zip(found, exact, strict=True):
        assert abs(x - y) <= 1e-13 * (1.0 + abs(y)), (axes, h)


# ---- The same in C ----


def in_c(rov: Vehicle, inputs: Values, state: Values, times: ArrayLike) -> Array:
    """Return the states and the heading at the times; the second axis is time."""
    return simulate(rov, times, {**inputs, **state}, [*rov.layout.state, "psi"], workers=1).values[:, 0]


# ---- The heading ----


def test_the_heading_counts_turns_while_the_nose_is_not_up_or_down() -> None:
    """It is compared with the headings of short steps, which need no count. Roll and pitch swing by up to a radian."""
    inputs = still(SIX) | {"K_ext": 0.3, "M_ext": 1.0, "N_ext": 2.0}
    start = {"phi_0": 0.4, "theta_0": -0.5, "psi_0": 20.0}
    times = np.linspace(0.0, 60.0, 6001)
    phi, theta, psi = simulate(SIX, times, {**inputs, **start}, ["phi", "theta", "psi"]).values[:, 0]
    assert (phi[0], theta[0], psi[0]) == pytest.approx((0.4, -0.5, 20.0), abs=1e-14)
    assert np.abs(theta).max() < 1.5
    assert np.abs(np.diff(psi)).max() < 0.2
    assert psi[-1] - psi[0] > 6.0 * pi
    for step in (50, 500, 6000):
        coarse = simulate(SIX, times[::step], {**inputs, **start}, ["psi"]).values[0, 0]
        assert coarse == pytest.approx(psi[::step], abs=1e-11)
    there = dict(zip(QUATERNION, (1.0, 0.0, 0.0, 0.0), strict=True))
    assert SIX.calculated(inputs, SIX.layout.at_rest | there | {"psi": 12.0})["psi"] == pytest.approx(4.0 * pi)


@pytest.mark.parametrize("rov", [SIX.with_(b_d_v=30.0, b_d_r=0.5), with_axes("pr")], ids=["six", "two"])
def test_a_long_step_of_a_steady_turn_is_many_short_ones(rov: Vehicle) -> None:
    """In C, it ends with a circle in closed form. With weight the vehicle stays nearly level; without, it tumbles."""
    inputs = still(rov) | {"X_ext": 8.0, "K_ext": 0.6, "N_ext": -2.0}
    inputs = {name: inputs[name] for name in rov.layout.inputs}
    settled = in_c(rov, inputs, at_rest(rov), [0.0, 300.0])[:, 1]
    start = {**at_rest(rov), **dict(zip(rov.layout.state, settled.tolist(), strict=False))}
    assert abs(start["r"]) > 0.5
    for end in (100.0, 103.0):  # after an odd and an even number of turns
        once, often = (in_c(rov, inputs, start, np.linspace(0.0, end, n + 1))[:, -1] for n in (1, 1000))
        assert once == pytest.approx(often, rel=1e-11, abs=1e-11), end


def test_a_long_step_of_a_vehicle_that_does_not_turn_goes_straight_on() -> None:
    """The Heavy sinks by its net weight."""
    begin, end = in_c(HEAVY, still(HEAVY), at_rest(HEAVY), [0.0, 300.0, 600.0]).T[1:]
    w, z = (HEAVY.layout.places[name] - HEAVY.layout.places["u"] for name in "wz")
    assert end[z] - begin[z] == pytest.approx(300.0 * begin[w], rel=1e-12)
    assert [*np.delete(end, z)] == pytest.approx([*np.delete(begin, z)], abs=1e-14)
    assert begin[w] > 0.01


def test_psi_and_the_sign_of_the_quaternion_do_not_depend_on_the_steps() -> None:
    """Some vehicles begin beyond a pitch of 90 degrees, and some pitch through the vertical without another motion."""
    rng = random.Random(8)
    starts = [{"theta_0": theta, "psi_0": 0.3, "q": q} for theta in (0.0, 1.6, -1.6, 3.1) for q in (0.0, 4.0, -4.0)]
    for _ in range(100):
        angles = {name: rng.uniform(-3.1, 3.1) for name in ("phi_0", "theta_0", "psi_0")}
        starts.append(angles | {v: rng.gauss(0.0, 4.0) for v in "pqr"})
    values = {n: np.array([[start.get(n, 0.0)] for start in starts]) for n in ("phi_0", "theta_0", "psi_0", *"pqr")}

    def turned(steps: int) -> Array:
        times = np.linspace(0.0, 3.0, steps + 1)
        return simulate(HEAVY, times, values, [*QUATERNION, "psi"], vehicles=len(starts)).values[:, :, -1]

    once = turned(1)
    for steps in (7, 100):
        assert np.abs(turned(steps) - once).max() < 1e-6, steps
