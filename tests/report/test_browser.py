"""What a person sees who opens the FMU's page, or an identification report, in Chromium."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rov_fmu.identify.inspection.inspected import inspect_paths
from rov_fmu.report.inspection_page import inspection_page
from rov_fmu.report.report import report_page
from tests.commands import ROOT
from tests.report.conftest import Visit
from tests.report.fly.boxes import SCREENS, problems
from tests.report.pages import check_fits_and_is_accessible
from tests.report.results import example
from tests.tank.readers.motion import DIVE
from tests.tank.readers.writers import LOGS

pytestmark = pytest.mark.interop


# ---- The pages -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of an identification."""
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(report_page(example()), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def documentation(videoray_dir: Path) -> Path:
    """The page of the FMU."""
    return videoray_dir / "documentation" / "index.html"


@pytest.fixture(scope="module")
def inspection(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What `rov-fmu inspect --report` writes about a dive."""
    folder = tmp_path_factory.mktemp("inspection")
    path = folder / "logs.html"
    path.write_text(inspection_page(inspect_paths([LOGS[".tlog"](folder, DIVE)])), encoding="utf-8")
    return path


@pytest.mark.parametrize(("width", "scheme"), SCREENS)
@pytest.mark.parametrize("name", ["documentation", "report", "inspection"])
def test_a_page_asks_for_nothing_fits_and_is_accessible(
    name: str, width: int, scheme: str, visit: Callable[..., Visit], request: pytest.FixtureRequest
) -> None:
    seen = visit(width=width, scheme=scheme)
    wait_for = "#live-section:not([hidden])" if name == "documentation" else "body"
    check_fits_and_is_accessible(seen, request.getfixturevalue(name), wait_for)
    cut = "[...document.querySelectorAll('.overview .wide')].filter(t => t.scrollWidth > t.clientWidth).length"
    assert seen.page.evaluate(cut) == 0, "the answers of the report are not cut off"
    if name == "report":
        sizes = seen.page.locator(".plots svg").evaluate_all("svgs => svgs.map((svg) => svg.clientWidth)")
        assert max(sizes) - min(sizes) <= 2, "the text of all plots has one size"


@pytest.mark.long
@pytest.mark.skipif(not (ROOT / "site").exists(), reason="CONTRIBUTING.md says how to build the site")
@pytest.mark.parametrize(("width", "scheme"), SCREENS)
def test_nothing_overlaps_or_is_cut_on_the_site(width: int, scheme: str, visit: Callable[..., Visit]) -> None:
    page = visit(width=width, scheme=scheme).page
    found = {}
    for path in sorted((ROOT / "site").glob("*.html")):
        page.goto(path.as_uri())
        found[path.name] = problems(page, "article" if page.locator("article").count() else "body")
        cut = "[...document.querySelectorAll('article pre')].filter((e) => e.scrollWidth > e.clientWidth + 1).length"
        assert page.evaluate(cut) == 0, f"{path.name}: no line of code or output is cut"
        assert page.evaluate("document.documentElement.scrollWidth") <= width, path.name
    assert {name: some for name, some in found.items() if some} == {}


# ---- The report of an identification ---------------------------------------------------------------------------------


def test_what_is_folded_opens_by_a_click_or_a_link_and_on_paper(report: Path, visit: Callable[..., Visit]) -> None:
    page = visit().page
    page.goto(report.as_uri())
    effects, known = page.locator("#effects p"), page.locator("#known > p").first
    assert not effects.is_visible()
    page.locator("summary", has_text="Effects").click()
    assert effects.is_visible()
    page.evaluate("location.hash = '#known'")
    known.wait_for(state="visible")
    table = page.locator("#predictions table")
    assert not table.is_visible()
    page.emulate_media(media="print")
    page.set_viewport_size({"width": 720, "height": 1000})
    assert page.locator(".picture .narrow svg").is_visible(), "beside the answers, there is half a page"
    assert not page.locator(".picture .broad svg").is_visible()
    box = table.bounding_box()
    assert box is not None
    assert box["height"] > 50


def values_at(seen: Visit, at: float) -> str:
    """Return the values that the large picture of a page shows while the pointer is at a time."""
    plot = seen.page.locator(".broad svg")
    panel = json.loads(plot.locator('[data-plot*="box"]').first.get_attribute("data-plot") or "")
    (left, top, right, _), (low, high) = panel["box"], panel["x"]
    scale = plot.evaluate("svg => svg.clientWidth / svg.viewBox.baseVal.width")
    x = left + (at - low) / (high - low) * (right - left)
    plot.hover(position={"x": scale * x, "y": scale * (top + 10.0)})
    return " ".join(seen.page.locator(".broad .values span").all_inner_texts()).replace("−", "-")


def test_a_plot_of_the_report_shows_the_values_under_the_pointer(report: Path, visit: Callable[..., Visit]) -> None:
    seen = visit(width=1440)
    seen.page.goto(report.as_uri())
    at = 20.0
    shown = values_at(seen, at)
    expected = example().axes[0].predictions[0]
    values = [np.interp(at, expected.time, values) for values in (expected.measured, expected.predicted)]
    pattern = r"time \(s\): (\S+) Distance, 10 s ahead \(m\): measured ([-\d.]+); predicted, with 95 % band ([-\d.]+)"
    assert [float(text) for text in re.findall(pattern, shown)[0]] == pytest.approx([at, *values], abs=0.2)
    assert re.search(r"Commands \(%\): .*u_t 50", shown)
    seen.page.mouse.move(5, 5)
    assert seen.page.locator(".broad .values span").count() == 0
    assert (seen.problems(), seen.requests) == ([], [report.as_uri()])


def test_the_answers_are_on_the_first_page_of_paper(report: Path, visit: Callable[..., Visit]) -> None:
    """Verdicts, answers, picture, next test and warnings fit on A4 with its margins, 182 mm by 273 mm."""
    seen = visit(width=688, height=1031)
    seen.page.emulate_media(media="print")
    seen.page.goto(report.as_uri())
    bottom = seen.page.evaluate("document.querySelector('.overview').getBoundingClientRect().bottom")
    assert 300.0 < bottom < 1031.0


# ---- The page of logs ------------------------------------------------------------------------------------------------


def test_the_page_of_logs_is_as_wide_as_the_window_and_shows_values(
    inspection: Path, visit: Callable[..., Visit]
) -> None:
    seen = visit(width=1800)
    seen.page.goto(inspection.as_uri())
    picture, table = (seen.page.locator(f".log {part}").first.bounding_box() for part in (".picture", "table"))
    assert picture is not None
    assert table is not None
    assert picture["x"] < 30.0
    assert picture["x"] + picture["width"] > 1770.0
    assert table["y"] > picture["y"] + picture["height"], "below the picture"
    shown = values_at(seen, 5.0)
    (depth,) = re.findall(r"Depth \(m\): measured ([\d.]+)", shown)
    assert float(depth) == pytest.approx(np.interp(5.0, DIVE.time, DIVE.position[:, 2]), abs=0.02)
    assert re.search(r"Commands \(%\): .*u_5 50", shown)
    assert (seen.problems(), seen.requests) == ([], [inspection.as_uri()])
