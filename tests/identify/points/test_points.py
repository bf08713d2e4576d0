"""The forms of drag, the choice between them, and points and forces as residuals, against numbers by hand."""

from dataclasses import replace
from math import inf, log, nan, sqrt

import numpy as np
import pytest

from rov_fmu.identify.driving import connected, curves_of, thrust_along
from rov_fmu.identify.points.choice import Choice, aicc
from rov_fmu.identify.points.drag_forms import DragForm, Point, candidate_forms, free_coefficients, levels
from rov_fmu.identify.points.quadratic_fit import fit_quadratic
from rov_fmu.identify.points.response_fit import _start, fit_response, predict, relative_rms
from rov_fmu.identify.points.tables import TableForces, TablePoints
from rov_fmu.identify.points.thrust_fit import fit_thrust, measured
from rov_fmu.model.layout import HEAVE, SURGE, YAW, Axis
from rov_fmu.vehicle.uncertainty import quantile
from tests.vehicles import HEAVY, VIDEORAY


def steady(*commands: float, quantity: str = "V_ss", weight: float = 1.0) -> list[Point]:
    return [Point(quantity, c, c, weight, "") for c in commands]


def test_the_criterion_is_that_of_akaike_for_few_data() -> None:
    """With the variance as another coefficient, k = 3 of 10 points: n log(rss/n) + 2 k + 2 k (k + 1)/(n - k - 1)."""
    assert aicc(0.4, 10, 2, 1e-5) == pytest.approx(10.0 * log(0.04) + 6.0 + 24.0 / 6.0)
    assert aicc(0.0, 10, 2, 1e-5) == pytest.approx(10.0 * log(1e-10) + 10.0)
    assert (aicc(0.4, 4, 2, 1e-5), aicc(0.4, 5, 2, 1e-5) < inf) == (inf, True)


@pytest.mark.parametrize(
    ("kept", "gain", "said"),
    [
        (True, 3.21, "earns its place: AICc less by 3.21"),
        (False, -3.21, "is left out: AICc more by 3.21"),
        (True, 0.0, "less by 0 "),
    ],
)
def test_a_choice_says_by_how_much(kept: bool, gain: float, said: str) -> None:
    words = Choice("a dead band", kept, gain, (0.5, 0.25)).words
    assert said in words
    assert words.endswith("error 0.25 with it and 0.5 without")


def test_levels_are_the_sizes_of_commands_in_a_direction() -> None:
    points = steady(0.3, -0.3, -0.5, 0.3000004)
    assert (levels(points), levels(points, 1.0), levels(points, -1.0)) == ({0.3, 0.5}, {0.3}, {0.3, 0.5})


@pytest.mark.parametrize(
    ("points", "names", "assumed"),
    [
        (steady(0.3, 0.5), ("a_d_w", "b_d_w"), {"beta_w": 1.0}),
        (steady(0.3, -0.3), ("a_d_w",), {"b_d_w": 0.0, "beta_w": 1.0}),
        ([*steady(0.3, 0.5), *steady(0.3, quantity="Tau")], ("a_d_w", "b_d_w", "beta_w"), {}),
    ],
)
def test_what_points_do_not_tell_is_assumed(
    points: list[Point], names: tuple[str, ...], assumed: dict[str, float]
) -> None:
    found, held = free_coefficients(HEAVE, points, ())
    assert found == names
    assert {name: value for name, (value, _) in held.items()} == assumed
    assert free_coefficients(HEAVE, points, ("a_d_w", "b_d_w", "beta_w")) == ((), {})


@pytest.mark.parametrize(
    ("axis", "points", "count"),
    [
        (HEAVE, steady(0.3, 0.5), 3),
        (HEAVE, steady(0.3, 0.5, -0.3), 3),
        (HEAVE, steady(0.3, 0.5, -0.3, -0.5), 9),
        (SURGE, steady(0.3, 0.5, -0.3, -0.5), 6),
        (HEAVE, [*steady(0.3, 0.5, -0.3), *steady(-0.5, weight=0.0)], 3),
        (HEAVE, steady(0.3), 1),
    ],
)
def test_more_forms_of_drag_need_two_commands_in_both_directions(axis: Axis, points: list[Point], count: int) -> None:
    forms = [*candidate_forms(axis, points, VIDEORAY, ())]
    assert len(forms) == count
    whats = [form.what for form in forms]
    every = ["", "quadratic drag alone", "linear drag alone", "drag by direction", "quadratic drag alone, by direction"]
    every += ["linear drag alone, by direction", "a constant load (net weight)"]
    every += ["quadratic drag alone with a constant load", "linear drag alone with a constant load"]
    assert whats == every[:count]
    assert all(form.base.coefficients.get("F_0_w", 0.0) == 0.0 for form in forms)
    assert [form.is_open for form in forms] == [bool(what) for what in whats]


def test_only_points_with_an_error_are_read_off_a_recording() -> None:
    assert replace(steady(0.3)[0], error=0.01).is_read_off
    assert not steady(0.3)[0].is_read_off


@pytest.mark.parametrize(
    ("names", "commands", "is_enough"),
    [
        (("a_d_w", "b_d_w"), (0.3,), False),
        (("a_d_w", "b_d_w"), (0.3, -0.5), True),
        (("a_d_w",), (0.3,), True),
        (("a_d_w", "b_d_w", "F_0_w"), (0.3, -0.3), True),
        (("a_d_w", "b_d_w", "F_0_w"), (0.3, 0.5), False),
        (("a_d_w", "b_d_w", "a_d_w_reverse", "b_d_w_reverse"), (0.3, 0.5, -0.3, -0.5), True),
        (("a_d_w", "b_d_w", "a_d_w_reverse", "b_d_w_reverse"), (0.3, 0.5, -0.3), False),
        (("a_d_w", "b_d_w", "beta_w"), (0.3, 0.5), False),
    ],
)
def test_a_form_needs_as_many_commands_as_coefficients(
    names: tuple[str, ...], commands: tuple[float, ...], is_enough: bool
) -> None:
    form = DragForm(HEAVE, VIDEORAY, names, (), {})
    assert form.is_identifiable_from(steady(*commands)) == is_enough
    assert form.is_identifiable_from([*steady(*commands), *steady(0.3, quantity="Tau")]) == (
        is_enough or "beta_w" in names
    )


def test_a_search_starts_with_half_of_the_drag_linear() -> None:
    """At V = 0.2 and 0.4 m/s the forces divided by velocity have a mean of which half is linear, half quadratic."""
    used = [Point("V_ss", c, V, 1.0, "") for c, V in ((0.3, 0.2), (-0.5, -0.4))]
    forces = [1.14 * (6.494 * c + 0.0513) * c for c in (0.3, 0.5)]
    mean = (forces[0] / 0.2 + forces[1] / 0.4) / 2.0
    start = _start(HEAVE, used, VIDEORAY, ("a_d_w", "b_d_w", "beta_w"))
    assert start == pytest.approx({"a_d_w": 0.5 * mean / 0.3, "b_d_w": 0.5 * mean, "beta_w": 1.0})
    Tau = VIDEORAY.replaced(start).response(HEAVE, 0.3)[1]
    taus = [Point("Tau", 0.3, Tau / ratio, 1.0, "") for ratio in (0.2, 0.5, 4.0)]
    assert _start(HEAVE, [*used, *taus], VIDEORAY, ("a_d_w", "b_d_w", "beta_w"))["beta_w"] == pytest.approx(0.5)


def test_the_relative_error_is_over_the_points_of_a_quantity_that_count() -> None:
    points = [*steady(0.3, 0.5, 0.7), *steady(0.3, weight=0.0), *steady(0.3, quantity="Tau")]
    model = np.array([0.3 * 1.3, 0.5 * 0.6, nan, 9.0, 9.0])
    assert relative_rms(points, model, "V_ss") == pytest.approx(sqrt((0.3**2 + 0.4**2) / 2.0))
    assert np.isnan(relative_rms(points, np.full(5, nan), "V_ss"))


def points_of(scatter: float, count: int = 6) -> list[Point]:
    signs = (1, -1, -1, 1, 1, -1)
    return [
        Point("V_ss", c, VIDEORAY.response(HEAVE, c)[0] * (1.0 + s * scatter), 1.0, "")
        for c, s in zip(np.linspace(0.2, 0.8, count).tolist(), signs, strict=False)
    ]


def test_points_are_as_uncertain_as_they_scatter_but_at_least_one_percent() -> None:
    exact, rough = (TablePoints.of(fit_response(HEAVE, points_of(scatter), VIDEORAY)) for scatter in (0.0, 0.05))
    assert exact
    assert rough
    assert exact.error == 0.01
    own = fit_response(HEAVE, points_of(0.05), VIDEORAY).given_thrust
    assert rough.error == pytest.approx(own.noise * quantile(4.0) / quantile(inf))
    assert rough.residuals(VIDEORAY) == pytest.approx(
        [
            (p.value**-1.0 * v - 1.0) / rough.error
            for p, v in zip(rough.points, predict(HEAVE, VIDEORAY, rough.points), strict=True)
        ]
    )
    assert (len(exact), TablePoints.of(fit_response(HEAVE, points_of(0.0, 2), VIDEORAY))) == (6, None)


def test_a_modelled_point_counts_as_ten_times_off_at_most() -> None:
    table = TablePoints(HEAVE, tuple(points_of(0.0)), 0.1)
    free = VIDEORAY.replaced({"a_d_w": 0.0, "b_d_w": 0.0})
    assert table.residuals(free) == pytest.approx(np.full(6, 90.0))
    assert table.residuals(VIDEORAY.replaced({"a_d_w": 1e-9, "b_d_w": 1e-9})) == pytest.approx(np.full(6, 90.0))


def test_forces_are_as_uncertain_as_they_scatter() -> None:
    curve = replace(VIDEORAY.layout.curves_by_name["top"])
    x = np.linspace(0.1, 0.9, 9)
    noise = 0.05 * np.array([1.0, -1.0, -1.0, 1.0, 1.0, -1.0, -1.0, 1.0, 1.0])
    fit = fit_thrust(curve, x, (6.494 * x + 0.5) * x + noise, (x < 0.85).astype(float))
    table = TableForces.of(fit)
    assert table
    assert (table.curve, len(table)) == ("top", 8)
    degrees = 8.0 - len(fit.estimate.names)
    assert table.error == pytest.approx(fit.estimate.noise * quantile(degrees) / quantile(inf))
    own = VIDEORAY.replaced({"a_t_top": 6.494, "b_t_top": 0.5})
    assert table.residuals(own) == pytest.approx(-noise[:8] / table.error)
    joint = measured([fit, fit_thrust(curve, x, (6.494 * x + 0.5) * x)])
    assert joint
    assert joint.names == fit.estimate.names, "exact forces have no uncertainty"
    assert joint.covariance == pytest.approx(fit.estimate.as_normal().covariance)
    assert measured([fit_thrust(curve, x, (6.494 * x + 0.5) * x)]) is None


def test_the_share_that_a_curve_explains_is_weighted() -> None:
    x, y, weights = np.array([0.2, 0.4, 0.6, 0.8]), np.array([1.0, 2.0, 4.0, 100.0]), np.array([1.0, 2.0, 1.0, 0.0])
    fit = fit_quadratic(("a_t_x", "b_t_x"), x, y, weights)
    rest = y[:3] - fit.value(x[:3])
    mean = (1.0 + 2.0 * 2.0 + 4.0) / 4.0
    total = (1.0 - mean) ** 2 + 2.0 * (2.0 - mean) ** 2 + (4.0 - mean) ** 2
    assert fit.r_squared == pytest.approx(1.0 - float(weights[:3] @ rest**2) / total)
    assert fit.residual_rms == pytest.approx(sqrt(float(rest @ rest) / 3.0))
    assert np.isnan(fit_quadratic(("a_t_x", "b_t_x"), x, np.ones(4), np.zeros(4)).r_squared)
    low, high = fit.band(x)
    assert low + high == pytest.approx(2.0 * fit.value(x))


# ---- Thrusters and axes ----------------------------------------------------------------------------------------------


def test_axes_that_share_a_curve_are_one_group() -> None:
    groups = [([c.name for c in curves], [a.name for a in axes]) for curves, axes in connected(VIDEORAY.layout)]
    assert groups == [(["rear"], ["surge", "yaw"]), (["top"], ["heave"])]
    (everything,) = connected(VIDEORAY.layout, tilts=True)
    assert everything == ([*VIDEORAY.layout.curves], [SURGE, HEAVE, YAW])
    assert len([*connected(HEAVY.layout)]) == 1, "its axes are coupled"
    crossed = replace(VIDEORAY.layout, cross=(("a_d", "w", "u"),))
    assert len([*connected(crossed)]) == 1, "surge acts on heave"
    assert [curve.name for curve in curves_of(VIDEORAY.layout, YAW)] == ["rear"]


def test_the_thrust_along_an_axis_is_the_sum_of_its_thrusters() -> None:
    commands = np.array([[0.3, 0.3, 0.5], [0.3, -0.3, -0.5], [0.5, 0.0, 0.0]])
    one = {c: (42.9 * abs(c) + 2.711) * c / 2.0 for c in (0.3, 0.5)}
    assert thrust_along(VIDEORAY, SURGE, commands) == pytest.approx([2.0 * one[0.3], 0.0, one[0.5]])
    top = (6.494 * 0.5 + 0.0513) * 0.5
    assert thrust_along(VIDEORAY, HEAVE, commands) == pytest.approx([top, -top, 0.0])
