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

/** A chart of an axis over time: the velocity with V_ss and Tau, or the measured position. */
class Chart {
  /** @param {Element} svg @param {Axis} axis @param {number} number */
  constructor(svg, axis, number) {
    this.svg = svg;
    this.axis = axis;
    this.number = number;
    this.frame = drawn(svg, "path", { class: "grid" });
    this.title = drawn(svg, "text", { class: "title", x: 2, y: 12 });
    this.marks = drawn(svg, "text", { class: "marks right" });
    this.ticks = [0, 1, 2, 3, 4, 5].map(() => drawn(svg, "text", { class: "right" }));
    this.ends = ["", "right"].map((kind) => drawn(svg, "text", { class: kind }));
    this.steady = drawn(svg, "path", { class: "steady" });
    this.lines = ["line ghostly", "line"].map((kind) => drawn(svg, "path", { class: kind }));
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
    const { number, axis } = this;
    const { left, right, top, bottom } = this.plot;
    const { times, time, pilot, playback, test } = flight;
    const signal = playback?.recording.signals.find((s) => s.axis === number) ?? null;
    const isPosition = signal?.isPosition ?? false;
    const start = Math.max(0, time - span);
    const [V, Tau] = pilot.model.marks.subarray(2 * number, 2 * number + 2);
    const mine = (isPosition ? pilot.positions : pilot.velocities)[number];
    const other = ghost && (playback === null || signal) ? this.ghostTrace(flight, isPosition) : null;
    const published =
      test && test.axis === number && test.V !== null
        ? { V: test.command < 0 ? -test.V : test.V, Tau: test.Tau }
        : null;
    const first = Math.max(0, times.findIndex((t) => t >= start) - 1);
    const [low, high, step] = rangeOf(
      isPosition ? [] : [0, V, published?.V ?? 0],
      (other ? [mine, other] : [mine]).map((trace) => trace.slice(first)),
      bottom - top,
    );
    const px = (/** @type {number} */ t) => left + ((t - start) / span) * (right - left);
    const py = (/** @type {number} */ v) => bottom - ((v - low) / (high - low)) * (bottom - top);
    this.lay(low, high, step, py);
    this.ends[0].textContent = `${shown(start, 0)} s`;
    this.ends[1].textContent = `${shown(start + span, 0)} s`;
    const line = (/** @type {number[]} */ trace) => lineOf(times, trace, first, (t) => Math.max(left, px(t)), py);
    this.lines[1].setAttribute("d", line(mine));
    this.lines[0].classList.toggle("measured", playback !== null);
    this.lines[0].setAttribute("d", other ? line(other) : "");
    const since = flight.since[number];
    const fromRest = V !== 0 && Math.abs(since.velocity) < 0.02 * Math.abs(V) && Number.isFinite(Tau);
    const hasSteady = !isPosition && V !== 0 && Number.isFinite(V);
    const level = (/** @type {number} */ x, /** @type {number} */ v) => `M${x.toFixed(1)} ${py(v).toFixed(1)}H${right}`;
    this.steady.setAttribute("d", hasSteady ? level(Math.max(left, px(since.time)), V) : "");
    const p = 1 - Math.exp(-1);
    this.mark(this.Tau, hasSteady && fromRest ? [px(since.time + Tau), py(p * V)] : null);
    this.measured.setAttribute("d", published ? level(left, published.V) : "");
    this.mark(this.point, published?.Tau ? [px(since.time + published.Tau), py(p * published.V)] : null);
    const at = pointed === null ? -1 : times.findIndex((t) => t >= start + pointed * span);
    this.pointer.setAttribute("d", at < 0 ? "" : `M${px(times[at]).toFixed(1)} ${top}V${bottom}`);
    const [what, digits, unit] = isPosition
      ? [axis.position ?? "distance", 2, axis.positionUnit]
      : [axis.velocity, 3, axis.unit];
    const reading = (/** @type {number[]} */ trace) => shown(trace[at < 0 ? trace.length - 1 : at], digits);
    this.title.textContent = `${axis.name}: ${what} ${reading(mine)} ${unit}`;
    if (at >= 0) this.marks.textContent = `${other ? `ghost ${reading(other)} · ` : ""}at ${shown(times[at], 2)} s`;
    else this.marks.textContent = hasSteady ? `V_ss ${shown(V, 3)}${fromRest ? ` · Tau ${shown(Tau, 2)} s` : ""}` : "";
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

  /** Returns the ghost's trace of the same axis, which may have another number. @param {Flight} flight @param {boolean} isPosition */
  ghostTrace(flight, isPosition) {
    const number = flight.ghost.axis(this.axis.name);
    const traces = isPosition ? flight.ghost.positions : flight.ghost.velocities;
    return number < 0 ? null : traces[number];
  }
}

/** Returns the ends of a chart's range, and the distance of its lines, for levels and traces and a height in px.
 * @param {number[]} levels @param {number[][]} traces @param {number} height */
function rangeOf(levels, traces, height) {
  let [low, high] = [Math.min(...levels), Math.max(...levels)];
  for (const trace of traces) {
    for (const value of trace) {
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  const step = roundUp(Math.max((high - low) / Math.max(1, Math.min(3.5, height / 24 - 1)), 0.05));
  low = Math.floor(low / step + 1e-9) * step;
  return [low, Math.max(low + 2 * step, Math.ceil(high / step - 1e-9) * step), step];
}

/** @param {number[]} times @param {number[]} trace @param {number} first @param {(t: number) => number} px @param {(v: number) => number} py */
function lineOf(times, trace, first, px, py) {
  const stride = Math.max(1, Math.floor((times.length - first) / 400));
  /** @type {string[]} */
  const places = [];
  const add = (/** @type {number} */ i) => places.push(`${px(times[i]).toFixed(1)} ${py(trace[i]).toFixed(1)}`);
  for (let i = first - (first % stride) + stride * (first % stride ? 1 : 0); i < times.length - 1; i += stride) add(i);
  add(times.length - 1);
  return `M${places.join("L")}`;
}
