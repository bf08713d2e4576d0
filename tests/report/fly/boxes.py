"""Measure on a page in a browser what overlaps and what is cut: its texts, its controls, and what its canvases draw."""

from typing import Any

WIDTHS = (400, 800, 1280)
"""The widths of a phone, a tablet and a laptop, px."""
SCREENS = ((400, "dark"), (800, "light"), (1280, "dark"))
"""Each width once, and both colour schemes: where a text stands does not depend on its colour."""

_RECORD = """() => {
  globalThis.drawnTexts = new Map();
  const { clear, text } = Board.prototype;
  Board.prototype.clear = function () { drawnTexts.set(this, []); clear.call(this); };
  Board.prototype.text = function (words, x, y, setting = {}) {
    text.call(this, words, x, y, setting);
    if (!words) return;
    const width = this.pen.measureText(words).width;
    const left = x - { left: 0, center: width / 2, right: width }[setting.align ?? "left"];
    const m = this.pen.getTransform();
    const scale = m.a / (this.canvas.width / this.width);
    const corner = new DOMPoint(left, y - 9).matrixTransform(m);
    const px = this.canvas.width / this.width;
    drawnTexts.get(this)?.push([words, corner.x / px, corner.y / px, width * scale, 10]);
  };
}"""
"""Makes a page that flies keep the texts that its canvases draw, with their boxes."""

_PROBLEMS = """within => {
  const root = document.querySelector(within);
  const problems = [];
  const near = 1.5;
  const cuts = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > near
    && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > near;
  // The part of a box that is not scrolled away inside an element that scrolls.
  const scrolls = (element) => element.closest(".wide, .equation, pre, .controls, .table-wrapper, nav");
  const texts = [];
  const walker = document.createTreeWalker(root, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const element = walker.currentNode.parentElement;
    const isText = walker.currentNode.textContent.trim() !== "";
    if (!isText || element.closest("svg, math, script, style, noscript, option, .over")) continue;
    if (!element.checkVisibility({ visibilityProperty: true })) continue; // what is folded
    const range = document.createRange();
    range.selectNodeContents(walker.currentNode);
    for (const box of range.getClientRects()) {
      if (box.width < 2 || box.height < 2) continue;
      texts.push({ box, element, words: walker.currentNode.textContent.trim().slice(0, 40) });
      const isCut = box.left < -1 || box.right > innerWidth + 1;
      if (isCut && !scrolls(element)) problems.push(`cut: ${texts.at(-1).words}`);
    }
  }
  texts.sort((one, other) => one.box.top - other.box.top);
  texts.forEach((one, n) => {
    for (let k = n + 1; k < texts.length && texts[k].box.top < one.box.bottom - near; k++) {
      const other = texts[k];
      const isSame = one.element.contains(other.element) || other.element.contains(one.element);
      const isScrolled = scrolls(one.element) !== scrolls(other.element);
      if (!isSame && !isScrolled && cuts(one.box, other.box)) problems.push(`overlap: ${one.words} | ${other.words}`);
    }
  });
  const controls = [...root.querySelectorAll("button, select, input, canvas, .stick, .grip span, summary")]
    .filter((element) => element.checkVisibility({ visibilityProperty: true }) && !element.closest(".controls"))
    .map((element) => ({ element, box: element.getBoundingClientRect() }));
  const moves = (element) => element.closest(".over");
  controls.forEach(({ element, box }, n) => {
    const words = `${element.tagName} ${element.id} ${element.textContent}`.slice(0, 40);
    if (box.left < -1 || box.right > innerWidth + 1) problems.push(`cut: ${words}`);
    const isShort = element.tagName === "BUTTON" && element.scrollWidth > element.clientWidth + 1;
    if (isShort) problems.push(`cut words: ${words}`);
    for (const other of controls.slice(n + 1)) {
      const isOverlay = !moves(element) !== !moves(other.element);
      if (!isOverlay && !element.contains(other.element) && cuts(box, other.box))
        problems.push(`overlap: ${words} | ${other.element.tagName} ${other.element.id}`);
    }
  });
  return problems;
}"""
"""Returns what is cut or overlaps among the texts and the controls within an element."""

_DRAWN = """() => {
  const problems = [];
  for (const [board, texts] of drawnTexts) {
    const name = board.canvas.id;
    if (!board.canvas.isConnected) continue;
    const above = name === "live-picture" ? [...live.picture.taken.slice(4)] : [];
    texts.forEach(([words, x, y, width, height], n) => {
      if (/^[0-9]+$/.test(words) && name === "live-picture") return; // the ladder of the horizon is clipped
      if (x < -1 || y < -2 || x + width > board.width + 1 || y + height > board.height + 3)
        problems.push(`${name}: cut: ${words} ${[x, y, width, board.width, board.height].map(Math.round)}`);
      for (const [other, u, v, w, h] of texts.slice(n + 1))
        if (Math.min(x + width, u + w) - Math.max(x, u) > 1 && Math.min(y + height, v + h) - Math.max(y, v) > 1)
          problems.push(`${name}: overlap: ${words} | ${other}`);
    });
  }
  return problems;
}"""
"""Returns what is cut or overlaps among the texts that the canvases draw."""


def record_drawn_texts(page: Any) -> None:
    """Keep the texts that the canvases of a page that flies draw from now on."""
    page.evaluate(_RECORD)


def problems(page: Any, within: str = "body") -> list[str]:
    """Return what is cut or overlaps among the texts and the controls of a page, or within an element of it."""
    found: list[str] = page.evaluate(_PROBLEMS, within)
    return found


def drawn_problems(page: Any) -> list[str]:
    """Return what is cut or overlaps among the texts that were drawn on canvases."""
    found: list[str] = page.evaluate(_DRAWN)
    return found
