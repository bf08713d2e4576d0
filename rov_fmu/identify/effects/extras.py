"""What is fitted beside drag and β: what recordings bring with them, and what a vehicle may have besides."""

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
    """One number more: a constant load, the delay from the commands to the motion (or between two clocks), a current
    along the axis or north and east, the lag or the dead band of a curve's thrusters; thrust or drag in reverse, as a
    ratio to the other direction's."""

    kind: EffectKind
    of: str
    """An axis, or one recording by its file, or a curve."""
    axis: str = ""
    """Of a recording: the axis, for one file may hold several."""

    @property
    def neutral(self) -> float:
        """As if it were not there."""
        return 1.0 if self.kind.startswith("reverse") else 0.0

    @property
    def is_of_file(self) -> bool:
        """Whether it belongs to one recording and not to the vehicle."""
        return self.of not in AXES and (self.kind in ("load", "delay") or self.is_current)

    @property
    def is_current(self) -> bool:
        """Whether it is of the water."""
        return self.kind.startswith("current")

    def unit(self, axis: Axis) -> str:
        """Of its value."""
        return {"load": axis.load, "delay": "s", "lag": "s"}.get(self.kind, axis.unit if self.is_current else "1")

    def concerns(self, recording: Recording) -> bool:
        """Whether it acts in a recording as a number of its own: a load, a delay, a current."""
        if self.kind in (NORTH, EAST):
            return self.of == recording.file and recording.axis is not HEAVE
        return self.of == recording.axis.name or (self.of, self.axis) == (recording.file, recording.axis.name)

    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Of a ratio: the names of what it scales in reverse, and of what that is the multiple of."""
        if self.kind == "reverse thrust":
            return tuple(
                (coefficient_name(key + REVERSE, self.of), coefficient_name(key, self.of)) for key in ("a_t", "b_t")
            )
        if self.kind == "reverse drag":
            axis = AXES[self.of]
            return tuple((axis.coefficient(key + REVERSE), axis.coefficient(key)) for key in ("a_d", "b_d"))
        return ()

    def coefficients(self, rov: Rov, value: float) -> dict[str, float]:
        """What it makes of the coefficients of a vehicle; nothing where it is of a recording alone, or a delay."""
        if self.kind == "load" and self.of in AXES:
            return {AXES[self.of].coefficient("F_0"): value}
        if key := {"lag": "T", "dead band": "c_0"}.get(self.kind):
            return {coefficient_name(key, self.of): value}
        return {reverse: value * rov[forward] for reverse, forward in self.pairs()}


def with_extras(rov: Rov, extras: Mapping[Extra, float]) -> Rov:
    """The vehicle with what the extras make of it."""
    added: dict[str, float] = {}
    for extra, value in extras.items():
        added |= extra.coefficients(rov, value)
    return rov.extended(added) if added else rov
