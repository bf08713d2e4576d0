"""A lag of the thrusters: the thrust follows its command with a time constant."""

from collections.abc import Iterator, Mapping
from typing import Any

from rov_fmu.identify.effects.effect import Effect, Setting
from rov_fmu.model.layout import Axis, coefficient_name


class Lag(Effect):
    """The lag of a thrust curve, fitted on request."""

    kind = "lag"
    words = "lag of the thrusters"
    sentence = (
        "the thrust of {of} follows the commands with a time constant of {value} s{interval}. The model "
        "contains this lag"
    )
    begin = 0.1
    limits = 0.05, 10.0
    order = 7

    @classmethod
    def candidates(cls, setting: Setting) -> Iterator[Effect]:
        """Yield the lags of the curves for which `[fit] lag` asks."""
        return (cls(name) for name in setting.curves if name in setting.requests.lag)

    def unit(self, axis: Axis) -> str:  # noqa: ARG002
        """Return the unit of time."""
        return "s"

    def coefficients(self, rov: Mapping[str, Any], value: Any) -> dict[str, Any]:  # noqa: ARG002
        """Return the time constant of the curve."""
        return {coefficient_name("T", self.of): value}
