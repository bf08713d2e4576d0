"""The pictures in the FMU: small, whole, of the vehicle's own thrusters, the same bytes every time."""

import re
from collections.abc import Mapping
from io import BytesIO
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from lxml import etree
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.text import Annotation

from rov_fmu.report.page.pictures import pictures
from rov_fmu.report.plots.drawing import draw_icon
from rov_fmu.report.plots.png import png_file
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.vehicles import VEHICLES, VIDEORAY

Pictures = Mapping[str, bytes]
"""The pictures of a vehicle by their path in the FMU."""
SIZES = {"diagram": 8_500, "icon": 3_000, "signal": 500}


@pytest.fixture(scope="module")
def shipped() -> dict[str, Pictures]:
    """The pictures of every vehicle that ships."""
    return {name: pictures(load_vehicle(path).rov) for name, path in SHIPPED.items()}


@pytest.fixture(params=SHIPPED)
def files(request: pytest.FixtureRequest, shipped: dict[str, Pictures]) -> Pictures:
    """The pictures of one of these vehicles."""
    return shipped[request.param]


def decoded(png: bytes) -> Any:
    """Return red, green, blue and alpha, from 0 to 1, by row and column."""
    return imread(BytesIO(png), format="png")


def test_each_png_opens_and_is_small(files: Pictures) -> None:
    shapes = {}
    for path, content in files.items():
        if path.endswith(".png"):
            name = path.split("/")[-1].removesuffix(".png")
            assert len(content) <= SIZES[name]
            assert not re.search(rb"tEXt|tIME|iTXt", content)
            shapes[name] = decoded(content).shape
    assert shapes["icon"] == (200, 200, 4)
    assert shapes["signal"] == (20, 20, 4)
    assert shapes["diagram"][1] == 740


def test_the_icon_is_transparent_and_the_diagram_is_not(shipped: dict[str, Pictures]) -> None:
    files = shipped["videoray"]
    icon = decoded(files["terminalsAndIcons/icon.png"])
    assert [float(icon[place][3]) for place in ((0, 0), (-1, -1), (100, 100))] == [0.0, 0.0, 1.0]
    assert (decoded(files["documentation/diagram.png"])[..., 3] == 1.0).all()


def test_the_svg_needs_nothing_and_runs_nothing(files: Pictures) -> None:
    svg = files["terminalsAndIcons/icon.svg"]
    root = etree.fromstring(svg)
    assert {etree.QName(element).localname for element in root.iter()} <= {
        "svg",
        "g",
        "path",
        "defs",
        "clipPath",
        "rect",
    }
    ids = set(root.xpath("//@id"))
    assert set(re.findall(r"url\(#(\w+)\)", svg.decode())) <= ids
    assert not re.search(rb"href|@import|url\((?!#)|<!|<\?|\bon\w+=", svg)
    assert len(svg) < 7_000


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
    horizontal = {(t.direction, t.position, t.arm) for t in VEHICLES[kind].layout.thrusters if t.direction[2] == 0.0}
    assert len(arrows) == len(horizontal)


def test_vehicles_have_pictures_of_their_own(shipped: dict[str, Pictures]) -> None:
    """The refit of the VideoRay has the same thrusters, so its pictures are the same."""
    assert shipped["videoray"] == shipped["videoray_refit"]
    names = ("videoray", "bluerov2", "bluerov2_heavy")
    for path in ("terminalsAndIcons/icon.png", "terminalsAndIcons/icon.svg", "documentation/diagram.png"):
        assert len({shipped[name][path] for name in names}) == len(names)


def test_the_same_bytes_whatever_matplotlib_is_set_to(shipped: dict[str, Pictures]) -> None:
    with mpl.rc_context({"lines.linewidth": 5.0, "figure.dpi": 77, "savefig.dpi": 55, "font.size": 20.0}):
        assert pictures(VIDEORAY) == shipped["videoray"]


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


def test_many_colours_come_down_to_those_that_are_near() -> None:
    def draw(figure: Figure) -> None:
        ax = figure.subplots()
        ax.set_axis_off()
        ax.imshow([[n / 255 for n in range(256)]], cmap="gray", aspect="auto")

    grey = np.round(255 * decoded(png_file(draw, (2.56, 0.1), background="white"))[5, :, 0])
    assert len(np.unique(grey)) <= 64
    assert np.abs(grey - range(256)).max() <= 16
