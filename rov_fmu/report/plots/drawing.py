"""Drawings of the vehicle's thrusters from its geometry: from above and from starboard."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from math import atan2, copysign, cos, degrees, hypot, sin
from typing import Any

from matplotlib.axes import Axes
from matplotlib.patches import Arc, Circle, PathPatch, Wedge
from matplotlib.path import Path

from rov_fmu.equation.catalogue import AXES, HEAVE, SURGE, SWAY, YAW, Axis
from rov_fmu.equation.layout import Thruster
from rov_fmu.report.plots.svg import LIGHT, with_formulas
from rov_fmu.vehicle.vehicle import Vehicle

Point = tuple[float, float, float]
Place = tuple[float, float]
_Box = tuple[Place, Place]

VIEWS = {"from above": (SWAY, HEAVE, -1), "from starboard": (HEAVE, SWAY, 1)}
"""For each view: the axis that points down, the axis along the line of sight, and 1 if this axis points toward the
viewer, else -1."""
_LETTERS = {SURGE: "x", SWAY: "y", HEAVE: "z"}
_INDEX = {axis: n for n, axis in enumerate(AXES.values())}
_SMALLEST = 0.05
"""The least size of a vehicle, m."""
_HEIGHT = 0.17
"""The height of a line of text, inches."""
_GAP = 0.045
"""The least distance between a name and what it names, inches."""
_AROUND = ((1.0, 0.0), (0.0, -1.0), (0.0, 1.0), (-1.0, 0.0), (1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))
"""The directions in which a label may stand: right, up, down, left, and between these."""
_WIDTH = 3.7
"""The width of a drawing, inches."""


def place(vehicle: Vehicle, thruster: Thruster) -> Point:
    """Return the position of a thruster from the centre of mass, m.

    A thruster on an arm is at the distance R and the angle γ behind the centre of mass; one without a known position is
    drawn at the centre of mass.
    """
    if thruster.position is not None:
        return thruster.position
    if not thruster.arm or not vehicle.layout.has_arm:
        return 0.0, 0.0, 0.0
    R, gamma = vehicle["R"], vehicle["gamma"]
    return -R * cos(gamma), -thruster.arm * R * sin(gamma), 0.0


@dataclass(frozen=True)
class _Mark:
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


def _marks(vehicle: Vehicle, down: Axis, sight: Axis, toward: int) -> Iterator[_Mark]:
    """Yield the marks of a view, which is one of VIEWS."""
    seen: dict[tuple[float, ...], list[str]] = {}
    for thruster in vehicle.layout.thrusters:
        at, d = place(vehicle, thruster), thruster.direction
        along = d[0], d[_INDEX[down]]
        hidden = toward * d[_INDEX[sight]] if hypot(*along) < 0.1 else 0.0
        key = tuple(round(part, 3) + 0.0 for part in (at[0], at[_INDEX[down]], *along, hidden))
        seen.setdefault(key, []).append(thruster.name)
    for (x, y, dx, dy, hidden), names in seen.items():
        label = ", ".join("$F_{" + name.replace("_", r"\_") + "}$" for name in names)
        yield _Mark((x, y), (dx, dy), hidden, label, sum(0.16 + 0.06 * len(name) for name in names) - 0.08)


@dataclass(frozen=True)
class Scene:
    """The content of a view, in metres; the second coordinate runs downward."""

    view: str
    marks: list[_Mark]
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
    return max([_SMALLEST, *(abs(part) for thruster in vehicle.layout.thrusters for part in place(vehicle, thruster))])


def _arranged(vehicle: Vehicle, view: str, inch: float) -> Scene:
    """Return a view with its labels placed, in a drawing in which an inch is `inch` metres.

    The label of a thruster stands at the end of the arrow of its force, or beside it where another label stands there.
    """
    down, sight, toward = VIEWS[view]
    size = size_of(vehicle)
    marks = list(_marks(vehicle, down, sight, toward))
    from_above = down is SWAY
    circles = [(mark.at, (0.1 * size, 0.1 * size)) for mark in marks]
    boxes: list[_Box] = []
    labels: list[tuple[str, Place, str]] = []

    def name(words: str, width: float, color: str, at: Place, distance: float, *directions: Place) -> None:
        half = width * inch / 2.0, _HEIGHT * inch / 2.0
        gap = distance + _GAP * inch
        places = []
        for dx, dy in directions:
            x, y = (part / (hypot(dx, dy) or 1.0) for part in (dx, dy))
            places.append((at[0] + x * gap + _side(x) * half[0], at[1] + y * gap + _side(y) * half[1]))
        best = min(places, key=lambda place: [_overlaps((place, half), some) for some in (boxes, circles)])
        labels.append((words, best, color))
        boxes.append((best, half))

    if from_above and vehicle.layout.has_arm:
        x, y, _ = _armed(vehicle)
        gamma, side = atan2(abs(y), -x), -1.0 if y < 0.0 else 1.0
        far = 0.38 * size
        name("$R$", 0.1, "muted", (0.68 * x, 0.68 * y - 0.12 * side * size), 0.0, (0.0, 0.0))
        at = -far * cos(gamma / 2.0), side * far * sin(gamma / 2.0)
        name(r"$\gamma$", 0.1, "muted", at, 0.0, (0.0, 0.0))
    for axis, end in ((SURGE, (1.4 * size, 0.0)), (down, (0.0, 0.9 * size))):
        words = rf"${_LETTERS[axis]}, {axis.velocity}$" if vehicle.layout.has(axis) else f"${_LETTERS[axis]}$"
        name(words, 0.3 if "," in words else 0.1, "ink", end, 0.0, (end[0] and 1.0, end[1] and 1.0), *_AROUND)
    if from_above and vehicle.layout.has(YAW):
        name(r"$\psi, r$", 0.3, "ink", _turn(size)[1], 0.0, (0.0, 1.0), *_AROUND)
    for mark in marks:
        at, distance = (mark.at, 0.1 * size) if mark.toward else (mark.tip(size), 0.0)
        name(mark.label, mark.width, "blue", at, distance, mark.along, *_AROUND)
    edges = [(1.4 * size, 0.9 * size), (-1.2 * size, 0.0), *(mark.tip(size) for mark in marks if not mark.toward)]
    edges += [(x + sign * w, y + sign * h) for (x, y), (w, h) in boxes + circles for sign in (-1.0, 1.0)]
    along, across = zip(*edges, strict=True)
    edge = 0.06 * inch
    low = max(across) + (0.3 if _has_scale(vehicle) else 0.06) * inch
    return Scene(view, marks, labels, size, ((min(along) - edge, max(along) + edge), (low, min(across) - edge)))


def _side(part: float) -> float:
    """Return -1, 0 or 1: the side of a point on which a label is, along one coordinate of the direction to it."""
    return 0.0 if abs(part) < 0.3 else copysign(1.0, part)


def _overlaps(one: _Box, others: Iterable[_Box]) -> int:
    """Return how many boxes, each with its centre and half its size, overlap one of them."""
    return sum(all(abs(one[0][n] - box[0][n]) < one[1][n] + box[1][n] for n in (0, 1)) for box in others)


def _has_scale(vehicle: Vehicle) -> bool:
    """Return True if the position of a thruster is known, so that the drawing has a scale."""
    return any(any(place(vehicle, thruster)) for thruster in vehicle.layout.thrusters)


def _armed(vehicle: Vehicle) -> Point:
    """Return the position of the first thruster on an arm."""
    return next(place(vehicle, t) for t in vehicle.layout.thrusters if t.position is None and t.arm)


def _turn(size: float) -> tuple[Place, Place]:
    """Return the start and the end of the arrow of a positive turn."""
    tail, tip = ((1.27 * size * cos(angle), 1.27 * size * sin(angle)) for angle in (-0.25, 0.25))
    return tail, tip


def draw_thrusters(ax: Axes, vehicle: Vehicle, scene: Scene) -> None:
    """Draw the centre of mass, the body frame, the thrusters with their positive forces, and R and γ if they exist."""
    down, size = VIEWS[scene.view][0], scene.size
    _draw_frame(ax, size, turns=down is SWAY and vehicle.layout.has(YAW))
    if not any(mark.toward and hypot(*mark.at) < 0.05 * size for mark in scene.marks):
        _draw_centre(ax, size)
    for mark in scene.marks:
        _draw_mark(ax, mark, size)
    if down is SWAY and vehicle.layout.has_arm:
        _draw_arm(ax, _armed(vehicle), size)
    for text, at, color in scene.labels:
        with_formulas(ax.text(*at, text, color=LIGHT[color], zorder=8, ha="center", va="center"))
    ax.set(aspect="equal", xlim=scene.limits[0], ylim=scene.limits[1])
    ax.grid(visible=False)
    ax.spines[:].set_visible(False)
    if _has_scale(vehicle):
        _draw_scale(ax, size)
    ax.set(xticks=[], yticks=[])
    ax.set_title(scene.view.capitalize(), loc="left")


def draw_icon(ax: Axes, vehicle: Vehicle) -> None:
    """Draw the vehicle from above without text: its thrusters on a body with a round bow."""
    size, marks = size_of(vehicle), list(_marks(vehicle, *VIEWS["from above"]))
    x, y = 1.2 * size, max([0.5 * size, *(abs(mark.at[1]) for mark in marks)])
    ax.add_patch(PathPatch(_body(x, y), facecolor=LIGHT["band"], edgecolor=LIGHT["metal"], linewidth=2.0))
    for mark in marks:
        _draw_mark(ax, mark, 1.6 * size)
    reach = 1.1 * max([x, *(abs(part) for mark in marks for part in mark.tip(1.6 * size))])
    ax.set(aspect="equal", xlim=(-reach, reach), ylim=(reach, -reach))
    ax.set_axis_off()


def _body(x: float, y: float) -> Path:
    """Return the outline of a body from -x to x and from -y to y."""
    starboard = [(-x, 0.0), (-x, 0.8 * y), (-x, y), (-x + 0.2 * y, y), (0.4 * x, y), (x, y), (x, 0.0)]
    port = [(along, -across) for along, across in reversed(starboard)]
    ahead = [Path.LINETO, Path.CURVE3, Path.CURVE3, Path.LINETO, Path.CURVE3, Path.CURVE3]
    back = ahead[::-1]
    return Path(starboard + port[1:], [Path.MOVETO, *ahead, *back])


def _arrow(ax: Axes, start: tuple[float, float], end: tuple[float, float], color: str, **how: Any) -> None:
    style = {"arrowstyle": "-|>", "color": LIGHT[color], "shrinkA": 0.0, "shrinkB": 0.0, "linewidth": 1.4, **how}
    ax.annotate("", end, start, arrowprops=style)


def _draw_mark(ax: Axes, mark: _Mark, size: float) -> None:
    """Draw a circle with an arrow; an arrow toward the viewer is a point, one away from the viewer a cross."""
    (x, y), (dx, dy), r = mark.at, mark.along, 0.1 * size
    ax.add_patch(Circle(mark.at, r, facecolor=LIGHT["panel"], edgecolor=LIGHT["metal"], linewidth=1.4, zorder=3))
    if not mark.toward:
        _arrow(ax, (x + dx * r, y + dy * r), mark.tip(size), "blue")
    elif mark.toward > 0.0:  # the point of the arrow
        ax.add_patch(Circle(mark.at, 0.3 * r, color=LIGHT["blue"], zorder=4))
    else:  # the feathers of the arrow
        a = 0.7 * r
        for sign in (-1, 1):
            ax.plot([x - a, x + a], [y - sign * a, y + sign * a], color=LIGHT["blue"], linewidth=1.4, zorder=4)


def _draw_frame(ax: Axes, size: float, *, turns: bool) -> None:
    """Draw the axes of the body, and the arrow of a positive turn."""
    for end in ((1.4 * size, 0.0), (0.0, 0.9 * size)):
        _arrow(ax, (0.0, 0.0), end, "ink", linewidth=1.0)
    if turns:
        _arrow(ax, *_turn(size), "ink", linewidth=1.0, connectionstyle="arc3,rad=0.13")


def _draw_centre(ax: Axes, size: float) -> None:
    """Draw the centre of mass."""
    r = 0.055 * size
    ax.add_patch(Circle((0.0, 0.0), r, facecolor=LIGHT["page"], edgecolor=LIGHT["ink"], linewidth=1.0, zorder=6))
    for angle in (0.0, 180.0):
        ax.add_patch(Wedge((0.0, 0.0), r, angle, angle + 90.0, color=LIGHT["ink"], linewidth=0.0, zorder=7))


def _draw_arm(ax: Axes, at: Point, size: float) -> None:
    """Draw R from the centre of mass to a rear thruster, and γ from the centre line."""
    x, y, _ = at
    dashed: Any = {"color": LIGHT["muted"], "linewidth": 1.0, "dashes": (4, 3), "zorder": 1}
    ax.plot([0.0, x], [0.0, y], **dashed)
    ax.plot([0.0, 1.15 * x], [0.0, 0.0], **dashed)
    angle = degrees(atan2(abs(y), -x))
    start = 180.0 if y < 0.0 else 180.0 - angle
    arc = 1.1 * size * 0.5
    ax.add_patch(Arc((0.0, 0.0), arc, arc, theta1=start, theta2=start + angle, color=LIGHT["muted"], linewidth=1.0))


def _draw_scale(ax: Axes, size: float) -> None:
    """Draw a scale bar with a length of 1, 2 or 5 times a power of 10."""
    lengths = (step * 10.0**n for n in range(3, -4, -1) for step in (5.0, 2.0, 1.0))
    length = next(length for length in lengths if length <= 0.6 * size)
    y, x = ax.get_ylim()[0] - 0.08 * size, ax.get_xlim()[0]
    ax.plot([x, x + length], [y, y], color=LIGHT["muted"], linewidth=2.0, solid_capstyle="butt")
    ax.text(x + length + 0.06 * size, y, f"{length:g} m", color=LIGHT["muted"], ha="left", va="center", fontsize=8.5)
