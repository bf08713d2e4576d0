"""A first guess of drag and β by linear regression, from which the fit to recordings begins.

The momentum that an axis gains over a short interval is the impulse of thrust and load less that of drag:
(m/β) Δv = ∫ (α F + F_0 - a_d |v| v - b_d v) dt, which is linear in 1/β, a_d, b_d and F_0.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import lsq_linear

from rov_fmu.identify.driving import thrust_along
from rov_fmu.identify.simulation.prepared import PreparedRecording
from rov_fmu.model.layout import PITCH, ROLL, SURGE, SWAY, YAW, Axis
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array

_INTERVAL = 1.0
"""The length of an interval, s."""
_STEP = 0.1
"""The steps of the integrals, s."""
_COUNTS = 10, 100_000
"""The smallest and the largest number of steps."""
DELAYS = (-0.2, -0.1, 0.0, 0.1, 0.2, 0.3, 0.5, 0.8, 1.2)
_BETAS = 0.02, 2.0
"""The smallest and the largest β of a guess. Noise raises it, and a vehicle without inertia is slow to simulate."""


def first_guess(
    axis: Axis, data: Sequence[PreparedRecording], base: Rov, delays: Sequence[float] = DELAYS
) -> tuple[dict[str, float], float]:
    """Return a_d, b_d, β and F_0 of an axis by key, and the delay of the commands (s), from all recordings.

    Forces of coupling are computed from the measured velocities with β = 1.
    """
    own = [d for d in data if d.axis is axis]
    inertia = base.inertia(base.layout.kinds[axis.name])
    commands = {id(d.recording): d.commands for d in own}
    thrust = {key: base[axis.coefficient("alpha")] * thrust_along(base, axis, u) for key, u in commands.items()}
    best: tuple[float, dict[str, float], float] = (np.inf, {}, 0.0)
    for delay in delays:
        parts = [_intervals(d, [o for o in data if _together(o, d)], thrust[id(d.recording)], base, delay) for d in own]
        A, b = (np.concatenate([part[n] for part in parts]) for n in (0, 1))
        A[:, 0] *= inertia
        scale = np.maximum(np.linalg.norm(A, axis=0), 1e-12)
        low = np.array([1.0 / _BETAS[1], 0.0, 0.0, -np.inf])
        high = np.array([1.0 / _BETAS[0], np.inf, np.inf, np.inf])
        found = lsq_linear(A / scale, b, (low * scale, high * scale))
        x = found.x / scale
        if found.cost < best[0]:
            best = found.cost, dict(zip(("beta", "a_d", "b_d", "F_0"), (1.0 / x[0], *x[1:]), strict=True)), delay
    return {key: float(value) for key, value in best[1].items()}, best[2]


def _together(other: PreparedRecording, data: PreparedRecording) -> bool:
    return (other.recording.file, other.piece) == (data.recording.file, data.piece)


def _intervals(
    data: PreparedRecording, beside: Sequence[PreparedRecording], thrust: Array, base: Rov, delay: float
) -> tuple[Array, Array]:
    """Return the factors of 1/β (without the inertia), a_d, b_d and F_0 in each interval, n x 4, and the impulse, n.

    `thrust` has the steady thrust along the axis from each switch of the commands to the next.
    """
    span = float(data.time[-1] - data.time[0])
    time = np.linspace(data.time[0], data.time[-1], int(np.clip(span / _STEP, *_COUNTS)))
    v = {d.axis.name: np.interp(time, d.time, d.velocity) for d in beside}
    held = np.maximum(np.searchsorted(data.switches + delay, time, side="right") - 1, 0)
    angles = {d.axis.name: np.interp(time, d.time, d.values) for d in beside if d.recording.is_position}
    force = thrust[held] + _coupling(data.axis, v, base) + _restoring(data.axis, angles, base)
    own = v[data.axis.name]
    rows = np.array([-np.abs(own) * own, -own, np.ones(len(own)), force])
    integrals = cumulative_trapezoid(rows, time, initial=0.0)
    n = int(np.clip(_INTERVAL / span * len(time), 1, len(time) // 2))
    gained, impulses = own[n:] - own[:-n], integrals[:, n:] - integrals[:, :-n]
    return np.column_stack([gained, *-impulses[:3]]), impulses[3]


def _coupling(axis: Axis, velocities: Mapping[str, Array], base: Rov) -> Array | float:
    """Return the force of coupling of surge, sway and yaw along an axis; 0 where a velocity is not measured."""
    layout = base.layout
    if not layout.is_linked or not {SURGE.name, SWAY.name} <= {*layout.kinds}:
        return 0.0
    M_u, M_v = (base.inertia(layout.kinds[form.name]) for form in (SURGE, SWAY))
    u, v, r = (velocities.get(form.name, 0.0) for form in (SURGE, SWAY, YAW))
    found = {SURGE.name: M_v * v * r, SWAY.name: -M_u * u * r, YAW.name: (M_u - M_v) * u * v}
    return found.get(axis.name, 0.0)


def _restoring(axis: Axis, angles: Mapping[str, Array], base: Rov) -> Array | float:
    """Return the moment of weight and buoyancy about the axis of roll or pitch; 0 where the angle is not measured."""
    if axis not in (ROLL, PITCH) or axis.name not in angles:
        return 0.0
    W, B, z_G, z_B = (base.coefficients.get(name, 0.0) for name in ("W", "B", "z_G", "z_B"))
    roll, pitch = (angles.get(form.name, 0.0) for form in (ROLL, PITCH))
    return np.asarray((B * z_B - W * z_G) * (np.cos(pitch) * np.sin(roll) if axis is ROLL else np.sin(pitch)))
