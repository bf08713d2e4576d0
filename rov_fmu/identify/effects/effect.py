"""The base class of effects. An effect is an optional parameter of a fit to recordings, in addition to drag and β."""

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf
from typing import Any, ClassVar

from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.driving import curves_of
from rov_fmu.model.layout import Axis, Curve
from rov_fmu.model.rov import Rov
from rov_fmu.tank.description import NO_REQUESTS, Requests


@dataclass(frozen=True, eq=False)
class Setting:
    """The recordings of a fit, and their vehicle."""

    recordings: Sequence[Recording]
    base: Rov
    known: Collection[str] = ()
    """The coefficients that are given, so they are not fitted."""
    requests: Requests = NO_REQUESTS

    @cached_property
    def axes(self) -> list[Axis]:
        """The recorded axes."""
        return list({r.axis.name: r.axis for r in self.recordings}.values())

    @cached_property
    def curves(self) -> dict[str, Curve]:
        """The thrust curves that drive the recorded axes, by name."""
        return {curve.name: curve for axis in self.axes for curve in curves_of(self.base.layout, axis)}

    def of_axis(self, axis: Axis) -> list[Recording]:
        """Return the recordings of an axis."""
        return [r for r in self.recordings if r.axis is axis]

    def strongest(self, axis: Axis) -> float:
        """Return the strongest thrust along an axis, N or N.m."""
        force = self.base[axis.coefficient("alpha")] * self.base.strongest(axis)
        return force if force > 0.0 else 1e6


@dataclass(frozen=True)
class Effect(ABC):
    """An optional parameter of a fit: of an axis, a thrust curve, or one recording.

    It enters the simulation in one of three ways: it sets coefficients of the vehicle, it adds to an input, or it
    delays the commands.
    """

    of: str
    """The name of an axis, a curve, or the file of one recording."""
    axis: str = ""
    """The axis of the recording, because a file may have several. Empty for an effect of an axis or a curve."""

    kind: ClassVar[str]
    """The name of the effect."""
    words: ClassVar[str]
    """The effect in a table of the report."""
    sentence: ClassVar[str]
    """The sentence of a finding about the effect. It has the fields {value}, {unit}, {interval} and {of}."""
    sentence_of_file: ClassVar[str] = ""
    """The sentence for a single recording, whose value is added to that of the axis. Empty if it is the same
    sentence."""
    neutral: ClassVar[float] = 0.0
    """The value without any effect."""
    begin: ClassVar[float] = 0.0
    """The value with which the search begins."""
    likely: ClassVar[float] = 0.0
    """The prior mean of the value."""
    limits: ClassVar[tuple[float, float]] = -inf, inf
    """The least and the greatest value that the search may reach."""
    deviation: ClassVar[float] = 0.5
    """The prior standard deviation of the value."""
    keeps_prior: ClassVar[bool] = False
    """True if the final fit also uses the prior. Other effects have a prior only during the selection."""
    order: ClassVar[int]
    """The place in the order of elimination. Effects with the smallest number are dropped first."""
    is_delay: ClassVar[bool] = False
    """True when it delays the commands."""
    is_current: ClassVar[bool] = False
    """True when it is a velocity of the water."""

    @classmethod
    @abstractmethod
    def candidates(cls, setting: Setting) -> Iterator["Effect"]:
        """Yield the effects of this kind that might act in the recordings."""

    @property
    def is_of_file(self) -> bool:
        """True when it belongs to one recording and not to the vehicle."""
        return bool(self.axis)

    @property
    def is_one_of_many(self) -> bool:
        """True if there are many effects of this kind. One of them is then more easily significant by chance, so the
        test is stricter."""
        return self.is_of_file

    @property
    def rank(self) -> int:
        """The order of elimination of this effect."""
        return 0 if self.is_of_file else self.order

    def unit(self, axis: Axis) -> str:  # noqa: ARG002
        """Return the unit of its value."""
        return "1"

    def concerns(self, recording: Recording) -> bool:
        """Return True when it acts in a recording as a load, a delay or a current."""
        return self.of == recording.axis.name or (self.of, self.axis) == (recording.file, recording.axis.name)

    def bounds(self, setting: Setting) -> tuple[float, float]:  # noqa: ARG002
        """Return the limits of the search."""
        return self.limits

    def prior(self, setting: Setting) -> float:  # noqa: ARG002
        """Return the prior standard deviation; it keeps unidentifiable effects near their neutral values."""
        return self.deviation

    def is_none(self, value: float) -> bool:  # noqa: ARG002
        """Return True if a value other than the neutral one also means no effect."""
        return False

    # ---- How it enters the simulation ----

    @property
    def input(self) -> str:
        """The name of the input to which it is added. Empty if it does not enter as an input."""
        return ""

    def coefficients(self, rov: Mapping[str, Any], value: Any) -> dict[str, Any]:  # noqa: ARG002
        """Return the coefficients of the vehicle that it sets."""
        return {}

    def pairs(self) -> tuple[tuple[str, str], ...]:
        """For a ratio, return pairs of coefficient names: in reverse and ahead."""
        return ()

    def added(self, rov: Rov, value: float) -> Rov:
        """Return the vehicle with the effect."""
        added = self.coefficients(rov.coefficients, value)
        return rov.extended(added) if added else rov


def with_effects(rov: Rov, effects: Mapping[Effect, float]) -> Rov:
    """Return the vehicle with the effects."""
    for effect, value in effects.items():
        rov = effect.added(rov, value)
    return rov


def delay_of(effects: Mapping[Effect, float], recording: Recording) -> float:
    """Return the delay from the commands to the motion in a recording, s."""
    return sum(value for effect, value in effects.items() if effect.is_delay and effect.concerns(recording))


def axis_of(effect: Effect, recordings: Sequence[Recording]) -> Axis:
    """Return the first axis that an effect concerns, or that of the first recording."""
    return next((r.axis for r in recordings if effect.concerns(r)), recordings[0].axis)


def of_axis_and_files(kind: type[Effect], setting: Setting, axis: Axis) -> Iterator[Effect]:
    """Yield the effect of an axis, and an effect for every file except the first, which is added to it."""
    yield kind(axis.name)
    yield from (kind(file, axis.name) for file in [*dict.fromkeys(r.file for r in setting.of_axis(axis))][1:])
