"""What the page that flies shows: surface and seabed, one screen, legible instruments, and the keys at first."""

from collections import Counter
from collections.abc import Callable
from typing import Any

import pytest

from tests.report.conftest import get
from tests.report.pages import UNFOLD
from tests.report.test_live import BOX

pytestmark = pytest.mark.interop


def test_a_vehicle_neither_flies_through_air_nor_enters_the_seabed(page: Any) -> None:
    page.evaluate("""() => {
        live.pause(true);
        live.flight.set({ u_t: -0.8 });
        live.flight.advance(5);
        live.draw();
    }""")
    assert get(page, "z") == [0.0]
    assert "depth 0.00 m (at the surface)" in page.inner_text("#live-readings")
    page.locator("input[name=bed]").fill("2")
    page.evaluate("() => { live.flight.set({ u_t: 0.8 }); live.flight.advance(60); live.draw(); }")
    assert get(page, "z") == pytest.approx([2.0 - 0.55 * page.evaluate("live.vehicle.size")])
    assert "(on the seabed)" in page.inner_text("#live-readings")
    assert "bedded" in page.get_attribute("#live-picture", "class")


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize(("width", "height"), [(1366, 650), (390, 844)])
@pytest.mark.parametrize("kind", ["videoray", "heavy", "bluerov2_heavy"])
def test_picture_instruments_column_and_an_even_grid_of_charts_are_on_one_screen(
    kind: str, fly: Callable[..., Any], width: int, height: int, scheme: str
) -> None:
    """Nothing moves when a message of one line comes or goes, and axe finds nothing, folded or not."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    page = fly(kind, width=width, height=height, scheme=scheme)
    assert page.locator("#live-picture").evaluate(BOX)["height"] > 0.25 * height
    for element in page.locator("#live-picture, #live-charts svg, #live-column svg, .instruments > svg").all():
        if element.is_visible():
            box = element.evaluate(BOX)
            assert box["x"] >= 0
            assert box["x"] + box["width"] <= width
            assert box["y"] + box["height"] <= height
    charts = [chart.evaluate(BOX) for chart in page.locator(".charts svg").all()]
    assert len(charts) == page.evaluate("live.vehicle.axes.length")
    assert len({(round(box["width"]), round(box["height"])) for box in charts}) == 1
    assert len({*Counter(round(box["y"]) for box in charts).values()}) == 1, "each row has as many charts"
    texts = page.evaluate(
        "[...document.querySelectorAll('.instruments > svg')].filter((svg) => svg.clientWidth).map((svg) =>"
        " parseFloat(getComputedStyle(svg.querySelector('text')).fontSize) * svg.getScreenCTM().a)"
    )
    assert min(texts) >= 10.0
    places = []
    for words in ("", "short"):
        page.evaluate("words => live.say(words)", words)
        places.append([page.locator(f"#live-{part}").evaluate(BOX) for part in ("stage", "charts", "controls")])
    assert places[0] == places[1]
    assert axe.run(page).response["violations"] == []
    page.evaluate(UNFOLD)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert axe.run(page).response["violations"] == []
