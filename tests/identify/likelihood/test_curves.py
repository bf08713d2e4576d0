"""The shape of thrust curves: how a command is warped, its prior, and the quadratic curve that a vehicle file has."""

from dataclasses import replace
from math import exp
from typing import Any, get_args

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from rov_fmu.equation.catalogue import HEAVE, Lag
from rov_fmu.equation.parts import Curve
from rov_fmu.identify.likelihood.curves import COUNT, KNOTS, NO_SHAPES, Shapes, nearest, nearest_drag
from rov_fmu.identify.likelihood.objective import TableRow, modelled
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.vehicles import VIDEORAY, extended

REAR, _ = VIDEORAY.layout.curves


def test_a_published_curve_is_met_within_a_thousandth_of_full_thrust() -> None:
    """The thrust of another maker's propeller, 51.5 N ((c - 0.06) / 0.94)^1.45, from the curve of the BlueROV2."""
    k = load_vehicle(SHIPPED["bluerov2"])
    (curve,) = k.layout.curves
    commands = np.linspace(0.02, 0.8, 40)
    truth = 51.5 * np.maximum(commands - 0.06, 0.0) ** 1.45 / 0.94**1.45

    def errors(p: np.ndarray) -> np.ndarray:
        rov = k.with_(c_0_t200=float(p[0]))
        shape = Shapes({curve.name: np.concatenate([p[2:], np.zeros(len(KNOTS))])}, {curve.name: (float(p[0]), 0.0)})
        return np.asarray(np.exp(p[1]) * shape.forces(rov, curve, commands) - truth)

    best = least_squares(errors, [0.06, *np.zeros(1 + len(KNOTS))], diff_step=1e-5)
    assert np.abs(best.fun).max() < 0.05
    assert best.x[0] == pytest.approx(0.06, abs=0.015)


def test_the_prior_of_a_shape_is_that_which_is_stated() -> None:
    """The force deviates by 10 % at weak commands, less towards full command, smoothly, and half alike astern."""
    random = np.random.default_rng(2)
    at = np.array([*KNOTS, -KNOTS[0]])
    forces = []
    for _ in range(4000):
        shape = Shapes({"rear": 0.1 * random.standard_normal(COUNT)})
        forces.append(1.5 * (shape.commands("rear", at) / at - 1.0))  # thrust grows about with this power
    spread, correlation = np.std(forces, axis=0), np.corrcoef(np.transpose(forces))
    to_full = np.exp(-0.5 * ((1.0 - np.array(KNOTS)) / 0.3) ** 2)
    assert spread[:4] == pytest.approx(0.1 * np.sqrt(1.0 - to_full**2), rel=0.05)
    assert correlation[0, 1] == pytest.approx(np.exp(-0.5 * (0.15 / 0.3) ** 2), abs=0.03)
    assert correlation[0, 4] == pytest.approx(0.5, abs=0.05)


def test_a_shape_bends_the_command_beyond_its_dead_band_and_astern_only_where_that_is_not_exact() -> None:
    eta = {"rear": 0.1 * np.random.default_rng(5).standard_normal(COUNT)}
    bent, at = Shapes(eta, {"rear": (0.1, 0.2)}, frozenset()), np.array([0.1, 0.6, -0.2, -0.6, -0.1, 0.05])
    whole = Shapes(eta).commands("rear", at) - at
    share = np.array([0.0, 0.5 / 0.6, 0.0, 0.4 / 0.6, 0.0, 0.0])
    assert bent.commands("rear", at) == pytest.approx(at + share * whole)
    exact = Shapes(eta, exact_astern=frozenset({"rear"}))
    assert exact.commands("rear", at) == pytest.approx(at + whole * (at > 0.0))
    assert Shapes({"rear": -100.0 * abs(eta["rear"])}).commands("rear", np.array([0.5, 1.0])) == pytest.approx(
        [0.05, 1.0]
    )


def test_the_nearest_curve_of_a_quadratic_one_is_this_one_and_has_its_variance() -> None:
    """Ahead and astern, each beyond its dead band, also where the tests had weaker commands alone."""
    curve = Curve("main", ("a_t", "b_t", "a_t_reverse", "b_t_reverse", "c_0", "c_0_reverse"))

    def forces(c: np.ndarray) -> np.ndarray:
        ahead, astern = c - 0.08, -c - 0.12
        return np.where(c > 0.0, 20.0 * ahead * abs(ahead) + 5.0 * ahead, -15.0 * astern * abs(astern) - 3.0 * astern)

    names = ("a_t_main", "b_t_main"), ("a_t_main_reverse", "b_t_main_reverse")
    for quadratic, own, values in zip(
        nearest(curve, forces, (0.08, 0.12), 0.05, 0.1), names, ((20, 5), (15, 3)), strict=True
    ):
        assert quadratic.coefficients == pytest.approx(dict(zip(own, values, strict=True)))
        assert np.abs(quadratic.misfit).max() < 1e-9
        variances = np.einsum("ni,ij,nj->n", quadratic.terms, quadratic.covariance(0.04), quadratic.terms)
        assert np.mean(variances) == pytest.approx(0.04)


def test_a_shape_is_fitted_where_it_was_tested() -> None:
    """No other quadratic curve has smaller relative errors over the tested commands, (6)."""
    shape = Shapes({"rear": 0.1 * np.random.default_rng(5).standard_normal(COUNT)})
    commands = np.linspace(0.2, 0.7, 40)
    (curve,) = nearest(REAR, lambda c: shape.forces(VIDEORAY, REAR, c), (0.0, 0.0), 0.2, 0.7)
    found = dict(curve.coefficients)

    def error(coefficients: dict[str, float]) -> float:
        near = VIDEORAY.with_(**coefficients)
        off = NO_SHAPES.forces(near, REAR, commands) / shape.forces(VIDEORAY, REAR, commands) - 1.0
        return float(np.sqrt(np.mean(np.square(off))))

    assert error(found) < 0.05 < error({})
    for name, value in found.items():
        assert error({**found, name: 1.01 * value}) > error(found) < error({**found, name: 0.99 * value})


@pytest.mark.parametrize("power", [-0.7, -1e-9, 0.6])
@pytest.mark.parametrize("command", [0.5, -0.2])
def test_a_motion_with_another_power_of_drag(command: float, power: float) -> None:
    """SciPy integrates w from rest to 63 % of V_ss, where the drag is the thrust, and from V_ss to a tenth of it."""
    k, typical = extended(VIDEORAY, F_0_w=0.1, a_d_w_reverse=14.0), 0.3
    own, other = np.array([power, 0.5 * power]), np.zeros(2)
    powers = {"heave": (own, other, typical) if command > 0.0 else (other, own, typical)}
    many: dict[str, Any] = {name: np.full(2, value) for name, value in k.coefficients.items()}
    rovs = Vehicle(k.layout, many)
    motions, rest = (Shapes({}, powers=powers).motions(rovs, HEAVE, np.array([c])) for c in (command, 0.0))
    V, Tau = motions.response()
    (speed, _), (time, _), (way, _) = V[0], Tau[0], rest.stopping_distance(V, 0.1)[0]
    M, a = k["m_rov"] / k["beta_w"], k["a_d_w" if command > 0.0 else "a_d_w_reverse"]
    force = k["alpha_w"] * (k["a_t_top"] * abs(command) + k["b_t_top"]) * command + 0.1

    def drag(w: float) -> float:
        return float(a * abs(w) * w * max(abs(w), 1e-12) ** power / typical**power + k["b_d_w"] * w)

    def reached(_: float, x: np.ndarray) -> float:
        return float(abs(x[0]) - (1.0 - exp(-1.0)) * abs(speed))

    def stopped(_: float, x: np.ndarray) -> float:
        return float(abs(x[0]) - 0.1 * abs(speed))

    reached.terminal = stopped.terminal = True  # type: ignore[attr-defined]
    exact = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-12}
    starts = solve_ivp(lambda _, x: [(force - drag(x[0])) / M], (0.0, 60.0), [0.0], events=reached, **exact)
    stops = solve_ivp(lambda _, x: [-drag(x[0]) / M, abs(x[0])], (0.0, 60.0), [speed, 0.0], events=stopped, **exact)
    assert drag(speed) == pytest.approx(force, rel=1e-9)
    assert time == pytest.approx(starts.t_events[0][0], rel=1e-6)
    assert way == pytest.approx(stops.y_events[0][0][1], rel=1e-6)
    if abs(power) < 1e-6:
        plain, at_rest = (NO_SHAPES.motions(rovs, HEAVE, np.array([c])) for c in (command, 0.0))
        assert [V, Tau] == [pytest.approx(one, rel=1e-7) for one in plain.response()]
        assert way == pytest.approx(at_rest.stopping_distance(V, 0.1)[0, 0], rel=1e-7)


@pytest.mark.parametrize("power", [-0.5, -0.2, 0.0, 0.2, 1.0])
def test_no_drag_without_another_power_is_nearer(power: float) -> None:
    """Over the tested speeds, no other linear and quadratic drag has smaller relative errors. Neither is negative."""
    near = nearest_drag("heave", {"a": 20.0, "b": 3.0}, power, 0.3, 0.6)
    a, b = near.coefficients.values()
    v = np.linspace(0.15, 1.0, 40) * 0.6

    def error(a: float, b: float) -> float:
        return float(np.mean(((a * v + b) * v / ((20.0 * v * (v / 0.3) ** power + 3.0) * v) - 1.0) ** 2))

    assert np.mean(near.misfit**2) == pytest.approx(error(a, b), abs=1e-15)
    assert min(a, b) >= 0.0
    if power == 0.0:
        assert (a, b) == (20.0, 3.0)
    else:
        others = [(a + da, max(b + db, 0.0)) for da in (-0.1, 0.0, 0.1) for db in (-0.01, 0.0, 0.01) if da or db]
        assert all(error(*pair) >= error(a, b) for pair in others)
    drag = {"a": np.full(2, 20.0), "b": np.full(2, 3.0)}
    many = nearest_drag("heave", drag, np.array([power, 0.0]), 0.3, 0.6)
    assert [one.tolist() for one in many.coefficients.values()] == [pytest.approx([a, 20.0]), pytest.approx([b, 3.0])]
    assert many.misfit[:, 0] == pytest.approx(near.misfit)


@pytest.mark.parametrize("lag", get_args(Lag))
@pytest.mark.parametrize("command", [0.5, -0.5])
def test_a_measured_time_constant_contains_the_lag(command: float, lag: Lag) -> None:
    """SciPy integrates w, and the thrust or the speed of the rotor, from rest, beside a load, until 63 % of V_ss."""
    T, M, c_0 = 0.4, VIDEORAY["m_rov"] / VIDEORAY["beta_w"], 0.06
    k = extended(VIDEORAY, T_top=T, F_0_w=0.1, c_0_top=c_0)
    k = k.with_(replace(k.layout, curves=tuple(replace(one, lag=lag) for one in k.layout.curves)))
    beyond = float(np.copysign(abs(command) - c_0, command))

    def thrust(n: float) -> float:
        return float((k["a_t_top"] * abs(n) + k["b_t_top"]) * n)

    def rates(_: float, x: np.ndarray) -> list[float]:
        w, lagging = x
        drag = (k["a_d_w"] * abs(w) + k["b_d_w"]) * w
        F = lagging if lag == "force" else thrust(lagging)
        follows = thrust(beyond) if lag == "force" else beyond
        return [(k["alpha_w"] * F + 0.1 - drag) / M, (follows - lagging) / T]

    def reached(_: float, x: np.ndarray) -> float:
        return float(abs(x[0]) - (1.0 - exp(-1.0)) * abs(k.response(HEAVE, command)[0]))

    reached.terminal = True  # type: ignore[attr-defined]
    (time,) = solve_ivp(rates, (0.0, 60.0), [0.0, 0.0], "DOP853", events=reached, rtol=1e-10, atol=1e-12).t_events[0]
    row = TableRow("heave", HEAVE, "Tau", command, 1.0, 1.0)
    assert modelled([row], k, NO_SHAPES) == pytest.approx(time, rel=1e-5)
    assert modelled([row], k, NO_SHAPES, least_lag=T) == pytest.approx(k.response(HEAVE, command)[1])
