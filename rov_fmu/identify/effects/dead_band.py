"""A dead band: the thrust begins at a command above zero."""

from collections.abc import Iterator, Mapping
from typing import Any

from rov_fmu.identify.effects.effect import Effect, Setting
from rov_fmu.model.layout import coefficient_name


class DeadBand(Effect):
    """The dead band of a thrust curve."""

    kind = "dead band"
    words = "dead band of the command"
    sentence = "the thrust of {of} begins at a command of {value}{interval}. The model contains this dead band"
    begin = 0.02
    limits = -0.2, 0.3  # a value below 0 means no dead band; a search that ends at a bound is slow
    deviation = 0.1
    order = 5

    @classmethod
    def candidates(cls, setting: Setting) -> Iterator[Effect]:
        """Yield the dead band of each curve that has none yet."""
        return (cls(name) for name, curve in setting.curves.items() if "c_0" not in curve.keys)

    @property
    def is_one_of_many(self) -> bool:
        """True: each curve may have a dead band."""
        return True

    def is_none(self, value: float) -> bool:
        """Return True for a dead band below zero."""
        return value <= 0.0

    def coefficients(self, rov: Mapping[str, Any], value: Any) -> dict[str, Any]:  # noqa: ARG002
        """Return the dead band of the curve."""
        return {coefficient_name("c_0", self.of): value}
