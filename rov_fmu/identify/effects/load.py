"""A constant load: the net weight, or the pull of a tether."""

from collections.abc import Iterator, Mapping
from typing import Any

from rov_fmu.identify.effects.effect import Effect, Setting, axis_of, of_axis_and_files
from rov_fmu.model.layout import AXES, SURGE, SWAY, Axis

_LARGEST = 1.5
"""The largest load, relative to the strongest thrust."""
_USUAL = 0.2
"""The usual load relative to the strongest thrust. It is also the usual difference of a single recording, relative to
the load of its axis."""


class Load(Effect):
    """A constant load along an axis, or what a single recording adds to it."""

    kind = "load"
    words = "constant load"
    sentence = (
        "a constant load of {value} {unit}{interval} acts in {of} (net weight or tether). The model contains this load"
    )
    sentence_of_file = (
        "in {of}, the constant load differs by {value} {unit}{interval} from the other recordings "
        "(ballast, tether or current). The model does not contain this difference"
    )
    order = 6

    @classmethod
    def candidates(cls, setting: Setting) -> Iterator[Effect]:
        """Yield the load of each axis whose load is not given, and of each recording but the first."""
        for axis in setting.axes:
            if axis.coefficient("F_0") not in setting.known:
                yield from of_axis_and_files(cls, setting, axis)

    @property
    def rank(self) -> int:
        """The order of elimination: ballast is a load in heave; in surge and sway a current is more likely."""
        return 2 if self.of in (SURGE.name, SWAY.name) else super().rank

    def unit(self, axis: Axis) -> str:
        """Return the unit of force or torque."""
        return axis.load

    def bounds(self, setting: Setting) -> tuple[float, float]:
        """Return the largest loads, relative to the thrust."""
        largest = _LARGEST * max(setting.strongest(r.axis) for r in setting.recordings if self.concerns(r))
        return -largest, largest

    def prior(self, setting: Setting) -> float:
        """Return the usual load, relative to the thrust."""
        usual = _USUAL * setting.base.strongest(axis_of(self, setting.recordings))
        return _USUAL * usual if self.is_of_file else usual

    @property
    def input(self) -> str:
        """The force or torque from outside, for the load of a recording."""
        return AXES[self.axis].external if self.is_of_file else ""

    def coefficients(self, rov: Mapping[str, Any], value: Any) -> dict[str, Any]:  # noqa: ARG002
        """Return the load of the axis."""
        return {} if self.is_of_file else {AXES[self.of].coefficient("F_0"): value}
