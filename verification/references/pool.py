"""A simulated pool for tests of identification: the equations of motion, integrated by SciPy's DOP853.

It uses the names of a vehicle's coefficients but none of the package's mathematics, so its recordings are an
independent truth. Commands may reach the thrusters with a delay, and the water may have a current.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import copysign, cos, sin

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from rov_fmu.model.layout import AXES, Thruster
from rov_fmu.model.rov import Rov

Array = NDArray[np.float64]

_PRECISION = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-12}
_ALONG = {"u": 0, "v": 1, "w": 2}  # the components of a direction: forward, starboard, down


def swim(
    k: Rov, time: Array, thrusters: Mapping[str, Array], delay: float = 0.0, current: tuple[float, float] = (0.0, 0.0)
) -> dict[str, Array]:
    """Return the velocities of the vehicle's axes and x, y, z, psi at the times (s), from rest, in SI units.

    `thrusters` maps each thruster to its commands, one for each time; without commands a thruster gives no thrust. Each
    command takes effect `delay` (s) after its time. `current` is the velocity of the water north and east (m/s). The
    vehicle starts with a heading of north.
    """
    still = np.zeros(len(time))
    commands = np.column_stack([thrusters.get(thruster.name, still) for thruster in k.layout.thrusters])
    changes = np.concatenate([[0], np.flatnonzero(np.any(np.diff(commands, axis=0) != 0.0, axis=1)) + 1])
    delayed = (time[changes] + delay).tolist()
    bounds = [float(time[0]), *(t for t in delayed if t < time[-1]), float(time[-1])]
    held = [np.zeros(commands.shape[1]), *commands[changes]]
    vehicle = _Vehicle.of(k)
    state = np.zeros(vehicle.size)
    found = np.empty((vehicle.size, len(time)))
    found[:, 0] = state
    for (start, end), command in zip(pairwise(bounds), held, strict=False):
        if end > start:
            inside = (time > start) & (time <= end)
            at = time[inside]
            asked = at if at.size and at[-1] == end else np.append(at, end)
            solution = solve_ivp(vehicle.rates(command, current), (start, end), state, t_eval=asked, **_PRECISION)
            assert solution.success, solution.message
            found[:, inside], state = solution.y[:, : at.size], solution.y[:, -1]
    return dict(zip((*vehicle.axes, "x", "y", "z", "psi"), found, strict=False))


@dataclass(frozen=True)
class _Vehicle:
    """The numbers of a vehicle, axis by axis and thruster by thruster."""

    k: Rov
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
    def of(cls, k: Rov) -> "_Vehicle":
        """Return the numbers of a vehicle."""
        get, names = k.coefficients.get, [axis.velocity for axis in AXES.values() if k.layout.has(axis)]
        bodies = [k["I_r" if v == "r" else "m_rov"] + get(f"m_a_{v}", 0.0) for v in names]
        drag = [(k[f"a_d_{v}"], k[f"b_d_{v}"]) for v in names]
        reverse = [
            (get(f"a_d_{v}_reverse", a), get(f"b_d_{v}_reverse", b)) for v, (a, b) in zip(names, drag, strict=True)
        ]
        return cls(
            k,
            tuple(names),
            [body / k[f"beta_{v}"] for v, body in zip(names, bodies, strict=True)],
            [(*ahead, *astern) for ahead, astern in zip(drag, reverse, strict=True)],
            [get(f"F_0_{v}", 0.0) for v in names],
            np.array([[k[f"alpha_{v}"] * _arm(k, t, v) for t in k.layout.thrusters] for v in names]),
            [get(f"T_{t.curve}", 0.0) for t in k.layout.thrusters],
        )

    def rates(self, command: Array, current: tuple[float, float]) -> Callable[[float, Array], list[float]]:
        """Return the function that gives the derivatives of the state under held commands."""
        k, n = self.k, len(self.axes)
        steady = [_force(k, t, c) for t, c in zip(k.layout.thrusters, command.tolist(), strict=True)]
        lagging = [number for number, lag in enumerate(self.lags) if lag]
        immediate = self.arms @ np.array([0.0 if lag else F for F, lag in zip(steady, self.lags, strict=True)])
        constant = (immediate + np.array(self.load)).tolist()
        lagging_arms = [[(n + 4 + number, arms[number]) for number in lagging] for arms in self.arms.tolist()]
        u_at, v_at, w_at, r_at = (self.axes.index(name) if name in self.axes else -1 for name in "uvwr")
        M_u, M_v, M_r = (self.inertia[at] if k.layout.coupled else 0.0 for at in (u_at, v_at, r_at))

        def derivatives(_time: float, state: Array) -> list[float]:
            y = state.tolist()
            found = [0.0] * len(y)
            for axis, (a, b, a_reverse, b_reverse) in enumerate(self.drag):
                speed = y[axis]
                resistance = (a * speed + b) * speed if speed >= 0.0 else (-a_reverse * speed + b_reverse) * speed
                force = constant[axis] + sum(arm * y[at] for at, arm in lagging_arms[axis])
                found[axis] = (force - resistance) / self.inertia[axis]
            u, v, w, r = (y[at] if at >= 0 else 0.0 for at in (u_at, v_at, w_at, r_at))
            if k.layout.coupled:
                found[u_at] += M_v * v * r / M_u
                found[v_at] -= M_u * u * r / M_v
                found[r_at] -= (M_v - M_u) * u * v / M_r
            heading = y[n + 3]
            found[n] = u * cos(heading) - v * sin(heading) + current[0]
            found[n + 1] = u * sin(heading) + v * cos(heading) + current[1]
            found[n + 2], found[n + 3] = w, r
            for number in lagging:
                found[n + 4 + number] = (steady[number] - y[n + 4 + number]) / self.lags[number]
            return found

        return derivatives


def _arm(k: Rov, thruster: Thruster, velocity: str) -> float:
    """Return the force along an axis, or the yaw torque, by 1 N of a thruster."""
    if velocity in _ALONG:
        return thruster.direction[_ALONG[velocity]]
    if thruster.position is None:
        return thruster.arm * k["R"] * sin(k["gamma"]) if thruster.arm else 0.0
    x, y, _ = thruster.position
    return x * thruster.direction[1] - y * thruster.direction[0]


def _force(k: Rov, thruster: Thruster, command: float) -> float:
    """Return the steady thrust (N) of one thruster.

    The curve a_t (c - c_0)^2 + b_t (c - c_0) is that of all its thrusters together.
    """
    get, name, end = k.coefficients.get, thruster.curve, "_reverse" if command < 0.0 else ""
    (together,) = (curve.together for curve in k.layout.curves if curve.name == name)
    a_t, b_t = (get(f"{key}_{name}{end}", k[f"{key}_{name}"]) for key in ("a_t", "b_t"))
    beyond = abs(command) - get(f"c_0_{name}{end}", get(f"c_0_{name}", 0.0))
    return copysign(a_t * beyond**2 + b_t * beyond, command) / together if beyond > 0.0 else 0.0
