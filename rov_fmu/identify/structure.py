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

from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.adapter.smoothing import without_spikes
from rov_fmu.identify.driving import curves_of
from rov_fmu.identify.effects.current import is_in_flow
from rov_fmu.identify.least_squares import basis, scaled
from rov_fmu.identify.noise_spectrum import cosines, noise_spectrum
from rov_fmu.identify.recordings.recordings_fit import RecordingsFit
from rov_fmu.identify.recordings.residual_analysis import Simulation
from rov_fmu.identify.simulation.linear_response import LinearResponse
from rov_fmu.model.layout import SURGE, SWAY
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.findings import Finding

_CHANCE = 1e-4
"""The probability of a false alarm by one cause; there are about ten causes."""
_FREEDOM = 30.0
"""The assumed degrees of freedom of the noise spectrum. They are few, so that an error of the spectrum raises no
alarm."""
_COEFFICIENTS = 512
"""The number of coefficients of the cosine transform that are tested; faster ones contain no motion."""
_LAG = 0.2
"""The time constant of the tested lag, s. It represents lags of any length, because the delay is projected out and only
the shape counts."""
_SLOW = 12
"""The number of cosines over time that stand for an unknown slow force."""
_BY_RECORDING = ("drift", "recording", "unknown")
"""The causes whose size may differ between recordings."""
_NEGLIGIBLE = 1e-6
"""Residuals smaller than this share of the range of the measured values are rounding errors, and are not tested."""
_LEAST_RECORDINGS = 3
"""The least number of recordings for which a single different one can be recognised."""
_LOGGED = 1.2
"""The score of a cause is multiplied by this factor if a column of the logs measures it."""


def on_structure(fit: RecordingsFit) -> Iterator[Finding]:
    """Yield a finding for each recording that the model does not explain: the most likely cause, and since when."""
    with threadpool_limits(1, user_api="blas"):  # threads make such small systems slower
        cases = _cases(fit)
        misfits = _misfits(cases) if cases else {}
    if not misfits:
        return
    logged = {name for case in cases for name in case.recording.context}
    scores = {name: misfit.score * (_LOGGED if name in logged else 1.0) for name, misfit in misfits.items()}
    cause = max(scores, key=lambda name: scores[name])
    if cause != "lag":  # a lag explains part of many a misfit, and an unknown force most of it
        cause = max(scores.keys() - {"lag", "unknown"} or {"unknown"}, key=lambda name: scores[name])
    parts = np.split(misfits[cause].explained, np.cumsum([len(case.spread) for case in cases[:-1]]))
    worst = max(range(len(cases)), key=lambda n: float(parts[n] @ parts[n]))
    if cause in _BY_RECORDING and (odd := _odd_one(cases)) is not None:
        cause, worst = "odd one", odd
    for n, (case, part) in enumerate(zip(cases, parts, strict=True)):
        start = case.visible_from(part)
        if n == worst or (start is not None and cause != "odd one"):
            found = Finding("unexplained", fit.axis.name, file=case.recording.file, names={"cause": cause})
            if cause == "lag":
                found = replace(found, kind="lag suggested", names={})
            yield replace(found, numbers={"start": start or 0.0})


def _odd_one(cases: Sequence["_Case"]) -> int | None:
    """Return the place of the only recording without which the model explains all others, or None."""
    if len(cases) < _LEAST_RECORDINGS:
        return None
    with threadpool_limits(1, user_api="blas"):
        odd = [n for n in range(len(cases)) if not _misfits([*cases[:n], *cases[n + 1 :]])]
    return odd[0] if len(odd) == 1 else None


def _cases(fit: RecordingsFit) -> list["_Case"]:
    """Return the recordings that can be tested.

    One recording may show little of its slow noise. Relative to its fast noise, its spectrum is therefore at least the
    mean of the spectra of all recordings with the same sensor.
    """
    found: list[tuple[_Recorded, Array]] = []
    for s in fit.simulations:
        if np.ptp(s.residuals) > _NEGLIGIBLE * np.ptp(s.measured):
            delay = fit.delay_of(s.recording.file)
            recorded = _Recorded(s, LinearResponse(fit.rov, s.recording, s.time, s.velocity, delay))
            if (spectrum := recorded.spectrum()) is not None:
                found.append((recorded, spectrum))
    cases = []
    for recorded, own in found:
        is_position = recorded.simulation.recording.is_position
        alike = [other for each, other in found if each.simulation.recording.is_position == is_position]
        at = np.linspace(0.0, 1.0, len(own), endpoint=False)  # frequencies relative to that of sampling
        shapes = [np.interp(at, np.linspace(0.0, 1.0, len(o), endpoint=False), o / o[-1]) for o in alike]
        cases.append(_Case(recorded, np.maximum(own, own[-1] * np.mean(shapes, axis=0))))
    return cases


@dataclass(frozen=True, eq=False)
class _Recorded:
    """One recording, and the linear response of the fitted model at its n samples."""

    simulation: Simulation
    response: LinearResponse

    # ---- What the fit may have absorbed, and what it cannot contain ----

    @cached_property
    def shared(self) -> Array:
        """The response to errors of thrust, dead band and drag in both directions, n x 8."""
        v, thrust, forces = self.simulation.velocity, self.response.thrust, []
        for F in (thrust, np.sign(thrust)):
            forces += [np.maximum(F, 0.0).sum(axis=1), np.minimum(F, 0.0).sum(axis=1)]
        for speed in (np.maximum(v, 0.0), np.minimum(v, 0.0)):
            forces += [speed, speed * speed]
        return self.response.by_force(*forces)

    @cached_property
    def own(self) -> Array:
        """The response to the start, load, delay and current of this recording, n x 5 or n x 6."""
        s, response = self.simulation, self.response
        one = np.ones(len(response.time))
        starts = response.by_force(0.0 * one, first=1.0), one * s.recording.is_position
        current = response.by_velocity(self._current)
        return np.column_stack([*starts, response.by_force(one), np.gradient(s.modelled, s.time), current])

    @cached_property
    def causes(self) -> dict[str, Array]:
        """The response to each cause, n x k each."""
        s, response = self.simulation, self.response
        F, v, t = response.thrust.sum(axis=1), s.velocity, response.time / response.time[-1]
        beyond = [np.sign(F) * np.maximum(np.abs(F) - share * np.abs(F).max(), 0.0) for share in (0.5, 0.75)]
        found = {
            "drift": response.by_force(F * t, t),
            "recording": response.by_force(F, v, v * np.abs(v)),
            "tether": response.by_force(self._displacement),
            "saturation": response.by_force(*beyond),
            "scale": (s.modelled - s.modelled[0])[:, None] * s.recording.is_position,
            "unknown": response.by_force(*(np.cos(np.pi * k * t) for k in range(1, _SLOW + 1))),
        }
        if not any(curve.has_lag for curve in curves_of(response.rov.layout, s.recording.axis)):
            found["lag"] = response.by_force(response.lagging(F, _LAG) - F)
        for name, values in s.recording.context.items():
            x = self._sampled(values)
            found[name] = response.by_force(F * (x - x.mean()), x - x.mean())
            if name in ("roll", "pitch"):  # a tilted sensor also measures the velocities of other axes
                across = np.column_stack([self._beside("u"), self._beside("v")])
                turning = across * np.gradient(x, s.time)[:, None]
                turned = response.by_velocity(across * x[:, None]), response.by_force(turning)
                found[name] = np.hstack([found[name], *turned])
        return found

    @cached_property
    def _directions(self) -> dict[str, Array]:
        """The unit vectors along u and v by the logged heading, with components north and east, n x 2 each."""
        psi = self._sampled(self.simulation.recording.beside["psi"])
        north, east = np.cos(psi), np.sin(psi)
        return {"u": np.column_stack([north, east]), "v": np.column_stack([-east, north])}

    @cached_property
    def _current(self) -> Array:
        """The velocity along the axis of currents of 1 m/s: north and east, or along the axis without a heading."""
        axis = self.simulation.recording.axis
        if is_in_flow(self.simulation.recording):
            return self._directions[axis.velocity]
        return np.full((len(self.simulation.time), 1), float(axis in (SURGE, SWAY)))

    @cached_property
    def _displacement(self) -> Array:
        """The displacement from the start, as a component along the present direction of the axis, n."""
        s, axis = self.simulation, self.simulation.recording.axis
        if not is_in_flow(s.recording):
            return self.response.integral(s.velocity[:, None])[:, 0]
        place = np.zeros((len(s.time), 2))
        for name, direction in self._directions.items():
            speed = s.velocity if name == axis.velocity else self._beside(name)
            place += self.response.integral(speed[:, None] * direction)
        return np.asarray((place * self._directions[axis.velocity]).sum(axis=1))

    def _beside(self, velocity: str) -> Array:
        """Return another logged velocity at the n samples, or 0 if it is not logged."""
        recording = self.simulation.recording
        return self._sampled(recording.beside.get(velocity, np.full(len(recording.time), np.nan)))

    def _sampled(self, values: Array) -> Array:
        """Return values of the log at the n samples, or 0 if all are missing."""
        there = np.isfinite(values)
        if not there.any():
            return np.zeros(len(self.simulation.time))
        return np.interp(self.simulation.time, self.simulation.recording.time[there], values[there])

    @cached_property
    def residuals(self) -> Array:
        """The residuals without spikes."""
        return without_spikes(self.simulation.residuals)

    def spectrum(self) -> Array | None:
        """Return the variance of the noise in each coefficient of its cosine transform; None for too few samples."""
        return noise_spectrum(self.residuals, np.hstack([self.shared, self.own, *self.causes.values()]))


@dataclass(frozen=True, eq=False)
class _Case:
    """One recording, whitened by the spectrum of the sensor's noise."""

    recorded: _Recorded
    spectrum: Array
    """n: the variance of the noise in each coefficient of its cosine transform."""

    @property
    def recording(self) -> Recording:
        """The recording itself."""
        return self.recorded.simulation.recording

    @property
    def time(self) -> Array:
        """The times of its n samples, s."""
        return self.recorded.simulation.time

    @cached_property
    def spread(self) -> Array:
        """The Cholesky factor of the covariance of the slow coefficients.

        The unknown times of switches add to the noise of the sensor.
        """
        S = cosines(self.recorded.response.by_switches())[:_COEFFICIENTS]
        return np.asarray(np.linalg.cholesky(S @ S.T + np.diag(self.spectrum[:_COEFFICIENTS])))

    def white(self, values: Array) -> Array:
        """Return the slow coefficients of the transform of n or n x k values, in standard deviations of the noise."""
        return np.asarray(solve_triangular(self.spread, cosines(values)[:_COEFFICIENTS], lower=True))

    @cached_property
    def white_shared(self) -> Array:
        """The whitened response to errors that all recordings share."""
        return self.white(self.recorded.shared)

    @cached_property
    def white_own(self) -> Array:
        """The whitened response to errors of this recording."""
        return self.white(self.recorded.own)

    @cached_property
    def white_residuals(self) -> Array:
        """The whitened residuals."""
        return self.white(self.recorded.residuals)

    @cached_property
    def white_causes(self) -> dict[str, Array]:
        """The whitened response to each cause."""
        return {name: self.white(response) for name, response in self.recorded.causes.items()}

    def visible_from(self, misfit: Array) -> float | None:
        """Return the time from which a whitened misfit exceeds the sensor's noise, s; None where it never does."""
        values = idct(self.spread @ misfit, n=len(self.time), norm="ortho")
        visible = np.flatnonzero(np.abs(values) > np.sqrt(np.mean(self.spectrum)))
        return float(self.time[visible[0]]) if visible.size else None


@dataclass(frozen=True, eq=False)
class _Misfit:
    """The part of the whitened residuals that one cause explains."""

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
    shared = np.concatenate([case.white_shared for case in cases])
    free = basis(scaled(np.hstack([shared, block_diag(*(case.white_own for case in cases))])), 1e-6)
    residuals = np.concatenate([case.white_residuals for case in cases])
    residuals -= free @ (free.T @ residuals)
    names = dict.fromkeys(name for case in cases for name in case.white_causes)
    if len(cases) == 1:
        del names["recording"]
    if len({case.recording.is_position for case in cases}) == 1:
        del names["scale"]
    found = {}
    for name in names:
        size = max(case.white_causes[name].shape[1] for case in cases if name in case.white_causes)
        parts = [case.white_causes.get(name, np.zeros((len(case.spread), size))) for case in cases]
        columns = scaled(block_diag(*parts) if name in _BY_RECORDING else np.concatenate(parts))
        own = basis(columns - free @ (free.T @ columns), 1e-3)
        misfit = _Misfit(own @ (own.T @ residuals), own.shape[1])
        if misfit.count and misfit.chance < _CHANCE:
            found[name] = misfit
    return found
