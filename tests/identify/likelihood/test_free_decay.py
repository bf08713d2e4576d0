"""A vehicle that slows down without thrust tells drag relative to inertia, with truth from DOP853."""

from collections.abc import Sequence
from itertools import pairwise
from math import log, sqrt
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rov_fmu.equation.catalogue import SURGE
from rov_fmu.identify.beginning import begin, load_tests
from rov_fmu.identify.identify import identify
from rov_fmu.identify.likelihood.fit import fit_all
from rov_fmu.identify.likelihood.posterior import QUANTILE
from rov_fmu.tank.arrays import Array

MASS, M, A, B = 11.5, 16.4, 30.0, 8.0
"""The mass, the whole inertia with the added mass (kg), and the drag (N.s2/m2, N.s/m)."""
A_T, B_T = 60.0, 5.0
"""The thrust (N)."""
Runs = Sequence[tuple[float, float]]
TIME: Array = np.arange(0.0, 10.05, 0.1)
HEAD = f"""
[vehicle]
name = "A"
identifier = "a"
version = "1"
description = "A vehicle of one axis"
source = "A simulation"
[body]
m_rov = {{ value = {MASS}, unit = "kg", source = "weighed" }}
[axes.surge]
"""
THRUSTER = f"""
[curves.t]
[[thruster]]
name = "t"
curve = "t"
direction = {{ value = [1, 0, 0], source = "a drawing" }}
[known]
a_t_t = {{ value = {A_T}, unit = "N", source = "the maker" }}
b_t_t = {{ value = {B_T}, unit = "N", source = "the maker" }}
"""


def motion(u_0: float, command: float = 0.0) -> tuple[Array, Array]:
    """Return u and x of M u' = a_t c² + b_t c - a |u| u - b u, x' = u; the command c acts from 1 s to 5 s."""

    def rates(t: float, y: Array) -> list[float]:
        thrust = A_T * abs(command) * command + B_T * command if 1.0 <= t < 5.0 else 0.0
        return [(thrust - A * abs(y[0]) * y[0] - B * y[0]) / M, y[0]]

    y = np.array([u_0, 0.0])
    found = [y]
    for start, end in pairwise(TIME):  # the command changes only between two of them
        y = solve_ivp(rates, (start, end - 1e-9), y, "DOP853", rtol=1e-10, atol=1e-12).y[:, -1]
        found.append(y)
    u, x = np.transpose(found)
    return u, x


def write(
    folder: Path, rov: str, quantity: str, runs: Sequence[tuple[float, float]], command: str = "command [%]"
) -> None:
    """Write a log for each velocity at the start and each command."""
    noise = np.random.default_rng(2)
    (folder / "rov.toml").write_text(rov, encoding="utf-8")
    for n, (u_0, c) in enumerate(runs, 1):
        u, x = motion(u_0, c)
        measured = (u if quantity.startswith("velocity") else x) + noise.normal(0.0, 0.005, len(TIME))
        commands = np.where((TIME >= 1.0 - 1e-6) & (TIME < 5.0 - 1e-6), 100.0 * c, 0.0)
        rows = np.column_stack([TIME, commands, measured])
        header = f"time [s],{command},{quantity}"
        np.savetxt(folder / f"log_surge_{n}.csv", rows, "%.6g", ",", header=header, comments="")


@pytest.mark.parametrize("quantity", ["velocity [m/s]", pytest.param("distance [m]", marks=pytest.mark.long)])
def test_drag_relative_to_inertia_follows_from_logs_without_thrust(quantity: str, tmp_path: Path) -> None:
    """The velocity at the start is free. Drag alone and inertia alone stay open, as a free decay does not tell them."""
    write(tmp_path, HEAD + THRUSTER, quantity, [(1.2, 0.0), (-1.0, 0.0)])
    tests = load_tests(tmp_path)
    assert [finding.kind for finding in tests.folder.findings] == ["free decay"] * 2
    known, logs, rows = begin(tests)
    posterior = fit_all(known, logs, rows).file.posterior
    table, S = posterior.table, posterior.covariance
    found = table.coefficients(posterior.z.tolist())
    inertia = table.index("inertia", "surge")
    for key, kind, true in (("a_d_u", "quadratic drag", A / M), ("b_d_u", "linear drag", B / M)):
        drag = table.index(kind, "surge")
        assert drag is not None
        assert inertia is not None
        deviation = sqrt(S[drag, drag] + S[inertia, inertia] - 2.0 * S[drag, inertia])
        assert deviation < 0.05
        assert abs(log(found[key] * found["beta_u"] / MASS / true)) < QUANTILE * deviation
        assert sqrt(S[drag, drag]) > 5.0 * deviation


def test_what_needs_thrust_is_not_known_where_nothing_tells_the_thrust(tmp_path: Path) -> None:
    """A vehicle without thrusters, whose loads are inputs, and no load in any log."""
    write(tmp_path, HEAD, "velocity [m/s]", [(1.2, 0.0), (-1.0, 0.0)], "X_ext [N]")
    result = identify(load_tests(tmp_path))
    (surge,) = result.axes
    assert surge.answers == ()
    assert "No steady velocity is determined." in surge.verdict.reasons
    assert result.vehicle.provenance
    assert any("slows down without thrust" in fact for fact in result.vehicle.provenance.facts)
    c = result.vehicle.coefficients
    assert c["a_d_u"] * c["beta_u"] / MASS == pytest.approx(A / M, rel=0.05)
    assert c["b_d_u"] * c["beta_u"] / MASS == pytest.approx(B / M, rel=0.05)


@pytest.mark.weekly
def test_a_log_with_thrust_beside_free_decays_gives_the_steady_velocity(tmp_path: Path) -> None:
    exact = HEAD + THRUSTER + "[priors]\nthrust = 0\n"
    write(tmp_path, exact, "velocity [m/s]", [(1.2, 0.0), (-1.0, 0.0), (0.8, 0.5)])
    (surge,) = identify(load_tests(tmp_path)).axes
    half = next(answer for answer in surge.answers if answer.command == 0.5)
    F = A_T * 0.25 + B_T * 0.5
    V, (low, high) = half.steady
    assert low < (sqrt(B * B + 4.0 * A * F) - B) / (2.0 * A) < high
    assert high - low < 0.1 * V
    assert surge.axis is SURGE
