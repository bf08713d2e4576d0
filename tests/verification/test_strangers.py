"""The gate of strangers: its simulator obeys the law, and every stranger breaks it."""

from dataclasses import replace
from math import exp, log, sqrt

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from verification.identification.strangers.drawn import draw
from verification.identification.strangers.kinds import AS_MODELLED, STRANGERS, Kind
from verification.identification.strangers.water import (
    DRIVEN,
    HEAVE,
    ROW,
    SURGE,
    SWAY,
    YAW,
    Array,
    Water,
    flown,
)


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


@pytest.mark.parametrize("axis", [SURGE, YAW])
def test_answers_are_those_in_closed_form(axis: int) -> None:
    drawn = draw(8, 2, AS_MODELLED)
    b, commands = drawn.body, [0.4, -0.7]
    arm = b.arm if axis == YAW else 1.0
    for command_, (V, rise, way) in zip(commands, drawn.truth(axis, commands).T.tolist(), strict=True):
        pair = DRIVEN[axis, :2] * command_
        F = abs(b.full * arm * float(np.sum(DRIVEN[axis, :2] * b.goal(pair))))
        lost = b.full * arm**2 * b.loss * abs(command_) * float(np.sum(b.directed(pair)))
        ratio, M = b.astern[axis] if command_ < 0.0 else 1.0, b.inertia[axis]
        a, c = ratio * b.quadratic[axis], ratio * b.linear[axis]
        speed = (sqrt((c + lost) ** 2 + 4.0 * a * F) - (c + lost)) / (2.0 * a)
        tau, _ = quad(lambda v, F=F, c=c + lost, a=a, M=M: M / (F - (c + a * v) * v), 0.0, (1.0 - exp(-1.0)) * speed)
        assert np.copysign(speed, command_) == pytest.approx(V, rel=1e-4)
        assert (rise, way) == pytest.approx((tau, M / a * log((a * speed + c) / (0.1 * a * speed + c))), rel=2e-3)


def _rates(kind: Kind, random: np.random.Generator) -> Array:
    """Return the motion of a kind at some states and commands."""
    water = Water(replace(draw(5, 4, kind).body, coupled=True), kind.act)
    y, commands = random.uniform(-1.0, 1.0, (16, 50)), random.uniform(-1.0, 1.0, (4, 50))
    return water.rates(np.full(50, 40.0), y, commands)


@pytest.mark.parametrize("kind", STRANGERS, ids=lambda kind: kind.name)
def test_every_stranger_breaks_the_law(kind: Kind) -> None:
    random = np.random.default_rng(1)
    commands = random.uniform(-1.0, 1.0, (100, 4, 2))
    columns = {axis: random.uniform(-1.0, 1.0, (100, 2)) for axis in (SURGE, SWAY, HEAVE, YAW)}
    shown = {axis: values.copy() for axis, values in columns.items()}
    kind.shown(shown, random)
    with_law = _rates(replace(kind, act=AS_MODELLED.act), np.random.default_rng(2))
    differences = (
        not np.allclose(_rates(kind, np.random.default_rng(2)), with_law),
        not np.array_equal(kind.followed(commands), commands),
        any(not np.array_equal(shown[axis], values) for axis, values in columns.items()),
        kind.has_hidden_sway,
    )
    assert sum(differences) == 1
