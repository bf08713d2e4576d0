"""No change, and constant velocity: what every method should beat."""

import numpy as np

from rov_fmu.equation.catalogue import Axis
from rov_fmu.tank.arrays import Array
from verification.identification.data import Recording, Split
from verification.identification.methods.motion import predicted
from verification.identification.protocol import Known


class ConstantVelocity:
    """Every axis keeps its velocity, and its position moves on with it."""

    name, uses_thrust, has_bands = "constant velocity", False, False

    def fit(self, split: Split) -> None:
        """Nothing is fitted."""

    def predict(self, recording: Recording, begin: float, span: float) -> tuple[Array, Array]:
        """Continue the state at each start."""
        limit = np.full(len(recording.axes), np.inf)
        values = predicted(lambda _, v, __: np.zeros_like(v), recording, begin, span, limit)[0]
        return values, np.zeros(len(values))

    def coefficients(self, axis: Axis) -> Known:  # noqa: ARG002
        """There are none."""
        return {}


class Unchanged(ConstantVelocity):
    """Every sensor keeps showing its last value."""

    name = "no change"

    def predict(self, recording: Recording, begin: float, span: float) -> tuple[Array, Array]:
        """Return the last sample of the sensor before each start."""
        record = recording.log.record
        since = record.time - record.time[0] - begin
        start = record.time[0] + begin + (0.0 if span == np.inf else span * np.floor(since / span))
        values = record.value.copy()
        for n in range(len(record.sensors)):
            own = np.flatnonzero(record.sensor == n)
            last = np.searchsorted(record.time[own], np.broadcast_to(start, len(values))[own]) - 1
            values[own] = record.value[own][np.maximum(last, 0)]
        return values, np.zeros(len(values))
