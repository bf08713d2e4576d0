"""Checks that every page must pass, and readers of its text and tables."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from lxml import html

from tests.report.conftest import Visit
from tests.report.fly.boxes import problems

_LONG_WORDS = """() => {
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  const own = ".number, thead, .values b, .values span, .live";
  let changed = 0;
  while (texts.nextNode()) {
    const text = texts.currentNode;
    if (!text.textContent.trim() || text.parentElement.closest(`svg, math, script, style, ${own}`)) continue;
    text.textContent = "https://example.org/" + "a".repeat(200);
    changed += 1;
  }
  return changed;
}"""
"""Replaces all text of a page by a long word, except the texts that are our own."""
_SMALL = """() => {
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  const small = [];
  while (texts.nextNode()) {
    const { parentElement: own, textContent: words } = texts.currentNode;
    if (!words.trim() || !own.checkVisibility() || own.closest("script, style, noscript, tspan")) continue;
    const svg = own.closest("svg");
    const scale = svg ? svg.getBoundingClientRect().width / svg.viewBox.baseVal.width : 1;
    if (scale * parseFloat(getComputedStyle(own).fontSize) < 10) small.push(words.trim());
  }
  return small;
}"""
"""Returns the texts of less than 10 px, except for subscripts in plots."""
UNFOLD = "document.querySelectorAll('details').forEach((fold) => { fold.open = true; })"
"""The script that opens everything that is folded on a page."""


def check_breaks_long_words(page: str, path: Path, visit: Callable[..., Visit]) -> None:
    """Check in a browser that a page is not wider than a phone or a screen, whatever words others have put into it."""
    path.write_text(page, encoding="utf-8")
    for width in (390, 1280):
        seen = visit(width=width).page
        seen.goto(path.as_uri())
        assert seen.evaluate(_LONG_WORDS) > 2
        assert seen.evaluate("document.documentElement.scrollWidth") == width


def check_fits_and_is_accessible(seen: Visit, path: Path, wait_for: str = "body") -> None:
    """Check a page folded and unfolded: nothing overlaps, is cut or too small to read, axe finds nothing in it, and it
    asks for nothing.

    It has the colours of the visit's scheme, and nothing moves by itself for people who do not want that.
    """
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    seen.page.emulate_media(reduced_motion="reduce")
    seen.page.goto(path.as_uri())
    seen.page.wait_for_selector(wait_for)
    for action in ("", UNFOLD):
        seen.page.evaluate(action)
        assert seen.page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        assert problems(seen.page) == [], "nothing overlaps or is cut"
        assert seen.page.evaluate(_SMALL) == []
    assert axe.run(seen.page).response["violations"] == []
    assert seen.page.evaluate("document.getAnimations().length") == 0
    lightness = seen.page.evaluate("getComputedStyle(document.body).backgroundColor").removeprefix("rgb(").split(",")[0]
    assert (int(lightness) > 128) == (seen.scheme == "light")
    assert (seen.messages, seen.requests) == ([], [path.as_uri()])


def text_of(page: str) -> str:
    """Return the text of a page, in which every space is one blank."""
    return " ".join(html.fromstring(page).text_content().split())


_BLOCKS = "h1 h2 h3 h4 p li tr dt dd div pre figure figcaption details summary section header footer"
"""The elements of our pages that begin a line."""


def lines_of(page: str) -> list[str]:
    """Return the text of a page as it is read: a line for each block and for each row, and the labels of plots.

    A heading begins with # and its level, and with + where what follows is folded; ! marks a cell that stands out.
    """
    root = html.fromstring(page)
    for element in root.xpath("//script | //style | //head | //svg/*"):
        element.drop_tree()
    for element in root.iter("svg"):
        element.text = f"\n[{element.get('aria-label', '')}]\n"
    for element in root.xpath("//td | //th"):
        element.tail = "|"
    for element in root.xpath("//td//span | //td[contains(@class, 'off')]"):
        element.text = f"{'! ' if element.tag == 'td' else ' '}{element.text or ''}"
    for element in root.iter(*_BLOCKS.split()):
        mark = f"{'#' * int(element.tag[1])} " if element.tag[1:].isdigit() else ""
        mark += "+ " * (element.getparent().tag == "summary" or (element.tag == "summary" and not len(element)))
        element.text, element.tail = f"\n{mark}{(element.text or '').lstrip()}", f"\n{element.tail or ''}"
    rows = (" ".join(line.replace("|", " | ").split()) for line in root.text_content().split("\n"))
    return [line for line in rows if line]


def unfolded(page: str) -> str:
    """The text of a page that is not folded, without plots."""
    root = html.fromstring(page)
    for element in root.xpath("//details/*[not(self::summary)] | //svg | //script | //style | //head"):
        element.drop_tree()
    return " ".join(root.text_content().split())


def rows(page: str) -> list[list[str]]:
    """Return the text of the cells of all rows of all tables."""
    return [[cell.text_content().strip() for cell in row.iter("th", "td")] for row in html.fromstring(page).iter("tr")]


def check_is_whole(page: str) -> None:
    """Check that every element is closed, and that every reference within the page leads to one element."""
    assert page.startswith("<!DOCTYPE html>")
    root = html.document_fromstring(page, ensure_head_body=True)
    assert root.get("lang") == "en"
    ids = [element.get("id") for element in root.iter() if isinstance(element.tag, str) and element.get("id")]
    assert len(ids) == len(set(ids))
    assert {a[1:] for a in root.xpath("//a/@href") if a.startswith("#")} <= set(ids)
    assert set(re.findall(r"url\(#(\w+)\)", page)) | set(re.findall(r'<use [^>]*href="#(\w+)"', page)) <= set(ids)
    for tag in re.findall(r"\w+", "table tbody tr td th div p ul li figure math mrow msub msubsup mfrac svg text"):
        assert len(re.findall(rf"<{tag}[\s>]", page)) == page.count(f"</{tag}>"), tag


def check_refers_to_itself_alone(page: str) -> None:
    """Check that no element loads anything, that links stay in the page, and that images are embedded."""
    root = html.fromstring(page)
    assert not list(root.iter("link", "iframe", "object", "embed", "base"))
    for element in root.iter():
        for name, value in element.items():
            assert name != "src" or (element.tag == "img" and value.startswith("data:image/svg+xml;base64,"))
            assert not name.startswith("on")
            assert name not in {"href", "xlink:href"} or value.startswith("#")
    namespace = 'createElementNS("http://www.w3.org/2000/svg"'  # the page's script names it, and nothing loads it
    assert not re.search(r"https?://|@import", page.replace(namespace, ""))
    assert set(re.findall(r"url\((.)", page)) <= {"#"}
