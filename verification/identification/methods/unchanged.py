"""No change: what every method should beat, and what errors are relative to."""

import numpy as np

from rov_fmu.equation.catalogue import Axis
from rov_fmu.identify.likelihood.records import SampledLog
from rov_fmu.tank.arrays import Array
from verification.identification.data import Split
from verification.identification.protocol import Known


class Unchanged:
    """Every sensor keeps showing its last value."""

    name, has_bands = "no change", False

    def fit(self, split: Split) -> None:
        """Nothing is fitted."""

    def predict(self, log: SampledLog, begin: float, span: float) -> tuple[Array, Array]:
        """Return the last sample of the sensor before each start."""
        record = log.record
        since = record.time - record.time[0] - begin
        start = record.time[0] + begin + (0.0 if span == np.inf else span * np.floor(since / span))
        values = record.value.copy()
        for n in range(len(record.sensors)):
            own = np.flatnonzero(record.sensor == n)
            last = np.searchsorted(record.time[own], np.broadcast_to(start, len(values))[own]) - 1
            values[own] = record.value[own][np.maximum(last, 0)]
        return values, np.zeros(len(values))

    def coefficients(self, axis: Axis) -> Known:  # noqa: ARG002
        """There are none."""
        return {}
