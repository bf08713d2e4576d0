// Values under the pointer, and zoom, in the plots of a page. Without this script the plots are as they are drawn.
// Each panel says in JSON where it is and which coordinates it has (rov_fmu/report/plots/svg.py), and a line is a path
// in these coordinates, so no number stands in the page twice.

/** @typedef {{box: number[], x: number[], y: number[], title: string, along: string}} Panel */

/** @param {Element} parent @param {string} tag @param {Record<string, string | number>} attributes */
function draw(parent, tag, attributes) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
  parent.append(element);
  return element;
}

/** @param {number} value @param {number} range the range of the axis, which says how many digits matter */
function inDigits(value, range) {
  const digits = Math.min(6, Math.max(0, 2 - Math.floor(Math.log10(Math.abs(range) || 1))));
  const text = value.toFixed(digits);
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
}

/** Returns the height of a path at a place along it: where several parts cross, the highest. @param {number[][]} points @param {number} x */
function heightAt(points, x) {
  let best = Number.NaN;
  for (let n = 1; n < points.length; n++) {
    const [[a, b], [c, d]] = [points[n - 1], points[n]];
    if ((a - x) * (c - x) > 0) continue;
    const y = a === c ? Math.min(b, d) : b + ((d - b) * (x - a)) / (c - a);
    if (!(y >= best)) best = y;
  }
  return best;
}

/** Returns round numbers from low to high, at most nine, as numbers and as text. @param {number} low @param {number} high */
function roundNumbers(low, high) {
  const decade = 10 ** Math.floor(Math.log10((high - low) / 8));
  const step = decade * ([1, 2, 5].find((n) => n * decade * 8 >= high - low) ?? 10);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const first = Math.ceil(low / step);
  const values = Array.from({ length: Math.floor(high / step) - first + 1 }, (_, n) => (first + n) * step);
  return values.map((value) => ({ value, text: value.toFixed(digits).replace("-", "−") }));
}

/** One plot with its panels, which are zoomed together along their common axis. */
class Plot {
  /** @param {SVGSVGElement} svg */
  constructor(svg) {
    this.svg = svg;
    this.panels = [...svg.querySelectorAll('[data-plot*="box"]')].map((group) => {
      /** @type {Panel} */
      const panel = JSON.parse(/** @type {HTMLElement} */ (group).dataset.plot ?? "");
      return { ...panel, group, lines: this.lines(group), ticks: group.querySelector('[data-plot*="ticks"]') };
    });
    const [low, high] = this.panels[0].x;
    this.low = low;
    this.high = high;
    /** @type {number | null} */
    this.from = null;
    this.cursor = draw(svg, "path", { stroke: "var(--muted)", "stroke-width": 0.8, fill: "none" });
    this.selection = draw(svg, "path", { fill: "var(--blue)", opacity: 0.15 });
    this.values = document.createElement("div");
    this.values.className = "values";
    this.values.setAttribute("role", "status");
    svg.after(this.values);
    svg.setAttribute("tabindex", "0");
    svg.classList.add("live-plot");
    svg.addEventListener("pointermove", (event) => this.move(this.along(event)));
    svg.addEventListener("pointerleave", () => this.move(null));
    svg.addEventListener("pointerdown", (event) => {
      this.from = this.along(event);
    });
    svg.addEventListener("pointerup", (event) => this.release(this.along(event)));
    svg.addEventListener("dblclick", () => this.zoom(...this.whole));
    svg.addEventListener("keydown", (event) => this.key(event));
    svg.addEventListener("blur", () => this.move(null));
  }

  /** @param {Element} group */
  lines(group) {
    return [...group.querySelectorAll('[data-plot*="line"]')].map((line) => {
      const numbers = (line.querySelector("path")?.getAttribute("d") ?? "").match(/-?[\d.]+/g)?.map(Number) ?? [];
      const points = Array.from({ length: numbers.length >> 1 }, (_, n) => numbers.slice(2 * n, 2 * n + 2));
      return { label: JSON.parse(/** @type {HTMLElement} */ (line).dataset.plot ?? "").line, points };
    });
  }

  get whole() {
    return /** @type {[number, number]} */ (this.panels[0].x);
  }

  /** Returns the place of the pointer along the axis, or null outside of it. @param {PointerEvent} event */
  along(event) {
    const [left, , right] = this.panels[0].box;
    const frame = this.svg.getBoundingClientRect();
    const at = (((event.clientX - frame.left) / frame.width) * this.svg.viewBox.baseVal.width - left) / (right - left);
    return at < 0 || at > 1 ? null : this.low + at * (this.high - this.low);
  }

  /** Returns the place on the page of a value along the axis. @param {number} value */
  place(value) {
    const [left, , right] = this.panels[0].box;
    return left + ((value - this.low) / (this.high - this.low)) * (right - left);
  }

  /** Shows the values at a place, or nothing. @param {number | null} at */
  move(at) {
    const [first] = this.panels;
    const [top, bottom] = [first.box[1], this.panels[this.panels.length - 1].box[3]];
    this.at = at;
    this.cursor.setAttribute("d", at === null ? "" : `M${this.place(at)} ${top}V${bottom}`);
    const selects = at !== null && this.from !== null;
    const [a, b] = selects ? [this.place(/** @type {number} */ (this.from)), this.place(at)] : [0, 0];
    this.selection.setAttribute("d", selects ? `M${a} ${top}H${b}V${bottom}H${a}Z` : "");
    const lines =
      at === null
        ? []
        : [
            `${first.along}: ${inDigits(at, this.high - this.low)}`,
            ...this.panels.map((panel) => this.read(panel, at)).filter(Boolean),
          ];
    this.values.replaceChildren(
      ...lines.map((text) => Object.assign(document.createElement("span"), { textContent: text })),
    );
  }

  /** @param {Plot["panels"][number]} panel @param {number} at */
  read(panel, at) {
    const [left, top, right, bottom] = panel.box;
    const x = left + ((at - panel.x[0]) / (panel.x[1] - panel.x[0])) * (right - left);
    const range = panel.y[1] - panel.y[0];
    const values = panel.lines
      .map(({ label, points }) => ({ label, y: heightAt(points, x) }))
      .filter(({ y }) => !Number.isNaN(y))
      .map(({ label, y }) => `${label} ${inDigits(panel.y[0] + ((bottom - y) / (bottom - top)) * range, range)}`);
    return values.length ? `${panel.title}: ${values.join("; ")}` : "";
  }

  /** @param {number | null} at */
  release(at) {
    const from = this.from;
    this.from = null;
    if (from !== null && at !== null && Math.abs(this.place(at) - this.place(from)) > 5) {
      this.zoom(Math.min(from, at), Math.max(from, at));
    }
    this.move(at);
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    const width = this.high - this.low;
    const at = this.at ?? this.low + width / 2;
    const step = { ArrowLeft: -0.02, ArrowRight: 0.02 }[event.key];
    const factor = { "+": 0.5, "-": 2 }[event.key];
    if (step) this.move(Math.min(this.high, Math.max(this.low, at + step * width)));
    else if (factor) {
      const [least, most] = this.whole;
      const half = (factor * width) / 2;
      this.zoom(Math.max(least, at - half), Math.min(most, at + half));
      this.move(at);
    } else if (event.key === "Escape") this.zoom(...this.whole);
    else return;
    event.preventDefault();
  }

  /** Shows a part of the axis in all panels. @param {number} low @param {number} high */
  zoom(low, high) {
    [this.low, this.high] = [low, high];
    const [least, most] = this.whole;
    const isWhole = low === least && high === most;
    for (const panel of this.panels) {
      const [left, , right, bottom] = panel.box;
      const factor = (most - least) / (high - low);
      const shift = left - factor * this.placeIn(panel, low);
      for (const shape of this.shapes(panel.group)) {
        if (isWhole) shape.removeAttribute("transform");
        else shape.setAttribute("transform", `matrix(${factor} 0 0 1 ${shift} 0)`);
      }
      panel.group.querySelector(".zoomed")?.remove();
      const text = panel.ticks?.querySelector("text");
      panel.ticks?.setAttribute("visibility", isWhole ? "visible" : "hidden");
      if (isWhole || !panel.ticks) continue;
      const own = draw(panel.group, "g", { class: "zoomed" });
      for (const { value, text: words } of roundNumbers(low, high)) {
        const x = left + ((value - low) / (high - low)) * (right - left);
        draw(own, "path", { d: `M${x} ${panel.box[1]}V${bottom}`, stroke: "var(--rule)", "stroke-width": 0.6 });
        if (!text) continue;
        const label = draw(own, "text", {
          x,
          y: bottom + 13,
          "text-anchor": "middle",
          style: text.getAttribute("style") ?? "",
        });
        label.style.textAnchor = "middle";
        label.textContent = words;
      }
      panel.group.prepend(own);
    }
    this.move(null);
  }

  /** @param {Plot["panels"][number]} panel @param {number} value */
  placeIn(panel, value) {
    const [left, , right] = panel.box;
    return left + ((value - panel.x[0]) / (panel.x[1] - panel.x[0])) * (right - left);
  }

  /** Returns the shapes of a panel that move with its axis. Each is put into a group that has its clipping. @param {Element} group */
  shapes(group) {
    for (const shape of group.querySelectorAll("[clip-path]:not(g.clip)")) {
      if (shape.closest('[data-plot*="ticks"]')) continue;
      const clip = draw(group, "g", { class: "clip", "clip-path": shape.getAttribute("clip-path") ?? "" });
      shape.replaceWith(clip);
      shape.removeAttribute("clip-path");
      shape.setAttribute("vector-effect", "non-scaling-stroke");
      for (const part of shape.querySelectorAll("*")) part.setAttribute("vector-effect", "non-scaling-stroke");
      clip.append(shape);
    }
    return [...group.querySelectorAll("g.clip > *")];
  }
}

for (const svg of document.querySelectorAll("svg:has([data-plot*=box])")) new Plot(/** @type {SVGSVGElement} */ (svg));
