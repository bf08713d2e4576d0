"""What the page that flies shows: surface and seabed, one screen, legible instruments, and the keys at first."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rov_fmu.fmu.archive import web_module
from rov_fmu.report.page.live import Flown, fly_page
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import load_vehicle
from tests.report.conftest import Visit
from tests.report.test_live import BOX, flying, until

pytestmark = pytest.mark.interop


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], str]:
    """A function that returns the address of the page of a vehicle."""
    folder = tmp_path_factory.mktemp("screen")

    def page(name: str) -> str:
        path, vehicle = folder / f"{name}.html", load_vehicle(SHIPPED[name])
        if not path.exists():
            path.write_text(fly_page([Flown(vehicle, web_module(vehicle.layout))]), encoding="utf-8")
        return path.as_uri()

    return page


@pytest.fixture
def page(address: Callable[[str], str], visit: Callable[..., Visit]) -> Any:
    return flying(visit, address("videoray")).page


def test_a_vehicle_neither_flies_through_air_nor_enters_the_seabed(page: Any) -> None:
    page.evaluate("""() => {
        live.pause(true);
        live.flight.set({ u_t: -0.8 });
        live.flight.advance(5);
        live.draw();
    }""")
    assert page.evaluate("['z', 'w'].map((name) => live.flight.pilot.model.get(name))")[0] == 0.0
    assert "depth 0.00 m (at the surface)" in page.inner_text("#live-readings")
    page.locator("input[name=bed]").fill("2")
    page.evaluate("() => { live.flight.set({ u_t: 0.8 }); live.flight.advance(60); live.draw(); }")
    z, size = page.evaluate("[live.flight.pilot.model.get('z'), live.vehicle.size]")
    assert z == pytest.approx(2.0 - 0.55 * size)
    assert "(on the seabed)" in page.inner_text("#live-readings")
    assert "bedded" in page.get_attribute("#live-picture", "class")


def test_the_keys_stand_on_the_picture_until_the_first_input(page: Any) -> None:
    hint = page.locator("#live-hint")
    assert hint.is_visible()
    assert "W S surge" in " ".join(hint.inner_text().split())
    page.keyboard.down("KeyW")
    until(page, "live.flight.begun && !live.changed || live.flight.time > 0.1")
    assert not hint.is_visible()


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize(("width", "height"), [(1366, 650), (390, 844)])
@pytest.mark.parametrize("name", ["videoray", "bluerov2_heavy"])
def test_picture_instruments_column_and_charts_are_on_one_screen(
    name: str,
    address: Callable[[str], str],
    visit: Callable[..., Visit],
    tmp_path: Path,
    width: int,
    height: int,
    scheme: str,
) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright")
    page = flying(visit, address(name), width=width, height=height, scheme=scheme).page
    page.screenshot(path=tmp_path / f"{name}-{width}-{scheme}.png")
    for element in page.locator("#live-picture, #live-charts svg, #live-column svg, .instruments > svg").all():
        if element.is_visible():
            box = element.evaluate(BOX)
            assert box["x"] >= 0
            assert box["x"] + box["width"] <= width
            assert box["y"] + box["height"] <= height
    texts = page.evaluate(
        "[...document.querySelectorAll('.instruments > svg')].filter((svg) => svg.clientWidth).map((svg) =>"
        " parseFloat(getComputedStyle(svg.querySelector('text')).fontSize) * svg.getScreenCTM().a)"
    )
    assert min(texts) >= 10.0
    assert axe.Axe().run(page).response["violations"] == []


@pytest.mark.parametrize("choice", ["velocities", "positions", "thrust"])
def test_the_charts_can_be_chosen(choice: str, page: Any) -> None:
    page.select_option("#live-view", choice)
    value, words = {
        "velocities": ("live.flight.pilot.model.get('u').toFixed(3)", "surge: u"),
        "positions": ("live.flight.pilot.distances[0].toFixed(2)", "surge: distance"),
        "thrust": ("live.flight.pilot.model.get('F_l').toFixed(2)", "left rear: F_l"),
    }[choice]
    title, expected = page.evaluate(f"""() => {{
        live.pause(true);
        live.flight.set({{ u_l: 0.5 }});
        live.flight.advance(3);
        live.draw();
        return [document.querySelector("#live-charts svg .title").textContent, {value}];
    }}""")
    assert title.startswith(f"{words} {expected} "), title
    hidden = page.evaluate(
        "[...document.querySelectorAll('#live-view option')].filter((o) => o.hidden).map((o) => o.value)"
    )
    assert hidden == ["measured", "error", "force"]
