"""The vehicle's thrusters drawn from its geometry: from above and from starboard."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import atan2, cos, degrees, hypot, sin
from typing import Any, Literal

from matplotlib.axes import Axes
from matplotlib.patches import Arc, Circle, Wedge

from rov_fmu.motion.layout import AXES, HEAVE, SURGE, SWAY, YAW, Axis, Thruster
from rov_fmu.motion.rov import Rov
from rov_fmu.pages.svg import LIGHT

Point = tuple[float, float, float]

VIEWS = {"from above": (SWAY, HEAVE, -1), "from starboard": (HEAVE, SWAY, 1)}
"""The axis that points down in the view, the one along the line of sight, and whether that points at who looks (1)."""
_LETTERS = {SURGE: "x", SWAY: "y", HEAVE: "z"}
_INDEX = {axis: n for n, axis in enumerate(AXES.values())}
_SMALLEST = 0.05  # m
_WIDTH = 3.7  # inches


def place(rov: Rov, thruster: Thruster) -> Point:
    """Where a thruster is, from the centre of mass: that of an arm R, γ behind it; the centre where nothing is said."""
    if thruster.position is not None:
        return thruster.position
    if not thruster.arm or not rov.layout.has_arm:
        return 0.0, 0.0, 0.0
    R, gamma = rov["R"], rov["gamma"]
    return -R * cos(gamma), -thruster.arm * R * sin(gamma), 0.0


@dataclass(frozen=True)
class _Mark:
    """Thrusters that look the same in a view: where, and the direction of a positive force."""

    at: tuple[float, float]
    along: tuple[float, float]
    toward: float
    """Of the direction, the part toward who looks."""
    label: str


def _marks(rov: Rov, down: Axis, sight: Axis, toward: int) -> Iterator[_Mark]:
    seen: dict[tuple[float, ...], list[str]] = {}
    for thruster in rov.layout.thrusters:
        at, d = place(rov, thruster), thruster.direction
        along = d[0], d[_INDEX[down]]
        hidden = toward * d[_INDEX[sight]] if hypot(*along) < 0.1 else 0.0
        key = tuple(round(part, 3) + 0.0 for part in (at[0], at[_INDEX[down]], *along, hidden))
        seen.setdefault(key, []).append(thruster.name.replace("_", r"\_"))
    for (x, y, dx, dy, hidden), names in seen.items():
        yield _Mark((x, y), (dx, dy), hidden, ", ".join(rf"$F_{{{name}}}$" for name in names))


def _extent(rov: Rov, view: str) -> tuple[float, tuple[tuple[float, float], tuple[float, float]]]:
    """How far thrusters are from the centre of mass (m), and the limits of a drawing; the second run downward."""
    places = [place(rov, thruster) for thruster in rov.layout.thrusters]
    size = max([_SMALLEST, *(abs(part) for at in places for part in at)])
    across = [at[_INDEX[VIEWS[view][0]]] for at in places]
    low, high = max(1.1 * size, max(across) + 0.75 * size), min(-0.4 * size, min(across) - 0.4 * size)
    return size, ((-1.5 * size, 1.75 * size), (low, high))


def drawing_size(rov: Rov, view: str) -> tuple[float, float]:
    """Width and height in inches that fit a drawing."""
    _, ((left, right), (low, high)) = _extent(rov, view)
    return _WIDTH, _WIDTH * (low - high) / (right - left) + 0.3


def draw_thrusters(ax: Axes, rov: Rov, view: str) -> None:
    """Centre of mass, body frame, thrusters with the direction of a positive force, R and γ where they are given."""
    down, sight, toward = VIEWS[view]
    marks = list(_marks(rov, down, sight, toward))
    places = [place(rov, thruster) for thruster in rov.layout.thrusters]
    size, limits = _extent(rov, view)
    _draw_frame(ax, rov, down, size)
    for mark in marks:
        _draw_mark(ax, mark, size)
    if down is SWAY and rov.layout.has_arm:
        _draw_arm(ax, next(place(rov, t) for t in rov.layout.thrusters if t.position is None and t.arm), size)
    ax.set(aspect="equal", xlim=limits[0], ylim=limits[1])
    ax.grid(visible=False)
    ax.spines[:].set_visible(False)
    if any(map(any, places)):
        _draw_scale(ax, size)
    ax.set(xticks=[], yticks=[])
    ax.set_title(view.capitalize(), loc="left")


def _arrow(ax: Axes, start: tuple[float, float], end: tuple[float, float], color: str, **how: Any) -> None:
    style = {"arrowstyle": "-|>", "color": LIGHT[color], "shrinkA": 0.0, "shrinkB": 0.0, "linewidth": 1.4, **how}
    ax.annotate("", end, start, arrowprops=style)


def _draw_mark(ax: Axes, mark: _Mark, size: float) -> None:
    (x, y), (dx, dy), r = mark.at, mark.along, 0.1 * size
    ax.add_patch(Circle(mark.at, r, facecolor=LIGHT["panel"], edgecolor=LIGHT["metal"], linewidth=1.4, zorder=3))
    if not mark.toward:
        _arrow(ax, (x + dx * r, y + dy * r), (x + dx * 5.0 * r, y + dy * 5.0 * r), "blue")
    elif mark.toward > 0.0:  # the point of an arrow
        ax.add_patch(Circle(mark.at, 0.3 * r, color=LIGHT["blue"], zorder=4))
    else:  # its feathers
        a = 0.7 * r
        for way in (-1, 1):
            ax.plot([x - a, x + a], [y - way * a, y + way * a], color=LIGHT["blue"], linewidth=1.4, zorder=4)
    label_x, label_y, ha = _label_place(mark, r)
    ax.text(label_x, label_y, mark.label, color=LIGHT["blue"], zorder=5, ha=ha, va="center")


def _label_place(mark: _Mark, r: float) -> tuple[float, float, Literal["left", "center", "right"]]:
    """Where the name stands, clear of the arrow and of the body's axes."""
    (x, y), (dx, dy) = mark.at, mark.along
    if mark.toward:
        return (x + 1.6 * r, y, "left") if abs(x) < r else (x, y + (2.1 * r if y > r else -2.1 * r), "center")
    if abs(dy) < 0.1:
        return x, y - 2.1 * r, "center"
    if abs(dx) < 0.1:  # beside the tip
        tip = y + dy * 6.2 * r
        return (x + 0.5 * r, tip, "left") if abs(x) < r else (x, tip, "center")
    return x - 2.3 * r * dx, y - 2.3 * r * dy, "right" if dx > 0.0 else "left"


def _draw_frame(ax: Axes, rov: Rov, down: Axis, size: float) -> None:
    """Axes of the body, and the centre of mass, in which they begin."""
    for axis, end, where in ((SURGE, (1.4 * size, 0.0), {"ha": "left", "va": "center"}),
                             (down, (0.0, 0.9 * size), {"ha": "center", "va": "top"})):  # fmt: skip
        _arrow(ax, (0.0, 0.0), end, "ink", linewidth=1.0)
        words = rf"${_LETTERS[axis]}, {axis.velocity}$" if rov.layout.has(axis) else f"${_LETTERS[axis]}$"
        ax.text(1.03 * end[0], 1.06 * end[1], words, color=LIGHT["ink"], **where)  # type: ignore[arg-type]
    if down is SWAY and rov.layout.has(YAW):
        turn = 1.27 * size
        tail, tip = ((turn * cos(angle), turn * sin(angle)) for angle in (-0.25, 0.25))
        _arrow(ax, tail, tip, "ink", linewidth=1.0, connectionstyle="arc3,rad=0.13")
        ax.text(1.03 * tip[0], tip[1] + 0.06 * size, r"$\psi, r$", color=LIGHT["ink"], ha="left", va="top")
    r = 0.055 * size
    ax.add_patch(Circle((0.0, 0.0), r, facecolor=LIGHT["page"], edgecolor=LIGHT["ink"], linewidth=1.0, zorder=6))
    for angle in (0.0, 180.0):
        ax.add_patch(Wedge((0.0, 0.0), r, angle, angle + 90.0, color=LIGHT["ink"], linewidth=0.0, zorder=7))


def _draw_arm(ax: Axes, at: Point, size: float) -> None:
    """R from the centre of mass to a rear thruster, and γ from the centre line."""
    x, y, _ = at
    dashed: Any = {"color": LIGHT["muted"], "linewidth": 1.0, "dashes": (4, 3), "zorder": 1}
    ax.plot([0.0, x], [0.0, y], **dashed)
    ax.plot([0.0, 1.15 * x], [0.0, 0.0], **dashed)
    gamma, side = atan2(abs(y), -x), -1.0 if y < 0.0 else 1.0
    angle = degrees(gamma)
    start = 180.0 if y < 0.0 else 180.0 - angle
    arc = 1.1 * size * 0.5
    ax.add_patch(Arc((0.0, 0.0), arc, arc, theta1=start, theta2=start + angle, color=LIGHT["muted"], linewidth=1.0))
    far, half = 0.38 * size, gamma / 2.0
    words: Any = {"color": LIGHT["muted"], "ha": "center", "va": "center"}
    ax.text(0.68 * x, 0.68 * y - 0.12 * side * size, "$R$", **words)
    ax.text(-far * cos(half), side * far * sin(half), r"$\gamma$", **words)


def _draw_scale(ax: Axes, size: float) -> None:
    """A bar of a length that one reads at once."""
    decade = 10.0 ** next(n for n in range(3, -4, -1) if 10.0**n <= 0.6 * size)
    length = next(step * decade for step in (5.0, 2.0, 1.0) if step * decade <= 0.6 * size)
    y, x = ax.get_ylim()[0] - 0.08 * size, -1.5 * size
    ax.plot([x, x + length], [y, y], color=LIGHT["muted"], linewidth=2.0, solid_capstyle="butt")
    ax.text(x + length + 0.06 * size, y, f"{length:g} m", color=LIGHT["muted"], ha="left", va="center", fontsize=8.5)
