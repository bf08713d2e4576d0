"""Where the thrusters of a vehicle are, and the views of a drawing from above and from starboard, with their labels.

Every still picture of a vehicle and the page that flies take the geometry from here. Nothing here draws.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import product
from math import atan2, copysign, cos, hypot, sin

import numpy as np
from numpy.typing import NDArray

from rov_fmu.equation.catalogue import HEAVE, SURGE, SWAY, YAW, Axis
from rov_fmu.equation.parts import Thruster
from rov_fmu.vehicle.vehicle import Vehicle

Point = tuple[float, float, float]
Place = tuple[float, float]
_Box = tuple[Place, Place]

VIEWS = {"from above": (SWAY, HEAVE, -1), "from starboard": (HEAVE, SWAY, 1)}
"""For each view: the axis that points down, the axis along the line of sight, and 1 if this axis points toward the
viewer, else -1."""
_SMALLEST = 0.05
"""The least size of a vehicle, m."""
_LEAST_HULL = (0.2, 0.15, 0.1)
"""The least length, width and height of the hull, m."""
_HEIGHT = 0.17
"""The height of a line of text, inches."""
_GAP = 0.045
"""The least distance between a name and what it names, inches."""
_AROUND = ((1.0, 0.0), (0.0, -1.0), (0.0, 1.0), (-1.0, 0.0), (1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))
"""The directions in which a label may stand: right, up, down, left, and between these."""
_POINTS = 20
"""The number of parts of a line between points that labels should not cover."""
_WIDTH = 3.7
"""The width of a drawing, inches."""


def thruster_place(vehicle: Vehicle, thruster: Thruster) -> Point:
    """Return the position of a thruster from the centre of mass, m.

    A thruster on an arm is at the distance R and the angle γ behind the centre of mass; one without a known position is
    drawn at the centre of mass.
    """
    if thruster.position or not thruster.arm or not vehicle.layout.has_arm:
        return thruster.place
    R, gamma = vehicle["R"], vehicle["gamma"]
    return -R * cos(gamma), -thruster.side * R * sin(gamma), 0.0


@dataclass(frozen=True)
class Mark:
    """One or more thrusters that look the same in a view."""

    at: Place
    along: Place
    """The direction of a positive force in the plane of the view."""
    toward: float
    """The component of the direction toward the viewer; 0 if the force is mostly in the plane of the view."""
    label: str
    width: float
    """The width of the label, inches."""

    def tip(self, size: float) -> Place:
        """Return the end of the arrow of its force."""
        return self.at[0] + 0.5 * size * self.along[0], self.at[1] + 0.5 * size * self.along[1]


def hull_size(vehicle: Vehicle) -> NDArray[np.float64]:
    """Return the length, width and height of a box that stands for the hull, m: it reaches to the outer thrusters."""
    corners = np.abs([(0.0, 0.0, 0.0), *(thruster_place(vehicle, thruster) for thruster in vehicle.layout.thrusters)])
    size: NDArray[np.float64] = np.maximum(2.0 * corners.max(axis=0), _LEAST_HULL)
    return size


def marks_of(vehicle: Vehicle, down: Axis, sight: Axis, toward: int) -> Iterator[Mark]:
    """Yield the marks of a view, which is one of VIEWS."""
    seen: dict[tuple[float, ...], list[str]] = {}
    for thruster in vehicle.layout.thrusters:
        at, d = thruster_place(vehicle, thruster), thruster.direction.value
        along = d[0], d[down.place]
        hidden = toward * d[sight.place] if hypot(*along) < 0.1 else 0.0
        key = tuple(round(part, 3) + 0.0 for part in (at[0], at[down.place], *along, hidden))
        seen.setdefault(key, []).append(thruster.name)
    for (x, y, dx, dy, hidden), names in seen.items():
        label = ", ".join("$F_{" + name.replace("_", r"\_") + "}$" for name in names)
        yield Mark((x, y), (dx, dy), hidden, label, sum(0.16 + 0.06 * len(name) for name in names) - 0.08)


@dataclass(frozen=True)
class Scene:
    """The content of a view, in metres; the second coordinate runs downward."""

    view: str
    marks: list[Mark]
    labels: list[tuple[str, Place, str]]
    """The text, centre and colour of each label."""
    size: float
    """The largest coordinate of a thruster from the centre of mass."""
    limits: tuple[Place, Place]
    """The coordinates at the left and right edge, and at the lower and upper edge."""

    @property
    def inches(self) -> Place:
        """The width and height of a drawing that the view fits into."""
        (left, right), (low, high) = self.limits
        return _WIDTH, _WIDTH * (low - high) / (right - left) + 0.3


def scenes(vehicle: Vehicle) -> dict[str, Scene]:
    """Return the scene of each view, at a common scale."""
    inch = 0.9 * size_of(vehicle)
    for _ in range(3):  # text takes part of the drawing, which changes the scale and so the size of text in metres
        found = {view: _arranged(vehicle, view, inch) for view in VIEWS}
        left, right = zip(*(scene.limits[0] for scene in found.values()), strict=True)
        inch = (max(right) - min(left)) / _WIDTH
    across = min(left), max(right)
    return {view: replace(scene, limits=(across, scene.limits[1])) for view, scene in found.items()}


def size_of(vehicle: Vehicle) -> float:
    """Return the largest coordinate of a thruster from the centre of mass, m."""
    return max(
        [_SMALLEST, *(abs(part) for thruster in vehicle.layout.thrusters for part in thruster_place(vehicle, thruster))]
    )


def _arranged(vehicle: Vehicle, view: str, inch: float) -> Scene:
    """Return a view with its labels placed, in a drawing in which an inch is `inch` metres.

    The label of a thruster stands at the end of the arrow of its force, or beside this end where something else is.
    """
    down, sight, toward = VIEWS[view]
    size = size_of(vehicle)
    shown = list(marks_of(vehicle, down, sight, toward))
    from_above = down is SWAY
    circles = [((0.0, 0.0), (0.06 * size, 0.06 * size)), *((mark.at, (0.1 * size, 0.1 * size)) for mark in shown)]
    ends = [((0.0, 0.0), (1.4 * size, 0.0)), ((0.0, 0.0), (0.0, 0.9 * size)), *([turn(size)] if from_above else [])]
    ends += [(mark.at, mark.tip(size)) for mark in shown if not mark.toward]
    lines = [box for start, end in ends for box in _along(start, end)]
    boxes: list[_Box] = []
    labels: list[tuple[str, Place, str]] = []

    def name(words: str, width: float, color: str, at: Place, distance: float, *directions: Place) -> None:
        half = width * inch / 2.0, _HEIGHT * inch / 2.0
        points = []
        for times, (dx, dy) in product((1.0, 2.5), directions):
            gap = distance + times * _GAP * inch
            x, y = (part / (hypot(dx, dy) or 1.0) for part in (dx, dy))
            points.append((at[0] + x * gap + _side(x) * half[0], at[1] + y * gap + _side(y) * half[1]))
        best = min(points, key=lambda point: [_overlaps((point, half), some) for some in (boxes, circles, lines)])
        labels.append((words, best, color))
        boxes.append((best, half))

    if from_above and vehicle.layout.has_arm:
        x, y, _ = on_arm(vehicle)
        gamma, side = atan2(abs(y), -x), -1.0 if y < 0.0 else 1.0
        far = 0.38 * size
        name("$R$", 0.1, "muted", (0.68 * x, 0.68 * y - 0.12 * side * size), 0.0, (0.0, 0.0))
        at = -far * cos(gamma / 2.0), side * far * sin(gamma / 2.0)
        name(r"$\gamma$", 0.1, "muted", at, 0.0, (0.0, 0.0))
    for axis, end in ((SURGE, (1.4 * size, 0.0)), (down, (0.0, 0.9 * size))):
        letter = "xyz"[axis.place]
        words = f"${letter}, {axis.velocity}$" if vehicle.layout.has(axis) else f"${letter}$"
        name(words, 0.3 if "," in words else 0.1, "ink", end, 0.0, (end[0] and 1.0, end[1] and 1.0), *_AROUND)
    if from_above and vehicle.layout.has(YAW):
        name(r"$\psi, r$", 0.3, "ink", turn(size)[1], 0.0, (0.0, 1.0), *_AROUND)
    for mark in shown:
        at, distance = (mark.at, 0.1 * size) if mark.toward else (mark.tip(size), 0.0)
        name(mark.label, mark.width, "blue", at, distance, mark.along, *_AROUND)
    edges = [(1.4 * size, 0.9 * size), (-1.2 * size, 0.0), *(mark.tip(size) for mark in shown if not mark.toward)]
    edges += [(x + sign * w, y + sign * h) for (x, y), (w, h) in boxes + circles for sign in (-1.0, 1.0)]
    along, across = zip(*edges, strict=True)
    edge = 0.06 * inch
    low = max(across) + (0.3 if has_scale(vehicle) else 0.06) * inch
    return Scene(view, shown, labels, size, ((min(along) - edge, max(along) + edge), (low, min(across) - edge)))


def _side(part: float) -> float:
    """Return -1, 0 or 1: the side of a point on which a label is, along one coordinate of the direction to it."""
    return 0.0 if abs(part) < 0.3 else copysign(1.0, part)


def _along(start: Place, end: Place) -> Iterator[_Box]:
    """Yield points on a line, as boxes without a size, closer to each other than a label is high."""
    for n in range(_POINTS + 1):
        x, y = (a + (b - a) * n / _POINTS for a, b in zip(start, end, strict=True))
        yield (x, y), (0.0, 0.0)


def _overlaps(box: _Box, others: Iterable[_Box]) -> int:
    """Return how many boxes, each with its centre and half its size, overlap one of them."""
    return sum(all(abs(box[0][n] - other[0][n]) < box[1][n] + other[1][n] for n in (0, 1)) for other in others)


def has_scale(vehicle: Vehicle) -> bool:
    """Return True if the position of a thruster is known, so that the drawing has a scale."""
    return any(any(thruster_place(vehicle, thruster)) for thruster in vehicle.layout.thrusters)


def on_arm(vehicle: Vehicle) -> Point:
    """Return the position of the first thruster on an arm."""
    return next(thruster_place(vehicle, t) for t in vehicle.layout.thrusters if t.position is None and t.arm)


def turn(size: float) -> tuple[Place, Place]:
    """Return the start and the end of the arrow of a positive turn."""
    tail, tip = ((1.27 * size * cos(angle), 1.27 * size * sin(angle)) for angle in (-0.25, 0.25))
    return tail, tip
