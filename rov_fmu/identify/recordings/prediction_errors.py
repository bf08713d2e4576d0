"""The errors of predictions in m and m/s (rad and rad/s), with two references: the sensor's noise, and the errors of
predicting no change."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from math import nan
from typing import Literal

import numpy as np

from rov_fmu.identify.adapter.smoothing import WINDOW, kernel, sensor_noise, velocity, without_spikes
from rov_fmu.identify.simulation.prepared import PreparedRecording
from rov_fmu.model.layout import Axis
from rov_fmu.tank.arrays import Array
from rov_fmu.tank.columns import in_degrees

Span = Literal["10 s", "whole recording"]
"""How far ahead the motion is predicted."""
Quantity = Literal["position", "velocity"]
Key = tuple[Span, Quantity]


@dataclass(frozen=True, eq=False)
class Errors:
    """The errors of a prediction at n samples, in SI units."""

    predicted: Array
    unchanged: Array
    """The errors of a model that predicts no change: position and velocity stay what they are at the start."""
    noise: Array
    """The standard deviation of the sensor's noise in the measured quantity."""

    @cached_property
    def rms(self) -> tuple[float, float, float]:
        """The RMS of the prediction, of no change, and of the noise."""
        predicted, unchanged, noise = (float(np.sqrt(np.mean(e**2))) for e in self._all)
        return predicted, unchanged, noise

    @property
    def explained(self) -> float:
        """The predicted share of the change beyond the noise, in mean squares. 1 is a perfect prediction; 0 is as good
        as predicting no change.

        It is NaN where the change is hardly above the noise.
        """
        predicted, unchanged, noise = (value**2 for value in self.rms)
        return 1.0 - max(predicted - noise, 0.0) / (unchanged - noise) if unchanged > 2.0 * noise else nan

    @property
    def _all(self) -> tuple[Array, Array, Array]:
        return self.predicted, self.unchanged, self.noise


def joined(parts: Iterable[Mapping[Key, Errors]]) -> dict[Key, Errors]:
    """Join the errors of several predictions."""
    found: dict[Key, list[Errors]] = {}
    for part in parts:
        for key, errors in part.items():
            found.setdefault(key, []).append(errors)
    return {
        key: Errors(*(np.concatenate(arrays) for arrays in zip(*(e._all for e in some), strict=True)))
        for key, some in found.items()
    }


def errors_of(data: PreparedRecording, predicted: Array, first: int) -> dict[Quantity, Errors]:
    """Return the errors of predicted values (n) of a recording from sample `first` on.

    A sensor measures one of the quantities. A velocity is the derivative of the positions, smoothed as the measured one
    is; a position is the integral of the velocity since the start.
    """
    values, noise = without_spikes(data.values), sensor_noise(data.values)
    start, rest = first - 1, slice(first, None)
    level, every = predicted[start], np.ones(len(values) - first)
    measured = Errors(predicted[rest] - values[rest], level - values[rest], noise * every)
    if data.recording.is_position:
        even, smooth = velocity(data.time, predicted, is_position=True)
        v = np.interp(data.time, even, smooth)
        spread = noise * float(np.linalg.norm(kernel(even, WINDOW, is_position=True)))
        of_velocity = Errors(v[rest] - data.velocity[rest], v[start] - data.velocity[rest], spread * every)
        return {"position": measured, "velocity": of_velocity}
    steps = np.diff(data.time[start:])
    covered, missed = (np.cumsum(0.5 * steps * (v[start:-1] + v[rest])) for v in (values, predicted - values))
    return {"position": Errors(missed, -covered, noise * np.sqrt(np.cumsum(steps**2))), "velocity": measured}


def shown_in(axis: Axis, quantity: Quantity) -> tuple[float, str]:
    """Return the factor from SI units to those of a report, and their name: angles are in degrees there."""
    return in_degrees(axis.position_unit if quantity == "position" else axis.unit)
