"""The pictures of the docs, made anew when what draws them has changed, and the figures of the paper: files for a
publication, with captions and with the numbers that the paper prints."""

import re
from io import BytesIO
from itertools import cycle
from pathlib import Path

import numpy as np
import pytest
from lxml import etree
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from PIL import Image

from docs import pictures
from docs.pictures import ELSEWHERE, HERE, PICTURES, changed
from examples.videoray.figures import COLUMNS, FORMATS, PaperFigure, paper_figures
from tests.commands import ROOT

FIGURES = {figure.name: figure for figure in paper_figures()}
EXAMPLE = ROOT / "examples" / "videoray"
SHIPPED = ROOT / "docs" / "figures"


def size_of(picture: bytes, form: str) -> tuple[float, float]:
    """Return the width and the height of a picture in inches."""
    if form == "png":
        image = Image.open(BytesIO(picture))
        return image.width / image.info["dpi"][0], image.height / image.info["dpi"][1]
    pattern = {"svg": rb'viewBox="([^"]*)"', "pdf": rb"/MediaBox \[([^]]*)]"}[form]
    _, _, width, height = map(float, re.findall(pattern, picture)[0].split())
    return width / 72.0, height / 72.0


def drawn(figure: PaperFigure, plot: int = 0) -> Axes:
    ax = Figure().subplots()
    figure.plots[plot](ax)
    return ax


@pytest.mark.parametrize(("form", "column"), [*zip(FORMATS, cycle(COLUMNS), strict=False)])
def test_a_figure_is_as_wide_as_the_column_and_has_the_same_bytes_again(form: str, column: str) -> None:
    picture = FIGURES["figure_5"].content(form, column)
    width, height = size_of(picture, form)
    assert width == pytest.approx(COLUMNS[column], abs=0.01)
    assert 0.25 * width < height < 2.5 * width
    assert FIGURES["figure_5"].content(form, column) == picture


def texts(picture: bytes) -> list[str]:
    """Return the texts of an SVG picture, which Matplotlib writes as comments beside their paths."""
    return [str(comment.text).strip() for comment in etree.fromstring(picture).iter(etree.Comment)]


@pytest.mark.long
def test_the_readme_shows_every_figure_that_is_drawn() -> None:
    page = " ".join((EXAMPLE / "README.md").read_text(encoding="utf-8").split())
    assert {path.name for path in SHIPPED.iterdir()} == {
        f"{name}.{suffix}" for name in FIGURES for suffix in ("svg", "txt")
    }
    for name, figure in FIGURES.items():
        assert f"(../../docs/figures/{name}.svg)" in page
        assert (SHIPPED / f"{name}.txt").read_text(encoding="utf-8") == f"{figure.caption}\n"
        shown, shipped = figure.content("svg", "double"), (SHIPPED / f"{name}.svg").read_bytes()
        assert size_of(shipped, "svg") == size_of(shown, "svg")
        assert texts(shipped) == texts(shown) != [], "the command in the README draws them"


def points(line: Line2D) -> list[tuple[float, float]]:
    """Return the points of a line in a plot."""
    x, y = np.asarray(line.get_data(), float)
    return [*zip(x.tolist(), y.tolist(), strict=True)]


def test_curves_and_points_are_those_that_the_paper_prints() -> None:
    unweighted, weighted = map(points, drawn(FIGURES["figure_5"]).lines)
    assert unweighted[-1] == pytest.approx((100.0, 100.3 - 27.09), rel=1e-9), "(8)"
    assert weighted[-1] == pytest.approx((100.0, 42.9 + 2.711), rel=1e-3), "(9)"
    measured = points(drawn(FIGURES["figure_7"]).lines[-1])
    assert measured[1] == pytest.approx((0.47, 42.9 * 0.3**2 + 2.711 * 0.3), rel=1e-3), "Table 4 at 30 %"
    surge = {str(line.get_label()): points(line) for line in drawn(FIGURES["steady_velocity"]).lines}
    assert surge["measured"][1] == pytest.approx((30.0, 0.47))
    assert surge["model of the paper"][15] == pytest.approx((30.0, 0.4729), abs=1e-4)
    turning = points(drawn(FIGURES["figure_9"]).lines[-1])
    assert turning[2][0] == pytest.approx(2.00 * 180.0 / np.pi, rel=1e-9), "Table 5 at 40 %"
    for name, count in {"figure_11a": 3, "figure_11b": 2, "surge_steps": 0}.items():
        lines = drawn(FIGURES[name]).lines
        assert sum(line.get_marker() == "o" and len(points(line)) > 0 for line in lines) == count, "Tau where measured"


# ---- The pictures of the docs ----------------------------------------------------------------------------------------


def test_no_page_or_plot_has_changed_since_its_picture_was_made() -> None:
    advice = "make them (python -m docs.pictures NAME), look at them, or say that they look the same (--same)"
    assert not changed(), advice


def test_each_picture_of_a_page_is_made_by_a_command() -> None:
    texts = [path.read_text(encoding="utf-8") for path in (ROOT / "README.md", *HERE.glob("*.md"))]
    shown = {Path(name).name for text in texts for name in re.findall(r"!\[[^\]]*\]\(([^):]+)\)", text)}
    drawn = {path.name for path in HERE.glob("drawings/*.svg")}  # by docs.reference
    assert shown - drawn == PICTURES.keys() | ELSEWHERE.keys()


def test_a_digest_follows_the_code_and_not_its_comments(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "plot.py").write_text('"""Draw."""\nwidth = 1  # inch\n')
    (tmp_path / "page.css").write_text("a {}")
    monkeypatch.setattr(pictures, "ROOT", tmp_path)
    picture = pictures.Picture(lambda _: b"", ("*.py", "page.*"))
    before = picture.digest
    (tmp_path / "plot.py").write_text('"""Draw a plot."""\nwidth = 1\n')
    assert picture.digest == before
    (tmp_path / "plot.py").write_text("width = 2\n")
    assert picture.digest != before
    (tmp_path / "plot.py").write_text("width = 1\n")
    (tmp_path / "page.css").write_text("a { color: red }")
    assert picture.digest != before
