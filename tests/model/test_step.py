"""Steps in cases that are difficult for Taylor series: reversals, lags, stiffness, overflow."""

import random
from collections.abc import Mapping
from itertools import product
from math import exp, isfinite, pi
from time import process_time

import pytest

from rov_fmu.model import step as module
from rov_fmu.model.equation import ONE, Directed, Equation, Term
from rov_fmu.model.expression import Name, of
from rov_fmu.model.step import ORDER, Table, usable_time
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.model.steps import in_python, worst
from tests.vehicles import HEAVY, VEHICLES, VIDEORAY, State, Values, at_rest, random_case, still

COUPLED, LAGGING = VEHICLES["coupled without lag, three commands, no heave"], VEHICLES["lag without coupling"]
FREE = VEHICLES["surge without drag"].replaced({"a_d_r": 0.0, "b_d_r": 0.0})
AHEAD = {"u_1": 0.5, "u_2": 0.6, "u_3": -0.4, "u_4": -0.5}
BACK = {"F_1": -10.0, "F_2": -10.0, "F_3": 10.0, "F_4": 10.0}
"""Forces against the commands ahead."""
M, I_R = FREE["m_rov"], FREE["I_r"]

CASES: dict[str, tuple[Vehicle, Values, Values, tuple[float, ...]]] = {
    "from rest, with a lag": (HEAVY, AHEAD, {}, (1e-6, 1e-3, 0.1, 1.0)),
    "from rest, by one lagging thruster, which turns and sways": (HEAVY, {"u_1": 0.5}, {}, (1e-5, 1e-2, 1.0)),
    "from rest, coupled": (COUPLED, {"Y_ext": 3.0, "N_ext": 0.1}, {}, (1e-5, 1e-2, 1.0)),
    "the thrust changes its sign": (HEAVY, AHEAD, {**BACK, "u": -0.3}, (1e-3, 0.1, 0.5)),
    "a load cancels the present thrust": (HEAVY, {"X_ext": 28.284271247461902}, BACK, (1e-5, 1.0)),
    "surge and sway turn the vehicle": (COUPLED, {}, {"u": 1.0, "v": 0.5}, (1e-3, 0.3, 2.0)),
    "sway alone": (COUPLED, {}, {"v": 0.5}, (0.1, 2.0)),
    "coasting": (HEAVY, {}, {"u": 1.0, "v": 0.1, "r": 0.3}, (0.1, 1.0)),
    "a spin": (COUPLED, {}, {"u": 1.0, "r": 100.0}, (0.01, 0.05)),
    "a lag of a minute": (LAGGING.replaced({"T_t200": 60.0}), {"u_l": 0.3}, {"u": 1.0, "r": 0.3, "F_l": 1.0}, (1.0,)),
    "a lag of a millisecond": (LAGGING.replaced({"T_t200": 1e-3}), {"u_l": 0.3}, {"u": 1.0, "F_l": 1.0}, (1e-3, 0.3)),
    "there and back with a turn there and back": (
        FREE,
        {"X_ext": -M, "N_ext": -I_R},
        {"u": 1.0, "r": 1.0},
        (1.0, 2.0, 3.0),
    ),
    "there and back in a steady turn": (FREE, {"X_ext": -M}, {"u": 1.0, "r": 1.0}, (1.0, 2.0, 3.0, 100.0)),
    "a fast axis beside slow ones": (
        VIDEORAY.replaced({"b_d_w": 1e4}),
        {"u_l": 0.6, "u_r": 0.3, "u_t": 0.5},
        {"w": 0.3},
        (0.1, 100.0),
    ),
    "a fast axis that nothing drives": (VIDEORAY.replaced({"b_d_w": 1e6}), {"u_l": 0.6}, {"w": 0.3}, (1000.0,)),
    "almost no drag": (
        VIDEORAY.replaced({f"{key}_d_{v}": 1e-6 for key in "ab" for v in "uwr"}),
        {},
        {"u": 1.0, "r": 0.5},
        (1.0, 100.0),
    ),
    "within the dead band": (HEAVY, {"u_1": 0.05, "u_2": -0.05}, {"u": 0.5, "r": 1.0}, (0.1, 2.0)),
}


def case(rov: Vehicle, inputs: Values, state: Values) -> tuple[Vehicle, State, State]:
    return rov, {**still(rov), **inputs}, {**at_rest(rov), **state}


def reversed_drag(rov: Vehicle, share: float) -> Vehicle:
    """Return a vehicle whose drag in reverse is a share of that ahead."""
    names = [f"{key}_{form.axis.velocity}" for form in rov.layout.axes for key in ("a_d", "b_d")]
    return rov.extended({f"{name}_reverse": share * rov[name] for name in names})


@pytest.mark.parametrize("name", CASES)
def test_a_step_in_a_special_case_is_exact(name: str) -> None:
    rov, inputs, state, steps = CASES[name]
    for h in steps:
        velocity, path = worst(in_python, *case(rov, inputs, state), h)
        assert velocity <= 1e-14, h
        assert path <= 1e-13, h


@pytest.mark.parametrize(
    ("names", "shares", "cases"),
    [
        (["bluerov2_heavy"], (0.01, 30.0), 1),
        pytest.param(sorted(SHIPPED), (0.01, 1.0 / 30.0, 30.0, 100.0), 2, marks=pytest.mark.long),
        pytest.param(sorted(SHIPPED), (0.01, 1.0 / 30.0, 30.0, 100.0), 40, marks=pytest.mark.weekly),
    ],
    ids=["the Heavy", "every vehicle", "every vehicle, often"],
)
def test_a_step_is_exact_whatever_the_drag_in_reverse(names: list[str], shares: tuple[float, ...], cases: int) -> None:
    """One step begins at rest, another one in motion."""
    for name, share in product(names, shares):
        rov = reversed_drag(HEAVY if name == "bluerov2_heavy" else load_vehicle(SHIPPED[name]), share)
        rng = random.Random(f"{name} {share} {cases}")
        for _ in range(cases):
            _, inputs, state, h = random_case(rng, rov, -2.0, 0.7)
            for start in (state, at_rest(rov)):
                velocity, path = worst(in_python, rov, inputs, start, h)
                assert max(velocity, path) <= 1e-13, (name, share, inputs, start, h)


# ---- Other tables ----


def table_of(rows: Mapping[str, tuple[Term, ...]], **directed: Directed) -> Table:
    """Return a table with these rows and without formulas. All its states are states of the vehicle."""
    return Table(Equation({}, directed, {}, {}, rows, {name: Name(name) for name in rows}, lags={}))


def test_a_series_of_which_two_coefficients_in_three_are_zero_is_not_used_too_far() -> None:
    """With t' = 1, q' = 2 t and y' = q y, the solution is y = exp(t^3/3)."""
    table = table_of({"t": (Term(ONE),), "q": (Term(of(2.0), ("t",)),), "y": (Term(ONE, ("q", "y")),)})
    for h in (0.5, 1.0, 2.0, 3.0):
        found = module.step(table, {"t": 0.0, "q": 0.0, "y": 1.0}, h)
        assert found == pytest.approx({"t": h, "q": h * h, "y": exp(h**3 / 3.0)}, rel=2e-14)


def test_a_pendulum_with_a_stop_that_pushes_back_harder_reverses_at_the_exact_time() -> None:
    """With v' = -x and x' = k v, where k depends on the direction, the motion consists of half ellipses."""
    table = table_of(
        {"x": (Term(Name("k"), ("v",)),), "v": (Term(-ONE, ("x",)),)},
        k=Directed("v", of(4.0), ONE),
    )
    found = module.step(table, {"x": 1.0, "v": 0.0}, 0.5 * pi)  # v < 0: x = cos t
    assert found == pytest.approx({"x": 0.0, "v": -1.0}, abs=1e-15)
    found = module.step(table, {"x": 1.0, "v": 0.0}, pi + 0.25 * pi)  # from t = pi on v > 0: x = -cos 2 (t - pi)
    assert found == pytest.approx({"x": 0.0, "v": 0.5}, abs=1e-15)
    found = module.step(table, {"x": 1.0, "v": 0.0}, 101 * 1.5 * pi)
    assert found == pytest.approx({"x": 1.0, "v": 0.0}, abs=1e-13)


# ---- Reversals ----


@pytest.mark.parametrize(
    "rov",
    [HEAVY, *(pytest.param(rov, marks=pytest.mark.long) for rov in (LAGGING, COUPLED))],
    ids=["Heavy", "lag", "coupled"],
)
def test_a_step_that_ends_at_a_reversal_or_near_it_is_exact(rov: Vehicle) -> None:
    """The time at which surge reverses is found by bisection."""
    rov, inputs, state = case(rov, {"X_ext": -20.0}, {"u": 0.4, "r": 0.5})
    low, high = 0.0, 2.0
    for _ in range(54):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if rov.step(inputs, state, middle)["u"] > 0.0 else (low, middle)
    assert high < 2.0
    for h in (low, high, high * (1.0 - 1e-9), high * (1.0 + 1e-9), 2.0 * high):
        velocity, path = worst(in_python, rov, inputs, state, h)
        assert max(velocity, path) <= 1e-14, h


def test_a_velocity_that_just_touches_zero_or_nearly_is_exact() -> None:
    """The lagging thrust reverses while the vehicle slows down, so that its velocity has a minimum near zero."""
    rov, inputs, state = case(LAGGING, {"u_l": 0.6, "u_r": 0.6}, {"F_l": -25.0, "F_r": -25.0})

    def lowest(u: float) -> float:
        return min(rov.step(inputs, {**state, "u": u}, 0.02 * n)["u"] for n in range(2, 20, 2))

    low, high = 0.0, 2.0
    for _ in range(20):
        u = 0.5 * (low + high)
        low, high = (u, high) if lowest(u) < 0.0 else (low, u)
    for depth in (0.0, 1e-12, 1e-6, -1e-9):
        velocity, path = worst(in_python, rov, inputs, {**state, "u": high - depth}, 0.4)
        assert max(velocity, path) <= 1e-14, depth


# ---- Overflow and very long steps ----


@pytest.mark.parametrize(
    ("rov", "inputs", "state", "h"),
    [
        (HEAVY, {}, {"u": 1e200, "v": 1e200, "r": 1e200}, 1.0),
        (FREE, {}, {"u": 1.0, "r": 1e300}, 1e10),
        (FREE, {"X_ext": 1e308}, {"r": 1.0}, 1e308),
        (COUPLED, {"X_ext": 1e308, "Y_ext": -1e308}, {"r": 1e300}, 1e300),
    ],
    ids=["velocities", "turn", "distance", "all"],
)
def test_a_step_that_overflows_is_not_finite_and_takes_no_time(
    rov: Vehicle, inputs: Values, state: Values, h: float
) -> None:
    start = process_time()
    assert not all(map(isfinite, in_python(*case(rov, inputs, state), h).values()))
    assert process_time() - start < 2.0


def test_a_step_of_too_many_pieces_is_not_finite(monkeypatch: pytest.MonkeyPatch) -> None:
    rov, inputs, state = case(COUPLED, {}, {"u": 1.0, "v": 0.2, "r": 3.0})
    assert all(map(isfinite, rov.step(inputs, state, 5.0).values()))
    monkeypatch.setattr(module, "MOST_PIECES", 3)
    assert not all(map(isfinite, rov.step(inputs, state, 5.0).values()))


@pytest.mark.parametrize("h", [1e3, 1e6, 1e30])
def test_once_all_has_settled_a_step_of_any_length_takes_no_longer(h: float) -> None:
    rov, inputs, state = case(HEAVY, AHEAD, {})
    start = process_time()
    found = rov.step(inputs, state, h)
    assert process_time() - start < 1.0
    assert all(map(isfinite, found.values()))


# ---- Numbers of a series ----

SHARE = 2.0 ** (-57 / 21)
"""The part of its radius of convergence up to which a series of order 20 is used."""


@pytest.mark.parametrize(
    ("c", "expected"),
    [
        ([1.0] * 21, SHARE),
        ([3.0 * 4.0**n for n in range(21)], SHARE / 4.0),
        ([0.0] * 5 + [1.0] * 16, SHARE),
        ([float(n % 2 == 0) for n in range(21)], SHARE),
        ([1.0, 100.0, *[1.0] * 19], SHARE * 100.0 ** (1 / 19)),
        ([1.0, 1.0, 100.0, *[1.0] * 18], SHARE * 100.0 ** (1 / 18)),
        ([1.0, 1.0, 1.0, 100.0, *[1.0] * 17], SHARE),
        ([1.0] * 20 + [1e6], SHARE * 1e-6 ** (1 / 20)),
        ([1.0] * 18 + [1e6, 1.0, 1.0], SHARE * 1e-6 ** (1 / 18)),
        ([1.0] * 17 + [1e6, 1.0, 1.0, 1.0], SHARE),
        ([0.0] * 19 + [1.0, 4.0], SHARE / 4.0),
        ([0.0] * 20 + [1.0], float("inf")),
        ([5.0] + [0.0] * 20, float("inf")),
        ([0.0] * 21, float("inf")),
    ],
)
def test_a_series_is_used_up_to_a_share_of_where_its_last_terms_equal_its_first(
    c: list[float], expected: float
) -> None:
    assert len(c) == ORDER + 1
    assert usable_time(c) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("c", "length", "expected"),
    [
        ([1.0, 0.5, 0.0], 1.0, (1.0, False)),
        ([1.0, -1.0, 0.0], 1.0, (1.0, False)),  # the largest coefficient still bounds it
        ([1.0, -2.0, 0.0], 1.0, (0.5, True)),
        ([-1.0, 2.0, 0.0], 1.0, (0.5, True)),
        ([1.0, -4.0, 0.25], 1.0, (8.0 - 60.0**0.5, True)),
        ([1.0, 2.0, 0.1], 1.0, (1.0, False)),
        ([1.0, -2.0, 1.0], 2.0, (0.25, False)),  # it touches 0 at 1, so only a part is certain
        ([0.0, 1.0, -2.0], 1.0, (0.5, False)),
        ([0.0, 0.0, 0.0], 3.0, (3.0, False)),
    ],
)
def test_a_velocity_keeps_its_sign_up_to_its_root_or_as_long_as_is_certain(
    c: list[float], length: float, expected: tuple[float, bool]
) -> None:
    end, is_zero = module._sign_kept(c, length)
    assert end == pytest.approx(expected[0], rel=1e-14)
    assert is_zero == expected[1]


def test_a_series_changes_by_its_terms_without_the_first() -> None:
    assert module._change([7.0, 2.0, 3.0, -1.0], 2.0) == 2.0 * 2.0 + 3.0 * 4.0 - 8.0
    assert module._root([-1.0, 1.0, 0.1]) == pytest.approx(5.0 * (1.4**0.5 - 1.0), rel=1e-15)
