"""The loss of thrust by the speed of advance: a thruster that moves ahead pushes less than one that is held."""

from collections.abc import Iterator, Mapping
from typing import Any

from rov_fmu.identify.effects.effect import Effect, Setting
from rov_fmu.model.layout import Axis, coefficient_name

_NO_THRUST = 2.0
"""The speed at which a usual thruster at full command gives no thrust, m/s."""


class Advance(Effect):
    """The loss of thrust of a curve per speed of advance at full command, fitted on request."""

    kind = "advance"
    words = "loss of thrust by the speed of advance"
    sentence = (
        "the thrust of {of} decreases by {value} {unit}{interval} with the speed of advance at full command. The "
        "model contains this"
    )
    order = 5

    @classmethod
    def candidates(cls, setting: Setting) -> Iterator[Effect]:
        """Yield the loss of the curves for which `[fit] advance` asks."""
        return (cls(name) for name in setting.curves if name in setting.requests.advance)

    @property
    def is_one_of_many(self) -> bool:
        """True: each curve may have such a loss, and it is hard to distinguish from drag."""
        return True

    def unit(self, axis: Axis) -> str:  # noqa: ARG002
        """Return the unit of a force per velocity."""
        return "N.s/m"

    def bounds(self, setting: Setting) -> tuple[float, float]:
        """Return 0, and ten times the usual loss."""
        return 0.0, 10.0 * self.prior(setting)

    def prior(self, setting: Setting) -> float:
        """Return the usual loss of thrusters of this strength."""
        curve = setting.base.layout.curves_by_name[self.of]
        return max(curve.together * setting.base.curve_force(curve, 1.0), 1e-3) / _NO_THRUST

    def is_none(self, value: float) -> bool:
        """Return True if there is no loss."""
        return value <= 0.0

    def coefficients(self, rov: Mapping[str, Any], value: Any) -> dict[str, Any]:  # noqa: ARG002
        """Return the loss of the curve."""
        return {coefficient_name("d", self.of): value}
