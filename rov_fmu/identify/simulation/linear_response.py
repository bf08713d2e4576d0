"""The linear response of a fitted model to forces: what a small cause would add to the measured values."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import solve_banded

from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.simulation.prepared import switched_rows
from rov_fmu.model.layout import REVERSE
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array

_MOST = 300
"""At most this many switches of a recording count as uncertain: the strongest ones."""
LONGEST = 1.0
"""The longest time between two rows in which a switch counts as uncertain, s. Longer ones are gaps."""


@dataclass(frozen=True, eq=False)
class LinearResponse:
    """The response of the model of one axis, linear about its motion, at n samples of a recording."""

    rov: Rov
    recording: Recording
    at: Array
    """The times of the samples, s."""
    velocity: Array
    """n: the velocity through the water."""
    delay: float

    @cached_property
    def time(self) -> Array:
        """The time from the first sample, s."""
        return np.asarray(self.at - self.at[0])

    # ---- Thrust ----

    @cached_property
    def steady(self) -> Array:
        """The force of each thruster along the axis without lag, n x thrusters."""
        held = np.searchsorted(self.recording.time, self.at - self.delay, side="right") - 1
        return self._steady(self.recording.reaching(self.rov.layout)[np.maximum(held, 0)])

    @cached_property
    def thrust(self) -> Array:
        """The force of each thruster along the axis, n x thrusters."""
        columns = []
        for thruster, force in zip(self.rov.layout.thrusters, self.steady.T, strict=True):
            curve = self.rov.layout.curve_of[thruster.name]
            columns.append(self.lagging(force, self.rov[curve.coefficient("T")]) if curve.has_lag else force)
        return np.column_stack(columns)

    def _steady(self, reaching: Array) -> Array:
        """Return the force of each thruster along the axis for its commands, n x thrusters."""
        layout, columns = self.rov.layout, []
        for thruster, commands in zip(layout.thrusters, reaching.T, strict=True):
            curve, effect = layout.curve_of[thruster.name], self.rov.effect(thruster, self.recording.axis)
            levels, places = np.unique(commands, return_inverse=True)
            forces = [effect * self.rov.curve_force(curve, c) if effect else 0.0 for c in levels.tolist()]
            columns.append(self.rov[self.recording.axis.coefficient("alpha")] * np.array(forces)[places])
        return np.column_stack(columns)

    def lagging(self, force: Array, T: float) -> Array:
        """Return the force with a lag of first order, which is steady at the start."""
        fall = np.exp(-np.diff(self.time) / T)
        return _recursion(np.append(fall, 0.0), np.append(force[0], (1.0 - fall) * force[:-1]))

    # ---- Response ----

    def by_force(self, *forces: Array, first: float = 0.0) -> Array:
        """Return the change of the measured values due to forces and an initial velocity, n x k."""
        form = self.rov.layout.kinds[self.recording.axis.name]
        a, b, a_reverse, b_reverse = (
            self.rov[form.coefficient(key + end)] for end in ("", REVERSE) for key in ("a_d", "b_d")
        )
        v, h, gain = 0.5 * (self.velocity[1:] + self.velocity[:-1]), np.diff(self.time), self.rov.gain(form)
        damping = np.where(v >= 0.0, 2.0 * a * v + b, b_reverse - 2.0 * a_reverse * v)
        fall = np.maximum(gain * damping, 1e-6) * h
        gained = -np.expm1(-fall) / fall * gain * h
        changes = gained[:, None] * np.column_stack(forces)[:-1]
        terms = np.vstack([np.full(changes.shape[1], first), changes])
        return self.by_velocity(_recursion(np.append(np.exp(-fall), 0.0), terms))

    def by_velocity(self, velocities: Array) -> Array:
        """Return the change of the measured values due to changes of the velocity, n x k."""
        return self.integral(velocities) if self.recording.is_position else velocities

    def integral(self, values: Array) -> Array:
        """Return the integral from the start by the trapezoidal rule, n x k."""
        steps = 0.5 * (values[1:] + values[:-1]) * np.diff(self.time)[:, None]
        return np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(steps, axis=0)])

    def by_switches(self, between: Array | None = None, *, squared: bool = False) -> Array:
        """Return the response to a delay of each strong switch by one standard deviation, n x switches.

        With `squared`, it is the second-order term of the response. It is proportional to the square of the delay, for
        which the root mean square is used.

        A command that changes between two rows of a log changes at an unknown time between them, whose standard
        deviation is the time between the rows divided by √12. `between` has the times about which the switches of the
        recording scatter; without it these are the rows.
        """
        rows, reaching = self.recording.time, self.recording.reaching(self.rov.layout)
        switched = switched_rows(reaching)[1:]
        at = (rows[switched] if between is None else between) + self.delay
        inside = (at >= self.at[0]) & (at < self.at[-1])
        switched, at = switched[inside], at[inside]
        if not len(switched):
            return np.zeros((len(self.at), 0))
        jumps = self._steady(reaching[switched]).sum(axis=1) - self._steady(reaching[switched - 1]).sum(axis=1)
        width = np.minimum(rows[switched] - rows[switched - 1], LONGEST)
        impulses = -jumps * width / np.sqrt(12.0)
        last = np.argsort(-np.abs(impulses))[:_MOST]
        if not squared:
            return self.by_force(self._pulses(at[last]) * impulses[last])
        step = 0.5 * float(np.median(np.diff(self.at)))
        slopes = (self._pulses(at[last] + step) - self._pulses(at[last] - step)) / (2.0 * step)
        return self.by_force(slopes * (0.5 * jumps * width**2 / np.sqrt(80.0))[last])

    def _pulses(self, times: Array) -> Array:
        """Return forces, held from each sample to the next, that equal unit impulses at some times, n x times.

        An impulse is divided between the two neighbouring steps whose middles lie before and after it, in such a way
        that its mean time is exact.
        """
        steps = np.diff(self.at)
        middles = self.at[:-1] + 0.5 * steps
        after = np.clip(np.searchsorted(middles, times), 1, len(middles) - 1)
        share = np.clip((times - middles[after - 1]) / (middles[after] - middles[after - 1]), 0.0, 1.0)
        found, column = np.zeros((len(self.at), len(times))), np.arange(len(times))
        found[after - 1, column] = (1.0 - share) / steps[after - 1]
        found[after, column] = share / steps[after]
        return found


def _recursion(factor: Array, terms: Array) -> Array:
    """Solve x_(n+1) = factor_n x_n + terms_(n+1) with x_0 = terms_0, where terms is N or N x k."""
    return np.asarray(solve_banded((1, 0), np.array([np.ones(len(factor)), -factor]), terms))
