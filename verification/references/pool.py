"""A simulated pool for tests of identification: the equations of motion, integrated by SciPy's DOP853.

It uses the names of a vehicle's coefficients but none of the package's mathematics, so its recordings are an
independent truth. The commands switch at any times, and the integration begins anew at each of them. `Conditions` adds
what a real dive has and a model may lack. Vehicles that roll and pitch are those of rigid_pool.py.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import copysign, cos, pi, sin, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from rov_fmu.equation.catalogue import AXES
from rov_fmu.equation.layout import Layout, Thruster
from rov_fmu.vehicle.vehicle import Vehicle

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
Rates = Callable[[float, Array], list[float]]

_PRECISION = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-12}
_ALONG = {"u": 0, "v": 1, "w": 2}  # the components of a direction: forward, starboard, down


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
class Tilt:
    """A vehicle that has neither roll nor pitch oscillates about both: phi and theta are sines of the time."""

    amplitude: float
    """The largest angle, rad."""
    roll_period: float = 7.0
    pitch_period: float = 11.0
    """s."""

    def at(self, time: float) -> tuple[float, float, float]:
        """Return phi, theta and the rate of theta."""
        roll, pitch = 2.0 * pi / self.roll_period, 2.0 * pi / self.pitch_period
        A = self.amplitude
        return A * sin(roll * time), A * sin(pitch * time), A * pitch * cos(pitch * time)


@dataclass(frozen=True)
class Conditions:
    """What acts on a vehicle in addition to its equation of motion."""

    delay: float = 0.0
    """The time from a command to its effect, s."""
    current: tuple[float, float] = (0.0, 0.0)
    """The velocity of the water north and east, m/s."""
    saturation: float = 1.0
    """The largest command that the thrusters follow."""
    thrust: Callable[[float], float] | None = None
    """The factor of all thrust as a function of the time (s), such as that of a battery that empties."""
    tether: Vector = (0.0, 0.0, 0.0)
    """The stiffness of a tether that pulls back to the start, by the displacement north, east and down, N/m."""
    tilt: Tilt | None = None
    """The roll and pitch of a vehicle that has neither axis. Thrust and velocity tilt with the vehicle, its net weight
    F_0_w stays vertical. The products of its velocities with the rates of roll and pitch are left out."""
    curves: Mapping[str, Callable[[float], float]] = field(default_factory=dict)
    """By curve: the steady thrust (N) of one thruster as a function of its command, where it is no polynomial."""
    has_rotors: bool = False
    """True if the speeds of the rotors lag behind, and thrust is proportional to their square. All have a lag."""


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


def motion(k: Vehicle, commands: Commands, time: Array, conditions: Conditions = NOTHING) -> dict[str, Array]:
    """Return the velocities of the vehicle's axes and x, y, z, psi at ascending times (s), in SI units.

    The vehicle starts from rest at the first time or the first switch, whichever is earlier, with a heading of north.
    Velocities are those through the water.
    """
    vehicle = _Vehicle.of(k, conditions)
    found = piecewise(vehicle.rates, k.layout, commands, time, conditions, np.zeros(vehicle.size))
    return dict(zip((*vehicle.axes, "x", "y", "z", "psi"), found, strict=False))


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
    still, most = np.zeros(len(commands.switches)), conditions.saturation
    held = np.column_stack([commands.thrusters.get(thruster.name, still) for thruster in layout.thrusters])
    held = np.vstack([np.zeros(held.shape[1]), np.clip(held, -most, most)])
    bounds = [begin, *np.clip(commands.switches + conditions.delay, begin, end).tolist(), end]
    for (start, stop), command in zip(pairwise(bounds), held, strict=True):
        if stop > start:
            yield start, stop, command


# ---- The vehicle -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Vehicle:
    """The numbers of a vehicle, axis by axis and thruster by thruster."""

    k: Vehicle
    conditions: Conditions
    axes: tuple[str, ...]
    """The symbols of the axes' velocities."""
    inertia: Sequence[float]
    """m/β of each axis."""
    drag: Sequence[tuple[float, float, float, float]]
    """a_d and b_d for v >= 0, then a_d and b_d for v < 0."""
    load: Sequence[float]
    """The constant load F_0 of each axis (N or N.m)."""
    arms: Array
    """α times the force or torque on each axis (row) by 1 N of each thruster (column)."""
    lags: Sequence[float]
    """The time constant (s) of each thruster; 0 without lag."""

    @property
    def size(self) -> int:
        """The size of the state: velocities, pose, forces of the thrusters."""
        return len(self.axes) + 4 + len(self.lags)

    @classmethod
    def of(cls, k: Vehicle, conditions: Conditions) -> "_Vehicle":
        """Return the numbers of a vehicle."""
        get, names = k.coefficients.get, [axis.velocity for axis in AXES.values() if k.layout.has(axis)]
        bodies = [k["I_r" if v == "r" else "m_rov"] + get(f"m_a_{v}", 0.0) for v in names]
        drag = [(k[f"a_d_{v}"], k[f"b_d_{v}"]) for v in names]
        reverse = [
            (get(f"a_d_{v}_reverse", a), get(f"b_d_{v}_reverse", b)) for v, (a, b) in zip(names, drag, strict=True)
        ]
        return cls(
            k,
            conditions,
            tuple(names),
            [body / k[f"beta_{v}"] for v, body in zip(names, bodies, strict=True)],
            [(*ahead, *astern) for ahead, astern in zip(drag, reverse, strict=True)],
            [get(f"F_0_{v}", 0.0) for v in names],
            np.array([[k[f"alpha_{v}"] * _arm(k, t, v) for t in k.layout.thrusters] for v in names]),
            [get(f"T_{t.curve}", 0.0) for t in k.layout.thrusters],
        )

    def rates(self, command: Array) -> Rates:
        """Return the function that gives the derivatives of the state under held commands."""
        k, n, given = self.k, len(self.axes), self.conditions
        steady = [
            given.curves[t.curve](c) if t.curve in given.curves else _force(k, t, c)
            for t, c in zip(k.layout.thrusters, command.tolist(), strict=True)
        ]
        lagging = [number for number, lag in enumerate(self.lags) if lag]
        immediate = self.arms @ np.array([0.0 if lag else F for F, lag in zip(steady, self.lags, strict=True)])
        pushes = immediate.tolist()
        lagging_arms = [[(n + 4 + number, arms[number]) for number in lagging] for arms in self.arms.tolist()]
        u_at, v_at, w_at, r_at = (self.axes.index(name) if name in self.axes else -1 for name in "uvwr")
        M_u, M_v, M_r = (self.inertia[at] if k.layout.coupled else 0.0 for at in (u_at, v_at, r_at))

        def derivatives(time: float, state: Array) -> list[float]:
            y = state.tolist()
            found = [0.0] * len(y)
            thrust = given.thrust(time) if given.thrust else 1.0
            phi, theta, theta_rate = given.tilt.at(time) if given.tilt else (0.0, 0.0, 0.0)
            R = _rotation(phi, theta, y[n + 3])
            load = self._loads(R, y[n : n + 3])
            for axis, (a, b, a_reverse, b_reverse) in enumerate(self.drag):
                speed = y[axis]
                resistance = (a * speed + b) * speed if speed >= 0.0 else (-a_reverse * speed + b_reverse) * speed
                lagging_force = sum(
                    arm * y[at] * (abs(y[at]) if given.has_rotors else 1.0) for at, arm in lagging_arms[axis]
                )
                force = thrust * pushes[axis] + load[axis] + lagging_force
                found[axis] = (force - resistance) / self.inertia[axis]
            u, v, w, r = (y[at] if at >= 0 else 0.0 for at in (u_at, v_at, w_at, r_at))
            if k.layout.coupled:
                found[u_at] += M_v * v * r / M_u
                found[v_at] -= M_u * u * r / M_v
                found[r_at] -= (M_v - M_u) * u * v / M_r
            north, east, down = (row[0] * u + row[1] * v + row[2] * w for row in R)
            found[n], found[n + 1], found[n + 2] = north + given.current[0], east + given.current[1], down
            found[n + 3] = (r + theta_rate * sin(phi)) / (cos(phi) * cos(theta))
            for number in lagging:
                goal = thrust * steady[number]
                goal = copysign(sqrt(abs(goal)), goal) if given.has_rotors else goal
                found[n + 4 + number] = (goal - y[n + 4 + number]) / self.lags[number]
            return found

        return derivatives

    def _loads(self, R: Sequence[Vector], place: Sequence[float]) -> list[float]:
        """Return the load along each axis, with the net weight along the vertical and the pull of the tether."""
        found = list(self.load)
        earth = [-stiffness * x for stiffness, x in zip(self.conditions.tether, place, strict=True)]
        if self.conditions.tilt and "w" in self.axes:
            earth[2] += self.load[self.axes.index("w")]
            found[self.axes.index("w")] = 0.0
        if any(earth):
            for name, column in _ALONG.items():
                if name in self.axes:
                    found[self.axes.index(name)] += sum(R[row][column] * earth[row] for row in range(3))
        return found


def _rotation(phi: float, theta: float, psi: float) -> tuple[Vector, Vector, Vector]:
    """Return the matrix from the body to the earth frame."""
    (cf, sf), (ct, st), (cp, sp) = ((cos(angle), sin(angle)) for angle in (phi, theta, psi))
    return (
        (cp * ct, cp * st * sf - sp * cf, cp * st * cf + sp * sf),
        (sp * ct, sp * st * sf + cp * cf, sp * st * cf - cp * sf),
        (-st, ct * sf, ct * cf),
    )


def _arm(k: Vehicle, thruster: Thruster, velocity: str) -> float:
    """Return the force along an axis, or the yaw torque, by 1 N of a thruster."""
    if velocity in _ALONG:
        return thruster.direction.value[_ALONG[velocity]]
    if thruster.position is None:
        return thruster.side * k["R"] * sin(k["gamma"]) if thruster.arm else 0.0
    x, y, _ = thruster.position.value
    return x * thruster.direction.value[1] - y * thruster.direction.value[0]


def _force(k: Vehicle, thruster: Thruster, command: float) -> float:
    """Return the steady thrust (N) of one thruster.

    The curve a_t (c - c_0)^2 + b_t (c - c_0) is that of all its thrusters together.
    """
    get, name, end = k.coefficients.get, thruster.curve, "_reverse" if command < 0.0 else ""
    (together,) = (curve.together for curve in k.layout.curves if curve.name == name)
    a_t, b_t = (get(f"{key}_{name}{end}", k[f"{key}_{name}"]) for key in ("a_t", "b_t"))
    beyond = abs(command) - get(f"c_0_{name}{end}", get(f"c_0_{name}", 0.0))
    return copysign(a_t * beyond**2 + b_t * beyond, command) / together if beyond > 0.0 else 0.0
