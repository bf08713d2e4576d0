"""Fixtures that open pages in headless browsers."""

import shutil
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import pytest

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
    for one in visits:
        one.page.close()
