"""A steady current: along an axis, or north and east where the heading is logged."""

from collections.abc import Iterator

from rov_fmu.identify.adapter.recording import Recording
from rov_fmu.identify.effects.effect import Effect, Setting
from rov_fmu.model.layout import HEAVE, SURGE, SWAY, Axis


class Current(Effect):
    """The velocity of the water along an axis in one recording."""

    kind = "current"
    words = "current along the axis"
    sentence = "in {of}, the water moved at {value} {unit}{interval} along the axis. The fit removes this current"
    limits = -3.0, 3.0
    deviation = 0.3
    order = 4
    is_current = True

    @classmethod
    def candidates(cls, setting: Setting) -> Iterator[Effect]:
        """Yield the current of each file with surge or sway and without a heading."""
        for axis in setting.axes:
            if axis in (SURGE, SWAY):
                files = dict.fromkeys(r.file for r in setting.of_axis(axis) if not is_in_flow(r))
                yield from (cls(file, axis.name) for file in files)

    @property
    def is_one_of_many(self) -> bool:
        """False: each recording may well have a current."""
        return False

    @property
    def rank(self) -> int:
        """The order of elimination."""
        return self.order

    def unit(self, axis: Axis) -> str:
        """Return the unit of the velocity."""
        return axis.unit

    @property
    def input(self) -> str:
        """The current along the axis at a heading of north."""
        return "V_E" if self.axis == SWAY.name else "V_N"


class CurrentNorth(Current):
    """The velocity of the water to the north in one log."""

    kind = "current north"
    words = "current to the north"
    sentence = "in {of}, the water moved north at {value} {unit}{interval}. The fit removes this current"

    @classmethod
    def candidates(cls, setting: Setting) -> Iterator[Effect]:
        """Yield the current of each log with a heading and a velocity over ground."""
        return (cls(file) for file in dict.fromkeys(r.file for r in setting.recordings if is_in_flow(r)))

    @property
    def is_of_file(self) -> bool:
        """True: it belongs to all recordings of a file."""
        return True

    def concerns(self, recording: Recording) -> bool:
        """Return True for the axes of its file that a horizontal current may act on."""
        return self.of == recording.file and recording.axis is not HEAVE

    @property
    def input(self) -> str:
        """The current to the north."""
        return "V_N"


class CurrentEast(CurrentNorth):
    """The velocity of the water to the east in one log."""

    kind = "current east"
    words = "current to the east"
    sentence = "in {of}, the water moved east at {value} {unit}{interval}. The fit removes this current"

    @property
    def input(self) -> str:
        """The current to the east."""
        return "V_E"


def is_in_flow(recording: Recording) -> bool:
    """Return True if a recording can show a current north and east, because the heading is logged."""
    return recording.axis in (SURGE, SWAY) and "psi" in recording.beside
