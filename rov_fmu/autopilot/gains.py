"""The gains of a cascade for a vehicle, in SI units, and the autopilot with these gains.

For each axis that the thrusters can push: v* = sat(k_x (x* - x)), braked so that the aim is reached without overshoot,
and tau = k_p (v* - v) + k_i ∫(v* - v) dt + d_1 v* + d_2 |v*| v* + M dv*/dt + bias. The bandwidth of the rate loop is

    k_v = 1/(2 (T + T_d) + 2.5 (delay + 2.5 h)),   k_p = k_v M,   k_i = k_v^2 M/4,   k_x = k_v/3,

with the inertia M with added mass, the lag T and the dead time T_d of the thrusters, the delay of the sensors, and the
step h of the controller. With 2.5 h in it, a loop in which all exchange their values at once (Jacobi) stays calm up to
100 ms. It is at most 3/s for translations and 8/s for turns, because vehicle files without a lag would allow any.

Where a hold begins, v* fades in from the measured velocity within 1/k_v, without M dv*/dt: the demand does not jump,
and the integrator has nothing to make up for, which would be an overshoot later.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray

from rov_fmu.autopilot.allocation import allocation_matrix, thrust_rows
from rov_fmu.autopilot.law import AXES, LOOP, OWN_GAINS, Sharing, pulse_of
from rov_fmu.equation.catalogue import HEAVE, PITCH, ROLL, SURGE, SWAY, YAW, Axis
from rov_fmu.equation.parts import Curve
from rov_fmu.io.messages import InputError, listed, only
from rov_fmu.io.numbers import GAIN_VALUES, NUMBERS
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.vehicle import Vehicle

STEP, DELAY = 0.02, 0.015
"""The step of the autopilot, and the time from the sensors to the thrust, that gains are made for by default, s."""
_ORDER = (HEAVE, YAW, ROLL, PITCH, SURGE, SWAY)
"""The axes in the order in which thrusters are given to them."""
_PRIORITY = {HEAVE: 0, ROLL: 0, PITCH: 0, YAW: 1, SURGE: 2, SWAY: 2}
_FASTEST = {False: 3.0, True: 8.0}
"""The largest k_v, 1/s, of a translation and of a turn."""
_LEAST = 1e-2
"""The least singular value of the directions of the thrusters, relative to the largest, with which an axis is held."""
_BRAKE, _SPEED = 0.3, 0.6
"""The parts of the largest force that brake before the aim, and that the drag at the largest rate takes."""


@dataclass(frozen=True, eq=False, repr=False)
class Autopilot:
    """The numbers of the autopilot of a vehicle."""

    vehicle: Vehicle
    step: float
    """The step that the gains are made for, s."""
    delay: float
    """The time from the sensors to the thrust that they are made for, s."""
    axes: tuple[Axis, ...]
    """The axes that the thrusters can push, in the order of AXES."""
    loops: NDArray[np.void]
    """The numbers of each of AXES, of the type LOOP."""
    sharing: Sharing
    lags: dict[str, float]
    """The lag of the thrusters of each axis, with the dead time, s."""

    def __repr__(self) -> str:
        """Return a line for each axis with its gains, and not the tables of the thrusters."""
        names = ("k_x", "k_p", "k_i", "v_max", "most")
        rows = [[f"{name} = {self.gain(axis, name):.4g}" for name in names] for axis in self.axes]
        lines = [f"{axis.name}: {', '.join(row)}" for axis, row in zip(self.axes, rows, strict=True)]
        head = f"Autopilot of {self.vehicle.identifier}, for a step of {self.step:g} s and a delay of {self.delay:g} s"
        return "\n".join([head, *lines])

    def gain(self, axis: Axis, name: str) -> float:
        """Return a number of an axis."""
        return float(self.loops[name][AXES.index(axis)])

    def with_gains(self, gains: Mapping[str, float]) -> "Autopilot":
        """Return the autopilot with other gains, by the names of the parameters of its FMU, such as `k_p_w`.

        Raises InputError about a name or a number.
        """
        loops = self.loops.copy()
        places = {f"{name}_{axis.velocity}": (name, AXES.index(axis)) for axis in self.axes for name in OWN_GAINS}
        for key, value in gains.items():
            if key not in places:
                raise InputError(f"gains: there is no {key}{only(key, places)}")
            name, n = places[key]
            loops[name][n] = (NUMBERS if name == "bias" else GAIN_VALUES).checked(f"gains: {key}", value)
        return replace(self, loops=loops)


def autopilot_of(vehicle: Vehicle, step: float = STEP, delay: float = DELAY) -> Autopilot:
    """Return the autopilot of a vehicle for a step (s) and a delay of the sensors (s).

        autopilot_of(load_vehicle(find_vehicle("videoray"))).gain(HEAVE, "k_p")  # N.s/m

    Raises InputError if the thrusters cannot hold any axis.
    """
    layout = vehicle.layout
    if layout.fins:
        names = listed(fin.name for fin in layout.fins)
        raise InputError(f"{vehicle.identifier}: the autopilot moves thrusters alone, and not the fins {names}")
    if not layout.thrusters:
        raise InputError(f"{vehicle.identifier}: has no thrusters, so no axis can be held")
    matrix, chosen = allocation_matrix(vehicle), list[Axis]()
    rows = {axis: matrix[n] for n, axis in enumerate(layout.bare_axes)}
    for axis in (axis for axis in _ORDER if axis in rows and np.abs(rows[axis]).max() > 0.0):
        tried = np.array([rows[one] / np.linalg.norm(rows[one]) for one in (*chosen, axis)])
        singular = np.linalg.svd(tried, compute_uv=False)
        if len(tried) <= tried.shape[1] and singular[-1] > _LEAST * singular[0]:
            chosen.append(axis)
    axes = tuple(axis for axis in AXES if axis in chosen)
    loops = np.zeros(len(AXES), LOOP)
    lags = {axis.name: lag_along(vehicle, axis) + vehicle.coefficients.get("T_d", 0.0) for axis in axes}
    sharing = _sharing(vehicle, axes, np.array([rows[axis] for axis in axes]))
    for axis in axes:
        loops[AXES.index(axis)] = _loop(vehicle, axis, sharing, lags[axis.name], step, delay)
    return Autopilot(vehicle, step, delay, axes, loops, sharing, lags)


def lag_along(vehicle: Vehicle, axis: Axis) -> float:
    """Return the largest lag T of the thrusters along an axis that gains are made for, s; 0 without any.

    Of one that is not known, it is the mean of the ends of its 95 % interval: its estimate is next to the lower end.
    """
    curves = (vehicle.layout.curve_of[one.name] for one in vehicle.layout.thrusters_along(axis))
    return max((_lag(vehicle, curve) for curve in curves if curve.has_lag), default=0.0)


def _lag(vehicle: Vehicle, curve: Curve) -> float:
    lag, interval = vehicle[curve.coefficient("T")], vehicle.basis[curve.coefficient("T")].interval
    return 0.5 * sum(interval) if interval and interval[1] > 2.0 * lag else lag


def _sharing(vehicle: Vehicle, axes: tuple[Axis, ...], matrix: Array) -> Sharing:
    """Return how the thrusters make the forces along axes, whose rows of the allocation matrix are given."""
    layout = vehicle.layout
    count, places = len(layout.thrusters), [AXES.index(axis) for axis in axes]
    of_axis, to_axis = np.zeros((2, count, len(AXES)))
    of_axis[:, places], to_axis[:, places] = np.linalg.pinv(matrix), matrix.T
    commands = np.eye(count)
    if layout.mix:
        commands = np.linalg.pinv(np.array(layout.gain_rows(t.name for t in layout.thrusters)))
    curves = list(layout.curves)
    return Sharing(
        *(of_axis, to_axis, commands, tuple(_PRIORITY[axis] for axis in AXES)),
        tables=tuple(np.array(thrust_rows(vehicle, curve, None)) for curve in curves),
        table_of=tuple(curves.index(layout.curve_of[one.name]) for one in layout.thrusters),
        attitude=layout.has_attitude,
        pulse=pulse_of(layout),
    )


def _loop(vehicle: Vehicle, axis: Axis, sharing: Sharing, lag: float, step: float, delay: float) -> NDArray[np.void]:
    """Return the numbers of an axis. They follow the rule at the head of this file."""
    loop = np.zeros((), LOOP)
    inertia = vehicle.effective_inertia(axis)
    ends = np.array([sharing.tables[n][[0, -1], 0] for n in sharing.table_of])
    along = sharing.to_axis[:, AXES.index(axis)]
    most = min(np.abs(np.sort(along[:, np.newaxis] * ends, axis=1).sum(axis=0)))
    alone = vehicle.motions(vehicle.layout.usual_inputs, (axis,))[0]
    d_1, d_2 = alone.B * inertia, alone.A * inertia
    k_v = min(1.0 / (2.0 * lag + 2.5 * (delay + 2.5 * step)), _FASTEST[axis.is_rotation])
    loop["k_x"], loop["k_p"], loop["k_i"] = k_v / 3.0, k_v * inertia, k_v**2 * inertia / 4.0
    loop["d_1"], loop["d_2"], loop["inertia"], loop["bias"] = d_1, d_2, inertia, -alone.C * inertia
    loop["most"] = loop["i_max"] = most
    loop["brake"], loop["v_max"] = _BRAKE * most / inertia, _speed(_SPEED * most, d_1, d_2)
    loop["tracking"], loop["handover"] = 2.0 / k_v, 1.0 / k_v
    return loop


def _speed(force: float, linear: float, quadratic: float) -> float:
    """Return the speed whose drag is a force; 0, which is no limit, without drag."""
    root = linear + sqrt(linear**2 + 4.0 * max(quadratic, 0.0) * force)
    speed = 2.0 * force / root if root > 0.0 else inf
    return speed if speed < inf else 0.0
