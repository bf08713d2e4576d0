"""Find room for labels in a drawing: near what they name, and clear of everything else. In drawings y is down."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from math import cos, pi, sin

Place = tuple[float, float]

AROUND: tuple[Place, ...] = tuple((cos(n * pi / 4.0), sin(n * pi / 4.0)) for n in (0, 6, 2, 4, 7, 1, 5, 3))
"""The directions from an object to its label: right, up, down, left, and between these."""
_HEIGHT = 0.17
"""The height of a line of text, inches."""
_GAP = 0.045
"""The least distance between a name and what it names, inches."""


@dataclass
class Space:
    """The occupied space of a drawing, as closely spaced points."""

    inch: float
    """The length of an inch of paper in the drawing, m."""
    busy: list[Place] = field(default_factory=list)

    def line(self, start: Place, end: Place) -> None:
        """Reserve the space of a line."""
        (x, y), dx, dy = start, end[0] - start[0], end[1] - start[1]
        self.busy += [(x + n / 24.0 * dx, y + n / 24.0 * dy) for n in range(25)]

    def ring(self, at: Place, r: float) -> None:
        """Reserve the space of a circle."""
        self.busy += [at, *((at[0] + r * dx, at[1] + r * dy) for dx, dy in AROUND)]

    def box(self, center: Place, width: float) -> None:
        """Reserve the space of a line of text with this width in inches."""
        w, h = width * self.inch, _HEIGHT * self.inch
        self.busy += [(center[0] + n * w / 12.0, center[1] + m * h / 2.0) for n in range(-6, 7) for m in (-1, 0, 1)]

    def name(self, width: float, around: Iterable[tuple[Place, float, Iterable[Place]]]) -> Place:
        """Return the centre of a name, and reserve its space; the width is in inches.

        It is the first free place, or else the one that covers least. `around` has points, each with the distance and
        the possible directions of the label.
        """
        half = width * self.inch / 2.0, _HEIGHT * self.inch / 2.0
        places = []
        for (x, y), radius, directions in around:
            distance = radius + _GAP * self.inch
            for dx, dy in directions:
                places.append((x + dx * distance + _side(dx) * half[0], y + dy * distance + _side(dy) * half[1]))
        found = min(places, key=lambda center: self._hidden(center, half))
        self.box(found, width)
        return found

    def limits(self) -> tuple[Place, Place]:
        """Return the least and greatest x, and the least and greatest y, of the reserved space."""
        x, y = zip(*self.busy, strict=True)
        return (min(x), max(x)), (min(y), max(y))

    def _hidden(self, center: Place, half: Place) -> int:
        """Return how many reserved points a name with this centre and half its size would hide."""
        (x, y), (w, h) = center, half
        return sum(abs(at - x) <= w and abs(down - y) <= h for at, down in self.busy)


def _side(part: float) -> float:
    """Return -1, 0 or 1: the side of a point on which a label is, along one coordinate of the direction to it."""
    return 0.0 if abs(part) < 0.3 else 1.0 if part > 0.0 else -1.0
