"""The opening screen of the identification report: the data, a prediction with its band, the known coefficients."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from rov_fmu.identify.adapter.tank_tests import TankTests
from rov_fmu.identify.identification import Identification
from rov_fmu.identify.recordings.held_out import Prediction
from rov_fmu.identify.recordings.prediction_errors import shown_in
from rov_fmu.identify.recordings.recordings_fit import RecordingsFit, count
from rov_fmu.identify.simulation.limits import MotionError
from rov_fmu.identify.simulation.simulator import Simulator
from rov_fmu.model.layout import Axis
from rov_fmu.model.rov import Rov
from rov_fmu.report.findings import Accuracy, Known, Unseen
from rov_fmu.tank.arrays import Array
from rov_fmu.vehicle.uncertainty import is_factor, quantile

_MOST_KNOWN = 16
"""The largest number of coefficients on the opening screen."""


@dataclass(frozen=True, eq=False)
class ShownPrediction:
    """The prediction that the opening screen shows, n samples in the units of a report."""

    axis: Axis
    file: str
    quantity: str
    """depth, heading, distance or velocity."""
    unit: str
    time: Array
    measured: Array
    predicted: Array
    start: float
    """The time at which the prediction begins, s. The data before it give the initial state."""
    half_band: Array | None
    """Half the width of the 95 % band of the measured values; None where the data do not determine it."""
    by: str
    """The data that the prediction was fitted to, in words."""
    others: int
    """The number of predictions from which this one was chosen, besides itself."""

    @property
    def later(self) -> NDArray[np.intp]:
        """The places of the samples that are predicted."""
        return np.flatnonzero(self.time >= self.start)

    @property
    def share_inside(self) -> float | None:
        """The share of the predicted samples that were measured inside the band; None without a band."""
        if self.half_band is None:
            return None
        off = np.abs(self.measured - self.predicted)[self.later]
        return float(np.mean(off <= self.half_band[self.later]))


def shown_prediction(results: Identification) -> ShownPrediction | None:
    """Return the prediction of unseen data with the median error, None if there is no prediction."""
    found = [
        (prediction, result.recordings, result.held_out.by_halves)
        for result in results.axes
        if result.recordings and result.held_out
        for prediction in result.held_out.predictions
    ]
    if not found:
        return None
    chosen, fit, by_halves = sorted(found, key=lambda one: one[0].error)[len(found) // 2]
    recording, part = chosen.recording, chosen.whole
    factor, unit = shown_in(recording.axis, "position" if recording.is_position else "velocity")
    half_band = band(chosen, fit, 2 if by_halves else len(fit.simulations))
    return ShownPrediction(
        axis=recording.axis,
        file=recording.file,
        quantity=recording.quantity,
        unit=unit,
        time=part.data.time,
        measured=factor * part.data.values,
        predicted=factor * part.values,
        start=float(part.data.time[part.start]),
        half_band=None if half_band is None else factor * half_band,
        by="the other half of the recording" if by_halves else "the other recordings",
        others=len(found) - 1,
    )


def band(prediction: Prediction, fit: RecordingsFit, parts: int) -> Array | None:
    """Return half the width of the 95 % band of the n measured values of an unseen recording, SI units.

    It has three sources: the coefficients, the velocity and position at the start, and the sensor's noise. The
    covariance of the coefficients is that of the fit to all `parts` of the data, increased by parts / (parts - 1)
    because the prediction is by a fit without one of them. Returns None where the data do not determine a coefficient.
    """
    data, first, estimate = prediction.whole.data, prediction.whole.start, fit.estimate
    if parts < 2 or estimate.degrees_of_freedom <= 0.0 or not np.isfinite(estimate.covariance).all():
        return None
    simulation = next(s for s in fit.simulations if s.recording is data.recording)
    coefficients = {name: prediction.coefficients.get(name, value) for name, value in fit.rov.coefficients.items()}
    model = Simulator((data,), Rov(fit.rov.layout, coefficients), estimate.names, (), np.ones(1))
    try:
        slopes = model.jacobian(model.start(coefficients, {}))[: len(data.time)]
    except MotionError:
        return None
    scale = [1.0 / coefficients[name] if is_factor(name) else 1.0 for name in estimate.names]
    covariance = estimate.covariance * np.outer(scale, scale) * parts / (parts - 1.0)
    of_coefficients, of_start = slopes[:, : len(scale)], slopes[:, len(scale) :]
    # The first samples determine the start, so a change of the coefficients also changes the start that fits them.
    inverse = np.linalg.pinv(of_start[:first])
    of_coefficients = of_coefficients - of_start @ (inverse @ of_coefficients[:first])
    variance = simulation.noise**2 * simulation.correlation_time * np.sum((of_start @ inverse) ** 2, axis=1)
    variance += np.einsum("ni,ij,nj->n", of_coefficients, covariance, of_coefficients) + simulation.noise**2
    found = quantile(estimate.degrees_of_freedom) * np.sqrt(np.maximum(variance, 0.0))
    return np.asarray(found) if np.isfinite(found).all() else None


def amount_of_data(tests: TankTests) -> str:
    """Return how much data a vehicle was identified from, in words."""
    lengths: dict[str, float] = {}
    for r in chain(*tests.recordings.values()):
        lengths[r.file] = max(float(r.time[-1]), lengths.get(r.file, 0.0))
    tables = {"force": tests.thrust, "steady velocity": tests.steady, "time constant": tests.time_constants}
    words = [count(sum(map(len, rows.values())), what) for what, rows in tables.items() if rows]
    if lengths:
        seconds = sum(lengths.values())
        total = f"{seconds / 60.0:.0f} min" if seconds >= 120.0 else f"{seconds:.0f} s"
        words.insert(0, f"{count(len(lengths), 'recording')} ({total})")
    return ", ".join(words)


def main_errors(predicted: Sequence[Unseen]) -> Iterator[tuple[Unseen, Accuracy]]:
    """Yield the most descriptive error of each axis: that of the position, over 10 s if there is one."""
    for row in predicted:
        if row.errors:
            yield row, min(row.errors, key=lambda e: (e.of == "velocity", e.span != "10 s"))


def main_coefficients(results: Identification, found: Sequence[Known]) -> tuple[Known, ...]:
    """Return the coefficients of the axes, or, if there are many, those with the widest intervals."""
    of_axes = {form.coefficient(key) for form in results.vehicle.layout.axes for key in (*form.keys, "alpha", "beta")}
    some = [k for k in found if k.name in of_axes] or [*found]
    widest = sorted(some, key=lambda k: -_width(k))[:_MOST_KNOWN]
    return tuple(k for k in some if k in widest)


_MEANINGS = {
    "a_d": "quadratic drag",
    "b_d": "linear drag",
    "F_0": "constant load",
    "beta": "given inertia divided by the identified inertia",
}
"""What coefficients of axes are, in words, by the part of their names before the axis."""


def legend(results: Identification, shown: Sequence[Known]) -> str:
    """Return what the names of the shown coefficients of axes stand for, in words."""
    words = [f"{key}: {meaning}" for key, meaning in _MEANINGS.items() if any(k.name.startswith(key) for k in shown)]
    ends = {form.coefficient("beta").removeprefix("beta"): form.axis.name for form in results.vehicle.layout.axes}
    words += [f"{end}: {axis}" for end, axis in ends.items() if any(k.name.endswith(end) for k in shown)]
    return ", ".join(words)


def _width(known: Known) -> float:
    """Return the width of an interval relative to the value, infinite where there is none."""
    return known.relative[1] - known.relative[0] if known.relative else np.inf
