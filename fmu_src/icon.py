"""model.png: the vehicle from above with its three thrusters, as importers show it on their diagrams.

The drawings are in centimetres in the body frame (x forward, y starboard or z down), for other pictures to use.
"""

from io import BytesIO
from math import cos, pi, sin
from typing import Any
from warnings import catch_warnings, simplefilter

from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Ellipse, FancyArrowPatch, FancyBboxPatch, Patch, PathPatch, Polygon, Wedge
from matplotlib.path import Path as Outline
from PIL import Image

from models.vehicle import Vehicle

HULL, SHADE, DARK, METAL, GLASS = "#f6b90c", "#d99a00", "#22303d", "#5d6f7e", "#a9d8f0"
FORCE = "#0a5cad"
_WIDTH, _HEIGHT = 400, 300


def model_icon(vehicle: Vehicle) -> bytes:
    """The picture as PNG, 400 by 300 pixels, the same bytes at every call."""
    drawn = BytesIO()
    with style.context("default"), catch_warnings():  # whatever the user's Matplotlib is set to
        simplefilter("ignore", UserWarning)  # of a script that the font does not have
        _draw(vehicle.name).savefig(drawn, format="png")
    # A palette is a third of the size, and names no software.
    png = BytesIO()
    Image.open(drawn).quantize(256, Image.Quantize.FASTOCTREE).save(png, format="PNG", optimize=True)
    return png.getvalue()


def _draw(caption: str) -> Figure:
    figure = Figure(figsize=(_WIDTH / 100, _HEIGHT / 100), dpi=100, facecolor="none")
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    bare(axes, (-23.5, 26.0), (20.9, -16.225))
    plate = FancyBboxPatch(
        (0.008, 0.01), 0.984, 0.98, boxstyle="round,pad=0,rounding_size=0.06", mutation_aspect=_WIDTH / _HEIGHT,
        transform=axes.transAxes, facecolor="#f4f9fc", edgecolor="#b8cbd8", linewidth=1.5, zorder=0,
    )  # fmt: skip
    axes.add_patch(plate)
    from_above(axes)
    for artist in axes.patches[1:]:
        artist.set_clip_path(plate)
    for y, label in ((-10.6, "$u_l$"), (10.6, "$u_r$")):
        arrow(axes, (-1.0, y), (15.0, y), width=3.4)
        axes.text(19.0, y, label, color=FORCE, fontsize=23, ha="center", va="center")
    axes.text(7.6, 0.2, "$u_t$", color=DARK, fontsize=23, ha="center", va="center", zorder=9)
    name = axes.text(0.5, 0.055, caption, transform=axes.transAxes, color=DARK, weight="bold", ha="center")
    name.set(fontsize=20.0, parse_math=False)
    width: float = name.get_window_extent(canvas.get_renderer()).width  # type: ignore[no-untyped-call]
    name.set_fontsize(20.0 * min(1.0, 0.9 * _WIDTH / width))
    return figure


def bare(axes: Axes, x: tuple[float, float], y: tuple[float, float]) -> None:
    """Limits of a drawing to scale, without ticks or spines."""
    axes.set(xlim=x, ylim=y, aspect="equal")
    axes.set_axis_off()


def arrow(
    axes: Axes,
    tail: tuple[float, float],
    tip: tuple[float, float],
    *,
    width: float = 1.6,
    color: str = FORCE,
    bend: float = 0.0,
) -> None:
    """A force, a velocity or an axis; bend makes it an arc."""
    head = f"-|>,head_length={2.2 * width},head_width={1.2 * width}"
    shape = FancyArrowPatch(
        tail, tip, arrowstyle=head, connectionstyle=f"arc3,rad={bend}", mutation_scale=1.0, shrinkA=0.0, shrinkB=0.0,
        color=color, linewidth=width, joinstyle="miter", zorder=9,
    )  # fmt: skip
    axes.add_patch(shape)


def into_page(axes: Axes, x: float, y: float, radius: float, color: str = FORCE) -> None:
    """⊗: an arrow seen from its tail."""
    d = radius / 2**0.5
    axes.add_patch(Circle((x, y), radius, facecolor="white", edgecolor=color, linewidth=1.6, zorder=9))
    for sign in (-1, 1):
        axes.plot([x - d, x + d], [y - sign * d, y + sign * d], color=color, linewidth=1.6, zorder=10)


def from_above(axes: Axes) -> None:
    """Hull with camera dome and lights, rear thrusters in their ducts, the top thruster, the tether."""
    add = _painter(axes)
    tether = [(-15, 0), (-19, 0), (-19, 3.5), (-27, 3.5)]
    add(PathPatch(Outline(tether, [1, 4, 4, 4]), fill=False, edgecolor=METAL, linewidth=2.4), 1)
    for side in (-1.0, 1.0):
        y = 10.6 * side
        add(_box(-10.5, min(3.0 * side, y), 6.0, 7.6, 0.5, METAL), 2)  # strut
        add(_box(-13.0, y - 2.6, 12.5, 5.2, 2.4, DARK), 4)  # motor
        add(_box(-17.5, y - 3.9, 6.0, 7.8, 1.0, METAL), 5)  # duct
        add(_box(-16.6, y - 3.0, 4.2, 6.0, 0.6, DARK), 5)
        for blade in (-1.0, 1.0):
            add(Ellipse((-14.5, y + 1.5 * blade), 1.4, 2.8, facecolor="#c6d2db", edgecolor="none"), 6)
        add(_box(-16.0, y - 0.5, 3.2, 1.0, 0.4, "#c6d2db"), 6)
    add(Ellipse((12.0, 0), 12.5, 11.0, facecolor=GLASS, edgecolor=DARK, linewidth=1.6), 3)
    add(Ellipse((14.6, -2.0), 3.6, 2.2, angle=25, facecolor="white", alpha=0.8, edgecolor="none"), 4)
    for y in (-5.4, 5.4):
        add(_box(10.4, y - 1.5, 3.4, 3.0, 0.8, DARK), 4)
        add(Wedge((13.8, y), 1.5, -90, 90, facecolor="#fffbe0", edgecolor=DARK, linewidth=1.0), 4)
    add(_hull(), 5)
    for y in (-5.0, 5.0):
        axes.plot([-9.0, 10.5], [y, y], color=SHADE, linewidth=1.6, zorder=6, solid_capstyle="round")
    _fan(axes, -3.0, 0.0, 5.0)


def from_starboard(axes: Axes) -> None:
    """The same vehicle from its right side, bow to the right: z points down the page."""
    add = _painter(axes)
    tether = [(-15, -1), (-20, -1), (-20, -6), (-27, -6)]
    add(PathPatch(Outline(tether, [1, 4, 4, 4]), fill=False, edgecolor=METAL, linewidth=2.0), 1)
    for x in (-8.0, 7.0):
        add(_box(x, 5.0, 1.4, 5.4, 0.2, METAL), 2)
    add(_box(-13.0, 9.8, 25.0, 1.5, 0.7, DARK), 3)  # skid
    add(Ellipse((12.0, 0), 12.5, 10.0, facecolor=GLASS, edgecolor=DARK, linewidth=1.3), 3)
    add(Ellipse((14.8, -1.8), 3.4, 2.0, angle=25, facecolor="white", alpha=0.8, edgecolor="none"), 4)
    add(_hull(0.93), 5)
    add(_box(-10.0, -8.6, 21.0, 5.2, 2.0, SHADE), 4)  # float
    add(_box(-6.6, -9.6, 7.2, 9.0, 0.8, DARK), 6)  # well of the top thruster
    for blade in (-1.0, 1.0):
        add(Ellipse((-3.0 + 1.6 * blade, -4.6), 3.0, 1.3, facecolor="#c6d2db", edgecolor="none"), 7)
    add(_box(-3.5, -6.0, 1.0, 3.0, 0.3, "#c6d2db"), 7)
    add(_box(-13.0, -0.4, 12.5, 5.2, 2.4, DARK), 7)  # rear thruster
    add(_box(-17.5, -1.7, 6.0, 7.8, 1.0, METAL), 8)
    add(_box(-16.6, -0.8, 4.2, 6.0, 0.6, DARK), 8)
    for blade in (-1.0, 1.0):
        add(Ellipse((-14.5, 2.2 + 1.5 * blade), 1.4, 2.8, facecolor="#c6d2db", edgecolor="none"), 8)
    add(_box(-16.0, 1.7, 3.2, 1.0, 0.4, "#c6d2db"), 8)


def _painter(axes: Axes) -> Any:
    def add(patch: Patch, layer: float) -> None:
        patch.set_zorder(layer)
        axes.add_patch(patch)

    return add


def _box(x: float, y: float, width: float, height: float, rounding: float, color: str) -> FancyBboxPatch:
    style = f"round,pad=0,rounding_size={rounding}"
    return FancyBboxPatch((x, y), width, height, boxstyle=style, facecolor=color, edgecolor="none")


def _hull(slender: float = 1.0) -> PathPatch:
    """The pressure hull: blunt towards the dome, tapered aft."""
    half = [(12.0, 5.6), (12.0, 6.8), (11.0, 7.0), (9.5, 7.0), (4.0, 7.4), (-6.0, 7.4), (-10.0, 6.6)]
    half += [(-14.0, 5.6), (-16.0, 3.0), (-16.0, 0.0)]
    back = [(x, -y) for x, y in reversed(half[:-1])]
    points = [(x, y * slender) for x, y in half + back]
    codes = [1] + [4] * (len(points) - 1)
    return PathPatch(
        Outline([*points, points[0]], [*codes, 79]), facecolor=HULL, edgecolor=DARK, linewidth=1.6, joinstyle="round"
    )


def _fan(axes: Axes, x: float, y: float, radius: float) -> None:
    """A thruster seen along its axis."""
    add = _painter(axes)
    add(Circle((x, y), radius, facecolor=DARK, edgecolor="none"), 6)
    add(Circle((x, y), 0.86 * radius, facecolor="#31475a", edgecolor="none"), 6)
    for n in range(3):
        angle = 2 * pi * n / 3 + pi / 2
        reach = [(0.16, -0.5), (0.55, -0.42), (0.80, -0.12), (0.80, 0.16), (0.5, 0.18), (0.16, 0.5)]
        blade = [(x + radius * d * cos(angle + a), y + radius * d * sin(angle + a)) for d, a in reach]
        add(Polygon(blade, facecolor="#c6d2db", edgecolor="none"), 7)
    add(Circle((x, y), 0.2 * radius, facecolor="#c6d2db", edgecolor=DARK, linewidth=0.8), 8)
