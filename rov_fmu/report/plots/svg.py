"""Plots as SVG, in the colours and fonts of the page that holds them. The bytes are the same at every call."""

import base64
import json
import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from html import escape
from io import BytesIO
from operator import mul
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from cycler import cycler
from lxml import etree
from markupsafe import Markup
from matplotlib import rc_params_from_file
from matplotlib.axes import Axes
from matplotlib.axis import XAxis, YAxis
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.style import context
from matplotlib.text import Text
from matplotlib.ticker import MaxNLocator

from rov_fmu.fmu.picture import read_svg
from rov_fmu.io.groups import grouped
from rov_fmu.io.messages import brief, reason_of
from rov_fmu.report.palette import PALETTE
from rov_fmu.report.templates import panel_title

LIGHT = {role: light for role, (light, _) in PALETTE.items()}
"""The colours on a light page. In a page, a plot follows the page."""
LINES = ("blue", "orange", "teal", "violet", "steel")
"""The colours of lines, in the order of their use. They differ for colour-blind people, too."""
KNOTS = 3600.0 / 1852.0
"""Knots in 1 m/s."""
_IN_KNOTS: Any = partial(mul, KNOTS), partial(mul, 1.0 / KNOTS)
"""The functions from m/s to knots and back."""
BROAD, NARROW = 7.2, 3.7
"""The width of the large picture of a page, and of all other plots, inches. Text of plots of a width has one size."""
_FONTS = "system-ui, sans-serif"
STYLE: Any = {
    **rc_params_from_file(Path(__file__).with_name("plots.mplstyle"), use_default_template=False),
    "axes.prop_cycle": cycler(color=[LIGHT[role] for role in LINES]),
    "axes.edgecolor": LIGHT["muted"],
    "axes.labelcolor": LIGHT["muted"],
    "axes.titlecolor": LIGHT["ink"],
    "grid.color": LIGHT["rule"],
    "xtick.color": LIGHT["muted"],
    "ytick.color": LIGHT["muted"],
    "text.color": LIGHT["ink"],
}
_PAD: float = STYLE["xtick.major.pad"]
"""The distance of the numbers from an axis, points."""
_NO_XML = re.compile(rb"[\x00-\x08\x0b\x0c\x0e-\x1f]|\xef\xbf[\xbe\xbf]")
"""The characters of a text that XML does not allow."""
_SVG, _XLINK = "{http://www.w3.org/2000/svg}", "{http://www.w3.org/1999/xlink}href"

Draw = Callable[[Figure], None]


def inline_svg(label: str, draw: Draw, size: tuple[float, float], *, salt: str = "", marked: bool = False) -> Markup:
    """Return a plot as part of a page, with a label for screen readers. The colours of the palette become the page's.

    `marked` adds what the script plots.js needs, for a page that has it.
    Two plots of a page must differ in their label or in their salt, because their ids follow from these. A plot that
    cannot be drawn becomes a line with the reason, because the rest of the page does not depend on it.
    """
    try:
        svg = svg_file(draw, size, salt=label + salt, background="none", margin=0.02, marked=marked)
    except Exception as error:  # Matplotlib raises any kind
        reason = brief(reason_of(error))
        return Markup("<p>{}: this plot cannot be drawn: {}</p>").format(label, reason)
    head = f'role="img" aria-label="{escape(label)}">'
    svg = re.sub(r'<svg [^>]*?(viewBox="[^"]*")[^>]*>', lambda found: f"<svg {found[1]} {head}", svg, count=1)
    svg = svg.replace(f"font-family:{_FONTS};", "")
    for role, color in LIGHT.items():
        svg = svg.replace(color, f"var(--{role})")
    return Markup(svg)


def in_both_widths(plot: Callable[..., Markup], height: float, broad: float = BROAD) -> Markup:
    """Return a picture twice, broad and for phones, of which the page shows one. `plot` draws it, given its size in
    inches and a salt."""
    sizes = {"broad": (broad, height), "narrow": (NARROW, height)}
    return Markup("").join(
        Markup('<div class="{}">{}</div>').format(key, plot(size=size, salt=key)) for key, size in sizes.items()
    )


def name_axes(ax: Axes, quantity: str, unit: str, x: str = "", *, gap: float = 0.0) -> None:
    """Name what the axes of a panel show, in words and with units, and add a scale in knots at the right of one in m/s.

    `gap` is the distance of this scale from the panel, in points.
    """
    ax.set_title(panel_title(quantity, unit), loc="left")
    ax.set_xlabel(x)
    ax.locator_params(nbins=6)
    if unit == "m/s":
        add_knots(ax, "y", gap)


def add_knots(ax: Axes, along: Literal["x", "y"], gap: float = 0.0) -> None:
    """Add a scale in knots to a panel with m/s: above it, or at its right, at a distance in points."""
    if along == "y":
        scale = ax.secondary_yaxis("right", functions=_IN_KNOTS)
        axis: XAxis | YAxis = scale.yaxis
    else:
        scale = ax.secondary_xaxis("top", functions=_IN_KNOTS)
        axis = scale.xaxis
    scale.spines[:].set_visible(False)
    axis.set_tick_params(length=0.0, pad=_PAD + gap)
    axis.set_label_text("knots")
    axis.set_major_locator(MaxNLocator(5))


def shade(ax: Axes, low: float, high: float, label: str | None = None) -> None:
    """Shade a panel between two places."""
    ax.axvspan(low, high, label=label, facecolor=LIGHT["band"], edgecolor="none", zorder=0)


def add_legend(figure: Figure, columns: int = 2) -> None:
    """Add one legend for all panels below them, where it hides nothing, if a line or an area has a name."""
    named = {label: look for ax in figure.axes for look, label in zip(*ax.get_legend_handles_labels(), strict=True)}
    if named:
        figure.legend(named.values(), named.keys(), loc="outside lower center", ncols=columns, columnspacing=1.0)


def draw_commands(ax: Axes, time: Any, commands: Mapping[str, Any], unit: str = "1") -> None:
    """Draw the commands of all thrusters as steps in one small panel: fractions in percent, or numbers in another unit.

    Equal commands share a line.
    """
    factor, shown = (100.0, "%") if unit == "1" else (1.0, unit)
    for names in grouped((np.asarray(values, float).tobytes(), name) for name, values in commands.items()).values():
        label = ", ".join(names)
        ax.plot(time, factor * np.asarray(commands[names[0]]), linewidth=1.0, label=label, drawstyle="steps-post")
    name_axes(ax, "commands", shown)
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    ax.locator_params("y", nbins=4)


def with_even_text(draw: Draw, size: float = STYLE["font.size"]) -> Draw:
    """Return a function that draws the same figure with all text in one size, in points."""

    def drawn(figure: Figure) -> None:
        draw(figure)
        for text in figure.findobj(Text):
            text.set_fontsize(size)

    return drawn


def with_formulas(*texts: Text) -> None:
    """Let Matplotlib set what stands between dollar signs as a formula. All other text is drawn as it is."""
    for text in texts:
        text.set_parse_math(True)


def image(label: str, path: Path) -> Markup:
    """Return a foreign SVG file as an image, in which no script runs and no link works. Raises FileError.

    The page shows it on a light ground, because the file does not follow the colours of the page.
    """
    data = base64.b64encode(read_svg(path)).decode()
    return Markup('<img src="data:image/svg+xml;base64,{}" alt="{}">').format(data, label)


def svg_file(
    draw: Draw,
    size: tuple[float, float],
    *,
    salt: str,
    background: str = "white",
    margin: float = 0.1,
    marked: bool = False,
) -> str:
    """Return a figure (size in inches) as SVG, independent of the user's settings of Matplotlib."""
    kind: Any = {"format": "svg", "metadata": {"Date": None}, "marked": marked}
    svg = saved(draw, size, background=background, margin=margin, salt=salt, **kind)
    return _without_ballast(_NO_XML.sub("\N{REPLACEMENT CHARACTER}".encode(), svg)).replace("'DejaVu Sans'", _FONTS)


def saved(
    draw: Draw,
    size: tuple[float, float],
    *,
    background: str,
    margin: float,
    salt: str = "",
    style: Mapping[str, Any] = MappingProxyType({}),
    marked: bool = False,
    **how: Any,
) -> bytes:
    """Return a figure (size in inches) as Matplotlib saves it, in the common style; `how` has the format and other
    options of Matplotlib.

    `style` has settings of Matplotlib that differ from the common style.
    """
    file = BytesIO()
    margins = {f"figure.constrained_layout.{side}_pad": margin for side in "wh"}
    with context(["default", STYLE, {"svg.hashsalt": salt, **margins, **style}]), without_font_warnings():
        figure = Figure(figsize=size, layout="constrained", facecolor=background)
        draw(figure)
        _arrange(figure, how["format"])
        if marked:
            _mark(figure)
        figure.savefig(file, **how)
    return file.getvalue()


@contextmanager
def without_font_warnings() -> Iterator[None]:
    """Print no warning about characters in foreign text that the font of a plot does not have."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from font", UserWarning)
        yield


def _arrange(figure: Figure, form: str) -> None:
    """Lay the figure out for a format. Otherwise Matplotlib would do it while saving, and draw everything twice."""
    if form in ("svg", "pdf"):
        figure.dpi = 72.0  # as these formats are drawn
    if form == "svg":
        FigureCanvasSVG(figure)
    engine = figure.get_layout_engine()
    assert engine
    engine.execute(figure)
    figure.set_layout_engine(None)


def _mark(figure: Figure) -> None:
    """Mark each panel and each line that has a name with what rov_fmu/report/templates/plots.js needs of it, as JSON in
    the id of its group: where the panel is, in which coordinates, and the names."""
    height = 72.0 * figure.get_figheight()
    for ax in figure.axes:
        box, title = ax.bbox, ax.get_title(loc="left")
        corners = [round(part, 2) for part in (box.x0, height - box.y1, box.x1, height - box.y0)]
        panel = {"box": corners, "x": ax.get_xlim(), "y": ax.get_ylim(), "title": title or ax.get_ylabel()}
        ax.set_gid(json.dumps(panel | {"along": ax.get_xlabel() or figure.axes[-1].get_xlabel()}))
        ax.xaxis.set_gid('{"ticks": "x"}')
        named = [(line.get_label(), [line]) for line in ax.lines] + [(bars.get_label(), bars) for bars in ax.containers]
        for label, artists in named:
            for artist in artists if not str(label).startswith("_") else ():
                artist.set_gid(json.dumps({"line": label}))


def _without_ballast(svg: bytes) -> str:
    """Return the picture without metadata, unused groups and ids, and invisible digits."""
    parser = etree.XMLParser(remove_comments=True, remove_blank_text=True)
    root = etree.fromstring(svg, parser)
    root.set("stroke-linejoin", "round")
    used = set(re.findall(rb'(?:href="|url\()#(\w+)', svg))
    for element in list(root.iter()):
        if element.get("id", "").encode() not in used:
            name = element.attrib.pop("id", "")
            if name.startswith("{"):
                element.set("data-plot", name)
        if element.get("transform", "").startswith("rotate(-0 "):
            del element.attrib["transform"]
        if link := element.attrib.pop(_XLINK, None):
            element.set("href", link)
        if "style" in element.attrib:
            element.set("style", element.get("style").replace(": ", ":").replace("; ", ";"))
        for name in ("d", "x", "y", "transform"):
            if name in element.attrib:
                element.set(name, _rounded(element.get(name)))
    for element in reversed(list(root.iter(*(_SVG + tag for tag in ("g", "defs", "style", "metadata"))))):
        parent = element.getparent()
        if element.tag == f"{_SVG}g" and not element.attrib:
            for child in list(element):
                element.addprevious(child)
        if not len(element) or element.tag == f"{_SVG}metadata":
            parent.remove(element)
    etree.cleanup_namespaces(root)
    return str(etree.tostring(root, encoding="unicode"))


def _rounded(text: str) -> str:
    """Round the coordinates in a text to two decimals."""
    text = re.sub(r"-?\d+\.\d+", lambda x: f"{float(x[0]):.2f}".rstrip("0").rstrip("."), text)
    return " ".join(text.split())
