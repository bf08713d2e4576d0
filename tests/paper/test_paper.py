"""The FMU of the VideoRay Pro 4 against the paper that it comes from: Tables 6 to 9, and the equations (1) to (18).

Enevoldsen, Einarsson, Pedersen, Yang: "Simplified Modelling and Identification of an Inspection ROV" (2018). Only FMPy
calls the FMU here; the equations are written out as the paper prints them, and integrated by SciPy. Commands are
fractions (the paper prints per cent). u, w and r are the velocities in surge, heave (down) and yaw.
"""

from collections.abc import Callable, Iterator
from itertools import product
from math import e, log, sin, sqrt
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

Values = dict[str, float]
Run = Callable[[Values, float, list[str]], list[float]]

# ---- The FMU ---------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def run(videoray_dir: Path) -> Iterator[Run]:
    """Return a function: with these parameters, inputs and states at the start, the variables after a time (s)."""
    description = fmpy.read_model_description(str(videoray_dir))
    place = {variable.name: variable.valueReference for variable in description.modelVariables}
    fmu = FMU2Slave(
        guid=description.guid,
        unzipDirectory=str(videoray_dir),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="paper",
    )
    fmu.instantiate()

    def after(values: Values, time: float, names: list[str]) -> list[float]:
        fmu.reset()
        fmu.setupExperiment(startTime=0.0)
        fmu.setReal([place[name] for name in values], [*values.values()])
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        if time:
            fmu.doStep(currentCommunicationPoint=0.0, communicationStepSize=time)
        return list(fmu.getReal([place[name] for name in names]))

    yield after
    fmu.freeInstance()


# ---- Table 9 ---------------------------------------------------------------------------------------------------------

TABLE_9 = {
    **{"a_t_top": 6.494, "b_t_top": 0.0513},  # F_t
    **{"a_t_rear": 42.9, "b_t_rear": 2.711},  # F_r + F_l
    **{"a_d_u": 3.159, "b_d_u": 9.379},  # F_d^u
    **{"a_d_w": 18.72, "b_d_w": 0.6324},  # F_d^w
    **{"a_d_r": 0.1246, "b_d_r": 0.103},  # tau_d^r
    **{"m_rov": 6.57, "I_r": 0.105, "R": 0.22, "gamma": 0.423},
    **{"beta_u": 1.0, "alpha_u": 1.1, "beta_w": 0.59, "alpha_w": 1.14, "beta_r": 0.12, "alpha_r": 1.2},
}
WHOLE = {"health_l": 1.0, "health_r": 1.0, "health_t": 1.0}
"""The paper's thrusters are whole."""
NON_LINEAR = dict.fromkeys([name for name in TABLE_9 if name.startswith(("alpha", "beta"))], 1.0)
"""The "non-linear model" of the paper has no tuning parameters; its "scaled model" has those of Table 9."""
SCALED: Values = {}


def test_table_9_is_the_start_of_all_parameters(run: Run, videoray_dir: Path) -> None:
    description = fmpy.read_model_description(str(videoray_dir))
    started = {v.name: float(v.start) for v in description.modelVariables if v.causality == "parameter"}
    assert started == TABLE_9 | WHOLE
    assert run({}, 0.0, [*TABLE_9]) == [*TABLE_9.values()]


# ---- Equations (1)-(16): forces, and what follows from them at one moment or at rest ---------------------------------

m_rov, I_r, R, gamma = (TABLE_9[name] for name in ("m_rov", "I_r", "R", "gamma"))
AXES = {"u": m_rov, "w": m_rov, "r": I_r}
"""The velocity and the inertia of each axis."""
SPEEDS = (-0.8, -0.2, 0.05, 0.4, 1.3)
COMMANDS = (-0.9, -0.3, 0.2, 0.5, 1.0)


def drag(axis: str, v: float) -> float:
    """(1): F_d = a_d |v| v + b_d v, with the coefficients of (14), (15) and (16)."""
    a_d, b_d = {"u": (3.159, 9.379), "w": (18.72, 0.6324), "r": (0.1246, 0.103)}[axis]
    return a_d * abs(v) * v + b_d * v


def rear(u: float) -> float:
    """(2) and (9): F_l + F_r = 42.9 |u_rear| u_rear + 2.711 u_rear. Each of the two gives half of it."""
    return 42.9 * abs(u) * u + 2.711 * u


def top(u: float) -> float:
    """(2) and (10): F_t = 6.494 |u_t| u_t + 0.0513 u_t."""
    return 6.494 * abs(u) * u + 0.0513 * u


def test_6_7_least_squares_of_the_thrust_give_its_coefficients(run: Run) -> None:
    """min over a_t, b_t of the sum of W_k (F_ss,k - F_hat_ss,k)²; W_k is 1 in (6). The forces are those of the FMU."""
    u = np.linspace(0.1, 1.0, 10)
    for name, count, fitted in (("u_l", 2.0, (42.9, 2.711)), ("u_t", 1.0, (6.494, 0.0513))):
        F_ss = count * np.array([run({name: command}, 0.0, [f"F_{name[-1]}"])[0] for command in u])
        for W in (np.ones(10), np.where(u < 0.75, 1.0 / u, 0.0)):
            A = np.column_stack([np.abs(u) * u, u]) * np.sqrt(W)[:, None]
            assert np.linalg.lstsq(A, np.sqrt(W) * F_ss)[0] == pytest.approx(fitted, rel=1e-12)


def test_1_to_5_9_10_14_to_16_thrust_and_drag_accelerate_each_axis(run: Run) -> None:
    """(3a) m u' = F_r + F_l - F_d^u, (3b) m w' = F_t - F_d^w, (4) I_r r' = F_l R sin γ + F_r R sin(-γ) - tau_d^r.

    With opposite commands (4) is (5). The coupling f, g and h is ignored, as in the paper.
    """
    for (u_l, u_r), u_t, v in product(product(COMMANDS, repeat=2), (-0.3, 0.5), SPEEDS):
        start = {**NON_LINEAR, "u_l": u_l, "u_r": u_r, "u_t": u_t, "u": v, "w": -v, "r": 2.0 * v}
        F_l, F_r, F_t = 0.5 * rear(u_l), 0.5 * rear(u_r), top(u_t)
        tau = F_l * R * sin(gamma) + F_r * R * sin(-gamma)
        forces = [F_r + F_l - drag("u", v), F_t - drag("w", -v), tau - drag("r", 2.0 * v)]
        found = run(start, 0.0, ["F_l", "F_r", "F_t", "tau_rear", "der(u)", "der(w)", "der(r)"])
        accelerations = [force / inertia for force, inertia in zip(forces, AXES.values(), strict=True)]
        assert found == pytest.approx([F_l, F_r, F_t, tau, *accelerations], rel=1e-12, abs=1e-12)


def test_8_the_fit_that_the_paper_does_not_use_is_that_of_the_other_coefficients(run: Run) -> None:
    for u in COMMANDS:
        F_l, F_r = run({"a_t_rear": 100.3, "b_t_rear": -27.09, "u_l": u, "u_r": u}, 0.0, ["F_l", "F_r"])
        assert F_l + F_r == pytest.approx(100.3 * abs(u) * u - 27.09 * u, rel=1e-13)


def commanded(axis: str, u: float) -> Values:
    """The commands of a test of the paper: both rear thrusters ahead, the top thruster, both rear thrusters opposed."""
    return {"u": {"u_l": u, "u_r": u}, "w": {"u_t": u}, "r": {"u_l": u, "u_r": -u}}[axis]


def thrust(axis: str, u: float) -> float:
    """The force or the torque of these commands."""
    return {"u": rear(u), "w": top(u), "r": R * sin(gamma) * rear(u)}[axis]


# ---- Equations (17) and (18): motion ---------------------------------------------------------------------------------


def law_18(_: float, y: np.ndarray, u_l: float, u_r: float, u_t: float) -> list[float]:
    """(18a-c): inertia times acceleration is β (α thrust - drag)."""
    u, w, r = y
    u_dot = 1.0 * (1.1 * 0.5 * (rear(u_l) + rear(u_r)) - drag("u", u)) / m_rov
    w_dot = 0.59 * (1.14 * top(u_t) - drag("w", w)) / m_rov
    r_dot = 0.12 * (1.2 * R * sin(gamma) * 0.5 * (rear(u_l) - rear(u_r)) - drag("r", r)) / I_r
    return [u_dot, w_dot, r_dot]


def test_18_the_scaled_model_moves_as_its_equations_integrated_by_dop853(run: Run) -> None:
    y, start = np.zeros(3), SCALED
    for *commands, time in ((0.7, 0.3, 0.5, 2.0), (-0.5, 0.6, -0.8, 1.5), (0.0, 0.0, 0.0, 4.0), (1.0, -1.0, 0.1, 3.0)):
        y = solve_ivp(law_18, (0.0, time), y, "DOP853", args=commands, rtol=1e-12, atol=1e-14).y[:, -1]
        values = run({**start, **dict(zip(("u_l", "u_r", "u_t"), commands, strict=True))}, time, [*"uwr"])
        assert values == pytest.approx(y, rel=1e-8, abs=1e-10)
        start = dict(zip("uwr", values, strict=True))


def steady_and_tau(run: Run, model: Values, axis: str, u: float) -> tuple[float, float]:
    """V_ss of the FMU from rest, and its Tau by (17): the time at (1 - 1/e) V_ss."""
    given = {**model, **commanded(axis, u)}
    (V_ss,) = run(given, 500.0, [axis])
    return V_ss, float(brentq(lambda t: run(given, t, [axis])[0] - (1.0 - 1.0 / e) * V_ss, 0.0, 50.0, xtol=1e-13))


def test_17_tau_is_read_from_a_step_response_as_from_a_recording(run: Run, videoray_dir: Path) -> None:
    """The step response is that of FMPy's simulate_fmu."""
    recorded = fmpy.simulate_fmu(str(videoray_dir), start_values={"u_t": 0.3}, stop_time=20.0, output_interval=0.01)
    read = float(np.interp((1.0 - 1.0 / e) * recorded["w"][-1], recorded["w"], recorded["time"]))
    assert read == pytest.approx(steady_and_tau(run, SCALED, "w", 0.3)[1], abs=1e-4)


def closed_form(model: Values, axis: str, u: float) -> tuple[float, float]:
    """V_ss and Tau of (18) from rest by hand: a_d V² + b_d V = αF, as in (11) to (13), and a Riccati equation."""
    alpha, beta = ((TABLE_9 | model)[f"{name}_{axis}"] for name in ("alpha", "beta"))
    a_d, b_d = TABLE_9[f"a_d_{axis}"], TABLE_9[f"b_d_{axis}"]
    root = sqrt(b_d**2 + 4.0 * a_d * alpha * thrust(axis, u))
    V, other = (root - b_d) / (2.0 * a_d), (root + b_d) / (2.0 * a_d)
    return V, AXES[axis] / (beta * root) * (1.0 + log(1.0 + (1.0 - 1.0 / e) * V / other))


# ---- Tables 6, 7 and 8 -----------------------------------------------------------------------------------------------

# For each axis and command in per cent, for V_ss and Tau of the non-linear and of the scaled model: what the paper
# prints, what follows from Table 9, and by how many per cent that is more. Printed values are never tuned to. The V_ss
# agree to their digits (0.39 and 0.42 are cut off, not rounded), but for 20, 30 and 50 % of the scaled yaw: no alpha_r
# gives these and 70 %. The paper does not tell how it read Tau. Table 8 is lost: there, measured V_ss stand instead.
TABLES = """
        non-linear V_ss    Tau               scaled V_ss        Tau
w  20   0.10 0.1044  4.4   1.76 2.012 14.3   0.11 0.1124   2.2  3.08 3.211  4.2   Table 6, heave
w  30   0.16 0.1629  1.8   1.33 1.387  4.3   0.17 0.1750   2.9  2.23 2.209 -0.9
w  50   0.28 0.2804  0.1   0.80 0.854  6.8   0.30 0.3005   0.2  1.40 1.359 -2.9
w  70   0.39 0.3981  2.1   0.58 0.617  6.4   0.42 0.4261   1.5  1.04 0.981 -5.7
r  20   0.93 0.9311  0.1   0.39 0.404  3.6   1.10 1.0478  -4.7  3.08 3.130  1.6   Table 7, yaw
r  30   1.47 1.4731  0.2   0.29 0.299  3.2   1.61 1.6449   2.2  2.23 2.305  3.4
r  50   2.57 2.5744  0.2   0.19 0.196  3.2   2.82 2.8544   1.2  1.46 1.503  3.0
r  70   3.68 3.6833  0.1   0.14 0.146  4.0   4.07 4.0705   0.0  1.10 1.114  1.3
u  20   0.31 0.2239 -27.8  -    0.635  -     0.31 0.2447 -21.1  -    0.630  -     Table 8, surge (measured)
u  30   0.47 0.4347 -7.5   -    0.584  -     0.47 0.4729   0.6  -    0.576  -
u  40   0.69 0.6880 -0.3   -    0.532  -     0.69 0.7452   8.0  -    0.522  -
u  50   0.86 0.9707 12.9   -    0.485  -     0.86 1.0474  21.8  -    0.473  -
u  60   1.14 1.2737 11.7   -    0.443  -     1.14 1.3700  20.2  -    0.431  -
u  70   1.47 1.5910  8.2   -    0.406  -     1.47 1.7068  16.1  -    0.394  -
"""
ROWS = [(line.split()[0], int(line.split()[1]), line.split()[2:14]) for line in TABLES.splitlines()[2:]]


@pytest.mark.parametrize(("axis", "command", "cells"), ROWS)
def test_tables_6_7_8_by_the_fmu(axis: str, command: int, cells: list[str], run: Run) -> None:
    for model, some in ((NON_LINEAR, cells[:6]), (SCALED, cells[6:])):
        u = command / 100.0
        found = steady_and_tau(run, model, axis, u)
        assert found == pytest.approx(closed_form(model, axis, u), rel=1e-11)
        for value, printed, computed, more in zip(found, some[::3], some[1::3], some[2::3], strict=True):
            assert f"{value:.{len(computed) - 2}f}" == computed
            if printed != "-":
                assert 100.0 * (value / float(printed) - 1.0) == pytest.approx(float(more), abs=0.051)
