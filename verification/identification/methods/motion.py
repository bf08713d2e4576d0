"""What the methods share that model each axis alone: derivatives on a grid, a linear model, and simulation.

The acceleration of an axis is a sum of features with weights: thrust, velocity, velocity times its size, and 1; for
roll and pitch also the sine of the angle, and for surge, sway and yaw the product of the two other velocities. Angles
and the depth are the integrals of the velocities of their axes, which is right for a vehicle that is nearly level.
"""

from collections.abc import Callable, Sequence
from math import inf, sqrt
from typing import Any

import numpy as np
from scipy.signal import savgol_filter

from rov_fmu.equation.catalogue import PITCH, ROLL, SURGE, SWAY, YAW, Axis
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.uncertainty import NORMAL
from verification.identification.data import STEP, Recording, Split
from verification.identification.protocol import Known

_SMOOTHED = 9
"""The points of the grid in which a parabola smooths the measurements: 0.45 s."""
_FASTEST = 3.0
"""No velocity of a simulation is larger than so many times the largest of the training."""
_COMMANDS = (0.3, 0.5, -0.3, -0.5)

Accelerations = Callable[[Array, Array, Array], Array]
"""From positions, velocities and thrust, each ... x axes."""


def measured(recording: Recording) -> tuple[Array, Array, Array, Array]:
    """Return positions, velocities, accelerations and thrust on the grid, n x axes, smoothed both ways."""
    grid = recording.grid
    found = np.zeros((3, len(grid), len(recording.axes)))
    for n, axis in enumerate(recording.axes):
        position, velocity = (recording.samples(axis, is_velocity=it) for it in (False, True))
        for samples, first in ((position, 0), (velocity, 1)):
            if samples:
                values = np.interp(grid, *samples)
                for order in range(3 - first):
                    found[first + order, :, n] = savgol_filter(values, _SMOOTHED, 2, deriv=order, delta=STEP)
    return found[0], found[1], found[2], recording.forces(grid)


def features(axes: Sequence[Axis], n: int, p: Array, v: Array, thrust: Array, library: Any = np) -> Array:
    """Return the features of an axis, ... x features. Thrust, velocity, its square and 1 stand first."""
    own = v[..., n]
    found = [thrust[..., n], own, abs(own) * own, library.ones_like(own)]
    if axes[n] in (ROLL, PITCH):
        found.append(library.sin(p[..., n]))
    level = [SURGE, SWAY, YAW]
    if axes[n] in level and all(axis in axes for axis in level):
        one, other = (axes.index(axis) for axis in level if axis is not axes[n])
        found.append(v[..., one] * v[..., other])
    return library.stack(found, axis=-1)  # type: ignore[no-any-return]


def linear(axes: Sequence[Axis], weights: Sequence[Array], library: Any = np) -> Accelerations:
    """Return the accelerations of the linear model with the weights of each axis, for NumPy or JAX.

    The weights may have a row for each of several vehicles, which as many equal parts of the states belong to.
    """

    def of(p: Array, v: Array, thrust: Array) -> Array:
        found = []
        for n, w in enumerate(weights):
            own = np.repeat(w, len(p) // len(w), axis=0) if w.ndim == 2 else w
            found.append((features(axes, n, p, v, thrust, library) * own).sum(axis=-1))
        return library.stack(found, axis=-1)  # type: ignore[no-any-return]

    return of


def largest(split: Split) -> Array:
    """Return the largest velocity of each axis that simulations may have."""
    return np.asarray(_FASTEST * np.max([np.abs(measured(r)[1]).max(axis=0) for r in split.training], axis=0) + 1e-6)


def simulate(rates: Accelerations, p: Array, v: Array, thrust: Array, limit: Array) -> tuple[Array, Array]:
    """Return positions and velocities, s x (m + 1) x axes, from s starts under m steps of thrust, s x m x axes."""
    places, velocities = [p], [v]
    for k in range(thrust.shape[1]):
        held = thrust[:, k]
        middle = np.clip(v + 0.5 * STEP * rates(p, v, held), -limit, limit)
        after = np.clip(v + STEP * rates(p + 0.5 * STEP * v, middle, held), -limit, limit)
        p, v = p + STEP * middle, after
        places.append(p)
        velocities.append(v)
    return np.stack(places, axis=1), np.stack(velocities, axis=1)


def predicted(
    rates: Accelerations, recording: Recording, begin: float, span: float, limit: Array, vehicles: int = 1
) -> Array:
    """Return the value of each sample of a recording by each of some vehicles, vehicles x samples.

    It is simulated from the state at the start of the span.
    """
    record = recording.log.record
    first, last = record.time[0] + begin, record.time[-1]
    length = max(min(span, last - first), STEP)
    starts = first + length * np.arange(max(int(np.ceil((last - first) / length - 1e-9)), 1))
    steps = int(np.ceil(length / STEP)) + 1
    states = [recording.state(start) for start in starts.tolist()]
    p, v = (np.tile(column, (vehicles, 1)) for column in zip(*states, strict=True))
    thrust = np.tile(recording.forces(starts[:, None] + STEP * np.arange(steps)), (vehicles, 1, 1))
    path = simulate(rates, p, v, thrust, limit)
    found = np.tile(record.value, (vehicles, 1))
    segment = np.minimum(np.floor((record.time - first) / length).astype(int), len(starts) - 1)
    for n, sensor in enumerate(record.sensors):
        own = np.flatnonzero((record.sensor == n) & (segment >= 0))
        at, place = segment[own], (record.time[own] - starts[segment[own]]) / STEP
        k = np.minimum(place.astype(int), steps - 1)
        values = path[int(sensor.is_velocity)][:, :, recording.axes.index(sensor.axis)]
        values = values.reshape(vehicles, len(starts), -1)
        found[:, own] = (1.0 - place + k) * values[:, at, k] + (place - k) * values[:, at, k + 1]
    return found


def solved(split: Split, axis: Axis, weights: Array, covariance: Array) -> Known:
    """Return V_ss and the quadratic drag over inertia of the linear model, with intervals by the covariance."""
    if axis in (ROLL, PITCH):
        return {}

    def numbers(w: Array) -> Array:
        push, b, a, load = w[0], -w[1], -w[2], w[3]
        found = []
        for command in _COMMANDS:
            F = push * split.push(axis, command) + load
            root = sqrt(max(b * b + 4.0 * a * abs(F), 0.0))
            found.append(2.0 * F / (b + root) if b + root else inf)
        return np.abs([*found, a])

    value = numbers(weights)
    slopes = np.zeros((len(value), len(weights)))
    for k, error in enumerate(np.sqrt(np.diag(covariance))):
        moved = np.where(np.arange(len(weights)) == k, 0.1 * error, 0.0)
        slopes[:, k] = (numbers(weights + moved) - numbers(weights - moved)) / (0.2 * error + 1e-300)
    half = NORMAL * np.sqrt(np.einsum("ni,ij,nj->n", slopes, covariance, slopes))
    names = [*(f"V_ss {100 * c:g} %" for c in _COMMANDS), "quadratic drag / inertia"]
    return {n: (float(x), float(x - h), float(x + h)) for n, x, h in zip(names, value, half, strict=True)}
