"""The ratios of thrust and drag in reverse to those ahead."""

from collections.abc import Iterator, Mapping
from typing import Any

from rov_fmu.identify.effects.effect import Effect, Setting
from rov_fmu.model.layout import AXES, REVERSE, coefficient_name


class _Ratio(Effect):
    """A ratio of coefficients in reverse to those ahead."""

    neutral = begin = likely = 1.0
    limits = 0.05, 20.0

    @property
    def is_one_of_many(self) -> bool:
        """True: each axis and each curve may have such a ratio."""
        return True

    def coefficients(self, rov: Mapping[str, Any], value: Any) -> dict[str, Any]:
        """Return the coefficients in reverse."""
        return {reverse: value * rov[forward] for reverse, forward in self.pairs()}


class ReverseThrust(_Ratio):
    """The ratio of the thrust of a curve in reverse to its thrust ahead."""

    kind = "reverse thrust"
    words = "ratio of the thrust in reverse to the thrust ahead"
    sentence = "the thrust of {of} in reverse is {value} times the thrust ahead{interval}. The model contains this"
    order = 3

    @classmethod
    def candidates(cls, setting: Setting) -> Iterator[Effect]:
        """Yield the ratio of each curve without separate coefficients in reverse."""
        return (cls(name) for name, curve in setting.curves.items() if "a_t" + REVERSE not in curve.keys)

    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Return the coefficients of thrust in reverse and ahead."""
        return tuple(
            (coefficient_name(key + REVERSE, self.of), coefficient_name(key, self.of)) for key in ("a_t", "b_t")
        )


class ReverseDrag(_Ratio):
    """The drag of an axis in reverse."""

    kind = "reverse drag"
    words = "ratio of the drag in reverse to the drag ahead"
    sentence = "the drag of {of} in reverse is {value} times the drag ahead{interval}. The model contains this"
    order = 1

    @classmethod
    def candidates(cls, setting: Setting) -> Iterator[Effect]:
        """Yield the ratio of each axis whose drag is fitted, and has no separate coefficients in reverse."""
        for axis in setting.axes:
            keys = setting.base.layout.kinds[axis.name].keys
            if "a_d" + REVERSE not in keys and axis.coefficient("a_d") not in setting.known:
                yield cls(axis.name)

    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Return the coefficients of drag in reverse and ahead."""
        axis = AXES[self.of]
        return tuple((axis.coefficient(key + REVERSE), axis.coefficient(key)) for key in ("a_d", "b_d"))
