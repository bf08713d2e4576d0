"""Where names stand in a drawing: beside what they name, clear of all else. In drawings y is down."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from math import cos, pi, sin

Place = tuple[float, float]

AROUND: tuple[Place, ...] = tuple((cos(n * pi / 4.0), sin(n * pi / 4.0)) for n in (0, 6, 2, 4, 7, 1, 5, 3))
"""Ways to go from what a name is of: right, up, down, left, and between."""
_HEIGHT = 0.17  # inches, of a line of text
_GAP = 0.045  # inches


@dataclass
class Space:
    """What a drawing holds, as points that are close together."""

    inch: float
    """Length of an inch of paper in the drawing."""
    busy: list[Place] = field(default_factory=list)

    def line(self, start: Place, end: Place) -> None:
        """Take a line."""
        self.busy += [_between(start, end, n / 24.0) for n in range(25)]

    def ring(self, at: Place, r: float) -> None:
        """Take a circle."""
        self.busy += [at, *((at[0] + r * dx, at[1] + r * dy) for dx, dy in AROUND)]

    def box(self, center: Place, width: float) -> None:
        """Take a line of text (inches)."""
        w, h = width * self.inch, _HEIGHT * self.inch
        self.busy += [(center[0] + n * w / 12.0, center[1] + m * h / 2.0) for n in range(-6, 7) for m in (-1, 0, 1)]

    def name(self, width: float, around: Iterable[tuple[Place, float, Iterable[Place]]]) -> Place:
        """The centre of a name (inches wide): the first place that is clear, or the one that hides least.

        `around` has points, how far a name stays from them, and the ways to go.
        """
        half = width * self.inch / 2.0, _HEIGHT * self.inch / 2.0
        found = min(
            (
                (
                    at[0] + dx * (clear + _GAP * self.inch) + _side(dx) * half[0],
                    at[1] + dy * (clear + _GAP * self.inch) + _side(dy) * half[1],
                )
                for at, clear, ways in around
                for dx, dy in ways
            ),
            key=lambda center: self._hidden(center, half),
        )
        self.box(found, width)
        return found

    def limits(self) -> tuple[Place, Place]:
        """From left to right, and from the top down."""
        x, y = zip(*self.busy, strict=True)
        return (min(x), max(x)), (min(y), max(y))

    def _hidden(self, center: Place, half: Place) -> int:
        (x, y), (w, h) = center, half
        return sum(abs(at - x) <= w and abs(down - y) <= h for at, down in self.busy)


def _between(start: Place, end: Place, part: float) -> Place:
    return start[0] + part * (end[0] - start[0]), start[1] + part * (end[1] - start[1])


def _side(part: float) -> float:
    return 0.0 if abs(part) < 0.3 else 1.0 if part > 0.0 else -1.0
