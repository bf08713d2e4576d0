"""How methods are compared: each is fitted to the training recordings, and predicts the test recordings.

A recording after its first 5 s is divided into spans of 1, 2, 5 or 10 s, or is one span to its end (open loop). All
samples in a span are predicted from the samples before its start and the commands until each sample. Methods without
bands of their own get them from their errors in the training recordings, by sensor and by the time ahead.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf
from time import process_time
from typing import Protocol

import numpy as np

from rov_fmu.equation.catalogue import Axis
from rov_fmu.identify.likelihood.records import SampledLog
from rov_fmu.tank.arrays import Array
from verification.identification.data import Split

SPANS = (1.0, 2.0, 5.0, 10.0, inf)
"""s."""
BEGIN = 5.0
"""When the first prediction starts, s after the first sample."""
_AHEAD = np.array([0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 40.0])
"""The times ahead between which the errors of the training are taken together, s."""

Known = Mapping[str, tuple[float, float, float]]
"""Coefficients of an axis by name: the value and its 95 % interval."""


class Method(Protocol):
    """A method of identification."""

    name: str
    has_bands: bool
    """True if its variances are those of measured minus predicted; False if the errors of the training are missing."""

    def fit(self, split: Split) -> None:
        """Fit the method to the training recordings."""

    def predict(self, log: SampledLog, begin: float, span: float) -> tuple[Array, Array]:
        """Return the value and the variance for each sample of a recording; before `begin` they do not count.

        The predictions start anew at `begin` (s after the first sample) and after each span.
        """

    def coefficients(self, axis: Axis) -> Known:
        """Return V_ss and the drag over inertia of an axis, if the method has coefficients."""


@dataclass(frozen=True, eq=False)
class Predicted:
    """The predictions of one recording over one span. n samples."""

    log: SampledLog
    span: float
    error: Array
    """n: measured minus predicted, angles within half a turn."""
    deviation: Array
    counts: Array
    """n: True after the begin."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a method did with a data set."""

    method: Method
    split: Split
    predictions: Sequence[Predicted]
    seconds: float
    """Processor time of the fit and of all predictions."""


def run(method: Method, split: Split, spans: Sequence[float] = SPANS) -> Outcome:
    """Fit a method to the training recordings of a data set, and predict the test recordings."""
    start = process_time()
    method.fit(split)
    bands = (
        None if method.has_bands else _Bands([_predicted(method, r, s, None) for r in split.training for s in spans])
    )
    found = [_predicted(method, log, span, bands) for log in split.test for span in spans]
    return Outcome(method, split, found, process_time() - start)


def ahead(log: SampledLog, span: float) -> Array:
    """Return how long before each sample its prediction starts, s; negative before the first start."""
    since = log.record.time - log.record.time[0] - BEGIN
    return np.asarray(since if span == inf else np.where(since < 0.0, since, since % span))


class _Bands:
    """The mean square error of a method in the training, by quantity and time ahead."""

    def __init__(self, predictions: Sequence[Predicted]) -> None:
        sums: dict[str, Array] = {}
        for one in predictions:
            place = np.searchsorted(_AHEAD, ahead(one.log, one.span), side="right")
            for number, m in enumerate(one.log.measured):
                own = one.counts & (one.log.record.sensor == number)
                found = sums.setdefault(m.channel.quantity.name, np.zeros((2, len(_AHEAD) + 1)))
                for row, weights in enumerate((np.ones(own.sum()), one.error[own] ** 2)):
                    found[row] += np.bincount(place[own], weights, len(_AHEAD) + 1)
        self._variances: dict[str, Array] = {}
        for name, (count, squares) in sums.items():
            seen = np.flatnonzero(count)
            nearest = seen[np.argmin(np.abs(np.arange(len(count))[:, None] - seen), axis=1)]
            self._variances[name] = squares[nearest] / count[nearest]

    def variance(self, log: SampledLog, span: float) -> Array:
        """Return the variance of each sample of a recording."""
        place = np.searchsorted(_AHEAD, ahead(log, span), side="right")
        rows = np.array([self._variances[m.channel.quantity.name] for m in log.measured])
        return np.asarray(rows[log.record.sensor, place])


def _predicted(method: Method, log: SampledLog, span: float, bands: _Bands | None) -> Predicted:
    values, variance = method.predict(log, BEGIN, span)
    record = log.record
    error = record.value - values
    wraps = np.array([m.channel.quantity.wraps for m in log.measured])[record.sensor]
    error = np.where(wraps, (error + np.pi) % (2.0 * np.pi) - np.pi, error)
    if bands:
        variance = variance + bands.variance(log, span)
    return Predicted(log, span, error, np.sqrt(variance), record.time >= record.time[0] + BEGIN)
