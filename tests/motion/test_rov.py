"""The ROV's mathematics in models.dynamics: thrust, signs, and how turning motions are cut into pieces."""

import random
from dataclasses import asdict, astuple, replace
from math import copysign, cos, isfinite, pi, sin, ulp

import pytest
from mpmath import mp

from rov_fmu.motion import path
from rov_fmu.motion.path import turning_step
from rov_fmu.motion.riccati import Riccati
from rov_fmu.motion.rov import Coefficients, Inputs, State, derivatives, step, thrust, thruster_force
from rov_fmu.vehicle.vehicle import Vehicle

COMMANDS = [-1.0, -0.7, -0.2, 0.0, 0.1, 0.27, 0.5, 1.0]


@pytest.fixture(scope="module")
def k(vehicle: Vehicle) -> Coefficients:
    return vehicle.coefficients


# ---- Thrust ----


@pytest.mark.parametrize("c", COMMANDS)
def test_thrust_is_that_of_2_9_and_10(k: Coefficients, c: float) -> None:
    assert thruster_force(3.0, -2.0, c) == pytest.approx(3.0 * abs(c) * c - 2.0 * c, rel=1e-15)
    F = thrust(k, Inputs(u_l=c, u_r=c, u_t=c))
    assert pytest.approx(42.9 * abs(c) * c + 2.711 * c, rel=1e-15) == F.F_l + F.F_r
    assert pytest.approx(6.494 * abs(c) * c + 0.0513 * c, rel=1e-15) == F.F_t
    assert F.F_l == F.F_r
    assert F.tau_rear == 0.0


@pytest.mark.parametrize("c", COMMANDS)
def test_the_unweighted_rear_thrust_is_that_of_8_negative_below_27_percent(vehicle: Vehicle, c: float) -> None:
    unweighted = replace(vehicle.coefficients, **vehicle.alternatives["unweighted_rear_thrust"].values)
    F = thrust(unweighted, Inputs(u_l=c, u_r=c))
    assert pytest.approx(100.3 * abs(c) * c - 27.09 * c, rel=1e-14) == F.F_l + F.F_r
    assert (F.F_l * c < 0.0) == (0.0 < abs(c) <= 0.27)


def test_each_rear_thruster_has_half_the_pair_and_the_torque_of_4(k: Coefficients) -> None:
    F = thrust(k, Inputs(u_l=0.6, u_r=-0.3))
    assert pytest.approx((42.9 * 0.36 + 2.711 * 0.6) / 2.0, rel=1e-15) == F.F_l
    assert pytest.approx(-(42.9 * 0.09 + 2.711 * 0.3) / 2.0, rel=1e-15) == F.F_r
    assert pytest.approx(0.22 * sin(0.423) * F.F_l + 0.22 * sin(-0.423) * F.F_r, rel=1e-15) == F.tau_rear


@pytest.mark.parametrize("beyond", [1.0 + 1e-15, 1.5, 1e300])
def test_commands_beyond_full_thrust_saturate(k: Coefficients, beyond: float) -> None:
    full = Inputs(u_l=1.0, u_r=-1.0, u_t=1.0)
    assert thrust(k, Inputs(u_l=beyond, u_r=-beyond, u_t=beyond)) == thrust(k, full)
    assert step(k, Inputs(beyond, -beyond, beyond), State(), 1.0) == step(k, full, State(), 1.0)


# ---- Signs ----


@pytest.mark.parametrize(
    ("inputs", "signs"),
    [
        (Inputs(u_l=0.3, u_r=0.3), {"u": 1, "x": 1}),
        (Inputs(u_l=-0.3, u_r=-0.3), {"u": -1, "x": -1}),
        (Inputs(u_l=0.3, u_r=-0.3), {"r": 1, "psi": 1}),
        (Inputs(u_l=-0.3, u_r=0.3), {"r": -1, "psi": -1}),
        (Inputs(u_l=0.5, u_r=0.3), {"u": 1, "x": 1, "y": 1, "r": 1, "psi": 1}),  # ahead, and to starboard of it
        (Inputs(u_t=0.3), {"w": 1, "z": 1}),
        (Inputs(u_t=-0.3), {"w": -1, "z": -1}),
        (Inputs(X_ext=1.0), {"u": 1, "x": 1}),
        (Inputs(Z_ext=1.0), {"w": 1, "z": 1}),
        (Inputs(N_ext=0.1), {"r": 1, "psi": 1}),
        (Inputs(V_N=1.0), {"x": 1}),
        (Inputs(V_E=1.0), {"y": 1}),
    ],
)
def test_the_signs_are_those_of_the_body_and_earth_frames(
    k: Coefficients, inputs: Inputs, signs: dict[str, int]
) -> None:
    after = asdict(step(k, inputs, State(), 0.5))
    assert {name: copysign(1, value) for name, value in after.items() if value != 0.0} == signs


def test_north_is_ahead_at_heading_zero_and_east_at_a_quarter_turn(k: Coefficients) -> None:
    ahead = Inputs(u_l=0.5, u_r=0.5)
    distance = step(k, ahead, State(), 2.0).x
    for psi in (0.0, 0.5 * pi, pi, -0.5 * pi, 2.0):
        after = step(k, ahead, State(psi=psi), 2.0)
        assert (after.x, after.y) == pytest.approx((distance * cos(psi), distance * sin(psi)), rel=1e-15, abs=1e-15)
        assert after.psi == psi


def test_a_current_displaces_and_does_nothing_else(k: Coefficients) -> None:
    still = Inputs(u_l=0.5, u_r=0.2, u_t=-0.4)
    before = State(u=0.3, w=0.1, r=-1.0, psi=0.7)
    a, b = (step(k, inputs, before, 3.0) for inputs in (still, replace(still, V_N=0.5, V_E=-0.25)))
    assert replace(b, x=a.x, y=a.y) == a
    assert (b.x - a.x, b.y - a.y) == pytest.approx((1.5, -0.75), rel=1e-14)


# ---- Rates and steps ----


def random_inputs(rng: random.Random) -> Inputs:
    return Inputs(*(rng.uniform(-1.2, 1.2) for _ in range(8)))


def random_state(rng: random.Random) -> State:
    return State(*(rng.uniform(-2.0, 2.0) for _ in range(7)))


def test_derivatives_are_the_rates_at_which_a_step_begins(k: Coefficients) -> None:
    rng = random.Random(4)
    for _ in range(50):
        inputs, before = random_inputs(rng), random_state(rng)

        def rates(h: float, inputs: Inputs = inputs, before: State = before) -> list[float]:
            after = step(k, inputs, before, h)
            return [(b - a) / h for a, b in zip(astuple(before), astuple(after), strict=True)]

        # the error of the first order in h cancels; yaw bends at 10/s, its third derivative is some 1e3
        found = [2.0 * b - a for a, b in zip(rates(1e-5), rates(0.5e-5), strict=True)]
        assert found == pytest.approx(astuple(derivatives(k, inputs, before)), rel=1e-7, abs=1e-7)


# ---- The pieces of a turning step ----


@pytest.mark.parametrize(("rule", "order"), [(path._GAUSS_4, 4), (path._GAUSS_8, 8)])
def test_the_quadrature_rules_are_gauss_legendre_to_the_last_digit(
    rule: tuple[tuple[float, float], ...], order: int
) -> None:
    with mp.workdps(50):
        for node, weight in rule:
            exact = mp.findroot(lambda x: mp.legendre(order, x), node)
            slope = mp.diff(lambda x: mp.legendre(order, x), exact)
            assert abs(node - exact) <= 0.51 * ulp(node)
            assert abs(weight - 2 / ((1 - exact**2) * slope**2)) <= 0.51 * ulp(weight)
    assert len({node for node, _ in rule}) == order // 2


@pytest.fixture
def pieces(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Lengths of the pieces that turns are cut into, except for straight ones."""
    lengths: list[float] = []
    longest_piece = path._longest_piece

    def noted(surge: Riccati, yaw: Riccati, u: float, r: float, rest: float) -> tuple[float, tuple[float, float]]:
        length, piece = longest_piece(surge, yaw, u, r, rest)
        lengths.append(length)
        return length, piece

    monkeypatch.setattr(path, "_longest_piece", noted)
    return lengths


def wild_axis(rng: random.Random, widest: float) -> Riccati:
    A, B = (rng.choice([0.0, *[10.0 ** rng.uniform(-widest, 3)] * 5]) for _ in range(2))
    return Riccati(A, B, rng.choice([-1.0, 1.0, 0.0]) * 10.0 ** rng.uniform(-widest, widest))


@pytest.mark.parametrize(
    ("widest", "cases"), [(4, 500), (12, 300), *(pytest.param(n, 2000, marks=pytest.mark.long) for n in (5, 13, 30))]
)
def test_no_turn_needs_more_than_some_thousand_pieces(widest: float, cases: int, pieces: list[float]) -> None:
    """Turns of up to 1e60 rad at 1e30 rad/s; most pieces where drag takes a hundredth of the turn rate in a radian."""
    rng = random.Random(widest)
    for _ in range(cases):
        surge, yaw = wild_axis(rng, widest), wild_axis(rng, widest)
        u, r = (rng.choice([-1.0, 0.0, 1.0]) * 10.0 ** rng.uniform(-2, widest) for _ in range(2))
        h = 10.0 ** rng.uniform(-5, widest)
        pieces.clear()
        motion = turning_step(surge, yaw, u, r, h)
        assert all(map(isfinite, motion)), (surge, yaw, u, r, h)
        assert len(pieces) < 20_000, (surge, yaw, u, r, h)


def test_a_turn_is_as_exact_as_the_straight_run_it_grows_from() -> None:
    """The same path a hair off straight: no jump between the formulas for the two."""
    surge = Riccati(0.5, 1.4, 2.0)
    straight = surge.distance(0.3, 2.0)
    for r in (1e-300, 1e-18, 1e-16, 1e-14):
        ahead, aside = turning_step(surge, Riccati(0.1, 1.0, 0.0), 0.3, r, 2.0)[:2]
        assert ahead == pytest.approx(straight, rel=1e-15)
        assert abs(aside) <= r * straight
