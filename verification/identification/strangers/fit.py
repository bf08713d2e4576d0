"""How far the best fit of the law is from the truth of a vehicle, without the product.

The law is fitted to what the sensor of an axis shows, without noise, by least squares. The commands, the thrust at
rest, and the motion along the other axes are exact.
"""

from dataclasses import replace
from functools import cached_property

import numpy as np
from scipy.optimize import least_squares

from verification.identification.strangers.drawn import Drawn
from verification.identification.strangers.water import (
    DRIVEN,
    HEAVE,
    ROW,
    SURGE,
    SWAY,
    YAW,
    Array,
    Body,
    Moment,
    Water,
    answers,
)

_HALF = 0.5 * ROW
"""The step of the fit, s."""
_FREE = 7
"""The parameters: ln of quadratic and linear drag, inertia, drag astern and lag, then the loss, and the load relative
to the full thrust."""
_LOW, _HIGH = np.array([-4.0, -5.0, -2.0, -1.0, -3.0, 0.0, -0.2]), np.array([3.0, 3.0, 2.0, 1.0, 3.0, 2.0, 0.2])
_PRIOR = 0.002
"""The weight of the distance from the true numbers, so that what no dive shows does not run away, m/s or rad/s."""
_DIFFERENCE = 1e-4


class _Axis:
    """One axis of a vehicle in its dives, with what the law says about it."""

    def __init__(self, drawn: Drawn, axis: int) -> None:
        self.drawn, self.axis, self.body = drawn, axis, drawn.body
        b, self.commands = drawn.body, drawn.kind.wired(drawn.commands)
        self.effect = b.places[axis][:, None]
        flat = drawn.water.bench(self.commands.transpose(1, 0, 2).ravel())
        self.thrust = flat.reshape(4, len(self.commands), -1).transpose(1, 0, 2)
        lost = b.full * np.abs(self.commands) * b.directed(self.commands)
        velocity = drawn.motion[:, :4]
        others = velocity.copy()
        others[:, axis] = 0.0
        sideways = np.einsum("aj,nad->njd", b.places, others)
        self.own = np.sum(self.effect**2 * lost, axis=1)
        self.advance = (
            np.sum(self.effect * lost * sideways, axis=1),
            np.sum(self.effect * lost * np.roll(sideways, -1, axis=0), axis=1),
        )
        u, v, _, r = velocity.transpose(1, 0, 2)
        Mu, Mv = b.inertia[SURGE], b.inertia[SWAY]
        turned = {SURGE: Mv * v * r, SWAY: -Mu * u * r, HEAVE: 0.0 * u, YAW: (Mu - Mv) * u * v}[axis]
        self.turned = turned if drawn.count == 4 else 0.0 * turned

    @cached_property
    def shown(self) -> Array:
        """The velocity that the sensor shows at each row, or between it and the next one."""
        values = self.drawn.columns[self.axis]
        return values[:-1] if self.axis in (SURGE, SWAY) else np.diff(values, axis=0) / ROW

    @property
    def begin(self) -> Array:
        """The parameters of the law with the true numbers."""
        load = self.body.load / self.body.full if self.axis == HEAVE else 0.0
        return np.array([0.0, 0.0, 0.0, 0.0, 0.0, self.body.loss, load])

    def numbers(self, x: Array) -> Body:
        """Return the vehicle with the parameters."""
        b, one = self.body, np.arange(4) == self.axis
        factors = np.exp(np.where(one[:, None], x[:5], 0.0)).T
        quadratic, linear, inertia, astern, _ = factors
        return replace(
            b,
            quadratic=b.quadratic * quadratic,
            linear=b.linear * linear,
            inertia=b.inertia * inertia,
            astern=b.astern * astern,
            lag=b.lag * float(np.exp(x[4])),
            loss=float(x[5]),
            load=float(x[6]) * b.full if self.axis == HEAVE else 0.0,
        )

    def velocities(self, x: Array) -> Array:
        """Return what the sensor shows by the law, rows x dives x k, for k sets of parameters, 7 x k."""
        b, n = self.body, self.axis
        a, linear, M, astern = (
            getattr(b, name)[n] * np.exp(row)
            for name, row in zip(("quadratic", "linear", "inertia", "astern"), x[:4], strict=True)
        )
        lag, loss = b.lag * np.exp(x[4]), x[5]
        load = x[6] * b.full if n == HEAVE else 0.0 * x[6]
        kept = np.exp(-0.5 * _HALF / lag)
        dives = self.thrust.shape[2]
        v, arrived, found = np.zeros((dives, x.shape[1])), np.zeros((dives, x.shape[1])), []
        push = np.sum(self.effect * self.thrust, axis=1)
        for row in range(len(push) - 1):
            goal, own = push[row][:, None], loss * self.own[row][:, None]
            before, after = loss * self.advance[0][row][:, None], loss * self.advance[1][row][:, None]
            first, last = self.turned[row][:, None], self.turned[row + 1][:, None]

            def rate(
                part: float,
                v: Array,
                F: Array,
                own: Array = own,
                ends: tuple[Array, Array] = (first - before, last - after),
            ) -> Array:
                other = (1.0 - part) * ends[0] + part * ends[1]
                drag = np.where(v < 0.0, astern, 1.0) * (a * np.abs(v) + linear) * v
                return np.asarray((F - own * v + other - drag + load) / M)

            way, start = 0.0 * v, v
            for half in (0.0, 0.5):
                F0 = arrived
                F1 = goal + (F0 - goal) * kept
                F2 = goal + (F1 - goal) * kept
                k1 = rate(half, v, F0)
                k2 = rate(half + 0.25, v + 0.5 * _HALF * k1, F1)
                k3 = rate(half + 0.25, v + 0.5 * _HALF * k2, F1)
                k4 = rate(half + 0.5, v + _HALF * k3, F2)
                way = way + _HALF * v + _HALF**2 / 6.0 * (k1 + k2 + k3)
                v, arrived = v + _HALF / 6.0 * (k1 + 2.0 * (k2 + k3) + k4), F2
            found.append(start if n in (SURGE, SWAY) else way / ROW)
        return np.array(found)

    def best(self) -> Array:
        """Return the parameters of the best fit."""
        steps = _DIFFERENCE * np.eye(_FREE)
        last: dict[bytes, tuple[Array, Array]] = {}

        def both(x: Array) -> tuple[Array, Array]:
            if x.tobytes() not in last:
                all_ = self.velocities(np.column_stack([x, x[:, None] + steps])).reshape(-1, 1 + _FREE)
                off = np.concatenate([all_[:, 0] - self.shown.ravel(), _PRIOR * (x - self.begin)])
                slopes = (all_[:, 1:] - all_[:, :1]) / _DIFFERENCE
                last.clear()
                last[x.tobytes()] = off, np.vstack([slopes, _PRIOR * np.eye(_FREE)])
            return last[x.tobytes()]

        begin = np.clip(self.begin, _LOW + 1e-6, _HIGH - 1e-6)
        found = least_squares(
            lambda x: both(x)[0], begin, lambda x: both(x)[1], bounds=(_LOW, _HIGH), ftol=1e-5, max_nfev=25
        )
        return np.asarray(found.x)


def answers_of_fit(drawn: Drawn, axis: int, commands: list[float]) -> Array:
    """Return V_ss, time and stopping distance by the best fit of the law, 3 x n."""
    one = _Axis(drawn, axis)
    asked = DRIVEN[axis][:, None] * np.array(commands)
    goal = drawn.water.bench(asked.ravel()).reshape(asked.shape) / drawn.body.full

    def as_pulled(m: Moment, _: Body) -> None:
        m.goal = np.where(m.command == 0.0, 0.0, goal)

    return answers(Water(one.numbers(one.best()), as_pulled), axis, asked, 0.0)
