"""How well a fit predicts data it was not fitted to: each recording is predicted by a fit to the others."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rov_fmu.identify.least_squares import minimize
from rov_fmu.identify.recordings.prediction_errors import Errors, Key, errors_of, joined
from rov_fmu.identify.recordings.runs import PreparedRecording
from rov_fmu.identify.recordings.simulator import Simulator, solve
from rov_fmu.identify.recordings.trajectory import MotionError
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.recording import Recording
from rov_fmu.tank.smoothing import velocity

_AHEAD = 10.0
"""How far ahead the short predictions reach, s."""
_LEAD = 5.0
"""The time before a prediction whose data give its first velocity and position, s; a third of a shorter recording."""
_MOST = 30
"""The largest number of predictions of 10 s in a recording."""


@dataclass(frozen=True, eq=False)
class Prediction:
    """The prediction of one recording by a fit to the others, at n samples."""

    model: Simulator
    """The recording with the vehicle of the fit to the others."""
    current: Array
    """The current in the recording, if any, fitted to all of it because it is independent of the vehicle."""
    start: int
    """The number of samples that give the first velocity and position; the prediction begins after them."""
    values: Array
    """The predicted values of the sensor, n."""

    @property
    def recording(self) -> Recording:
        """The recording; the prediction may be of a half of it."""
        return self._data.recording

    @property
    def time(self) -> Array:
        """The time of the samples, s."""
        return self._data.time

    @property
    def measured(self) -> Array:
        """The smoothed velocity of the sensor, n."""
        return self._data.velocity

    @cached_property
    def predicted(self) -> Array:
        """The predicted velocity, smoothed in the same way, n."""
        even, smooth = velocity(self.time, self.values, is_position=self.recording.is_position)
        return np.interp(self.time, even, smooth)

    @property
    def coefficients(self) -> Mapping[str, float]:
        """The coefficients of the vehicle by the fit to the others."""
        return self.model.base.coefficients

    @property
    def error(self) -> float:
        """The mean square error of the velocity, relative to its mean square."""
        spread = float(np.mean(self.measured**2))
        return float(np.mean((self.measured - self.predicted) ** 2)) / spread if spread > 0.0 else 0.0

    @cached_property
    def errors(self) -> dict[Key, Errors]:
        """The errors over the whole recording, and those of predictions of 10 s where it is long enough for them."""
        whole = errors_of(self._data, self.values, self.start)
        found: dict[Key, Errors] = {("whole recording", quantity): errors for quantity, errors in whole.items()}
        windows = [*_windows(self._data)]
        if not windows:
            return found
        try:
            runs = _predicted(self.model, self.current, windows)
        except MotionError:
            return found
        parts = (errors_of(data, run, start) for (data, start), run in zip(windows, runs, strict=True))
        return found | joined({("10 s", quantity): e for quantity, e in part.items()} for part in parts)

    @property
    def _data(self) -> PreparedRecording:
        return self.model.data[0]


@dataclass(frozen=True, eq=False)
class HeldOut:
    """The predictions of the recordings of an axis, or of the two halves of a single one."""

    predictions: tuple[Prediction, ...]
    by_halves: bool
    failed: tuple[str, ...] = ()
    """The files whose prediction cannot be computed."""

    @cached_property
    def errors(self) -> dict[Key, Errors]:
        """The errors of all predictions together."""
        return joined(prediction.errors for prediction in self.predictions)


def hold_out(model: Simulator, x: Array) -> HeldOut:
    """Predict every recording of a model of one axis by a fit to the others, which starts near the solution x."""
    by_halves = len(model.data) == 1
    parts = _halves(model.data[0]) if by_halves else model.data
    sigma = np.repeat(model.sigma, 2) if by_halves else model.sigma
    found, failed = [], []
    for out, part in enumerate(parts):
        try:
            found.append(_prediction(model, x, parts, sigma, out))
        except MotionError:
            failed.append(part.recording.file)
    return HeldOut(tuple(found), by_halves, tuple(dict.fromkeys(failed)))


def _prediction(model: Simulator, x: Array, parts: Sequence[PreparedRecording], sigma: Array, out: int) -> Prediction:
    unseen, rest = parts[out], [n for n in range(len(parts)) if n != out]
    seen = tuple(parts[n].thinned() for n in rest)
    extras = tuple(e for e in model.extras if not e.is_of_file or any(e.concerns(d.recording) for d in seen))
    others = replace(model, data=seen, sigma=sigma[rest], extras=extras)
    found = solve(others, others.start(dict(model.rov(x).coefficients), model.extra_values(x)), "linear", 1e-6).x
    values = others.extra_values(found)
    delay = sum(v for e, v in values.items() if e.kind == "delay" and not e.is_of_file)
    late = replace(unseen, switches=unseen.switches + delay)
    own = tuple(e for e in model.extras if e.kind == "current" and e.concerns(unseen.recording))
    alone = Simulator((late,), others.rov(found), (), own, sigma[[out]])
    thin = replace(alone, data=(late.thinned(),))
    current = solve(thin, thin.start({}, {}), "linear", 1e-6).x[: thin.shared] if own else np.zeros(0)
    start = _lead(late, float(late.time[0]), min(_LEAD, float(np.ptp(late.time)) / 3.0)) or len(late.time) // 3
    (predicted,) = _predicted(alone, current, [(late, start)])
    return Prediction(alone, current, start, predicted)


def _halves(data: PreparedRecording) -> tuple[PreparedRecording, PreparedRecording]:
    first = (
        np.arange(len(data.time)) < len(data.time) // 2
    )  # half of the samples, since a gap may take most of the time
    return data.part(first), data.part(~first)


# ---- Predictions from a state that the data up to their start give ---------------------------------------------------


def _predicted(model: Simulator, current: Array, parts: Sequence[tuple[PreparedRecording, int]]) -> list[Array]:
    """Predict parts of a recording, each from a number of first samples, to which its initial values are fitted.

    Returns the values of the sensor at all samples of each part. Raises MotionError.
    """
    sigma = np.repeat(model.sigma, len(parts))
    leads = replace(model, data=tuple(data.part(slice(start)).thinned() for data, start in parts), sigma=sigma)

    def at(initial: Array) -> Array:
        return np.concatenate([current, initial])

    first = leads.start({}, {})[leads.shared :]
    if not np.isfinite(leads.residuals(at(first))).all():
        raise MotionError("the motion cannot be computed")
    free = np.full(len(first), np.inf)
    found = minimize(
        lambda initial: leads.residuals(at(initial)),
        first,
        (-free, free),
        jacobian=lambda initial: leads.jacobian(at(initial))[:, leads.shared :],
        tolerance=1e-8,
    )
    ahead = replace(model, data=tuple(data for data, _ in parts), sigma=sigma)
    return [output.values for output in ahead.run(at(found.x))]


def _windows(data: PreparedRecording) -> Iterator[tuple[PreparedRecording, int]]:
    """Yield parts of a recording, spaced evenly along it: the lead of a prediction and the 10 s after it."""
    last = float(data.time[-1]) - _LEAD - _AHEAD
    for begin in np.arange(
        float(data.time[0]), last + 1e-9, max(_AHEAD, (last - float(data.time[0])) / _MOST)
    ).tolist():
        first, end = np.searchsorted(data.time, [begin, begin + _LEAD + _AHEAD]).tolist()
        part = data.part(slice(first, end))
        start = _lead(part, begin, _LEAD) if end - first > 3 else 0
        if start and end - first > 2 * start:  # most of the samples are there
            yield part, start


def _lead(data: PreparedRecording, begin: float, seconds: float) -> int:
    """Return the number of samples in the first seconds; 0 where most of them are missing, or fewer than three."""
    count = int(np.searchsorted(data.time, begin + seconds, side="right"))
    return count if count >= max(3.0, 0.5 * seconds / float(np.median(np.diff(data.time)))) else 0
