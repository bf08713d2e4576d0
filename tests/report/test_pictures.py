"""The pictures in the FMU: small, whole, of the vehicle's own thrusters, the same bytes every time."""

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from io import BytesIO
from itertools import combinations
from math import atan2, hypot, sin
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from lxml import etree
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.text import Annotation

from rov_fmu.fmu.archive import Content, native_content, python_content
from rov_fmu.fmu.terminals import ICON
from rov_fmu.report.page.pictures import pictures
from rov_fmu.report.palette import PALETTE
from rov_fmu.report.plots.drawing import draw_icon, draw_thrusters
from rov_fmu.report.plots.geometry import VIEWS, place, scenes
from rov_fmu.report.plots.png import png_file
from rov_fmu.report.plots.svg import LINES, inline_svg, with_formulas
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.vehicles import VEHICLES, VIDEORAY

SIZES = {"diagram": 9_000, "icon": 3_000, "signal": 500}


@cache
def shipped(name: str) -> Mapping[str, bytes]:
    """Return the pictures of a vehicle that ships, by their path in the FMU."""
    return pictures(load_vehicle(SHIPPED[name]))


def decoded(png: bytes) -> Any:
    """Return red, green, blue and alpha, from 0 to 1, by row and column."""
    return imread(BytesIO(png), format="png")


@pytest.mark.parametrize("name", ["videoray", "bluerov2_heavy", pytest.param("bluerov2", marks=pytest.mark.long)])
def test_the_pictures_are_small_and_need_nothing(name: str) -> None:
    shapes = {}
    for path, content in shipped(name).items():
        if path.endswith(".png"):
            kind = path.split("/")[-1].removesuffix(".png")
            assert len(content) <= SIZES[kind]
            assert not re.search(rb"tEXt|tIME|iTXt", content)
            shapes[kind] = decoded(content).shape
    assert (shapes["icon"], shapes["signal"], shapes["diagram"][1]) == ((200, 200, 4), (20, 20, 4), 740)
    svg = shipped(name)["terminalsAndIcons/icon.svg"]
    root = etree.fromstring(svg)
    tags = {etree.QName(element).localname for element in root.iter()}
    assert tags <= {"svg", "g", "path", "defs", "clipPath", "rect"}
    assert set(re.findall(r"url\(#(\w+)\)", svg.decode())) <= set(root.xpath("//@id"))
    assert not re.search(rb"href|@import|url\((?!#)|<!|<\?|\bon\w+=", svg)
    assert len(svg) < 7_000


def test_the_icon_is_transparent_and_the_diagram_is_not() -> None:
    icon = decoded(shipped("videoray")[ICON])
    assert [float(icon[place][3]) for place in ((0, 0), (-1, -1), (100, 100))] == [0.0, 0.0, 1.0]
    assert (decoded(shipped("videoray")["documentation/diagram.png"])[..., 3] == 1.0).all()


def test_vehicles_have_pictures_of_their_own() -> None:
    for path in (ICON, "terminalsAndIcons/icon.svg", "documentation/diagram.png"):
        assert shipped("videoray")[path] != shipped("bluerov2_heavy")[path]


def test_the_same_bytes_whatever_matplotlib_is_set_to() -> None:
    def draw(figure: Figure) -> None:
        figure.subplots().plot([0.0, 1.0], [0.0, 2.0], label="$x$")
        figure.axes[0].legend()

    plot = inline_svg("A plot", draw, (3.0, 2.0))
    with mpl.rc_context({"lines.linewidth": 5.0, "figure.dpi": 77, "savefig.dpi": 55, "font.size": 20.0}):
        assert pictures(VIDEORAY) == shipped("videoray")
        assert inline_svg("A plot", draw, (3.0, 2.0)) == plot


@pytest.mark.parametrize(
    "foreign", ["$_$", "$x^$", r"$\frac{$", "\x1b[31mred $", "\0$a_$", "Kälte $^$ 温度", "</text>$\\"]
)
def test_foreign_text_in_a_plot_is_no_markup(foreign: str) -> None:
    def draw(figure: Figure) -> None:
        ax = figure.subplots()
        ax.plot([0.0, 1.0], label=foreign)
        ax.set(title=foreign, xlabel=foreign)
        ax.set_yticks([0.0, 1.0], [foreign, "$x$"])
        with_formulas(ax.set_ylabel("$V_{ss}$"))
        figure.legend(title=foreign)

    found = etree.fromstring(inline_svg(foreign, draw, (6.0, 4.0)).encode(), etree.XMLParser(recover=True))
    texts = [" ".join(text.split()) for text in found.xpath("//*[local-name()='text']/text()")]
    shown = " ".join(re.sub("[\0\x1b]", "\N{REPLACEMENT CHARACTER}", foreign).split())
    assert texts.count(shown) == 5, "the title, the label, the tick, and both texts of the legend"
    assert "$x$" in texts
    assert "$V_{ss}$" not in texts, "our own formula is one"


def test_a_plot_that_cannot_be_drawn_costs_only_itself() -> None:
    def fail(_: Figure) -> None:
        raise OverflowError("too large <b>")

    assert inline_svg("Speed <1>", fail, (3.0, 2.0)) == (
        "<p>Speed &lt;1&gt;: this plot cannot be drawn: too large &lt;b&gt;</p>"
    )


@pytest.mark.parametrize("content_of", [native_content, python_content])
def test_model_png_is_the_own_picture_or_else_the_icon(vehicle: Vehicle, content_of: Callable[..., Content]) -> None:
    assert vehicle.pictures
    own = (vehicle.pictures / "model.png").read_bytes()
    assert len(own) < 20_000
    assert b"tEXt" not in own
    assert content_of(vehicle, shipped("videoray")).files["model.png"] == own
    bare = replace(vehicle, pictures=None)
    assert content_of(bare, shipped("videoray")).files["model.png"] == shipped("videoray")[ICON]


@pytest.mark.parametrize("size", [(0.29, 0.57), (1.14, 0.58)])
def test_a_png_has_the_pixels_asked_for_in_flat_colours(size: tuple[float, float]) -> None:
    """Odd widths too, whose last row ends within a byte."""

    def draw(figure: Figure) -> None:
        ax = figure.subplots()
        ax.set_axis_off()
        ax.axvspan(0.0, 0.5, color="#0a5cad", linewidth=0.0)
        ax.set_xlim(0.0, 1.0)

    pixels = np.round(255 * decoded(png_file(draw, size, background="white"))).astype(int)
    assert pixels.shape[:2] == (round(100 * size[1]), round(100 * size[0]))
    assert (pixels[:, 1, :3] == [0x0A, 0x5C, 0xAD]).all()
    assert (pixels[:, -1, :3] == 255).all()


def test_many_colours_become_few_near_ones() -> None:
    def draw(figure: Figure) -> None:
        ax = figure.subplots()
        ax.set_axis_off()
        ax.imshow([[n / 255 for n in range(256)]], cmap="gray", aspect="auto")

    grey = np.round(255 * decoded(png_file(draw, (2.56, 0.1), background="white"))[5, :, 0])
    assert len(np.unique(grey)) <= 64
    assert np.abs(grey - range(256)).max() <= 16


_BLIND = {
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.3039]],
}
"""What colour-blind people see of linear red, green and blue (Machado et al. 2009, doi:10.1109/TVCG.2009.113)."""


def _lab(color: str, seen: Any) -> Any:
    """A colour of sRGB in CIELAB (D65), as somebody sees it for whom `seen` holds."""
    values = np.array([int(color[n : n + 2], 16) / 255 for n in (1, 3, 5)])
    linear = np.clip(
        np.array(seen) @ np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4), 0, 1
    )
    xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]) @ linear
    x, y, z = np.where((t := xyz / [0.9505, 1.0, 1.089]) > 0.008856, np.cbrt(t), 7.787 * t + 16 / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize(("kind", "least"), [("protanopia", 20.0), ("deuteranopia", 20.0), ("tritanopia", 11.0)])
def test_colour_blind_people_tell_the_lines_apart(kind: str, least: float) -> None:
    """2.3 is just noticeable. The last kind is a thousand times as rare as the others."""
    for scheme in (0, 1):
        for one, other in combinations(LINES, 2):
            colors = (_lab(PALETTE[role][scheme], _BLIND[kind]) for role in (one, other))
            assert np.linalg.norm(np.subtract(*colors)) > least, (scheme, one, other)


# ---- The thrusters in a drawing --------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", VEHICLES)
def test_every_thruster_is_within_the_icon(kind: str) -> None:
    """A circle for each that differs from above, with the arrow of its force wherever that points."""
    ax = Figure().subplots()
    draw_icon(ax, VEHICLES[kind])
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    assert left == -right
    assert high == -low == left
    points = [patch.get_center() for patch in ax.patches if hasattr(patch, "get_center")]
    arrows = [text for text in ax.texts if isinstance(text, Annotation)]
    points += [end for arrow in arrows for end in (arrow.xy, arrow.xyann)]
    assert points
    assert all(left < x < right and high < y < low for x, y in points)
    horizontal = {
        (t.direction.value, t.position, t.arm) for t in VEHICLES[kind].layout.thrusters if t.direction.value[2] == 0.0
    }
    assert len(arrows) == len(horizontal)


def test_thrusters_are_drawn_where_they_are_and_push_where_they_push(heavy: Vehicle) -> None:
    """An arrow begins at the thruster and points along its direction; in pixels y is down."""
    figure = Figure(figsize=(6.0, 6.0))
    ax = figure.subplots()
    draw_thrusters(ax, heavy, scenes(heavy)["from above"])
    arrows = {(round(a.xyann[0], 2), round(a.xyann[1], 2)): a.xy for a in ax.texts if isinstance(a, Annotation)}
    names = {text.get_text() for text in ax.texts}
    for thruster in heavy.layout.thrusters:
        assert f"$F_{{{thruster.name}}}$" in names
        x, y, _ = thruster.place
        if thruster.direction.value[2] == 0.0:
            ((start, tip),) = [(a, b) for a, b in arrows.items() if hypot(a[0] - x, a[1] - y) < 0.03]
            along = tip[0] - start[0], tip[1] - start[1]
            expected = atan2(thruster.direction.value[1], thruster.direction.value[0])
            assert atan2(along[1], along[0]) == pytest.approx(expected, abs=0.2)
    assert ax.yaxis_inverted()


def test_the_arm_of_the_paper_stands_where_its_torque_says(vehicle: Vehicle) -> None:
    """(4): x F_y - y F_x of a force ahead is ±R sin γ, behind the centre of mass."""
    k = vehicle
    for thruster, side in zip(vehicle.layout.thrusters[:2], (1.0, -1.0), strict=True):
        x, y, _ = place(k, thruster)
        assert x < 0.0
        assert hypot(x, y) == pytest.approx(k["R"])
        assert -y == pytest.approx(side * k["R"] * sin(k["gamma"]))


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize(
    "kind",
    [
        "VideoRay",
        "neither lag nor coupling",
        *(pytest.param(kind, marks=pytest.mark.long) for kind in ("heave only", "yaw only", "sway and yaw")),
    ],
)
def test_a_drawing_holds_its_arrows_and_names_which_do_not_cover_each_other(kind: str, view: str) -> None:
    scene = scenes(VEHICLES[kind])[view]
    figure = Figure(figsize=scene.inches, layout="constrained")
    ax = figure.subplots()
    draw_thrusters(ax, VEHICLES[kind], scene)
    figure.draw_without_rendering()
    boxes = {text: text.get_window_extent() for text in ax.texts if text.get_text()}
    for text, box in boxes.items():
        assert min(box.x0, box.y0) >= 0.0, text
        assert box.x1 <= figure.bbox.x1, text
        assert box.y1 <= ax.bbox.y1, text
        assert sum(box.overlaps(other) for other in boxes.values()) == 1, text
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    tips = [text.xy for text in ax.texts if isinstance(text, Annotation)]
    assert tips
    assert all(left < x < right and high < y < low for x, y in tips)


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("name", ["videoray", "bluerov2", "bluerov2_heavy"])
def test_no_name_of_a_force_lies_on_an_axis_of_the_body(name: str, view: str) -> None:
    """The axes run from the centre of mass, at (0, 0), forward and downward in the drawing."""
    vehicle = load_vehicle(SHIPPED[name])
    scene = scenes(vehicle)[view]
    figure = Figure(figsize=scene.inches, layout="constrained")
    ax = figure.subplots()
    draw_thrusters(ax, vehicle, scene)
    figure.draw_without_rendering()
    axes = [(1.4 * share * scene.size, 0.0) for share in np.linspace(0.0, 1.0, 200)]
    axes += [(0.0, 0.9 * share * scene.size) for share in np.linspace(0.0, 1.0, 200)]
    on_axes = ax.transData.transform(axes)
    forces = [text for text in ax.texts if text.get_text().startswith("$F")]
    assert forces
    assert not any(text.get_window_extent().contains(*point) for text in forces for point in on_axes)
