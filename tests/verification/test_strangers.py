"""The gate of strangers: its simulator obeys the law."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from verification.identification.strangers.drawn import draw
from verification.identification.strangers.kinds import AS_MODELLED
from verification.identification.strangers.water import ROW, Array, flown


def test_a_vehicle_as_modelled_moves_as_the_law_written_out() -> None:
    """The law in scalars, integrated by DOP853 between the rows, is an independent truth."""
    drawn = draw(3, 4, AS_MODELLED)
    b, commands = drawn.body, np.array([[0.6, 0.2, -0.5, 0.4], [0.6, 0.2, -0.5, 0.4], [-0.3, 0.5, 0.5, 0.0]])
    rows = np.repeat(commands, [5, 5, 10], axis=0)

    def rates(_: float, y: Array, c: Array) -> list[float]:
        u, v, w, r, _, _, _, psi, *F = y
        Mu, Mv, Mw, Ir = b.inertia
        advance = (u + b.arm * r, u - b.arm * r, v, w)
        T = []
        goals = []
        for force, asked, along in zip(F, c, advance, strict=True):
            beyond = max(abs(asked) - b.dead_band, 0.0) / (1.0 - b.dead_band)
            direction, sign = (b.reverse, -1.0) if asked < 0.0 else (1.0, 1.0)
            goals.append(sign * direction * beyond**2)
            T.append(b.full * (force - b.loss * abs(asked) * direction * along))
        X, Y, Z, N = T[0] + T[1], T[2], T[3] + b.load, b.arm * (T[0] - T[1])
        D = [
            (b.astern[n] if x < 0.0 else 1.0) * (b.quadratic[n] * abs(x) + b.linear[n]) * x
            for n, x in enumerate((u, v, w, r))
        ]
        moved = [u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi), w, r]
        pushed = [(X - D[0] + Mv * v * r) / Mu, (Y - D[1] - Mu * u * r) / Mv, (Z - D[2]) / Mw]
        turned = (N - D[3] + (Mu - Mv) * u * v) / Ir
        return [*pushed, turned, *moved, *((goal - force) / b.lag for goal, force in zip(goals, F, strict=True))]

    y = np.zeros(12)
    y[6:8] = 2.0, 0.3
    for row in rows[:-1]:
        y = solve_ivp(rates, (0.0, ROW), y, "DOP853", args=(row,), rtol=1e-9, atol=1e-11).y[:, -1]
    found = flown(drawn.water, rows[:, :, None], np.zeros(1), np.array([0.3]), 2.0)
    assert found[-1, :12, 0] == pytest.approx(y, rel=1e-4, abs=1e-4)
