"""How well a fit predicts data it was not fitted to: each recording is predicted by a fit to the others."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rov_fmu.identify.recordings.runs import PreparedRecording
from rov_fmu.identify.recordings.simulator import Simulator, solve
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.recording import Recording
from rov_fmu.tank.smoothing import velocity, without_spikes


@dataclass(frozen=True, eq=False)
class Prediction:
    """The prediction of one recording by a fit to the others, at n evenly spaced samples."""

    recording: Recording
    time: Array
    measured: Array
    """The smoothed velocity of the sensor; the prediction is smoothed in the same way."""
    predicted: Array
    fitted: Array
    """The velocity by the fit to all recordings."""
    coefficients: Mapping[str, float]
    """The coefficients of the vehicle by the fit to the others."""

    @property
    def fit(self) -> float:
        """The time-domain fit, see `fit_percent`."""
        return fit_percent(self.measured, self.predicted)

    @property
    def error(self) -> float:
        """The mean square error of the velocity, relative to its mean square."""
        spread = float(np.mean(self.measured**2))
        return float(np.mean((self.measured - self.predicted) ** 2)) / spread if spread > 0.0 else 0.0


@dataclass(frozen=True, eq=False)
class HeldOut:
    """The predictions of all recordings of an axis, or of the two halves of a single one."""

    predictions: tuple[Prediction, ...]
    by_halves: bool

    @property
    def fit(self) -> float:
        """The time-domain fit over all predictions, percent."""
        return self._percent("predicted")

    @property
    def possible(self) -> float:
        """The time-domain fit of the fit to all recordings; the sensor's noise keeps it below 100."""
        return self._percent("fitted")

    def _percent(self, key: str) -> float:
        measured, model = (np.concatenate([getattr(p, k) for p in self.predictions]) for k in ("measured", key))
        return fit_percent(measured, model)


def fit_percent(measured: Array, predicted: Array) -> float:
    """Return 100 (1 - |v - v_predicted| / |v - mean v|): 100 is perfect, 0 is no better than the mean."""
    spread = float(np.linalg.norm(measured - measured.mean()))
    return 100.0 * (1.0 - float(np.linalg.norm(measured - predicted)) / spread) if spread > 0.0 else float("nan")


def hold_out(model: Simulator, x: Array) -> HeldOut:
    """Predict every recording of a model of one axis, starting near its solution. Raises MotionError.

    The initial velocity and position of a predicted recording, and its current, are fitted to it, because they are
    independent of the vehicle.
    """
    by_halves = len(model.data) == 1
    parts = _halves(model.data[0]) if by_halves else model.data
    sigma = np.repeat(model.sigma, 2) if by_halves else model.sigma
    fitted = [output.values for output in model.run(x)]
    if by_halves:
        fitted = np.split(fitted[0], [len(parts[0].time)])
    found = (_prediction(model, x, parts, sigma, out, fitted[out]) for out in range(len(parts)))
    return HeldOut(tuple(found), by_halves)


def _prediction(
    model: Simulator, x: Array, parts: Sequence[PreparedRecording], sigma: Array, out: int, fitted: Array
) -> Prediction:
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
    first = solve(thin, thin.start({}, {}), "linear", 1e-6).x
    predicted = alone.run(first)[0].values
    all_of = (without_spikes(late.values), predicted, fitted)
    smooth = [velocity(late.time, values, is_position=late.recording.is_position) for values in all_of]
    measured, by_others, by_all = (v for _, v in smooth)
    return Prediction(late.recording, smooth[0][0], measured, by_others, by_all, alone.base.coefficients)


def _halves(data: PreparedRecording) -> tuple[PreparedRecording, PreparedRecording]:
    first = (
        np.arange(len(data.time)) < len(data.time) // 2
    )  # half of the samples, since a gap may take most of the time
    return data.part(first), data.part(~first)
