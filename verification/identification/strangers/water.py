"""The motion of a vehicle in water, by Runge-Kutta steps of fourth order, for several runs at once.

It imports nothing of the product. The law is the one that the product has: a force of each thruster that lags behind
its command, loses with the speed of advance, linear and quadratic drag, a constant inertia, and perhaps Coriolis and
Munk terms. A stranger is a function that changes what the law says at one moment.

Arrays have a row for each axis or thruster, and a column for each of n runs.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import exp
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

AXES = ("surge", "sway", "heave", "yaw")
SURGE, SWAY, HEAVE, YAW = range(4)
THRUSTERS = ("port", "stbd", "lat", "vert")
DRIVEN = np.array([[1.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0], [1.0, -1.0, 0.0, 0.0]])
"""4 x 4: the command of each thruster for a full command along each axis."""
ROW, STEP = 0.1, 0.05
"""The time between two rows of a log, and the step within it, s."""
_FINE = (0.02, 0.02, 0.02, 0.01)
"""The step of the answers of each axis, s."""
_LONGEST = 60.0
"""The longest time of an answer, s."""


@dataclass(frozen=True, eq=False)
class Body:
    """The numbers of a vehicle. Those with 4 entries have one for each axis."""

    mass: float
    turning: float
    """The mass, and the moment of inertia about the vertical axis, both in air."""
    inertia: Array
    """4: with added mass."""
    quadratic: Array
    linear: Array
    astern: Array
    """4: the factor of the drag at a negative velocity."""
    top: Array
    """4: about the speed at full command, m/s and rad/s."""
    load: float
    """The constant force in heave, N."""
    arm: float
    """How far port and starboard are from the middle, m."""
    full: float
    """The force of a thruster at full command, N."""
    reverse: float
    """The factor of the force for a negative command."""
    dead_band: float
    loss: float
    """The share of the full thrust that is lost per speed of advance at full command, s/m."""
    lag: float
    """s."""
    coupled: bool
    """True with Coriolis and Munk terms."""
    reach: float = 1.0
    """The arm of port and starboard relative to the one that rov.toml gives."""
    ahead: float = 0.0
    """How far the lateral thruster is ahead of the middle, which rov.toml gives, m."""

    @property
    def places(self) -> Array:
        """4 x 4: the effect of the force of each thruster along each axis."""
        effects = DRIVEN * np.array([1.0, 1.0, 1.0, self.reach * self.arm])[:, None]
        effects[YAW, 2] = self.ahead
        return np.asarray(effects)

    def goal(self, command: Array) -> Array:
        """Return the steady force at rest for each command, relative to that of full command."""
        beyond = np.maximum(np.abs(command) - self.dead_band, 0.0) / (1.0 - self.dead_band)
        return np.asarray(np.sign(command) * beyond**2 * self.directed(command))

    def directed(self, command: Array) -> Array:
        """Return the factor of the force by the direction of each command."""
        return np.where(command < 0.0, self.reverse, 1.0)

    def drag(self, v: Array) -> Array:
        """Return the drag of each axis at its velocity."""
        factor = np.where(v < 0.0, self.astern[:, None], 1.0)
        return factor * (self.quadratic[:, None] * np.abs(v) + self.linear[:, None]) * v


Where = Literal["dive", "open water", "bench"]
"""In a dive; far from everything, where the answers hold; and one thruster at a balance, deep in a tank."""


def _as_is(state: Array) -> Array:
    return state


@dataclass(eq=False)
class Moment:
    """What acts at one moment by the law, which a stranger may change."""

    clock: Array
    """n: the time since the vehicle was first switched on, s."""
    velocity: Array
    place: Array
    """3 x n: north, east, depth, m."""
    command: Array
    """4 x n."""
    memory: Array
    """4 x n: states of the stranger."""
    goal: Array
    """4 x n: the state to which each thruster goes."""
    drag: Array
    push: Array
    """4 x n: other forces along each axis."""
    inertia: Array
    lag: Array
    """4 x n, s."""
    gain: Array
    """4 x n: a factor of the force of each thruster."""
    lost: Array
    """4 x n: the loss by the speed of advance, relative to the full thrust."""
    recall: Array
    """4 x n: the derivatives of the memory."""
    share: Callable[[Array], Array] = field(default=_as_is)
    """The force that belongs to the states of the thrusters, relative to the full thrust."""
    where: Where = "dive"


Act = Callable[[Moment, Body], None]
"""Changes what acts at one moment."""


def nothing(_moment: Moment, _body: Body) -> None:
    """Obey the law."""


@dataclass(frozen=True, eq=False)
class Water:
    """A vehicle with what it does beside the law."""

    body: Body
    act: Act = nothing
    where: Where = "dive"

    def moment(self, clock: Array, y: Array, command: Array) -> Moment:
        """Return what acts at one moment. `y` has the 16 states of each run, as `rates` has."""
        b, v = self.body, y[:4]
        one = np.ones_like(v)
        lost = b.loss * np.abs(command) * b.directed(command) * (b.places.T @ v)
        m = Moment(
            clock,
            v,
            y[4:7],
            command,
            y[12:],
            b.goal(command),
            b.drag(v),
            0.0 * one,
            b.inertia[:, None] * one,
            b.lag * one,
            one.copy(),
            lost,
            0.0 * one,
            where=self.where,
        )
        m.push[HEAVE] = b.load
        self.act(m, b)
        return m

    def rates(self, clock: Array, y: Array, command: Array, *, quick: bool = False) -> Array:
        """Return the derivatives of the states: 4 velocities, north, east, depth, heading, 4 thrusters, 4 of memory.

        With `quick`, the thrusters have no lag.
        """
        b, m = self.body, self.moment(clock, y, command)
        (u, v, w, r), psi = y[:4], y[7]
        force = b.full * m.gain * (m.share(m.goal if quick else y[8:12]) - m.lost)
        total = b.places @ force - m.drag + m.push
        if b.coupled:
            Mu, Mv = b.inertia[SURGE], b.inertia[SWAY]
            total = total + np.array([Mv * v * r, -Mu * u * r, 0.0 * w, (Mu - Mv) * u * v])
        moved = np.array([u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi), w, r])
        return np.concatenate([total / m.inertia, moved, (m.goal - y[8:12]) / m.lag, m.recall])

    def bench(self, commands: Array) -> Array:
        """Return the force of the starboard thruster at rest, alone, for each of n commands, N.

        Faults of one thruster are those of port.
        """
        command = np.zeros((4, len(commands)))
        command[1] = commands
        m = replace(self, where="bench").moment(np.zeros(len(commands)), np.zeros((16, len(commands))), command)
        return np.asarray(self.body.full * (m.gain * m.share(m.goal))[1])


def step(rates: Callable[[float, Array], Array], t: float, y: Array, h: float) -> Array:
    """Return the states after one step."""
    k1 = rates(t, y)
    k2 = rates(t + 0.5 * h, y + 0.5 * h * k1)
    k3 = rates(t + 0.5 * h, y + 0.5 * h * k2)
    k4 = rates(t + h, y + h * k3)
    return np.asarray(y + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4))


def flown(water: Water, commands: Array, begins: Array, heading: Array, depth: float) -> Array:
    """Return the states at each row, rows x 16 x n. The commands are rows x 4 x n, and `begins` the clocks, n."""
    y = np.zeros((16, commands.shape[2]))
    y[6], y[7] = depth, heading
    rows = [y]
    for row, command in enumerate(commands[:-1]):
        for n in range(round(ROW / STEP)):
            y = step(lambda t, y, c=command: water.rates(begins + t, y, c), row * ROW + n * STEP, y, STEP)  # type: ignore[misc]
        rows.append(y)
    return np.array(rows)


def answers(water: Water, axis: int, commands: Array, clock: float) -> Array:
    """Return V_ss, the time to 63 % of it and the stopping distance of an axis alone, 3 x n, for commands of 4 x n.

    Each begins at rest with the full thrust of its command, and the distance ends at a tenth of V_ss, without thrust
    and load. NaN where the velocity has not the direction of the command.
    """
    free = np.zeros((16, 1))
    free[[axis, 12, 13, 14, 15]] = 1.0
    n, h = commands.shape[1], _FINE[axis]

    def run(water: Water, y: Array, command: Array, least: Array) -> Array:
        """Return the states until they are steady or below a least speed, steps x 16 x n."""

        def rates(_: float, y: Array) -> Array:
            return free * water.rates(np.full(n, clock), y, command, quick=True)

        rows, block = [y], round(1.0 / h)
        for k in range(round(_LONGEST / h)):
            y = step(rates, 0.0, y, h)
            rows.append(y)
            if k % block == block - 1:
                before = rows[-block][axis]
                if np.all((np.abs(y[axis] - before) < 1e-5 * water.body.top[axis]) | (np.abs(y[axis]) < least)):
                    break
        return np.array(rows)

    water = replace(water, where="open water")
    rise = run(water, np.zeros((16, n)), commands, np.zeros(n))
    V = rise[-1, axis]
    resting = replace(water, body=replace(water.body, load=0.0))
    fall = run(resting, free * rise[-1], np.zeros_like(commands), 0.1 * np.abs(V))
    found = np.full((3, n), np.nan)
    for k, sign in enumerate(np.sign(DRIVEN[axis] @ commands)):
        if V[k] * sign > 0.0:
            up, down = np.abs(rise[:, axis, k]), np.abs(fall[:, axis, k])
            tau = _crossing(up >= (1.0 - exp(-1.0)) * V[k] * sign, up, (1.0 - exp(-1.0)) * V[k] * sign)
            end = _crossing(down <= 0.1 * V[k] * sign, down, 0.1 * V[k] * sign)
            way = np.concatenate([[0.0], np.cumsum(0.5 * (down[1:] + down[:-1]))])
            found[:, k] = V[k], h * tau, h * np.interp(end, np.arange(len(way)), way)
    return found


def _crossing(beyond: NDArray[np.bool_], values: Array, level: float) -> float:
    """Return the place, in steps, at which values first reach a level; NaN if never."""
    if not beyond.any():
        return float("nan")
    n = int(np.argmax(beyond))
    return n - 1.0 + float((level - values[n - 1]) / (values[n] - values[n - 1])) if n else 0.0
