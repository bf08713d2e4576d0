"""Fits of drag and β to points: the choice of the form, different vehicles, drag by direction, a constant load."""

from dataclasses import replace
from math import atanh, copysign, exp, inf, sqrt

import numpy as np
import pytest

from rov_fmu.identify.diagnostics import on_turning
from rov_fmu.identify.findings import sentences
from rov_fmu.identify.identification import AxisResult
from rov_fmu.identify.least_squares import Estimate
from rov_fmu.identify.points.choice import MARGIN
from rov_fmu.identify.points.drag_forms import LEFT_OUT, Point
from rov_fmu.identify.points.response_fit import ResponseFit, fit_response, response_band
from rov_fmu.model.layout import HEAVE, SWAY, YAW, Curve, Layout, Thruster, VehicleAxis
from rov_fmu.model.rov import Rov
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle

BOTH_WAYS = (0.2, 0.35, 0.5, 0.7, -0.2, -0.35, -0.5, -0.7)
RISE = 1.0 - exp(-1.0)


def points_of(
    drag: tuple[float, float],
    reverse: tuple[float, float],
    scatter: float = 0.0,
    seed: int = 0,
    commands: tuple[float, ...] = BOTH_WAYS,
    mass: float = 10.0,
    beta: float = 0.8,
    load: float = 0.0,
) -> list[Point]:
    """Return V_ss and Tau of 10 kg under a thrust of 20 c^2 + 5 c N and a load, with relative errors."""
    random, found = np.random.default_rng(seed), []
    for c in commands:
        (a, b), F = drag if c > 0.0 else reverse, 20.0 * c * c + 5.0 * abs(c) + copysign(load, c * load)
        V = (sqrt(b * b + 4.0 * a * F) - b) / (2.0 * a) if a else F / b
        # From rest v = F tanh(w t)/(root + b/2 tanh(w t)), w = beta/m root.
        root = sqrt(a * F + b * b / 4.0)
        Tau = mass / beta / root * atanh(RISE * V * root / (F - RISE * V * b / 2.0))
        values = np.array([V if c > 0.0 else -V, Tau]) * (1.0 + scatter * random.standard_normal(2))
        found += [Point(q, c, v, 1.0, "") for q, v in zip(("V_ss", "Tau"), values.tolist(), strict=True)]
    return found


@pytest.fixture
def sway() -> Rov:
    """Return a vehicle of one axis, other than the paper's."""
    layout = Layout((VehicleAxis(SWAY),), (Curve("t"),), (Thruster("s", "t", (0.0, 1.0, 0.0)),))
    numbers = dict.fromkeys(layout.coefficients, 1.0) | {"m_rov": 10.0, "a_t_t": 20.0, "b_t_t": 5.0}
    return Rov(layout, numbers)


@pytest.fixture
def heave() -> Rov:
    """Return a vehicle of heave alone."""
    layout = Layout((VehicleAxis(HEAVE),), (Curve("t"),), (Thruster("v", "t", (0.0, 0.0, 1.0)),))
    return Rov(layout, dict.fromkeys(layout.coefficients, 1.0) | {"m_rov": 10.0, "a_t_t": 20.0, "b_t_t": 5.0})


def kept(fit: ResponseFit) -> list[str]:
    return [choice.what for choice in fit.choices if choice.kept]


def test_thrusters_of_a_bluerov2_with_their_curve_by_direction() -> None:
    """Four thrusters drive sway, two of them in reverse."""
    k = load_vehicle(SHIPPED["bluerov2"]).rov
    points = [Point(q, c, k.response(SWAY, c)[q == "Tau"], 1.0, "") for q in ("V_ss", "Tau") for c in (0.2, 0.5, 0.8)]
    fit = fit_response(SWAY, points, k.replaced({"a_d_v": 1.0, "b_d_v": 1.0, "beta_v": 1.0}))
    assert [fit.rov[name] for name in ("a_d_v", "b_d_v", "beta_v")] == pytest.approx(
        [k[name] for name in ("a_d_v", "b_d_v", "beta_v")], rel=1e-4
    )


def test_drag_by_direction_where_the_points_tell_it(sway: Rov) -> None:
    fit = fit_response(SWAY, points_of((15.0, 4.0), (30.0, 6.0), 0.01), sway)
    assert kept(fit) == ["drag by direction"]
    assert fit.rov.layout.kinds["sway"].keys == ("a_d", "b_d", "a_d_reverse", "b_d_reverse")
    true = {"a_d_v": 15.0, "b_d_v": 4.0, "beta_v": 0.8, "a_d_v_reverse": 30.0, "b_d_v_reverse": 6.0}
    assert set(fit.estimate.names) == set(true)
    for name, (low, high) in fit.estimate.intervals.items():
        assert low < true[name] < high
    assert fit.rms("V_ss") < 0.02


@pytest.mark.parametrize(
    "seeds", [pytest.param(30, marks=pytest.mark.long), pytest.param(100, marks=pytest.mark.weekly)]
)
def test_drag_alike_both_ways_stays_so(seeds: int, sway: Rov) -> None:
    """With 3 % scatter, at most one of ten fits has drag by direction."""
    fits = [fit_response(SWAY, points_of((15.0, 4.0), (15.0, 4.0), 0.03, seed), sway) for seed in range(seeds)]
    assert sum("a_d_v_reverse" in fit.estimate.names for fit in fits) <= 0.1 * seeds


@pytest.mark.parametrize("load", [0.8, -0.8])
def test_a_net_weight_is_found_from_points_in_both_directions(load: float, heave: Rov) -> None:
    fit = fit_response(HEAVE, points_of((15.0, 4.0), (15.0, 4.0), load=load), heave)
    assert kept(fit) == ["a constant load (net weight)"]
    assert fit.rov["F_0_w"] == pytest.approx(load, rel=1e-6)
    assert fit.rov["a_d_w"] == pytest.approx(15.0, rel=1e-6)


def test_drag_by_direction_is_not_taken_for_a_net_weight(heave: Rov) -> None:
    fit = fit_response(HEAVE, points_of((15.0, 4.0), (30.0, 6.0)), heave)
    assert kept(fit) == ["drag by direction"]


def test_a_known_net_weight_is_not_fitted(heave: Rov) -> None:
    fit = fit_response(HEAVE, points_of((15.0, 4.0), (15.0, 4.0), load=0.8), heave.extended({"F_0_w": 0.5}))
    assert fit.rov["F_0_w"] == 0.5
    assert "F_0_w" not in fit.estimate.names


@pytest.mark.parametrize(
    "seeds", [pytest.param(30, marks=pytest.mark.long), pytest.param(100, marks=pytest.mark.weekly)]
)
def test_intervals_of_a_net_weight_cover_and_none_is_invented(seeds: int, heave: Rov) -> None:
    """With 3 % scatter, at most one of ten fits invents a load, and few intervals miss that of 0.8 N."""
    invented = covered = 0
    for seed in range(seeds):
        without, with_load = (
            fit_response(HEAVE, points_of((15.0, 4.0), (15.0, 4.0), 0.03, seed, load=load), heave)
            for load in (0.0, 0.8)
        )
        invented += "F_0_w" in without.estimate.names
        low, high = with_load.estimate.intervals["F_0_w"]
        covered += low <= 0.8 <= high
    assert invented <= 0.1 * seeds
    assert covered >= 0.85 * seeds


def test_one_command_in_reverse_tells_no_direction(sway: Rov) -> None:
    fit = fit_response(SWAY, points_of((15.0, 4.0), (30.0, 6.0), commands=(0.2, 0.4, 0.5, 0.7, -0.5)), sway)
    assert not any("direction" in choice.what for choice in fit.choices)


def test_drag_that_has_no_linear_part_is_fitted_without(sway: Rov) -> None:
    points = points_of((15.0, 0.0), (15.0, 0.0), 0.05, 1, commands=(0.2, 0.3, 0.5, 0.7))
    fit = fit_response(SWAY, points, sway)
    assert kept(fit) == ["quadratic drag alone"]
    assert fit.rov["b_d_v"] == 0.0
    assert fit.assumed == {"b_d_v": LEFT_OUT}
    alone = fit_response(SWAY, points, sway.replaced({"b_d_v": 0.0}), known=["b_d_v"])
    assert fit.rov["a_d_v"] == pytest.approx(alone.rov["a_d_v"], rel=1e-6)
    assert fit.leave_one_out == pytest.approx(alone.leave_one_out, rel=1e-6)
    for name in ("a_d_v", "beta_v"):
        low, high = fit.estimate.intervals[name]
        least, most = alone.estimate.intervals[name]
        assert high - low > most - least, "what is left out keeps its share in the intervals"
    assert fit.estimate.intervals["b_d_v"][1] > 0.0


def test_fewer_coefficients_need_no_margin(sway: Rov) -> None:
    """A form with fewer coefficients is taken although AICc prefers it by less than the margin of one with more."""
    points = points_of((15.0, 0.6), (15.0, 0.6), 0.05, 10, commands=tuple(0.2 + 0.05 * n for n in range(12)))
    (choice,) = (c for c in fit_response(SWAY, points, sway).choices if c.what == "quadratic drag alone")
    assert choice.kept
    assert 0.0 < choice.gain < MARGIN


@pytest.mark.parametrize("drag", [(0.0, 9.0), (15.0, 0.0), (15.0, 9.0)])
def test_points_without_errors_have_both_parts_found(sway: Rov, drag: tuple[float, float]) -> None:
    fit = fit_response(SWAY, points_of(drag, drag), sway)
    assert [fit.rov["a_d_v"], fit.rov["b_d_v"]] == pytest.approx(drag, rel=1e-4, abs=1e-4)


def test_known_drag_leaves_nothing_to_choose(sway: Rov) -> None:
    fit = fit_response(SWAY, points_of((15.0, 4.0), (15.0, 4.0)), sway.replaced({"a_d_v": 15.0}), known=["a_d_v"])
    assert fit.choices == ()
    assert fit.estimate.names == ("b_d_v", "beta_v")


def test_known_reverse_drag_stays(sway: Rov) -> None:
    form = VehicleAxis(SWAY, ("a_d", "b_d", "a_d_reverse", "b_d_reverse"))
    known = {"a_d_v_reverse": 30.0, "b_d_v_reverse": 6.0}
    base = Rov(replace(sway.layout, axes=(form,)), {**sway.coefficients, **known})
    fit = fit_response(SWAY, points_of((15.0, 4.0), (30.0, 6.0)), base, known=known)
    assert fit.rov.layout.kinds["sway"] == form
    assert fit.estimate.named == pytest.approx({"a_d_v": 15.0, "b_d_v": 4.0, "beta_v": 0.8}, rel=1e-5)


def test_uncertain_thrust_of_one_direction_makes_its_drag_uncertain(sway: Rov) -> None:
    """Drag by direction is proportional to thrust by direction."""
    layout = replace(sway.layout, curves=(Curve("t", ("a_t", "b_t", "a_t_reverse", "b_t_reverse")),))
    base = Rov(layout, {**sway.coefficients, "a_t_t_reverse": 20.0, "b_t_t_reverse": 5.0})
    spread = np.outer([20.0, 5.0], [20.0, 5.0]) * 0.1**2
    thrust = Estimate(("a_t_t_reverse", "b_t_t_reverse"), np.array([20.0, 5.0]), spread, 6.0, 1.0)
    steady = [p for p in points_of((15.0, 4.0), (30.0, 6.0)) if p.quantity == "V_ss"]
    fit = fit_response(SWAY, steady, base, thrust=thrust)
    assert fit.estimate.errors["a_d_v_reverse"] / 30.0 == pytest.approx(0.1, rel=0.01)
    assert fit.estimate.errors["b_d_v_reverse"] / 6.0 == pytest.approx(0.1, rel=0.01)
    assert fit.estimate.errors["a_d_v"] / 15.0 < 0.001


def test_upward_points_of_the_paper_ask_for_no_direction(vehicle: Vehicle) -> None:
    """The data are Table 3: 0.13, 0.17, 0.28, 0.38 down, 0.13, 0.17, 0.25, 0.37 up."""
    down, up = (0.13, 0.17, 0.28, 0.38), (0.13, 0.17, 0.25, 0.37)
    points = [Point("V_ss", c, v, 1.0, "") for c, v in zip((0.2, 0.3, 0.5, 0.7), down, strict=True)]
    points += [Point("V_ss", -c, -v, 1.0, "") for c, v in zip((0.2, 0.3, 0.5, 0.7), up, strict=True)]
    fit = fit_response(HEAVE, points, vehicle.rov.replaced({"alpha_w": 1.0, "beta_w": 1.0}))
    assert "a_d_w_reverse" not in fit.estimate.names
    assert next(choice for choice in fit.choices if choice.what == "drag by direction").gain < 0.0


ALIKE, STRONGER = 1.0, 1.5
"""The drag in reverse, relative to that ahead."""


@pytest.mark.parametrize(
    ("seeds", "least", "drag", "reverse"),
    [
        pytest.param(20, 0.75, (15.0, 4.0), STRONGER, marks=pytest.mark.long),
        pytest.param(20, 0.75, (15.0, 0.0), ALIKE, marks=pytest.mark.long),
        *(
            pytest.param(200, 0.88, (15.0, linear), reverse, marks=pytest.mark.weekly)
            for linear in (4.0, 0.5, 0.0)
            for reverse in (ALIKE, STRONGER)
        ),
    ],
)
def test_intervals_cover_the_truth(
    sway: Rov, drag: tuple[float, float], reverse: float, seeds: int, least: float
) -> None:
    """The intervals hold for 3 % scatter, with and without linear drag.

    An interval covers at least 88 % of 200 seeds. A 95 % interval misses more than 5 of 20 seeds once in 1,000 cases.
    """
    back = drag[0] * reverse, drag[1] * reverse
    hits: dict[str, list[bool]] = {}
    for seed in range(seeds):
        fit = fit_response(SWAY, points_of(drag, back, 0.03, seed), sway)
        true = {"a_d_v": drag[0], "b_d_v": drag[1], "beta_v": 0.8, "a_d_v_reverse": back[0], "b_d_v_reverse": back[1]}
        for name, (low, high) in fit.estimate.intervals.items():
            hits.setdefault(name, []).append(low <= true[name] <= high)
    assert all(np.mean(found) >= least for found in hits.values() if len(found) > seeds / 2), hits


def test_the_band_of_drag_at_its_bound(sway: Rov) -> None:
    """Without quadratic drag, V = F/b_d and dV/da_d = -F^2/b_d^3."""
    rov = sway.replaced({"a_d_v": 0.0, "b_d_v": 20.0})
    found = Estimate(("a_d_v",), np.array([0.0]), np.array([[1.0]]), inf, 1.0)
    low, high, *_ = response_band(SWAY, rov, found, np.array([0.5]))
    F = 20.0 * 0.5**2 + 5.0 * 0.5
    assert high - low == pytest.approx([2.0 * 1.96 * F**2 / 20.0**3], rel=1e-3)


@pytest.mark.parametrize(("forward", "turns"), [(0.0, False), (0.12, True)])
def test_tables_of_thrusters_that_also_turn_the_vehicle_are_told(forward: float, turns: bool) -> None:
    """A thruster at the centre of mass pushes aside only, and one in front of it turns the bow too."""
    thruster = Thruster("s", "t", (0.0, 1.0, 0.0), position=(forward, 0.0, 0.0))
    layout = Layout((VehicleAxis(SWAY), VehicleAxis(YAW)), (Curve("t"),), (thruster,))
    numbers = dict.fromkeys(layout.coefficients, 1.0) | {"m_rov": 10.0, "a_t_t": 20.0, "b_t_t": 5.0}
    rov = Rov(layout, numbers)
    points = tuple(points_of((15.0, 4.0), (15.0, 4.0)))
    fit = fit_response(SWAY, points, rov)
    result = AxisResult(SWAY, points, (), None, fit, None, {}, ())
    (line,) = sentences(on_turning([result], fit.rov)) or ("",)
    # At 70 %, 13.3 N turn the vehicle by 1.6 N.m against a drag of r^2 + r: 0.86 rad/s.
    assert line.startswith("sway: at a command of 70% its thrusters also turn the vehicle, at up to 49 deg/s.") is turns
    assert bool(line) is turns
