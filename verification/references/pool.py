"""A simulated pool for tests of identification: the equations of equations.py, integrated by SciPy's DOP853.

It uses none of the package's mathematics, so its recordings are an independent truth. The commands switch at any times,
and the integration begins anew at each of them. `Conditions` adds what a real dive has and a model may lack. Vehicles
that roll and pitch are those of rigid_pool.py.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import cos, sin

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from rov_fmu.equation.layout import Layout
from rov_fmu.vehicle.vehicle import Vehicle

from .equations import FLOATS, PLACES, driven
from .equations import thrust as thrust_of

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
Rates = Callable[[float, Array], Array | list[float]]

_PRECISION = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-12}


# ---- Runs ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Commands:
    """Commands that are held from their switch until the next. Before the first switch there are none."""

    switches: Array
    """J: the time of each switch, s, ascending."""
    thrusters: Mapping[str, Array]
    """J each, by thruster: the command, a fraction of the full command. A thruster without a name here has none."""

    def at(self, time: Array) -> dict[str, Array]:
        """Return the command of each thruster at some times."""
        held = np.searchsorted(self.switches, time, side="right") - 1
        return {name: np.where(held < 0, 0.0, values[np.maximum(held, 0)]) for name, values in self.thrusters.items()}


@dataclass(frozen=True)
class Conditions:
    """What acts on a vehicle in addition to its equation of motion."""

    delay: float = 0.0
    """The time from a command to its effect, s."""
    current: tuple[float, float] = (0.0, 0.0)
    """The velocity of the water north and east, m/s."""
    thrust: Callable[[float], float] | None = None
    """The factor of all thrust as a function of the time (s), such as that of a battery that empties."""
    tether: Vector = (0.0, 0.0, 0.0)
    """The stiffness of a tether that pulls back to the start, by the displacement north, east and down, N/m."""


NOTHING = Conditions()


def swim(
    k: Vehicle,
    time: Array,
    thrusters: Mapping[str, Array],
    delay: float = 0.0,
    current: tuple[float, float] = (0.0, 0.0),
) -> dict[str, Array]:
    """Return the motion of a vehicle whose commands switch at samples: `thrusters` has a command for each time."""
    changed = [np.diff(values) != 0.0 for values in thrusters.values()]
    changes = np.concatenate([[0], np.flatnonzero(np.any(changed, axis=0)) + 1])
    commands = Commands(time[changes], {name: values[changes] for name, values in thrusters.items()})
    return motion(k, commands, time, Conditions(delay, current))


def stick(random: np.random.Generator, n: int, most: Sequence[float], held: float, every: int = 1) -> Array:
    """Return where a pilot holds a stick in n rows: a third of the time in the middle, else on alternating sides.

    `most` has the farthest places ahead and astern; a place is held for about `held` rows, a multiple of `every`.
    """
    found, side = np.empty(0), 0
    while len(found) < n:
        rows = every * round(held / every * random.uniform(0.5, 1.5))
        level = 0.0 if random.random() < 1 / 3 else (1 - 2 * side) * most[side] * random.uniform(0.4, 1.0)
        side = 1 - side if level else side
        found = np.append(found, np.full(rows, level))
    return found[:n]


def motion(k: Vehicle, commands: Commands, time: Array, conditions: Conditions = NOTHING) -> dict[str, Array]:
    """Return the velocities of the vehicle's axes and x, y, z, psi at ascending times (s), in SI units.

    The vehicle starts from rest at the first time or the first switch, whichever is earlier, with a heading of north.
    Velocities are those through the water.
    """
    names = [form.axis.velocity for form in k.layout.axes]
    start = np.zeros(len(names) + 4 + len(k.layout.lagging))
    found = piecewise(lambda command: _rates(k, command, conditions), k.layout, commands, time, conditions, start)
    return dict(zip((*names, "x", "y", "z", "psi"), found, strict=False))


def piecewise(
    rates: Callable[[Array], Rates],
    layout: Layout,
    commands: Commands,
    time: Array,
    conditions: Conditions,
    state: Array,
    precision: Mapping[str, object] = _PRECISION,
) -> Array:
    """Return the states at the times, by an integration that begins anew when a command takes effect.

    `rates` returns the derivatives of the state under held commands, one for each thruster of the layout.
    """
    found = np.empty((len(state), len(time)))
    found[:, time <= (begin := min(time[0], commands.switches[0]))] = state[:, None]
    for start, end, command in _holds(layout, commands, conditions, begin, float(time[-1])):
        inside = (time > start) & (time <= end)
        at = time[inside]
        asked = at if at.size and at[-1] == end else np.append(at, end)
        solution = solve_ivp(rates(command), (start, end), state, t_eval=asked, **precision)
        assert solution.success, solution.message
        found[:, inside], state = solution.y[:, : at.size], solution.y[:, -1]
    return found


def _holds(
    layout: Layout, commands: Commands, conditions: Conditions, begin: float, end: float
) -> Iterator[tuple[float, float, Array]]:
    """Yield the start and the end of each hold, with the command that each thruster of the layout follows."""
    still = np.zeros(len(commands.switches))
    held = np.column_stack([commands.thrusters.get(thruster.name, still) for thruster in layout.thrusters])
    held = np.vstack([np.zeros(held.shape[1]), np.clip(held, -1.0, 1.0)])
    bounds = [begin, *np.clip(commands.switches + conditions.delay, begin, end).tolist(), end]
    for (start, stop), command in zip(pairwise(bounds), held, strict=True):
        if stop > start:
            yield start, stop, command


# ---- The vehicle -----------------------------------------------------------------------------------------------------


def _rates(k: Vehicle, command: Array, given: Conditions) -> Rates:
    """Return the function that gives the derivatives of the state under held commands."""
    steady = {
        t.name: thrust_of(k, k.layout.curve_of[t.name], c, FLOATS)
        for t, c in zip(k.layout.thrusters, command.tolist(), strict=True)
    }
    held = driven(k, steady, {}, FLOATS)
    n, lags = len(held.axes), [*held.lags.values()]
    pulled = [(at, PLACES[name], axis.inertia) for at, (name, axis) in enumerate(held.axes.items()) if name in PLACES]

    def derivatives(time: float, state: Array) -> list[float]:
        y = state.tolist()
        thrust = given.thrust(time) if given.thrust else 1.0
        c, s = cos(y[n + 3]), sin(y[n + 3])
        R = (c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)  # from the body to the earth frame
        found = held.accelerations(y[:n], y[n + 4 :], thrust=thrust)
        earth = [-stiffness * x for stiffness, x in zip(given.tether, y[n : n + 3], strict=True)]
        for at, column, inertia in pulled if any(earth) else ():
            found[at] += sum(R[row][column] * earth[row] for row in range(3)) / inertia
        u, v, w, r = held.level(y)
        north, east, down = (row[0] * u + row[1] * v + row[2] * w for row in R)
        found += [north + given.current[0], east + given.current[1], down, r]
        for lag, x in zip(lags, y[n + 4 :], strict=True):
            found.append((thrust * lag.target - x) / lag.T)
        return found

    return derivatives
