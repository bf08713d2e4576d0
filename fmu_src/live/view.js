// The instruments of a flight as SVG in the colours of the page: heading, attitude, depth, and charts over time.

/** @param {Element} parent @param {string} tag @param {Record<string, string | number>} [attributes] @returns {SVGElement} */
function drawn(parent, tag, attributes = {}) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  place(element, attributes);
  parent.append(element);
  return element;
}

/** @param {Element} element @param {Record<string, string | number>} attributes */
function place(element, attributes) {
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
}

/** Returns the smallest of 1, 2, 5 times a power of ten that is not below x. @param {number} x */
function roundUp(x) {
  const decade = 10 ** Math.floor(Math.log10(x));
  return decade * ([1, 2, 5].find((n) => n * decade >= x * (1 - 1e-9)) ?? 10);
}

/** @param {number} x @param {number} digits */
function shown(x, digits) {
  const text = Math.abs(x) < 1e7 ? x.toFixed(digits) : x.toExponential(2).replace("e+", "e");
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
}

/** A compass rose with a needle for the heading. */
class Compass {
  /** @param {Element} svg */
  constructor(svg) {
    drawn(svg, "circle", { class: "thruster", cx: 60, cy: 60, r: 44 });
    for (let angle = 0; angle < 360; angle += 30) {
      drawn(svg, "path", {
        class: "scale thin",
        d: `M60 ${angle % 90 ? 20 : 16}V24`,
        transform: `rotate(${angle} 60 60)`,
      });
    }
    for (const [letter, x, y] of /** @type {[string, number, number][]} */ ([
      ["N", 60, 12],
      ["E", 112, 64],
      ["S", 60, 117],
      ["W", 8, 64],
    ])) {
      drawn(svg, "text", { x, y, class: "centred" }).textContent = letter;
    }
    this.needles = ["ghostly", ""].map((kind) =>
      drawn(svg, "path", { class: `needle ${kind}`, d: "M60 26L68 84L60 76L52 84Z" }),
    );
  }

  /** @param {Flight} flight @param {boolean} ghost */
  draw(flight, ghost) {
    [flight.ghost, flight.pilot].forEach(({ model }, n) => {
      const turned = ((model.get("psi") * 180) / Math.PI).toFixed(1);
      place(this.needles[n], { transform: `rotate(${turned} 60 60)`, visibility: n || ghost ? "visible" : "hidden" });
    });
  }
}

/** An artificial horizon: it sinks when the bow rises, and leans to port when the starboard side goes down. */
class Horizon {
  /** @param {Element} svg */
  constructor(svg) {
    const window = drawn(svg, "svg", { x: 10, y: 2, width: 100, height: 100, viewBox: "-50 -50 100 100" });
    drawn(window, "rect", { class: "above", x: -50, y: -50, width: 100, height: 100 });
    this.world = drawn(window, "g");
    drawn(this.world, "rect", { class: "below", x: -200, y: 0, width: 400, height: 400 });
    drawn(this.world, "path", { class: "scale", d: "M-200 0H200" });
    for (const angle of [-60, -30, 30, 60]) {
      drawn(this.world, "path", { class: "scale thin", d: `M-12 ${angle * HORIZON_SCALE}H12` });
      drawn(this.world, "text", { x: 15, y: angle * HORIZON_SCALE + 4 }).textContent = `${Math.abs(angle)}`;
    }
    this.ghost = drawn(window, "path", { class: "line ghostly", d: "M-200 0H200" });
    drawn(window, "path", { class: "force", d: "M-34 0H-14L-8 6M34 0H14L8 6M0 0h.1" });
    drawn(svg, "rect", { class: "frame", x: 10, y: 2, width: 100, height: 100 });
    this.angles = [
      drawn(svg, "text", { x: 10, y: 116 }),
      drawn(svg, "text", { class: "right", x: 110, y: 116 }),
      drawn(svg, "text", { class: "centred", x: 60, y: 130 }),
    ];
  }

  /** @param {Flight} flight @param {boolean} ghost */
  draw(flight, ghost) {
    const [other, own] = [flight.ghost, flight.pilot].map(({ model }) => attitudeOf(model));
    const transform = (/** @type {number[]} */ [phi, theta]) =>
      `rotate(${(-phi).toFixed(1)}) translate(0 ${(theta * HORIZON_SCALE).toFixed(1)})`;
    place(this.world, { transform: transform(own) });
    place(this.ghost, { transform: transform(other), visibility: ghost ? "visible" : "hidden" });
    own.forEach((angle, n) => {
      this.angles[n].textContent = `${"φθψ"[n]} ${shown(angle, 0)}°`;
    });
  }
}

const HORIZON_SCALE = 0.8; // of the picture, per degree

/** Returns the roll angle, the pitch angle and the heading (from 0 to 359) in degrees. @param {Model} model */
function attitudeOf(model) {
  const [phi, theta, psi] = ["phi", "theta", "psi"].map((name) => (model.get(name) * 180) / Math.PI);
  return [phi, theta, ((Math.round(psi) % 360) + 360) % 360];
}

/** A tape of depths that runs past a mark. */
class DepthTape {
  /** @param {Element} svg */
  constructor(svg) {
    this.ticks = drawn(svg, "path", { class: "scale thin" });
    this.labels = [0, 1, 2, 3, 4, 5].map(() => drawn(svg, "text", { x: 34 }));
    this.marks = ["ghostly", ""].map((kind) => drawn(svg, "path", { class: `needle ${kind}`, d: "M14 0L2 -7V7Z" }));
  }

  /** @param {Flight} flight @param {boolean} ghost */
  draw(flight, ghost) {
    const [other, z] = [flight.ghost, flight.pilot].map(({ model }) => model.get("z"));
    const py = (/** @type {number} */ depth) => 60 + (depth - z) * 24;
    const first = Math.ceil(z - 2.2);
    const halves = [-0.5, 0, 0.5, 1, 1.5, 2, 2.5, 3, 3.5, 4, 4.5].filter((n) => Math.abs(first + n - z) <= 2.2);
    this.ticks.setAttribute("d", halves.map((n) => `M18 ${py(first + n).toFixed(1)}h${n % 1 ? 6 : 12}`).join(""));
    this.labels.forEach((label, n) => {
      place(label, { y: (py(first + n) + 4).toFixed(1), visibility: halves.includes(n) ? "visible" : "hidden" });
      label.textContent = shown(first + n, 0);
    });
    place(this.marks[1], { transform: "translate(0 60)" });
    place(this.marks[0], {
      transform: `translate(0 ${Math.max(0, Math.min(120, py(other))).toFixed(1)})`,
      visibility: ghost ? "visible" : "hidden",
    });
  }
}

/** A line of a chart: its class, its times, its value at the n-th of them, and half of its band, if it has one.
 * @typedef {{kind: string, times: number[], value: (n: number) => number, band?: (n: number) => number}} Trace */
/** What a chart shows: its place in the page, its title, the unit and the digits of its readings, its lines, the axis whose V_ss and Tau
 * it marks, and the number of the recording's signal that the second line is, if any.
 * @typedef {{id: string, title: string, unit: string, digits: number, traces: Trace[], axis?: number, signal?: number}} Graph */

/** The choices of charts, which are empty without what they show, by the words of the list. @type {Record<string, (flight: Flight) => Graph[]>} */
const PANELS = {
  velocities: (flight) => axisPanels(flight, () => false),
  positions: (flight) => axisPanels(flight, () => true),
  thrust: ({ pilot, times }) =>
    pilot.model.vehicle.thrusters.map(({ force, label }) => ({
      id: force,
      title: `${label}: ${force}`,
      unit: "N",
      digits: 2,
      traces: [{ kind: "line", times, value: (n) => pilot.at(n, force) }],
    })),
  measured: (flight) => {
    const { signals } = flight.replay?.recording ?? { signals: [] };
    return signals.length ? axisPanels(flight, (a) => signals.find(({ axis }) => axis === a)?.isPosition ?? false) : [];
  },
  error: ({ replay, pilot }) =>
    (replay?.recording.signals ?? []).map(({ axis, isPosition, times, band }, s) => {
      const own = pilot.model.vehicle.axes[axis];
      return banded(own.name, "error", unitOf(own, isPosition), 3, { times, values: replay?.errors[s] ?? [], band });
    }),
  force: ({ replay, pilot }) =>
    (replay?.recording.forces ?? []).map((force) => {
      const { name, unit } = pilot.model.vehicle.axes[force.axis];
      return banded(name, "unknown", unit.startsWith("rad") ? "N m" : "N", 2, force);
    }),
};

/** Returns a chart of one line of a recording, and of its band, if there is one. @param {string} id The name of the axis.
 * @param {string} what @param {string} unit @param {number} digits @param {Band & {band?: Band}} line @returns {Graph} */
function banded(id, what, unit, digits, { times, values, band }) {
  /** @type {Trace} */
  const trace = { kind: "line", times, value: (n) => values[n] ?? 0 };
  if (band) trace.band = (n) => between(band.times, (k) => band.values[k], times[n]);
  return { id, title: `${id}: ${what}`, unit, digits, traces: [trace] };
}

/** Returns a chart for each axis: of its position or of its velocity. In a recording, the second line is what was measured.
 * @param {Flight} flight @param {(a: number) => boolean} ofPosition @returns {Graph[]} */
function axisPanels({ pilot, ghost, times, replay }, ofPosition) {
  return pilot.model.vehicle.axes.map((axis, a) => {
    const [id, isPosition] = [axis.name, ofPosition(a)];
    /** @type {Trace[]} */
    const traces = [{ kind: "line", times, value: (n) => pilot.along(a, isPosition, n) }];
    const other = ghost.axis(id);
    const signal = replay?.recording.signals.findIndex((one) => one.axis === a) ?? -1;
    const measured = replay?.recording.signals[signal];
    const isMeasured = measured?.isPosition === isPosition;
    if (isMeasured) traces.push({ kind: "line measured", times: measured.times, value: (n) => measured.values[n] });
    else if (other >= 0 && (!replay || measured))
      traces.push({ kind: "line ghostly", times, value: (n) => ghost.along(other, isPosition, n) });
    const title = `${id}: ${variableOf(axis, isPosition) ?? "distance"}`;
    const graph = { id, title, unit: unitOf(axis, isPosition), digits: isPosition ? 2 : 3, traces };
    return { ...graph, ...(isPosition ? {} : { axis: a }), ...(isMeasured ? { signal } : {}) };
  });
}

/** The tracks from above, north up, in a scale that shows all of both. */
class Track {
  /** @param {Element} svg */
  constructor(svg) {
    this.svg = svg;
    this.bar = drawn(svg, "path", { class: "scale thin" });
    this.words = drawn(svg, "text", { x: 6, y: 14 });
    this.lines = ["line ghostly", "line"].map((kind) => drawn(svg, "path", { class: kind }));
    this.here = drawn(svg, "path", { class: "needle", d: "M0 -8L5 6L0 3L-5 6Z" });
    [this.width, this.height] = [160, 160];
    this.fit();
  }

  /** Takes over the size on the screen. */
  fit() {
    this.width = this.svg.clientWidth || this.width;
    this.height = this.svg.clientHeight || this.height;
    place(this.svg, { viewBox: `0 0 ${this.width} ${this.height}` });
  }

  /** @param {Flight} flight @param {boolean} ghost */
  draw({ pilot, ghost: other, times, time }, ghost) {
    const { width, height } = this;
    const last = placeOf(times, time);
    const tracks = [other, pilot].map((craft) => trackOf(craft, last, 500));
    const shownTracks = ghost ? tracks : tracks.slice(1);
    const [north, east] = [0, 1].map((i) => shownTracks.flatMap((points) => points.map((p) => p[i])));
    const [middle, aside] = [north, east].map((list) => (Math.min(...list) + Math.max(...list)) / 2);
    const reach = [north, east].map((list) => Math.max(2, 1.15 * (Math.max(...list) - Math.min(...list))));
    const scale = Math.min((height - 20) / reach[0], width / reach[1]);
    const see = (/** @type {number[]} */ [x, y]) => [
      width / 2 + (y - aside) * scale,
      height / 2 + 8 - (x - middle) * scale,
    ];
    this.lines.forEach((line, n) => {
      line.setAttribute("d", n || ghost ? path(tracks[n].map(see)) : "");
    });
    const [x, y] = see(positionOf(pilot.model));
    const turned = (pilot.model.get("psi") * 180) / Math.PI;
    place(this.here, { transform: `translate(${x.toFixed(1)} ${y.toFixed(1)}) rotate(${turned.toFixed(1)})` });
    const step = roundUp(30 / scale);
    this.bar.setAttribute("d", `M6 20h${(step * scale).toFixed(1)}`);
    this.words.textContent = `Track from above: ${step < 1 ? `${Math.round(step * 100)} cm` : `${step} m`}`;
  }
}

/** A chart over time. */
class Chart {
  /** @param {Element} parent @param {Graph} panel */
  constructor(parent, panel) {
    const svg = drawn(parent, "svg", {
      id: `live-chart-${panel.id}`,
      role: "img",
      "aria-label": `${panel.title} over time`,
    });
    this.svg = svg;
    this.panel = panel;
    /** True for a chart whose numbers grow downward. */
    this.isDepth = panel.id === "dive";
    this.frame = drawn(svg, "path", { class: "grid" });
    this.title = drawn(svg, "text", { class: "title", x: 2, y: 12 });
    this.marks = drawn(svg, "text", { class: "marks right" });
    this.ticks = [0, 1, 2, 3, 4, 5].map(() => drawn(svg, "text", { class: "right" }));
    this.ends = ["", "right"].map((kind) => drawn(svg, "text", { class: kind }));
    this.band = drawn(svg, "path", { class: "band" });
    this.steady = drawn(svg, "path", { class: "steady" });
    /** Those of the traces, the last of which is drawn first. */
    this.lines = [...panel.traces].reverse().map(({ kind }) => drawn(svg, "path", { class: kind }));
    this.measured = drawn(svg, "path", { class: "measured" });
    this.Tau = drawn(svg, "circle", { class: "tau", r: 4 });
    this.point = drawn(svg, "circle", { class: "point", r: 4.5 });
    this.pointer = drawn(svg, "path", { class: "scale thin" });
    /** The edges of the plot in px. */
    this.plot = { left: 0, right: 0, top: 0, bottom: 0 };
    this.fit();
  }

  /** Takes over the size on the screen. */
  fit() {
    const [width, height] = [this.svg.clientWidth || 300, this.svg.clientHeight || 150];
    const isNarrow = width < 300;
    this.plot = { left: 38, right: width - 4, top: isNarrow ? 34 : 22, bottom: height - 17 };
    place(this.svg, { viewBox: `0 0 ${width} ${height}` });
    place(this.marks, { x: this.plot.right, y: isNarrow ? 25 : 12 });
    for (const tick of this.ticks) place(tick, { x: this.plot.left - 5 });
    this.ends.forEach((text, n) => {
      place(text, { x: n ? this.plot.right : this.plot.left, y: height - 4 });
    });
  }

  /** @param {Flight} flight @param {number} span The time span in s. @param {boolean} ghost
   * @param {number | null} pointed The place of the pointer, from 0 to 1 of the span. */
  draw(flight, span, ghost, pointed) {
    const { axis, unit, digits, signal } = this.panel;
    const traces = this.panel.traces.filter(({ kind }) => ghost || kind !== "line ghostly");
    const { left, right, top, bottom } = this.plot;
    const { time, replay, test } = flight;
    const start = Math.max(0, time - span);
    const marked = axis !== undefined && !flight.steering();
    const [V, Tau] = marked ? flight.pilot.model.marks.subarray(2 * axis, 2 * axis + 2) : [0, 0];
    const published =
      marked && test?.axis === axis && test.V !== null
        ? { V: test.command < 0 ? -test.V : test.V, Tau: test.Tau }
        : null;
    const windows = traces.map(({ times }) => [placeOf(times, start), placeOf(times, time)]);
    const levels = axis === undefined ? [] : [0, V, published?.V ?? 0];
    const [low, high, step] = rangeOf(levels, traces, windows, bottom - top);
    const px = (/** @type {number} */ t) => Math.max(left, left + ((t - start) / span) * (right - left));
    const share = (/** @type {number} */ v) => (v - low) / (high - low);
    const py = (/** @type {number} */ v) => bottom - (this.isDepth ? 1 - share(v) : share(v)) * (bottom - top);
    this.lay(low, high, step, py);
    this.ends[0].textContent = `${shown(start, 0)} s`;
    this.ends[1].textContent = `${shown(start + span, 0)} s`;
    this.lines.forEach((line, n) => {
      const trace = traces[this.lines.length - 1 - n];
      line.setAttribute("d", trace ? lineOf(trace, windows[this.lines.length - 1 - n], px, py) : "");
    });
    const [mine, other] = traces;
    const { band } = mine;
    if (band) {
      const upper = lineOf({ ...mine, value: band }, windows[0], px, py);
      const lower = lineOf({ ...mine, value: (n) => -band(n) }, windows[0], px, py);
      this.band.setAttribute("d", `${upper}L${lower.slice(1).split("L").reverse().join("L")}Z`);
    }
    const since = flight.since[axis ?? 0];
    const fromRest = marked && V !== 0 && Math.abs(since.velocity) < 0.02 * Math.abs(V) && Number.isFinite(Tau);
    const hasSteady = marked && V !== 0 && Number.isFinite(V);
    const level = (/** @type {number} */ x, /** @type {number} */ v) => `M${x.toFixed(1)} ${py(v).toFixed(1)}H${right}`;
    this.steady.setAttribute("d", hasSteady ? level(px(since.time), V) : "");
    const p = 1 - Math.exp(-1);
    this.mark(this.Tau, hasSteady && fromRest ? [px(since.time + Tau), py(p * V)] : null);
    this.measured.setAttribute("d", published ? level(left, published.V) : "");
    this.mark(this.point, published?.Tau ? [px(published.Tau), py(p * published.V)] : null);
    const at = pointed === null ? time : start + pointed * span;
    const isPointed = pointed !== null && at <= time;
    const reading = (/** @type {Trace} */ { times, value }) => between(times, value, Math.min(at, time));
    this.pointer.setAttribute("d", isPointed ? `M${px(at).toFixed(1)} ${top}V${bottom}` : "");
    this.title.textContent = `${this.panel.title} ${shown(reading(mine), digits)} ${unit}`;
    const words = [];
    if (signal !== undefined && replay && other) {
      const n = placeOf(other.times, Math.min(at, time));
      const half = replay.recording.signals[signal].band;
      const error = shown(replay.errors[signal][n] ?? 0, digits);
      words.push(
        `error ${error}${
          half
            ? ` ± ${shown(
                between(half.times, (k) => half.values[k], at),
                digits,
              )}`
            : ""
        }`,
      );
    } else if (isPointed && other) words.push(`ghost ${shown(reading(other), digits)}`);
    else if (isPointed && band) words.push(`± ${shown(band(placeOf(mine.times, at)), digits)}`);
    else if (hasSteady && !isPointed)
      words.push(`V_ss ${shown(V, 3)}`, ...(fromRest ? [`Tau ${shown(Tau, 2)} s`] : []));
    if (isPointed) words.push(`at ${shown(at, 2)} s`);
    this.marks.textContent = words.join(" · ");
  }

  /** Draws the horizontal lines and their numbers. @param {number} low @param {number} high @param {number} step
   * @param {(v: number) => number} py */
  lay(low, high, step, py) {
    const { left, right } = this.plot;
    const rows = this.ticks.map((_, n) => low + n * step).filter((v) => v < high + step / 2);
    this.frame.setAttribute("d", rows.map((v) => `M${left} ${py(v).toFixed(1)}H${right}`).join(""));
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    this.ticks.forEach((text, n) => {
      text.textContent = n < rows.length ? shown(rows[n], digits) : "";
      if (n < rows.length) place(text, { y: (py(rows[n]) + 4).toFixed(1) });
    });
  }

  /** @param {SVGElement} circle @param {[number, number] | null} at */
  mark(circle, at) {
    const visible = at !== null && at[0] >= this.plot.left && at[0] <= this.plot.right;
    place(circle, { visibility: visible ? "visible" : "hidden" });
    if (visible) place(circle, { cx: at[0].toFixed(1), cy: at[1].toFixed(1) });
  }
}

/** Returns the ends of a chart's range, and the distance of its lines, for levels, windows of traces and a height in px.
 * @param {number[]} levels @param {Trace[]} traces @param {number[][]} windows @param {number} height */
function rangeOf(levels, traces, windows, height) {
  let [low, high] = [Math.min(...levels), Math.max(...levels)];
  traces.forEach(({ value, band }, t) => {
    for (let n = windows[t][0]; n <= windows[t][1]; n++) {
      const [one, half] = [value(n), band?.(n) ?? 0];
      low = Math.min(low, one, half ? -half : one);
      high = Math.max(high, one, half || one);
    }
  });
  const step = roundUp(Math.max((high - low) / Math.max(1, Math.min(3.5, height / 24 - 1)), 0.05));
  low = Math.floor(low / step + 1e-9) * step;
  return [low, Math.max(low + 2 * step, Math.ceil(high / step - 1e-9) * step), step];
}

/** @param {Trace} trace @param {number[]} window @param {(t: number) => number} px @param {(v: number) => number} py */
function lineOf({ times, value }, [first, last], px, py) {
  const stride = Math.max(1, Math.floor((last - first) / 250));
  const places = [];
  for (let n = Math.ceil(first / stride) * stride; n < last; n += stride) places.push([px(times[n]), py(value(n))]);
  return path([...places, [px(times[last]), py(value(last))]]);
}
