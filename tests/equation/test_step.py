"""Steps in Python and in C in difficult cases: reversals, lags, stiffness, long steps, overflow."""

from math import cos, isfinite, sin

import pytest

from rov_fmu.c.simulation import simulate
from rov_fmu.equation.python import step as module
from rov_fmu.vehicle.vehicle import Vehicle
from tests.equation.steps import in_engine, worst
from tests.often import spread
from tests.vehicles import HEAVY, VEHICLES, VIDEORAY, State, Values, at_rest, still

COUPLED, LAGGING = VEHICLES["coupled without lag, three commands, no heave"], VEHICLES["lag without coupling"]
FREE = VEHICLES["surge without drag"].with_(a_d_r=0.0, b_d_r=0.0)
AHEAD = {"u_1": 0.5, "u_2": 0.6, "u_3": -0.4, "u_4": -0.5}
BACK = {"F_1": -10.0, "F_2": -10.0, "F_3": 10.0, "F_4": 10.0}
"""Forces against the commands ahead."""
M, I_R = FREE["m_rov"], FREE["I_r"]

CASES: dict[str, tuple[Vehicle, Values, Values, tuple[float, ...]]] = {
    "from rest, with a lag": (HEAVY, AHEAD, {}, (1e-6, 1e-3, 0.1, 1.0)),
    "surge and yaw begin to push the vehicle to port": (HEAVY, {"X_ext": 20.0, "N_ext": 2.0}, {}, (1e-2, 0.3, 2.0)),
    "the thrust changes its sign": (HEAVY, AHEAD, {**BACK, "u": -0.3}, (1e-3, 0.1, 0.5)),
    "a load cancels the present thrust": (HEAVY, {"X_ext": 28.284271247461902}, BACK, (1e-5, 1.0)),
    "surge and sway turn the vehicle": (COUPLED, {}, {"u": 1.0, "v": 0.5}, (1e-3, 0.3, 2.0)),
    "a lag of a millisecond": (LAGGING.with_(T_t200=1e-3), {"u_l": 0.3}, {"u": 1.0, "F_l": 1.0}, (1e-3, 0.3)),
    "there and back with a turn there and back": (
        FREE,
        {"X_ext": -M, "N_ext": -I_R},
        {"u": 1.0, "r": 1.0},
        (1.0, 2.0, 3.0),
    ),
    "a fast axis beside slow ones": (
        VIDEORAY.with_(b_d_w=1e4),
        {"u_l": 0.6, "u_r": 0.3, "u_t": 0.5},
        {"w": 0.3},
        (0.1, 1.0),
    ),
    "within the dead band": (HEAVY, {"u_1": 0.05, "u_2": -0.05}, {"u": 0.5, "r": 1.0}, (0.1, 2.0)),
}


def case(rov: Vehicle, inputs: Values, state: Values) -> tuple[Vehicle, State, State]:
    return rov, {**still(rov), **inputs}, {**at_rest(rov), **state}


@pytest.mark.parametrize("name", spread(CASES, [*CASES][::2], CASES))
def test_a_step_in_a_special_case_is_exact(name: str) -> None:
    rov, inputs, state, steps = CASES[name]
    for h in steps:
        assert worst(*case(rov, inputs, state), h) <= 1e-13, h


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
        low, high = (middle, high) if in_engine(rov, inputs, state, middle)["u"] > 0.0 else (low, middle)
    assert high < 2.0
    for h in (low, high, high * (1.0 - 1e-9), high * (1.0 + 1e-9), 2.0 * high):
        assert worst(rov, inputs, state, h) <= 1e-13, h


@pytest.mark.long
def test_a_velocity_that_just_touches_zero_or_nearly_is_exact() -> None:
    """The lagging thrust reverses while the vehicle slows down, so that its velocity has a minimum near zero."""
    rov, inputs, state = case(LAGGING, {"u_l": 0.6, "u_r": 0.6}, {"F_l": -25.0, "F_r": -25.0})

    times = [0.0, *(0.02 * n for n in range(2, 20, 2))]

    def lowest(u: float) -> float:
        return float(simulate(rov, times, {**inputs, **state, "u": u}, ["u"], workers=1).values[0, 0, 1:].min())

    low, high = 0.0, 2.0
    for _ in range(20):
        u = 0.5 * (low + high)
        low, high = (u, high) if lowest(u) < 0.0 else (low, u)
    for depth in (0.0, 1e-12, 1e-6, -1e-9):
        assert worst(rov, inputs, {**state, "u": high - depth}, 0.4) <= 1e-13, depth


# ---- Overflow and long steps ----


def test_a_step_of_more_substeps_than_allowed_is_not_finite(monkeypatch: pytest.MonkeyPatch) -> None:
    rov, inputs, state = case(HEAVY, AHEAD, {})
    for most, finite in ((10_000, True), (100, False)):
        monkeypatch.setattr(module, "MOST_SUBSTEPS", most)
        assert all(map(isfinite, rov.step(inputs, state, 300.0).values())) == finite


def test_a_long_step_ends_in_circular_motion() -> None:
    """From a state that has settled, the motion is a circle, with its radius from the steady velocities."""
    h = 100.0
    inputs = still(VIDEORAY) | {"u_l": 0.6, "u_r": 0.3, "u_t": 0.5, "V_N": 0.1}
    a = VIDEORAY.step(inputs, at_rest(VIDEORAY), 90.0)
    b = VIDEORAY.step(inputs, at_rest(VIDEORAY), 90.0 + h)
    u, r = a["u"], a["r"]
    assert [b[v] for v in "uwr"] == pytest.approx([a[v] for v in "uwr"], rel=1e-14)
    assert b["psi"] == pytest.approx(a["psi"] + r * h, rel=1e-13)
    assert b["z"] == pytest.approx(a["z"] + a["w"] * h, rel=1e-13)
    turned = 2e-13 * r * h  # the angle is known to rounding of the number of radians
    assert b["x"] - a["x"] == pytest.approx(0.1 * h + u / r * (sin(b["psi"]) - sin(a["psi"])), rel=1e-13, abs=turned)
    assert b["y"] - a["y"] == pytest.approx(-u / r * (cos(b["psi"]) - cos(a["psi"])), abs=turned)
