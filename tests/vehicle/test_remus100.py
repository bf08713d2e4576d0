"""The REMUS 100 of the example moves as the equations of the thesis say, with the coefficients as it gives them."""

from math import cos, sin, tan
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rov_fmu.c.simulation import simulate
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.vehicles import at_rest

REMUS = load_vehicle(Path(__file__).parents[2] / "examples" / "remus100" / "remus100.toml")
W, B, m, z_g = 299.0, 306.0, 30.48, 0.0196
I_xx, I_yy, I_zz = 0.177, 3.45, 3.45


def rates(y: np.ndarray, prop: float, rudder: float, plane: float) -> list[float]:
    """Return the rates of u, v, w, p, q, r, x, y, z, phi, theta, psi: Prestero (2001), equations of motion."""
    u, v, w, p, q, r, _, _, _, phi, theta, psi = y
    X_udot, Y_vdot, Z_wdot, K_pdot, M_qdot, N_rdot = -0.93, -35.5, -35.5, -0.0141, -4.88, -4.88
    Y_rdot, Z_qdot = 1.93, -1.93
    X = -(W - B) * sin(theta) - 1.62 * u * abs(u) - 35.5 * w * q - 1.93 * q * q + 35.5 * v * r - 1.93 * r * r + prop
    Y = (W - B) * cos(theta) * sin(phi) - 131.0 * v * abs(v) + 0.632 * r * abs(r) - 28.6 * u * v
    Y += 5.22 * u * r + 35.5 * w * p + 1.93 * p * q + 9.64 * u * abs(u) * rudder
    Z = (W - B) * cos(theta) * cos(phi) - 131.0 * w * abs(w) - 0.632 * q * abs(q) - 28.6 * u * w
    Z += -5.22 * u * q - 35.5 * v * p + 1.93 * r * p - 9.64 * u * abs(u) * plane
    K = -z_g * W * cos(theta) * sin(phi) - 0.0013 * p * abs(p)
    M = -z_g * W * sin(theta) + 3.18 * w * abs(w) - 9.4 * q * abs(q) + 24.0 * u * w - 2.0 * u * q
    M += -1.93 * v * p + 4.8659 * r * p - 0.638 * 9.64 * u * abs(u) * plane
    N = -3.18 * v * abs(v) - 9.4 * r * abs(r) - 24.0 * u * v - 2.0 * u * r
    N += -1.93 * w * p - 4.8659 * p * q - 0.638 * 9.64 * u * abs(u) * rudder
    right = [
        X - m * (w * q - v * r + z_g * p * r),
        Y - m * (u * r - w * p + z_g * q * r),
        Z - m * (v * p - u * q - z_g * (p * p + q * q)),
        K - (I_zz - I_yy) * q * r + m * z_g * (u * r - w * p),
        M - (I_xx - I_zz) * r * p - m * z_g * (w * q - v * r),
        N - (I_yy - I_xx) * p * q,
    ]
    mass = np.diag([m - X_udot, m - Y_vdot, m - Z_wdot, I_xx - K_pdot, I_yy - M_qdot, I_zz - N_rdot])
    mass[0, 4] = mass[4, 0] = m * z_g
    mass[1, 3] = mass[3, 1] = -m * z_g
    mass[1, 5] = mass[5, 1] = -Y_rdot
    mass[2, 4] = mass[4, 2] = -Z_qdot
    c1, s1, c2, s2, c3, s3 = cos(phi), sin(phi), cos(theta), sin(theta), cos(psi), sin(psi)
    return [
        *np.linalg.solve(mass, right),
        u * c3 * c2 + v * (c3 * s2 * s1 - s3 * c1) + w * (c3 * s2 * c1 + s3 * s1),
        u * s3 * c2 + v * (s3 * s2 * s1 + c3 * c1) + w * (s3 * s2 * c1 - c3 * s1),
        -u * s2 + v * c2 * s1 + w * c2 * c1,
        p + (q * s1 + r * c1) * tan(theta),
        q * c1 - r * s1,
        (q * s1 + r * c1) / c2,
    ]


@pytest.mark.parametrize(("rudder", "plane"), [(-0.2, 0.0), (0.1, -0.15), (0.0, 0.3)])
def test_it_moves_as_the_thesis_says(rudder: float, plane: float) -> None:
    angle, start = REMUS["angle_max_rudder"], {"u": 1.5}
    inputs = {"u_prop": 1.0, "u_rudder": rudder, "u_plane": plane}
    names = ["u", "v", "w", "p", "q", "r", "x", "y", "z", "phi", "theta", "psi"]
    found = simulate(REMUS, np.array([0.0, 20.0]), {**inputs, **at_rest(REMUS), **start}, names).values[:, 0, 1]
    y = np.zeros(12)
    y[0] = start["u"]
    end = solve_ivp(
        lambda _, y: rates(y, 3.86, angle * rudder, angle * plane), (0.0, 20.0), y, "DOP853", rtol=1e-11, atol=1e-12
    ).y[:, -1]
    assert found == pytest.approx(end, abs=1e-7)
    assert max(abs(found[9:])) > 0.5
