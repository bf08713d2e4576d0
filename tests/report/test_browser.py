"""What a person sees who opens the FMU: its documentation page, and FMPy's web app, in headless Chromium.

SCREENSHOTS=docs pytest -m interop tests/report/test_browser.py takes the picture of the README anew.
"""

import importlib.util
import json
import os
import re
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from rov_fmu.fmu.claims.claims import prove_claims
from rov_fmu.fmu.variables import Variable, unit_of, variables
from rov_fmu.report.proof_page import proof_page
from rov_fmu.report.report import report_page
from rov_fmu.vehicle.vehicle import Vehicle
from tests.report.conftest import Visit
from tests.report.pages import UNFOLD
from tests.report.results import example

if TYPE_CHECKING:
    from playwright.sync_api import Browser

    pass

pytestmark = pytest.mark.interop


@pytest.fixture(scope="module")
def declared(vehicle: Vehicle) -> tuple[Variable, ...]:
    return variables(vehicle)


# ---- documentation/index.html ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 1280])
def test_the_documentation_asks_for_nothing_and_fits(
    videoray_dir: Path, visit: Callable[..., Visit], tmp_path: Path, width: int, scheme: str
) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright")
    seen = visit(width=width, scheme=scheme)
    url = (videoray_dir / "documentation" / "index.html").as_uri()
    seen.page.goto(url)
    seen.page.screenshot(path=tmp_path / f"documentation-{width}-{scheme}.png", full_page=True)
    assert seen.messages == []
    assert seen.requests == [url]
    assert seen.page.evaluate("document.documentElement.scrollWidth") <= width  # nothing to scroll sideways for
    seen.page.wait_for_selector("#live-section:not([hidden])")
    assert axe.Axe().run(seen.page).response["violations"] == [], "folded"
    seen.page.evaluate(UNFOLD)
    assert seen.page.evaluate("document.documentElement.scrollWidth") <= width
    plots = seen.page.locator("svg:not(.live svg), img")
    assert plots.count() == 12
    for plot in plots.all():
        box = plot.bounding_box()
        assert box is not None
        assert box["width"] > 200
        assert box["height"] > 100
    light = seen.page.evaluate("getComputedStyle(document.body).backgroundColor").removeprefix("rgb(").split(",")[0]
    assert (int(light) > 128) == (scheme == "light")
    assert axe.Axe().run(seen.page).response["violations"] == []


# ---- The report of an identification ---------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(report_page(example()), encoding="utf-8")
    return path


@pytest.mark.parametrize("width", [375, 1280])
def test_the_report_asks_for_nothing_and_fits(
    report: Path, visit: Callable[..., Visit], tmp_path: Path, width: int
) -> None:
    seen = visit(width=width)
    seen.page.goto(report.as_uri())
    seen.page.screenshot(path=tmp_path / f"report-{width}.png", full_page=True)
    assert seen.messages == []
    assert seen.requests == [report.as_uri()]
    assert seen.page.evaluate("document.documentElement.scrollWidth") <= width
    tables = seen.page.evaluate(
        "Array.from(document.querySelectorAll('.overview .wide'), t => t.scrollWidth - t.clientWidth)"
    )
    assert tables == [0], "the answers are not cut off"


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
    assert page.locator(".picture .broad svg").is_visible(), "a page of A4 is as wide as a screen"
    assert not page.locator(".picture .narrow svg").is_visible()
    box = table.bounding_box()
    assert box is not None
    assert box["height"] > 50


def test_a_plot_of_the_report_shows_the_values_under_the_pointer(report: Path, visit: Callable[..., Visit]) -> None:
    seen = visit(width=1440)
    seen.page.goto(report.as_uri())
    plot = seen.page.locator(".broad svg")
    panel = json.loads(plot.locator('[data-plot*="box"]').first.get_attribute("data-plot") or "")
    left, top, right, _ = panel["box"]
    low, high = panel["x"]
    box, width = plot.bounding_box(), plot.evaluate("svg => svg.viewBox.baseVal.width")
    assert box is not None
    scale = box["width"] / width
    at = 20.0
    x = left + (at - low) / (high - low) * (right - left)
    plot.hover(position={"x": scale * x, "y": scale * (top + 10.0)})
    texts = seen.page.locator(".broad .values span").all_inner_texts()
    shown = dict(text.split(": ", 1) for text in texts)

    def value(panel: str, line: str) -> float:
        (found,) = re.findall(rf"(?:^|; ){re.escape(line)} ([−\d.]+)", shown[panel])
        return float(found.replace("−", "-"))

    expected = example().axes[0].predictions[0]
    assert float(shown["time (s)"]) == pytest.approx(at, abs=0.2)
    measured, predicted = (np.interp(at, expected.time, values) for values in (expected.measured, expected.predicted))
    assert value("Distance (m)", "measured") == pytest.approx(measured, abs=0.03)
    assert value("Distance (m)", "predicted, with 95 % band") == pytest.approx(predicted, abs=0.03)
    assert value("Commands (%)", "u_t") == pytest.approx(50.0, abs=0.5)
    seen.page.mouse.move(5, 5)
    assert seen.page.locator(".broad .values span").count() == 0
    assert not seen.problems()
    assert seen.requests == [report.as_uri()]


def test_a_plot_of_the_report_zooms_by_dragging_and_by_keys(report: Path, visit: Callable[..., Visit]) -> None:
    seen = visit(width=1440)
    seen.page.goto(report.as_uri())
    plot = seen.page.locator(".broad svg")
    box = plot.bounding_box()
    assert box is not None
    ticks = plot.locator(".zoomed").last.locator("text")
    seen.page.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + 60)
    seen.page.mouse.down()
    seen.page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 60, steps=4)
    seen.page.mouse.up()
    zoomed = [float(text) for text in ticks.all_text_contents()]
    assert len(zoomed) >= 4
    assert min(zoomed) > 0.0
    assert max(zoomed) < 40.0, "a fifth of the minute"
    assert plot.locator("g.clip > [transform]").count() > 5, "lines and bands of all panels"
    plot.dblclick(position={"x": 0.4 * box["width"], "y": 60})
    assert plot.locator(".zoomed").count() == 0
    assert plot.locator("g.clip > [transform]").count() == 0
    plot.focus()
    seen.page.keyboard.press("ArrowRight")
    first = seen.page.locator(".broad .values span").first.inner_text()
    seen.page.keyboard.press("ArrowRight")
    assert seen.page.locator(".broad .values span").first.inner_text() != first
    seen.page.keyboard.press("+")
    assert plot.locator(".zoomed").count() == 4
    seen.page.keyboard.press("Escape")
    assert plot.locator(".zoomed").count() == 0
    assert not seen.problems()


def test_without_scripts_the_report_has_its_plots(report: Path, browser: "Browser") -> None:
    context = browser.new_context(java_script_enabled=False, viewport={"width": 1440, "height": 900})
    page = context.new_page()
    page.goto(report.as_uri())
    box = page.locator(".broad svg").bounding_box()
    assert box is not None
    assert box["height"] > 200
    assert page.locator(".values").count() == 0
    context.close()


# ---- The evidence of `rov-fmu prove --report` ------------------------------------------------------------------------


@pytest.fixture(scope="module")
def evidence(videoray_fmu: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("evidence") / "evidence.html"
    path.write_text(proof_page(prove_claims(videoray_fmu)), encoding="utf-8")
    return path


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 1440])
def test_the_evidence_asks_for_nothing_and_fits(
    evidence: Path, visit: Callable[..., Visit], width: int, scheme: str
) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright")
    seen = visit(width=width, scheme=scheme)
    seen.page.goto(evidence.as_uri())
    assert (seen.messages, seen.requests) == ([], [evidence.as_uri()])
    assert seen.page.evaluate("document.documentElement.scrollWidth") <= width
    assert axe.Axe().run(seen.page).response["violations"] == []
    printed = seen.page.pdf(prefer_css_page_size=True)
    assert 2 <= len(re.findall(rb"/Type /Page\b", printed)) <= 4


# ---- FMPy's web app --------------------------------------------------------------------------------------------------

COMMANDS = {"u_l": 0.32, "u_r": 0.3, "u_t": 0.4}
SHOWN = {"u": "m/s", "w": "m/s", "r": "rad/s", "z": "m", "psi": "rad"}


@pytest.fixture
def webapp(videoray_fmu: Path, declared: tuple[Variable, ...], tmp_path: Path) -> Iterator[str]:
    """The address of the app; it offers the commands and all parameters."""
    pytest.importorskip("dash_bootstrap_components", reason="FMPy's web app is not installed: fmpy[webapp]")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    offered = [*COMMANDS, *(v.name for v in declared if v.causality == "parameter")]
    command = [sys.executable, "-m", "fmpy.webapp", str(videoray_fmu), "--port", str(port)]
    with (tmp_path / "log").open("w") as log:  # beside it it unzips the FMU, and leaves it
        server = subprocess.Popen(
            [*command, "--start-values", *offered, "--output-variables", *SHOWN],
            stdout=log,
            stderr=subprocess.STDOUT,
            env={**os.environ, "TMPDIR": str(tmp_path)},
        )
    address = f"http://127.0.0.1:{port}/"
    try:
        for _ in range(1200):
            with suppress(OSError):
                urllib.request.urlopen(address).close()
                break
            assert server.poll() is None, (tmp_path / "log").read_text()
            time.sleep(0.1)
        yield address
    finally:
        server.terminate()
        server.wait()


def _bootstrap() -> str:
    """The style sheet as another package brings it; without it the page is plain, and has the same content."""
    package = importlib.util.find_spec("flask_bootstrap")
    if package is None or package.origin is None:
        return ""
    return Path(package.origin).with_name("static").joinpath("bootstrap5/css/bootstrap.min.css").read_text("utf-8")


def test_the_web_app_offers_the_declared_values_simulates_and_describes_the_model(
    webapp: str, visit: Callable[..., Visit], vehicle: Vehicle, declared: tuple[Variable, ...], tmp_path: Path
) -> None:
    from dash_bootstrap_components.themes import BOOTSTRAP

    seen = visit(width=1120, height=720)
    page = seen.page
    # the one request to the outside is FMPy's own, and is answered here
    page.route(BOOTSTRAP, lambda route: route.fulfill(content_type="text/css", body=_bootstrap()))
    page.goto(webapp)
    page.wait_for_selector("#simulate-button")
    rows = page.evaluate(
        "Array.from(document.querySelectorAll('#simulation-container label'), label => [label.innerText,"
        " document.getElementById(label.htmlFor).value, label.parentElement.querySelector('span').innerText])"
    )
    offered = [v for v in declared if v.name in COMMANDS or v.causality == "parameter"]
    assert [(name, float(value), unit) for name, value, unit in rows] == [(v.name, v.start, v.unit) for v in offered]

    for name, value in COMMANDS.items():
        box = page.get_by_label(name, exact=True)
        box.fill(str(value))
        box.blur()  # only then the app takes it
    page.click("#simulate-button")
    page.wait_for_selector("#result-col .js-plotly-plot .trace")
    assert page.locator(".alert").count() == 0
    page.wait_for_timeout(500)  # it draws with a transition
    page.screenshot(path=Path(os.environ.get("SCREENSHOTS", tmp_path)) / "webapp.png")
    last, titles = page.evaluate(
        "(plot => [plot._fullData.map(trace => trace.y.at(-1)), plot.data.map((trace, n) =>"
        " plot.layout['yaxis' + (n ? n + 1 : '')].title.text)])(document.querySelector('.js-plotly-plot'))"
    )
    rest = dict.fromkeys([*vehicle.layout.inputs, *vehicle.layout.state], 0.0)
    end = vehicle.step(rest | COMMANDS, rest, 10.0)
    assert titles == [f"{name} [{unit_of(unit).display or unit}]" for name, unit in SHOWN.items()]
    assert titles[0] == "u [knot]"
    assert last == pytest.approx([end[name] * unit_of(unit).factor for name, unit in SHOWN.items()], abs=1e-4)

    page.get_by_role("tab", name="Model Info").click()
    info = page.locator("#model-info-container")
    info.wait_for(state="visible")
    text = info.inner_text()
    assert vehicle.description in text
    assert "Model Exchange, Co-Simulation" in text
    for label, count in (("Continuous States", 7), ("Event Indicators", 0), ("Variables", len(declared))):
        assert f"{label}\n{count}\n" in text
    size = info.locator("img").evaluate("image => [image.naturalWidth, image.naturalHeight]")
    assert min(size) >= 100

    page.get_by_role("tab", name="Documentation").click()
    page.locator("#documentation-container").wait_for(state="visible")
    assert vehicle.name in page.frame_locator("#documentation-container iframe").locator("h1").inner_text()
    assert seen.problems() == []
    assert [url for url in seen.requests if not url.startswith((webapp, BOOTSTRAP))] == []
