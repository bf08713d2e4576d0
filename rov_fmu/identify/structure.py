"""Test whether the residuals of a fit to recordings show a cause that the model does not contain.

A cause changes the force on the vehicle or the measured values. The linear response of the fitted model to it is
compared with the residuals, after projecting out everything that the fit may have absorbed (a score test). The
residuals are whitened by the spectrum of the sensor's noise, so correlated noise alone is no misfit.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.fft import idct
from scipy.linalg import block_diag, solve_triangular
from scipy.special import fdtrc
from threadpoolctl import threadpool_limits

from rov_fmu.identify.driving import curves_of
from rov_fmu.identify.recordings.noise_spectrum import cosines, noise_spectrum
from rov_fmu.identify.recordings.recordings_fit import RecordingsFit
from rov_fmu.identify.recordings.residual_analysis import Simulation
from rov_fmu.identify.recordings.trajectory import recursion
from rov_fmu.model.layout import REVERSE, SURGE, SWAY
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.findings import Finding
from rov_fmu.tank.smoothing import without_spikes

_CHANCE = 1e-4
"""The probability of a false alarm by one cause; there are about ten causes."""
_FREEDOM = 30.0
"""The degrees of freedom of the estimated spectrum of the noise; few, so that a wrong spectrum raises no alarm."""
_COEFFICIENTS = 512
"""The number of coefficients of the cosine transform that are tested; faster ones contain no motion."""
_SWITCHES = 300
"""The number of switches of a recording that count as uncertain, strongest first."""
_LAG = 0.2
"""The time constant that stands for a lag of any length, s. The delay is projected out, so only the shape counts."""
_SLOW = 12
"""The number of cosines over time that stand for an unknown slow force."""
_BY_RECORDING = ("drift", "recording", "unknown")
"""The causes whose size may differ between recordings."""
_LOGGED = 1.2
"""The factor by which the score of a cause with a column of its own in the logs is raised above that of the others."""


def on_structure(fit: RecordingsFit) -> Iterator[Finding]:
    """Yield a finding for each recording that the model does not explain: the most likely cause, and since when."""
    with threadpool_limits(1, user_api="blas"):  # threads make such small systems slower
        all_cases = (_Case(fit.rov, s, fit.delay_of(s.recording.file)) for s in fit.simulations)
        cases = [case for case in all_cases if case.spectrum is not None]
        misfits = _misfits(cases) if cases else {}
    if not misfits:
        return
    logged = {name for case in cases for name in case.simulation.recording.context}
    scores = {name: misfit.score * (_LOGGED if name in logged else 1.0) for name, misfit in misfits.items()}
    cause = max(scores, key=lambda name: scores[name])
    if cause != "lag":  # a lag explains part of many a misfit, and an unknown force most of it
        cause = max(scores.keys() - {"lag", "unknown"} or {"unknown"}, key=lambda name: scores[name])
    parts = np.split(misfits[cause].explained, np.cumsum([len(case.spread) for case in cases[:-1]]))
    worst = max(range(len(cases)), key=lambda n: float(parts[n] @ parts[n]))
    for n, (case, part) in enumerate(zip(cases, parts, strict=True)):
        start = case.visible_from(part)
        if start is not None or n == worst:
            found = Finding("unexplained", fit.axis.name, file=case.simulation.recording.file, names={"cause": cause})
            if cause == "lag":
                found = replace(found, kind="lag suggested", names={})
            yield replace(found, numbers={"start": start or 0.0})


@dataclass(frozen=True, eq=False)
class _Case:
    """One recording, and the linear response of the fitted model at its n samples."""

    rov: Rov
    simulation: Simulation
    delay: float

    @cached_property
    def time(self) -> Array:
        """The time from the first sample, s."""
        return np.asarray(self.simulation.time - self.simulation.time[0])

    @cached_property
    def steady(self) -> Array:
        """The force of each thruster along the axis without lag, n x thrusters."""
        layout, recording = self.rov.layout, self.simulation.recording
        held = np.searchsorted(recording.time, self.simulation.time - self.delay, side="right") - 1
        columns = []
        for thruster, commands in zip(layout.thrusters, recording.reaching(layout)[np.maximum(held, 0)].T, strict=True):
            curve, effect = layout.curve_of[thruster.name], self.rov.effect(thruster, recording.axis)
            levels, places = np.unique(commands, return_inverse=True)
            forces = [effect * self.rov.curve_force(curve, c) if effect else 0.0 for c in levels.tolist()]
            columns.append(self.rov[recording.axis.coefficient("alpha")] * np.array(forces)[places])
        return np.column_stack(columns)

    @cached_property
    def thrust(self) -> Array:
        """The force of each thruster along the axis, n x thrusters."""
        columns = []
        for thruster, force in zip(self.rov.layout.thrusters, self.steady.T, strict=True):
            curve = self.rov.layout.curve_of[thruster.name]
            columns.append(self.lagging(force, self.rov[curve.coefficient("T")]) if curve.has_lag else force)
        return np.column_stack(columns)

    def lagging(self, force: Array, T: float) -> Array:
        """Return the force with a lag of first order, which is steady at the start."""
        fall = np.exp(-np.diff(self.time) / T)
        return recursion(np.append(fall, 0.0), np.append(force[0], (1.0 - fall) * force[:-1]))

    def by_force(self, *forces: Array, first: float = 0.0) -> Array:
        """Return the change of the measured values due to forces and an initial velocity, n x k."""
        s, form = self.simulation, self.rov.layout.kinds[self.simulation.recording.axis.name]
        a, b, a_reverse, b_reverse = (
            self.rov[form.coefficient(key + end)] for end in ("", REVERSE) for key in ("a_d", "b_d")
        )
        v, h, gain = s.velocity[:-1], np.diff(self.time), self.rov.gain(form)
        damping = np.where(v >= 0.0, 2.0 * a * v + b, b_reverse - 2.0 * a_reverse * v)
        fall = np.maximum(gain * damping, 1e-6) * h
        gained = -np.expm1(-fall) / fall * gain * h
        changes = gained[:, None] * np.column_stack(forces)[:-1]
        terms = np.vstack([np.full(changes.shape[1], first), changes])
        return self.by_velocity(recursion(np.append(np.exp(-fall), 0.0), terms))

    def by_velocity(self, velocities: Array) -> Array:
        """Return the change of the measured values due to changes of the velocity, n x k."""
        return self.integral(velocities) if self.simulation.recording.is_position else velocities

    def integral(self, values: Array) -> Array:
        """Return the integral from the start by the trapezoidal rule, n x k."""
        steps = 0.5 * (values[1:] + values[:-1]) * np.diff(self.time)[:, None]
        return np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(steps, axis=0)])

    # ---- What the fit may have absorbed, and what it cannot contain ----

    @cached_property
    def shared(self) -> Array:
        """The response to errors of thrust, dead band and drag in both directions, n x 8."""
        v, forces = self.simulation.velocity, []
        for F in (self.thrust, np.sign(self.thrust)):
            forces += [np.maximum(F, 0.0).sum(axis=1), np.minimum(F, 0.0).sum(axis=1)]
        for speed in (np.maximum(v, 0.0), np.minimum(v, 0.0)):
            forces += [speed, speed * speed]
        return self.by_force(*forces)

    @cached_property
    def own(self) -> Array:
        """The response to the start, load, delay and current of this recording, n x 5."""
        s, one = self.simulation, np.ones(len(self.time))
        starts = self.by_force(0.0 * one, first=1.0), one * s.recording.is_position
        current = self.by_velocity(one[:, None] * (s.recording.axis in (SURGE, SWAY)))
        return np.column_stack([*starts, self.by_force(one), np.gradient(s.modelled, s.time), current])

    @cached_property
    def causes(self) -> dict[str, Array]:
        """The response to each cause, n x k each."""
        s, F, v, t = self.simulation, self.thrust.sum(axis=1), self.simulation.velocity, self.time / self.time[-1]
        beyond = [np.sign(F) * np.maximum(np.abs(F) - share * np.abs(F).max(), 0.0) for share in (0.5, 0.75)]
        found = {
            "drift": self.by_force(F * t, t),
            "recording": self.by_force(F, v, v * np.abs(v)),
            "tether": self.by_force(self.integral(v[:, None])),
            "saturation": self.by_force(*beyond),
            "scale": (s.modelled - s.modelled[0])[:, None] * s.recording.is_position,
            "unknown": self.by_force(*(np.cos(np.pi * k * t) for k in range(1, _SLOW + 1))),
        }
        if not any(curve.has_lag for curve in curves_of(self.rov.layout, s.recording.axis)):
            found["lag"] = self.by_force(self.lagging(F, _LAG) - F)
        for name, values in s.recording.context.items():
            x = self._sampled(values)
            found[name] = self.by_force(F * (x - x.mean()), x - x.mean())
            if name in ("roll", "pitch"):  # they turn the velocities of other axes into that of this one
                still = np.zeros(len(s.recording.time))
                across = np.column_stack([self._sampled(s.recording.beside.get(key, still)) for key in "uv"])
                turned = self.by_velocity(across * x[:, None]), self.by_force(across * np.gradient(x, s.time)[:, None])
                found[name] = np.hstack([found[name], *turned])
        return found

    def _sampled(self, values: Array) -> Array:
        """Return values beside the recording at the n samples; 0 where there are none."""
        there = np.isfinite(values)
        if not there.any():
            return np.zeros(len(self.time))
        return np.interp(self.simulation.time, self.simulation.recording.time[there], values[there])

    # ---- Noise ----

    @cached_property
    def residuals(self) -> Array:
        """The residuals without spikes."""
        return without_spikes(self.simulation.residuals)

    @cached_property
    def spectrum(self) -> Array | None:
        """The variance of the noise in each coefficient of its cosine transform; None for too few samples."""
        return noise_spectrum(self.residuals, np.hstack([self.shared, self.own, *self.causes.values()]))

    @cached_property
    def spread(self) -> Array:
        """The Cholesky factor of the covariance of the slow coefficients.

        A command that changes between two rows of a log changes at an unknown time between them, which adds to the
        noise of the sensor. Where it changes on average is a delay.
        """
        assert self.spectrum is not None
        jumps = np.diff(self.steady.sum(axis=1))
        last = np.argsort(-np.abs(jumps * np.diff(self.time)))[:_SWITCHES]
        pulses = np.zeros((len(self.time), len(last)))
        pulses[last, np.arange(len(last))] = jumps[last] / np.sqrt(12.0)
        S = cosines(self.by_force(pulses))[:_COEFFICIENTS]
        return np.asarray(np.linalg.cholesky(S @ S.T + np.diag(self.spectrum[:_COEFFICIENTS])))

    def white(self, values: Array) -> Array:
        """Return the slow coefficients of the transform of n or n x k values, in standard deviations of the noise."""
        return np.asarray(solve_triangular(self.spread, cosines(values)[:_COEFFICIENTS], lower=True))

    def visible_from(self, misfit: Array) -> float | None:
        """Return the time from which a whitened misfit exceeds the sensor's noise, s; None where it never does."""
        assert self.spectrum is not None
        values = idct(self.spread @ misfit, n=len(self.time), norm="ortho")
        visible = np.flatnonzero(np.abs(values) > np.sqrt(np.mean(self.spectrum)))
        return float(self.simulation.time[visible[0]]) if visible.size else None


@dataclass(frozen=True, eq=False)
class _Misfit:
    """What one cause explains of the whitened residuals."""

    explained: Array
    count: int
    """The number of regressors of the cause."""

    @property
    def gain(self) -> float:
        """The explained sum of squares."""
        return float(self.explained @ self.explained)

    @property
    def score(self) -> float:
        """The explained sum of squares, less the cost of the regressors by the Bayesian criterion."""
        return self.gain - self.count * float(np.log(len(self.explained)))

    @property
    def chance(self) -> float:
        """The probability of at least this sum of squares in noise alone."""
        return float(fdtrc(self.count, _FREEDOM, self.gain / self.count))


def _misfits(cases: Sequence[_Case]) -> dict[str, _Misfit]:
    """Return the causes that explain more of the residuals than chance does."""
    shared = np.concatenate([case.white(case.shared) for case in cases])
    free = _basis(_scaled(np.hstack([shared, block_diag(*(case.white(case.own) for case in cases))])), 1e-6)
    residuals = np.concatenate([case.white(case.residuals) for case in cases])
    residuals -= free @ (free.T @ residuals)
    names = dict.fromkeys(name for case in cases for name in case.causes)
    if len(cases) == 1:
        del names["recording"]
    if len({case.simulation.recording.is_position for case in cases}) == 1:
        del names["scale"]
    found = {}
    for name in names:
        size = max(case.causes[name].shape[1] for case in cases if name in case.causes)
        parts = [case.white(case.causes.get(name, np.zeros((len(case.time), size)))) for case in cases]
        columns = _scaled(block_diag(*parts) if name in _BY_RECORDING else np.concatenate(parts))
        basis = _basis(columns - free @ (free.T @ columns), 1e-3)
        misfit = _Misfit(basis @ (basis.T @ residuals), basis.shape[1])
        if misfit.count and misfit.chance < _CHANCE:
            found[name] = misfit
    return found


def _scaled(columns: Array) -> Array:
    """Return the columns that are not zero, with a length of 1."""
    size = np.linalg.norm(columns, axis=0)
    return np.asarray(columns[:, size > 0.0] / size[size > 0.0])


def _basis(columns: Array, least: float) -> Array:
    """Return an orthonormal basis of the space of the columns, without directions that are smaller than `least`."""
    U, s, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(U[:, s > least])
