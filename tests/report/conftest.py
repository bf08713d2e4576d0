"""Fixtures that open pages in headless browsers, and the pages on which vehicles fly."""

import shutil
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from rov_fmu.fmu.content import web_module
from rov_fmu.report.page.live import FlyingVehicle, fly_page
from rov_fmu.vehicle.shipped import SHIPPED
from rov_fmu.vehicle.vehicle import Vehicle, load_vehicle
from tests.commands import BARE, ROOT
from tests.vehicles import EVERYTHING, HEAVY, SIX, THRUST_EFFECTS, a_vehicle, with_rotors

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page, Playwright

_FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
_LONG = 120_000.0
"""The milliseconds that a browser on a busy machine may take for any action."""


@pytest.fixture(scope="module")
def engine() -> "Iterator[Playwright]":
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as engine:
        yield engine


@pytest.fixture(scope="module")
def browser(engine: "Playwright") -> "Iterator[Browser]":
    chromium = shutil.which("chromium") or pytest.skip("there is no chromium")
    browser = engine.chromium.launch(executable_path=chromium, headless=True, args=_FLAGS, timeout=_LONG)
    yield browser
    browser.close()


@pytest.fixture(scope="module")
def firefox(engine: "Playwright") -> "Iterator[Browser]":
    firefox = shutil.which("firefox") or shutil.which("firefox-esr") or pytest.skip("there is no firefox")
    # With this channel Playwright uses WebDriver BiDi, which also drives a Firefox that is not Playwright's build.
    browser = engine.firefox.launch(channel="moz-firefox", executable_path=firefox, headless=True, timeout=_LONG)
    yield browser
    browser.close()


class Visit:
    """A page in a browser, with its console messages and the addresses that it requested."""

    def __init__(self, browser: "Browser", *, width: int = 1280, height: int = 900, scheme: Any = "light") -> None:
        self.scheme = scheme
        self.page: Page = browser.new_page(viewport={"width": width, "height": height}, color_scheme=scheme)
        self.page.set_default_timeout(_LONG)
        self.messages: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", lambda message: self.messages.append(f"{message.type}: {message.text}"))
        self.page.on("pageerror", lambda error: self.messages.append(f"exception: {error}"))
        self.page.on("request", lambda request: self.requests.append(request.url))

    def problems(self) -> list[str]:
        return [text for text in self.messages if text.startswith(("error", "warning", "exception", "assert"))]


@pytest.fixture
def visit(browser: "Browser") -> Iterator[Callable[..., Visit]]:
    visits: list[Visit] = []

    def new(**options: Any) -> Visit:
        visits.append(Visit(browser, **options))
        return visits[-1]

    yield new
    for visit in visits:
        visit.page.close()


# ---- Pages on which vehicles fly -------------------------------------------------------------------------------------

_FILES = {
    **SHIPPED,
    "everything": EVERYTHING,
    "bare": BARE,
    "thrust effects": THRUST_EFFECTS,
    "remus100": ROOT / "examples" / "remus100" / "remus100.toml",
}


@cache
def flown_vehicle(kind: str) -> Vehicle:
    """Return a vehicle by the name of its page. The `heavy` is HEAVY, of whose FMU `heavy_dir` is the folder."""
    if kind in ("six", "rotors"):
        return a_vehicle(SIX if kind == "six" else with_rotors(SIX))
    return HEAVY if kind == "heavy" else load_vehicle(_FILES[kind])


def write_page(path: Path, *vehicles: Vehicle, compact: bool = False) -> str:
    """Write the page on which a vehicle flies, perhaps beside another one, and return its address."""
    flown = [FlyingVehicle(vehicle, web_module(vehicle.layout)) for vehicle in vehicles]
    path.write_text(fly_page(flown, compact=compact), encoding="utf-8")
    return path.as_uri()


@pytest.fixture(scope="session")
def address(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], str]:
    """A function that returns the address of the page of a kind of vehicle, which is written once."""
    folder = tmp_path_factory.mktemp("pages")
    return cache(lambda kind: write_page(folder / f"{kind}.html", flown_vehicle(kind)))


@pytest.fixture
def fly(visit: Callable[..., Visit], address: Callable[[str], str]) -> Iterator[Callable[..., "Page"]]:
    """A function that opens the page of a kind of vehicle, or of an address, and waits until the vehicle flies.

    At the end, no page may have printed anything to the console or requested anything but itself.
    """
    opened: list[Visit] = []

    def page(kind: str, **options: Any) -> "Page":
        opened.append(visit(**options))
        opened[-1].page.goto(kind if "://" in kind else address(kind))
        opened[-1].page.wait_for_selector("#live-section:not([hidden])")
        return opened[-1].page

    yield page
    for one in opened:
        assert one.messages == []
        assert len(one.requests) == 1


@pytest.fixture
def page(fly: Callable[..., "Page"]) -> "Page":
    """The page of the VideoRay, in which its model flies."""
    return fly("videoray")


def until(page: Any, condition: str) -> None:
    """Wait for a condition. Playwright's own waiting evaluates strings in the page, which the page forbids."""
    for _ in range(2400):
        if page.evaluate(condition):
            return
        page.wait_for_timeout(50)
    pytest.fail(f"never: {condition}")


def chart(page: Any, name: str) -> dict[str, Any]:
    """Return what a chart shows: its title with the value, its words, the places of Tau and of the measured point."""
    found: dict[str, Any] = page.evaluate(
        """name => {
            const { title, words, Tau, point } = live.charts.find(({ panel }) => panel.id === name);
            return { title, words, Tau, point };
        }""",
        name,
    )
    return found


def get(page: Any, *names: str) -> list[float]:
    """Return values of the model that flies."""
    found: list[float] = page.evaluate("names => names.map((name) => live.flight.pilot.model.get(name))", names)
    return found
