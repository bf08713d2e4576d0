"""Find V_ss and Tau in recordings (sections 4.1-4.3 of the paper): smooth, differentiate, find the steady state, apply
(17).

V_ss comes from the raw samples: it is the slope of the position over the steady part of a hold, or the mean of the
velocity. The raw samples have no correlation from a filter. The remaining correlation (turbulence) is measured and
taken into account.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from math import hypot, isnan, nan, sqrt

import numpy as np

from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.adapter.smoothing import WINDOW, kernel, robust_deviation, velocity, without_spikes
from rov_fmu.model.riccati import RISE
from rov_fmu.tank.arrays import Array

_SAME_COMMAND = 0.005  # fraction of the full command
_LEAST = 20
"""The smallest number of samples of a hold, and of its steady part."""
_BIAS = 0.002
"""The largest relative error of Tau due to the filter."""


@dataclass(frozen=True)
class StepResponse:
    """The response to one held command of a recording, other than zero. Velocities in m/s or rad/s, with sign."""

    file: str
    start: float
    """The start of the hold, s."""
    end: float
    before: float | None
    """The command before; None at the start of the recording."""
    command: float
    V_ss: float | None = None
    V_ss_error: float | None = None
    """The standard error of V_ss."""
    steady: tuple[float, float] | None = None
    """The start and end of the part that V_ss is taken from, s."""
    Tau: float | None = None
    """The time constant (17) of a step from rest, s."""
    Tau_error: float | None = None
    note: str = ""
    """The reason why there is no V_ss or no Tau."""


def steps(recording: Recording) -> tuple[StepResponse, ...]:
    """Return the responses to the held commands of a recording; none if the recording has no command of the axis."""
    if recording.command is None:
        return ()
    there = np.isfinite(recording.values)
    time, values = recording.time[there], without_spikes(recording.values[there])
    found = []
    for start, end, before, command in _holds(recording.time, recording.command):
        if command == 0.0:
            continue
        step = StepResponse(recording.file, start, end, before, command)
        inside = (time >= start) & (time <= end)
        if inside.sum() < _LEAST:
            found.append(replace(step, note="too short"))
            continue
        samples = time[inside], values[inside], recording.is_position
        step = _steady(step, *samples)
        if step.V_ss is not None:
            past = (time >= start - 1.0) & (time <= start)
            rests = past.sum() >= _LEAST // 2 and _rests(time[past], values[past], recording.is_position, step.V_ss)
            step = _rising(step, *samples) if rests else replace(step, note="not from rest: no Tau")
        found.append(step)
    return tuple(found)


def correlation_time(residuals: Array) -> float:
    """Return the number of samples that count as one independent sample: 1 + 2 (sum of autocorrelation), 1 for white
    noise.

    The sum ends where the autocorrelation is no larger than that of white noise by chance.
    """
    from scipy.signal import correlate  # imported here because it is slow, and tables do not need it

    n = len(residuals)
    centred = residuals - residuals.mean()
    lags = correlate(centred, centred, mode="full", method="fft")[n - 1 :]
    if n < 3 or lags[0] <= 0.0:
        return 1.0
    rho = lags[1:] / lags[0]
    chance = np.flatnonzero(rho < 2.0 / sqrt(n))
    return 1.0 + 2.0 * float(rho[: chance[0] if chance.size else n].sum())


def _holds(time: Array, commands: Array) -> Iterator[tuple[float, float, float | None, float]]:
    """Yield start and end (s), the command before and the command of every stretch with a constant command."""
    changes = np.flatnonzero(np.abs(np.diff(commands)) > _SAME_COMMAND) + 1
    before = None
    for first, last in pairwise([0, *changes.tolist(), len(time)]):
        command = float(np.median(commands[first:last]))
        end = time[min(last, len(time) - 1)]
        yield float(time[first]), float(end), before, command
        before = command


def _steady(step: StepResponse, time: Array, values: Array, is_position: bool) -> StepResponse:
    """Find V_ss in the longest final part of the hold over which the velocity changes only by noise."""
    even, v = velocity(time, values, is_position=is_position)
    tail = v[int(0.7 * len(v)) :]
    level = float(np.median(tail))
    off = np.flatnonzero(np.abs(v - level)[: len(v) - len(tail)] > max(0.02 * abs(level), 3.0 * robust_deviation(tail)))
    earliest = int(np.searchsorted(time, even[off[-1]])) + 1 if off.size else 0
    latest = len(time) - max(_LEAST, len(time) // 4)
    for first in np.unique(np.linspace(min(earliest, latest), latest, 15).astype(int)).tolist():
        V, error, drift, drift_error = _level(time[first:], values[first:], is_position)
        if abs(drift) < max(1.5 * drift_error, 0.005 * abs(V)):
            break
    else:
        return replace(step, note="the velocity still changes at the end: no V_ss")
    if drift_error > 0.05 * abs(V):
        return replace(step, note="too short, or too noisy, to tell whether the velocity still changes: no V_ss")
    if V * step.command <= 0.0:
        return replace(step, note="moves against the command: no V_ss")
    hidden = hypot(drift, drift_error) / sqrt(12.0)  # a change that cannot be seen
    return replace(step, V_ss=V, V_ss_error=hypot(error, hidden), steady=(float(time[first]), float(time[-1])))


def _level(time: Array, values: Array, is_position: bool) -> tuple[float, float, float, float]:
    """Return the mean velocity and the change of velocity from start to end, each with its standard error.

    The numbers come from a regression whose errors include the correlation of residuals.
    """
    half = 0.5 * float(time[-1] - time[0])
    s = (time - 0.5 * (time[-1] + time[0])) / half  # -1 ... 1
    order = int(is_position)
    M = np.polynomial.legendre.legvander(s, order + 1)
    coefficients, *_ = np.linalg.lstsq(M, values, rcond=None)
    residuals = values - M @ coefficients
    variance = float(residuals @ residuals) / max(len(values) - M.shape[1], 1) * correlation_time(residuals)
    errors = np.sqrt(np.diag(np.linalg.inv(M.T @ M)) * variance)
    (c, d), (error, d_error) = coefficients[order:].tolist(), errors[order:].tolist()
    per_time = 1.0 / half if is_position else 1.0
    growth = (6.0 if is_position else 2.0) * per_time  # of dP2/ds from -1 to 1, or of P1
    return c * per_time, error * per_time, d * growth, d_error * growth


def _rests(time: Array, values: Array, is_position: bool, V_ss: float) -> bool:
    """Return True when nothing moves before the step, within the noise."""
    V, error, *_ = _level(time, values, is_position)
    return error < 0.1 * abs(V_ss) and abs(V) < max(0.03 * abs(V_ss), 2.0 * error)


def _rising(step: StepResponse, time: Array, values: Array, is_position: bool) -> StepResponse:
    """Find the time when the smoothed velocity reaches (1 - 1/e) V_ss, (17); the smoothing window is adapted to the
    time constant."""
    assert step.V_ss is not None
    assert step.V_ss_error is not None
    window, Tau = max(WINDOW, 0.1 * (step.end - step.start)), nan
    for _ in range(4):
        even, v = velocity(time, values, is_position=is_position, window=window)
        Tau = _crossing(even - step.start, v / step.V_ss)
        if isnan(Tau):
            return replace(step, note="no clear rise to V_ss: no Tau")
        window = min(Tau, 0.5 * (step.end - step.start))
    weights = kernel(even, window, is_position=is_position)
    _, fitted = velocity(time, values, is_position=False, window=window)
    noise = robust_deviation(np.interp(even, time, values) - fitted)
    at = int(np.searchsorted(even - step.start, Tau))
    beside = len(weights) // 4 + 1
    near = slice(max(at - beside, 0), at + beside + 1)
    rise = float(np.polyfit(even[near], v[near], 1)[0])
    error = hypot(noise * float(np.linalg.norm(weights)), RISE * step.V_ss_error) / abs(rise) if rise else np.inf
    return replace(step, Tau=Tau, Tau_error=hypot(error, _BIAS * Tau))


def _crossing(time: Array, rise: Array) -> float:
    """Return the time when a noisy rise passes 1 - 1/e, the mean of the first and the last crossing; or NaN."""
    high = np.flatnonzero(rise > 0.95)
    top = int(high[0]) + 1 if high.size else len(rise)
    up = np.maximum.accumulate(rise[:top])
    down = np.minimum.accumulate(rise[:top][::-1])[::-1]
    if rise[0] > RISE or up[-1] < RISE:
        return nan
    return 0.5 * float(np.interp(RISE, up, time[:top]) + np.interp(RISE, down, time[:top]))
