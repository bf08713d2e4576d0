"""Optional parameters of a fit to recordings, in addition to drag and β."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from rov_fmu.identify.effects.coupling import EAST, NORTH
from rov_fmu.model.layout import AXES, HEAVE, REVERSE, Axis, coefficient_name
from rov_fmu.model.rov import Rov
from rov_fmu.tank.recording import Recording

EffectKind = Literal[
    "load", "delay", "current", "current north", "current east", "lag", "dead band", "reverse thrust", "reverse drag"
]


@dataclass(frozen=True)
class Extra:
    """An optional parameter of a fit.

    It is a constant load, the delay from commands to motion (or between two clocks), a current along the axis or north
    and east, the lag or the dead band of a curve, or the ratio of thrust or drag in reverse to that ahead.
    """

    kind: EffectKind
    of: str
    """The name of an axis, a curve, or the file of one recording."""
    axis: str = ""
    """The axis of the recording, since one file may have several."""

    @property
    def neutral(self) -> float:
        """The value without any effect."""
        return 1.0 if self.kind.startswith("reverse") else 0.0

    @property
    def is_of_file(self) -> bool:
        """True when it belongs to one recording and not to the vehicle."""
        return self.of not in AXES and (self.kind in ("load", "delay") or self.is_current)

    @property
    def is_current(self) -> bool:
        """True when it is a velocity of the water."""
        return self.kind.startswith("current")

    def unit(self, axis: Axis) -> str:
        """Return the unit of its value."""
        return {"load": axis.load, "delay": "s", "lag": "s"}.get(self.kind, axis.unit if self.is_current else "1")

    def concerns(self, recording: Recording) -> bool:
        """Return True when it acts in a recording as a load, a delay or a current."""
        if self.kind in (NORTH, EAST):
            return self.of == recording.file and recording.axis is not HEAVE
        return self.of == recording.axis.name or (self.of, self.axis) == (recording.file, recording.axis.name)

    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Return pairs of coefficient names for a ratio: the one in reverse and the one ahead."""
        if self.kind == "reverse thrust":
            return tuple(
                (coefficient_name(key + REVERSE, self.of), coefficient_name(key, self.of)) for key in ("a_t", "b_t")
            )
        if self.kind == "reverse drag":
            axis = AXES[self.of]
            return tuple((axis.coefficient(key + REVERSE), axis.coefficient(key)) for key in ("a_d", "b_d"))
        return ()

    def coefficients(self, rov: Rov, value: float) -> dict[str, float]:
        """Return the coefficients of the vehicle that it sets; none for one of a recording, or a delay."""
        if self.kind == "load" and self.of in AXES:
            return {AXES[self.of].coefficient("F_0"): value}
        if key := {"lag": "T", "dead band": "c_0"}.get(self.kind):
            return {coefficient_name(key, self.of): value}
        return {reverse: value * rov[forward] for reverse, forward in self.pairs()}


def with_extras(rov: Rov, extras: Mapping[Extra, float]) -> Rov:
    """Return the vehicle with the coefficients that the extras set."""
    added: dict[str, float] = {}
    for extra, value in extras.items():
        added |= extra.coefficients(rov, value)
    return rov.extended(added) if added else rov
