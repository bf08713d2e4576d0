"""The voltage of the battery: thrust is proportional to (voltage / V_0)^n_V."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.effects.effect import Effect, Setting
from rov_fmu.model.layout import coefficient_name
from rov_fmu.model.rov import Rov
from rov_fmu.tank.arrays import Array


@dataclass(frozen=True)
class Voltage(Effect):
    """The exponent n_V of a thrust curve, fitted on request with the logged voltage."""

    kind = "voltage"
    words = "exponent of the voltage in the thrust"
    sentence = (
        "the thrust of {of} is proportional to the voltage to the power of {value}{interval}. The model contains this"
    )
    begin = likely = 1.5
    limits = 1.0, 4.0
    keeps_prior = True
    order = 9

    V_0: float = 1.0
    """The voltage at which the thrust was measured, V: the given one, or the mean of the recordings."""
    usual: float = 1.0
    """The mean voltage of the recordings, V."""

    @classmethod
    def candidates(cls, setting: Setting) -> Iterator[Effect]:
        """Yield the exponent of each curve if `[fit] voltage` asks for it."""
        if setting.requests.voltage:
            voltages = np.concatenate([r.context["voltage"] for r in setting.recordings])
            usual = round(float(np.nanmean(voltages)), 3)
            for name in setting.curves:
                yield cls(name, V_0=setting.requests.measured_at.get(name, usual), usual=usual)

    def is_none(self, value: float) -> bool:
        """Return True for an exponent at the lower limit, which means that the thrust does not depend on the
        voltage."""
        return value <= self.limits[0]

    def coefficients(self, rov: Mapping[str, Any], value: Any) -> dict[str, Any]:  # noqa: ARG002
        """Return the exponent of the curve."""
        return {coefficient_name("n_V", self.of): value}

    def added(self, rov: Rov, value: float) -> Rov:
        """Return the vehicle with a battery, and a curve that depends on its voltage."""
        powered = Rov(replace(rov.layout, voltage=self.usual), rov.coefficients)
        return powered.extended({coefficient_name("V_0", self.of): self.V_0, coefficient_name("n_V", self.of): value})


def voltage_at(recording: Recording, time: Array) -> Array:
    """Return the logged voltage at some times."""
    values = recording.context["voltage"]
    there = np.isfinite(values)
    return np.interp(time, recording.time[there], values[there])
