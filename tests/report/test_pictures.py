"""The pictures in the FMU: small, whole, of the vehicle's own thrusters, the same bytes every time."""

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from io import BytesIO
from typing import Any

import pytest
from lxml import etree
from matplotlib.figure import Figure
from matplotlib.image import imread

from rov_fmu.fmu.content import FmuContent, native_content, python_content
from rov_fmu.fmu.terminals import ICON
from rov_fmu.report.page.pictures import pictures
from rov_fmu.report.plots.svg import inline_svg, with_formulas
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle

SIZES = {"diagram": 9_000, "icon": 3_000, "signal": 500}


@cache
def shipped(name: str) -> Mapping[str, bytes]:
    """Return the pictures of a vehicle that ships, by their path in the FMU."""
    return pictures(load_vehicle(SHIPPED[name]))


def decoded(png: bytes) -> Any:
    """Return red, green, blue and alpha, from 0 to 1, by row and column."""
    return imread(BytesIO(png), format="png")


@pytest.mark.parametrize("name", ["videoray", pytest.param("bluerov2_heavy", marks=pytest.mark.long)])
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


def test_a_plot_tells_its_script_where_its_panel_is_in_the_coordinates_of_its_lines() -> None:
    def draw(figure: Figure) -> None:
        upper, lower = figure.subplots(2, 1)
        upper.plot([0.0, 2.0], [1.0, 5.0], label="a line")
        upper.set_title("Speed (m/s)", loc="left")
        lower.bar([1.0], [2.0], label="_no name")
        lower.set(xlabel="time (s)", ylabel="force")

    found = etree.fromstring(inline_svg("A plot", draw, (4.0, 3.0), marked=True))
    marks = [(json.loads(group.get("data-plot")), group) for group in found.xpath("//*[@data-plot]")]
    upper, lower = (mark for mark, _ in marks if "box" in mark)
    assert [(mark["title"], mark["along"]) for mark in (upper, lower)] == [
        ("Speed (m/s)", "time (s)"),
        ("force", "time (s)"),
    ]
    (line,) = (group for mark, group in marks if mark.get("line") == "a line")
    assert len([mark for mark, _ in marks if "line" in mark]) == 1
    left, top, right, bottom = upper["box"]
    (x0, x1), (y0, y1) = upper["x"], upper["y"]
    points = [
        (left + (x - x0) / (x1 - x0) * (right - left), bottom + (y - y0) / (y1 - y0) * (top - bottom))
        for x, y in ((0.0, 1.0), (2.0, 5.0))
    ]
    assert [float(part) for part in re.findall(r"[\d.]+", line[0].get("d"))] == pytest.approx(
        [*points[0], *points[1]], abs=0.05
    )


def test_a_plot_that_cannot_be_drawn_costs_only_itself() -> None:
    def fail(_: Figure) -> None:
        raise OverflowError("too large <b>")

    assert inline_svg("Speed <1>", fail, (3.0, 2.0)) == (
        "<p>Speed &lt;1&gt;: this plot cannot be drawn: too large &lt;b&gt;</p>"
    )


@pytest.mark.parametrize("content_of", [native_content, python_content])
def test_model_png_is_the_own_picture_or_else_the_icon(vehicle: Vehicle, content_of: Callable[..., FmuContent]) -> None:
    assert vehicle.pictures
    own = (vehicle.pictures / "model.png").read_bytes()
    assert len(own) < 20_000
    assert b"tEXt" not in own
    assert content_of(vehicle, shipped("videoray")).files["model.png"] == own
    bare = replace(vehicle, pictures=None)
    assert content_of(bare, shipped("videoray")).files["model.png"] == shipped("videoray")[ICON]
