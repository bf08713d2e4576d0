"""Drawings of a vehicle's thrusters with Matplotlib: the views with their labels, and the icon."""

from math import atan2, degrees, hypot
from typing import Any

from matplotlib.axes import Axes
from matplotlib.patches import Arc, Circle, PathPatch, Wedge
from matplotlib.path import Path

from rov_fmu.equation.catalogue import SWAY, YAW
from rov_fmu.report.plots.geometry import VIEWS, Mark, Point, Scene, has_scale, marks_of, on_arm, size_of, turn
from rov_fmu.report.plots.svg import LIGHT, with_formulas
from rov_fmu.vehicle.vehicle import Vehicle


def draw_thrusters(ax: Axes, vehicle: Vehicle, scene: Scene) -> None:
    """Draw the centre of mass, the body frame, the thrusters with their positive forces, and R and γ if they exist."""
    down, size = VIEWS[scene.view][0], scene.size
    _draw_frame(ax, size, turns=down is SWAY and vehicle.layout.has(YAW))
    if not any(mark.toward and hypot(*mark.at) < 0.05 * size for mark in scene.marks):
        _draw_centre(ax, size)
    for mark in scene.marks:
        _draw_mark(ax, mark, size)
    if down is SWAY and vehicle.layout.has_arm:
        _draw_arm(ax, on_arm(vehicle), size)
    for text, at, color in scene.labels:
        with_formulas(ax.text(*at, text, color=LIGHT[color], zorder=8, ha="center", va="center"))
    ax.set(aspect="equal", xlim=scene.limits[0], ylim=scene.limits[1])
    ax.grid(visible=False)
    ax.spines[:].set_visible(False)
    if has_scale(vehicle):
        _draw_scale(ax, size)
    ax.set(xticks=[], yticks=[])
    ax.set_title(scene.view.capitalize(), loc="left")


def draw_icon(ax: Axes, vehicle: Vehicle) -> None:
    """Draw the vehicle from above without text: its thrusters on a body with a round bow."""
    size, marks = size_of(vehicle), list(marks_of(vehicle, *VIEWS["from above"]))
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


def _draw_mark(ax: Axes, mark: Mark, size: float) -> None:
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
        _arrow(ax, *turn(size), "ink", linewidth=1.0, connectionstyle="arc3,rad=0.13")


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
