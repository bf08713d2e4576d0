"""The motion of one axis alone, and the quadratic drag that a vehicle file has."""

from dataclasses import replace
from math import exp
from typing import Any, get_args

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rov_fmu.equation.catalogue import HEAVE, Lag
from rov_fmu.identify.likelihood.curves import QUADRATIC_DRAG, Drags, nearest_drag
from rov_fmu.identify.likelihood.objective import TableRow, modelled
from rov_fmu.vehicle.vehicle import Vehicle
from tests.vehicles import VIDEORAY, extended

REAR, _ = VIDEORAY.layout.curves


@pytest.mark.parametrize("power", [-0.7, -1e-9, 0.6])
@pytest.mark.parametrize("command", [0.5, -0.2])
def test_a_motion_with_another_power_of_drag(command: float, power: float) -> None:
    """SciPy integrates w from rest to 63 % of V_ss, where the drag is the thrust, and from V_ss to a tenth of it."""
    k, typical = extended(VIDEORAY, F_0_w=0.1, a_d_w_reverse=14.0), 0.3
    own, other = np.array([power, 0.5 * power]), np.zeros(2)
    powers = {"heave": (own, other, typical) if command > 0.0 else (other, own, typical)}
    many: dict[str, Any] = {name: np.full(2, value) for name, value in k.coefficients.items()}
    rovs = Vehicle(k.layout, many)
    motions, rest = (Drags(powers).motions(rovs, HEAVE, np.array([c])) for c in (command, 0.0))
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
        plain, at_rest = (QUADRATIC_DRAG.motions(rovs, HEAVE, np.array([c])) for c in (command, 0.0))
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
    assert modelled([row], k, QUADRATIC_DRAG) == pytest.approx(time, rel=1e-5)
    assert modelled([row], k, QUADRATIC_DRAG, least_lag=T) == pytest.approx(k.response(HEAVE, command)[1])
