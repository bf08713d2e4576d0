"""Findings about fits, just below and just above the threshold of each."""

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import f as f_distribution
from scipy.stats import t as student

from rov_fmu.identify import diagnostics
from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.diagnostics import on_axis, on_delay, on_forces, on_thrust, on_voltage
from rov_fmu.identify.identification import AxisResult
from rov_fmu.identify.least_squares import Estimate
from rov_fmu.identify.points.drag_forms import Point
from rov_fmu.identify.points.quadratic_fit import fit_quadratic
from rov_fmu.identify.points.response_fit import ResponseFit, fit_response
from rov_fmu.identify.points.thrust_fit import ThrustFit
from rov_fmu.identify.recordings.held_out import HeldOut
from rov_fmu.identify.recordings.prediction_errors import Errors
from rov_fmu.identify.recordings.recordings_fit import FittedEffect, RecordingsFit
from rov_fmu.identify.recordings.residual_analysis import Simulation
from rov_fmu.model.layout import HEAVE
from rov_fmu.model.rov import Rov
from rov_fmu.tank.description import Requests
from rov_fmu.tank.findings import Finding
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.vehicles import THRUST_EFFECTS, VIDEORAY

DRAG = ("a_d_w", "b_d_w")
NOTHING = Estimate((), np.zeros(0), np.zeros((0, 0)), 1.0, 1.0)


def estimate(values: Sequence[float], errors: Sequence[float], degrees: float = 10.0, shared: float = 0.0) -> Estimate:
    """Return an estimate of drag in heave with these standard errors and a covariance of the two."""
    of = np.diag(np.square(errors)) + shared * (1.0 - np.eye(2))
    return Estimate(DRAG, np.array(values), of, degrees, 1.0)


def steady(command: float, factor: float = 1.0, weight: float = 1.0, rov: Rov = VIDEORAY) -> Point:
    """Return a V_ss in heave that is a multiple of that of the vehicle."""
    return Point("V_ss", command, factor * rov.response(HEAVE, command)[0], weight, "a table")


def fit_of(rov: Rov = VIDEORAY, found: Estimate = NOTHING, **more: Any) -> RecordingsFit:
    none = HeldOut((), by_halves=False)
    return RecordingsFit(
        HEAVE, rov, found, found, more.pop("simulations", ()), more.pop("effects", ()), lambda: none, **more
    )


def result_of(points: Sequence[Point] = (), **more: Any) -> AxisResult:
    of: dict[str, Any] = {"drag": None, "response": None, "recordings": None, "assumed": {}, **more}
    return AxisResult(HEAVE, tuple(points), (), findings=(), **of)


def found_in(
    result: AxisResult, kind: str, thrust: dict[str, ThrustFit] | None = None, base: Rov = VIDEORAY
) -> list[Finding]:
    return [finding for finding in on_axis(result, base, thrust or {}) if finding.kind == kind]


# ---- Both directions -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("more", [0.051, -0.051, 0.049, -0.049])
def test_directions_that_differ_by_five_percent_more_than_in_the_model_are_told(more: float) -> None:
    found = found_in(result_of([steady(0.4), steady(-0.4, 1.0 + more), steady(0.6), steady(-0.6)]), "asymmetry")
    assert bool(found) == (abs(more) > 0.05)
    for finding in found:
        assert finding.numbers == pytest.approx({"measured": more, "command": 0.4})
        assert finding.names == {"quantity": "V_ss", "window": "heave"}


def test_the_largest_difference_is_told_beside_that_of_the_model() -> None:
    rov = VIDEORAY.extended({"a_d_w_reverse": 2.0 * VIDEORAY["a_d_w"], "b_d_w_reverse": VIDEORAY["b_d_w"]})
    points = [steady(c, factor, rov=rov) for c, factor in ((0.2, 1.0), (-0.2, 1.06), (0.4, 1.0), (-0.4, 1.2))]
    (finding,) = found_in(result_of(points), "asymmetry", base=rov)
    modelled = -rov.response(HEAVE, -0.4)[0] / rov.response(HEAVE, 0.4)[0]
    expected = {"measured": 1.2 * modelled - 1.0, "command": 0.4, "modelled": modelled - 1.0}
    assert finding.numbers == pytest.approx(expected)


def test_directions_are_compared_with_the_fit_and_not_with_the_vehicle_before_it() -> None:
    rov = VIDEORAY.extended({"a_d_w_reverse": 2.0 * VIDEORAY["a_d_w"], "b_d_w_reverse": VIDEORAY["b_d_w"]})
    points = [steady(c, rov=rov) for c in (0.4, -0.4)]
    assert found_in(result_of(points), "asymmetry")
    for fitted in ({"recordings": fit_of(rov)}, {"response": replace(response_fit(0.0, 0.0, "V_ss"), rov=rov)}):
        assert found_in(result_of(points, **fitted), "asymmetry") == []


@pytest.mark.parametrize(("scatter", "is_told"), [(0.0143, True), (0.0146, False)])
def test_a_difference_within_four_standard_errors_is_chance(scatter: float, is_told: bool) -> None:
    """Two values that deviate by e have a standard deviation of sqrt(2) e, and the ratio an error of sqrt(3) e."""
    points = [steady(0.4, 1.0 + scatter), steady(0.4, 1.0 - scatter), steady(-0.4, 1.1)]
    assert bool(found_in(result_of(points), "asymmetry")) == is_told
    assert (4.0 * np.sqrt(3.0) * scatter < 0.1) == is_told


# ---- Drag ------------------------------------------------------------------------------------------------------------


def test_drag_with_an_interval_wider_than_itself_is_hardly_identifiable() -> None:
    reach = float(student.ppf(0.975, 10.0))
    for width, is_told in ((0.99, False), (1.01, True)):
        errors = [0.5 * width * 20.0 / reach, 0.01]
        result = result_of(recordings=fit_of(found=estimate([20.0, 5.0], errors, shared=0.5 * errors[0] * 0.01)))
        found = found_in(result, "inseparable drag")
        assert bool(found) == is_told
    (finding,) = found
    half = 0.5 * 1.01 * 20.0
    assert finding.names == {"a_d": "a_d_w"}
    assert finding.numbers == pytest.approx({"a_d low": 20.0 - half, "a_d high": 20.0 + half, "correlation": 0.5})


def test_drag_without_any_interval_has_no_correlation() -> None:
    (finding,) = found_in(
        result_of(recordings=fit_of(found=estimate([20.0, 5.0], [np.inf, np.inf]))), "inseparable drag"
    )
    assert (finding.names, finding.numbers) == ({"a_d": "a_d_w", "b_d": "b_d_w"}, {})


@pytest.mark.parametrize(("degrees", "is_told"), [(0.0, True), (1.0, False)])
def test_as_many_coefficients_as_points_leave_no_freedom(degrees: float, is_told: bool) -> None:
    result = result_of(recordings=fit_of(found=estimate([20.0, 5.0], [50.0, 50.0], degrees)))
    assert bool(found_in(result, "drag without freedom")) == is_told
    assert bool(found_in(result, "inseparable drag")) != is_told


def test_drag_at_zero_is_told_with_the_fit_to_the_forces_of_the_same_coefficient() -> None:
    x = np.array([0.1, 0.2, 0.3, 0.4])
    drag = fit_quadratic(DRAG, x, 20.0 * x * x - 0.5 * x)
    response = fit_response(HEAVE, [steady(c) for c in (0.2, 0.4, 0.6)], VIDEORAY)
    for n, values in enumerate(([0.0, 5.0], [20.0, 0.0])):
        of_points = replace(response, estimate=estimate(values, [0.1, 0.1]))
        (finding,) = found_in(result_of(response=of_points, drag=drag), "drag at zero")
        assert finding.names == {"coefficient": DRAG[n]}
        assert finding.numbers == ({"unbounded": pytest.approx(-0.5)} if n else {}), "20 is not negative"
        (finding,) = found_in(
            result_of(recordings=fit_of(found=estimate(values, [0.1, 0.1])), drag=drag), "drag at zero"
        )
        assert finding.numbers == {}
        left = result_of(response=of_points, assumed={DRAG[n]: "left out"})
        assert found_in(left, "drag at zero") == []


# ---- Points ----------------------------------------------------------------------------------------------------------


def response_fit(fitted: float, predicted: float, quantity: str) -> ResponseFit:
    """Return a fit to two points that it is off by a share, and the predictions without them by another."""
    of = {"V_ss": 0, "Tau": 1}[quantity]
    points = [Point(quantity, c, VIDEORAY.response(HEAVE, c)[of] / (1.0 + fitted), 1.0, "") for c in (0.3, 0.5)]
    values = np.array([p.value for p in points])
    out = values * (1.0 + predicted)
    return ResponseFit(HEAVE, tuple(points), VIDEORAY, NOTHING, NOTHING, {}, {}, out)


@pytest.mark.parametrize("quantity", ["V_ss", "Tau"])
@pytest.mark.parametrize(
    ("fitted", "predicted", "is_told"),
    [(0.001, 0.021, True), (0.001, 0.019, False), (0.1, 0.151, True), (0.1, 0.149, False)],
)
def test_single_thrusts_that_carry_much_are_told(fitted: float, predicted: float, is_told: bool, quantity: str) -> None:
    """The error without the thrust is above 2 % and above one and a half times that of the fit."""
    found = found_in(result_of(response=response_fit(fitted, predicted, quantity)), "leave-one-out error")
    assert bool(found) == is_told
    for finding in found:
        assert finding.names == {"quantity": quantity}
        assert finding.numbers == pytest.approx({"predicted": predicted, "fitted": fitted})


@pytest.mark.parametrize(("off", "is_told"), [(0.051, True), (0.049, False)])
def test_tables_that_the_recordings_contradict_are_told(off: float, is_told: bool) -> None:
    points = [steady(c, 1.0 / (1.0 + off)) for c in (0.3, 0.5)]
    found = found_in(result_of(points, recordings=fit_of()), "tables against recordings")
    assert [finding.numbers["error"] for finding in found] == pytest.approx([off] * is_told)
    others = [replace(p, weight=0.0) for p in points] + [replace(p, error=0.1) for p in points]
    assert found_in(result_of(others, recordings=fit_of()), "tables against recordings") == []


def test_the_scatter_of_a_table_does_not_contradict_the_recordings() -> None:
    """Differences of ±10 % about zero are scatter; all on one side, or growing with the command, they are not."""
    commands = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7)
    kinds = {
        "scatter": (0.1, -0.1, 0.08, -0.12, 0.11, -0.07),
        "offset": (0.1, 0.11, 0.12, 0.09, 0.1, 0.08),
        "trend": (-0.15, -0.09, -0.04, 0.03, 0.08, 0.14),
    }
    for kind, errors in kinds.items():
        points = [steady(c, 1.0 / (1.0 + error)) for c, error in zip(commands, errors, strict=True)]
        found = found_in(result_of(points, recordings=fit_of()), "tables against recordings")
        assert bool(found) == (kind != "scatter"), kind


def thrust_fit(factor: float = 1.0, b_t: float = 0.0513, noise: float = 0.1, degrees: float = 8.0) -> ThrustFit:
    """Return a fit to forces at ±20, ±40, ±60 %, with a factor in reverse, and at 90 % without weight."""
    curve = VIDEORAY.layout.curves_by_name["top"]
    x = np.array([0.2, 0.4, 0.6, -0.2, -0.4, -0.6, 0.9])
    y = (6.494 * np.abs(x) + b_t) * x * np.where(x < 0.0, factor, 1.0)
    values = {"a_t_top": 6.494, "b_t_top": b_t}
    own = Estimate(("a_t_top", "b_t_top"), np.array([6.494, b_t]), np.eye(2), degrees, noise)
    return ThrustFit(x, y, (x < 0.8).astype(float), own, y, curve, values)


@pytest.mark.parametrize(
    ("commands", "range_told"), [((0.196, 0.604), None), ((0.194, 0.5), (0.194, 0.5)), ((0.3, -0.606), (0.3, 0.606))]
)
def test_commands_beyond_the_tested_ones_are_told(
    commands: tuple[float, float], range_told: tuple[float, float] | None
) -> None:
    """The tolerance is half a percent of the full command."""
    points = [*(steady(c) for c in commands), steady(0.9, weight=0.0)]
    found = found_in(result_of(points), "untested thrust", {"top": thrust_fit()})
    assert [(f.numbers["low"], f.numbers["high"]) for f in found] == ([range_told] if range_told else [])
    assert all((f.numbers["tested_low"], f.numbers["tested_high"]) == (0.2, 0.6) for f in found)


def test_what_moves_without_a_push_is_told() -> None:
    dead = VIDEORAY.extended({"c_0_top": 0.1})
    points = [Point("V_ss", c, np.sign(c), 0.0, "") for c in (0.05, 0.3, -0.1)]
    (finding,) = found_in(result_of(points), "no push", base=dead)
    assert finding.names == {"commands": "-10%, 5%"}


# ---- Thrust ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("command", "is_told"), [(0.0051, True), (0.0049, False)])
@pytest.mark.parametrize("end", ["", "_reverse"])
def test_a_curve_that_points_backward_is_told(command: float, is_told: bool, end: str) -> None:
    rov = VIDEORAY.extended({"a_t_top_reverse": 6.0, "b_t_top_reverse": 0.1}) if end else VIDEORAY
    rov = rov.replaced({f"b_t_top{end}": -command * rov[f"a_t_top{end}"]})
    found = [finding for finding in on_thrust("top", thrust_fit(), rov) if "backward" in finding.kind]
    assert [finding.kind for finding in found] == [f"backward thrust{' in reverse' if end else ''}"] * is_told
    assert [finding.numbers["command"] for finding in found] == pytest.approx([command] * is_told)


@pytest.mark.parametrize(("degrees", "is_told"), [(0.0, True), (1.0, False)])
def test_forces_without_freedom_are_told_with_their_number(degrees: float, is_told: bool) -> None:
    found = [f for f in on_thrust("top", thrust_fit(degrees=degrees), VIDEORAY) if f.kind == "thrust without freedom"]
    assert [finding.numbers for finding in found] == [{"count": 6}] * is_told


@pytest.mark.parametrize(("factor", "is_told"), [(1.051, True), (1.049, False)])
def test_forces_that_differ_by_direction_are_told(factor: float, is_told: bool) -> None:
    found = [finding for finding in on_thrust("top", thrust_fit(factor), VIDEORAY) if finding.kind == "asymmetry"]
    assert [finding.numbers["measured"] for finding in found] == pytest.approx([factor - 1.0] * is_told)
    assert all(finding.names == {"quantity": "force", "window": "thrust_top"} for finding in found)


@pytest.mark.parametrize(("larger", "is_told"), [(1.01, False), (0.99, True)])
def test_recordings_that_change_a_curve_beyond_the_scatter_of_its_forces_are_told(larger: float, is_told: bool) -> None:
    """The F-test at 0.3 % compares the increase of the sum of squares with the scatter of the forces."""
    x = np.array([0.2, 0.4, 0.6])
    increase = 2.0 * float(np.sum((0.5 * x * x) ** 2))
    noise = larger * np.sqrt(increase / 2.0 / f_distribution.isf(0.003, 2, 8))
    forces = thrust_fit(noise=float(noise))
    fit = fit_of(VIDEORAY.replaced({"a_t_top": 6.994}), forces.estimate)
    found = [*on_forces(fit, forces)]
    assert bool(found) == is_told
    for finding in found:
        expected = {"command": 0.6, "joint": 6.994 * 0.36 + 0.0513 * 0.6, "alone": 6.494 * 0.36 + 0.0513 * 0.6}
        assert finding.numbers == pytest.approx(expected)
    assert [*on_forces(replace(fit, estimate=NOTHING), forces)] == [], "the curve was not fitted"
    assert found_in(result_of(recordings=fit), "recordings against forces", {"top": forces}) == found
    steeper = fit_of(VIDEORAY.replaced({"a_t_top": 7.294, "b_t_top": -0.4487}), forces.estimate)
    below = {c: 0.8 * c * c - 0.5 * c for c in (0.2, 0.4, 0.6)}
    (most,) = on_forces(steeper, thrust_fit(noise=1e-3))
    assert abs(most.numbers["command"]) == max(below, key=lambda c: abs(below[c])), "where the curves differ most"
    for unknown in (0.0, np.nan):
        assert [*on_forces(fit, replace(forces, estimate=replace(forces.estimate, noise=unknown)))] == []


def test_the_voltage_of_the_thrust_is_asked_for_where_it_is_not_given() -> None:
    rov = load_vehicle(THRUST_EFFECTS).rov
    names = [curve.name for curve in rov.layout.curves if "V_0" in curve.keys]
    assert len(names) > 1
    (finding,) = on_voltage(rov, Requests(voltage=True, measured_at={names[0]: 16.0}))
    assert finding.names == {"curves": ", ".join(names[1:]), "key": f"V_0_{names[1]}"}
    assert finding.numbers == {"voltage": rov[f"V_0_{names[1]}"]}
    assert [*on_voltage(rov, Requests())] == []
    assert [*on_voltage(rov, Requests(voltage=True, measured_at=dict.fromkeys(names, 16.0)))] == []


# ---- Recordings ------------------------------------------------------------------------------------------------------


def simulation(outliers: int = 0, samples: float = 1.0, noise: float = 0.01) -> Simulation:
    """Return a simulation of 100 samples of a depth from 0 to 2 m."""
    time, depth = np.arange(100.0), np.linspace(0.0, 2.0, 100)
    recording = Recording("log.csv", HEAVE, "depth", time, np.ones(100), depth)
    return Simulation(recording, time, depth, depth, depth, noise, samples, outliers)


@pytest.mark.parametrize(
    ("one", "kinds"),
    [
        (simulation(outliers=3), []),
        (simulation(outliers=4), ["outliers"]),
        (simulation(outliers=15), ["outliers"]),
        (simulation(outliers=16), ["many outliers"]),
        (simulation(samples=3.0), []),
        (simulation(samples=3.1), ["correlated residuals"]),
        (simulation(samples=3.1, noise=2.1e-4), ["correlated residuals"]),
        (simulation(samples=3.1, noise=1.9e-4), []),
    ],
)
def test_outliers_and_slow_noise_are_told(one: Simulation, kinds: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(diagnostics, "on_structure", lambda _: ())
    found = [*on_axis(result_of(recordings=fit_of(simulations=(one,))), VIDEORAY, {})]
    assert [(finding.kind, finding.file) for finding in found] == [(kind, "log.csv") for kind in kinds]
    assert all({*finding.numbers.values()} <= {one.outliers / 100.0, one.correlation_time} for finding in found)


@pytest.mark.parametrize(("off", "is_told"), [(5.02, True), (4.98, False)])
@pytest.mark.parametrize(("by_halves", "others"), [(True, "the other half"), (False, "the others")])
def test_a_model_that_predicts_less_than_half_of_the_change_is_poor(
    off: float, is_told: bool, by_halves: bool, others: str
) -> None:
    """With a noise of 1 and a change of 7, the mean squares beyond the noise are off² - 1 of 48."""
    rms = [np.full(9, value) for value in (off, 7.0, 1.0)]
    prediction: Any = SimpleNamespace(errors={("whole recording", "velocity"): Errors(*rms)})
    held_out = HeldOut((prediction,), by_halves)
    fit = replace(fit_of(), hold_out=lambda: held_out)
    found = found_in(result_of(recordings=fit), "poor prediction")
    assert [finding.names for finding in found] == [{"others": others, "unit": "m/s"}] * is_told
    for finding in found:
        assert finding.numbers == pytest.approx({"predicted": off, "unchanged": 7.0, "noise": 1.0})


def test_a_disagreement_has_the_range_of_its_factors() -> None:
    (finding,) = found_in(result_of(recordings=fit_of(disagreement={"a_d_w": 5.0, "beta_w": 3.0})), "disagreement")
    assert finding.numbers == {"low": 3.0, "high": 5.0}
    assert finding.names == {"coefficients": "a_d_w, beta_w"}


@pytest.mark.parametrize(
    ("of", "value", "kept", "is_told"),
    [
        ("heave", 0.3, True, True),
        ("heave", -0.3, True, False),
        ("heave", 0.3, False, False),
        ("log.csv", 0.3, True, False),
    ],
)
def test_a_delay_of_the_axis_is_told_with_the_vehicle(of: str, value: float, kept: bool, is_told: bool) -> None:
    effects = (
        FittedEffect("delay", of, "s", value, (0.2, 0.4), kept),
        FittedEffect("load", "heave", "N", 1.0, None, True),
    )
    found = [*on_delay(fit_of(effects=effects))]
    assert [finding.kind for finding in found] == ["delay not modelled"] * is_told
    assert all(finding.numbers == {"value": 0.3, "low": 0.2, "high": 0.4} for finding in found)


def test_an_effect_of_a_recording_has_its_file_and_others_what_they_are_of(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(diagnostics, "on_structure", lambda _: ())
    effects = tuple(
        FittedEffect("load", of, "N", 1.0, None, kept=of != "b.csv") for of in ("log.csv", "heave", "b.csv")
    )
    fit = fit_of(simulations=(simulation(),), effects=effects)
    found = found_in(result_of(recordings=fit), "load")
    assert [(f.file, f.names, f.numbers) for f in found] == [
        ("log.csv", {"unit": "N"}, {"value": 1.0}),
        ("", {"unit": "N", "of": "heave"}, {"value": 1.0}),
    ]
