// The views of a flight as SVG in the colours of the page: the track from above, depth, heading, and strip charts.

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

/** Returns the path of an arrow from a point, in the body frame seen from above: x up and y to the right.
 * @param {[number, number]} at @param {number} dx @param {number} dy */
function arrow([x, y], dx, dy) {
  const [u, v] = [x + dx, y + dy];
  const head = (/** @type {number} */ side) =>
    `${v - 0.28 * dy + side * 0.16 * dx} ${-(u - 0.28 * dx - side * 0.16 * dy)}`;
  return `M${y} ${-x}L${v} ${-u}M${head(1)}L${v} ${-u}L${head(-1)}`;
}

/** A vehicle from above. The body is as wide as the distance of the thrusters, and round at the bow. */
class Figure {
  /** @param {Element} parent @param {Vehicle} vehicle @param {string} kind */
  constructor(parent, vehicle, kind) {
    this.vehicle = vehicle;
    this.group = drawn(parent, "g", { class: kind });
    const { size, thrusters } = vehicle;
    const x = 1.2 * size;
    const y = Math.max(0.5 * size, ...thrusters.map(({ at }) => Math.abs(at[1])));
    const side = (/** @type {number} */ s) =>
      `L${s * 0.8 * y} ${x}Q${s * y} ${x} ${s * y} ${x - 0.2 * y}L${s * y} ${-0.4 * x}Q${s * y} ${-x} 0 ${-x}`;
    drawn(this.group, "path", { class: "body", d: `M0 ${x}${side(1)}M0 ${x}${side(-1)}` });
    this.forces = thrusters.map(({ at }) => {
      drawn(this.group, "circle", { class: "thruster", cx: at[1], cy: -at[0], r: 0.1 * size });
      return drawn(this.group, "path", { class: "force" });
    });
  }

  /** @param {Model} model @param {number} east The centre in px. @param {number} north @param {number} scale px per m */
  draw(model, east, north, scale) {
    const [forward, starboard] = fromAbove(model);
    const entries = [starboard[1], -starboard[0], -forward[1], forward[0]].map((x) => (x * scale).toFixed(3));
    place(this.group, { transform: `matrix(${entries.join(" ")} ${east.toFixed(1)} ${north.toFixed(1)})` });
    const { size, thrusters } = this.vehicle;
    thrusters.forEach(({ at, along, force, most }, n) => {
      const share = model.get(force) / most;
      this.forces[n].setAttribute("d", Math.abs(share) < 0.004 ? "" : forceOf(at, along, share, size));
    });
  }
}

/** Returns the directions forward and to starboard, north and east, as they are seen from above. @param {Model} model */
function fromAbove(model) {
  const [phi, theta, psi] = ["phi", "theta", "psi"].map((name) => model.get(name));
  const [s, c] = [Math.sin(psi), Math.cos(psi)];
  const [along, aside] = [Math.sin(phi) * Math.sin(theta), Math.cos(phi)];
  return [
    [c * Math.cos(theta), s * Math.cos(theta)],
    [along * c - aside * s, along * s + aside * c],
  ];
}

/** Returns the path for a thruster's force: an arrow, a cross for a force down, or a diamond for a force up.
 * @param {[number, number]} at @param {[number, number, number]} along @param {number} share @param {number} size */
function forceOf(at, along, share, size) {
  const flat = Math.hypot(along[0], along[1]);
  if (flat > 0.1) return arrow(at, along[0] * share * 1.5 * size, along[1] * share * 1.5 * size);
  const [x, y] = [at[1], -at[0]];
  const r = 0.32 * size * Math.sqrt(Math.abs(share));
  return along[2] * share > 0
    ? `M${x - r} ${y - r}L${x + r} ${y + r}M${x - r} ${y + r}L${x + r} ${y - r}`
    : `M${x} ${y - r}L${x + r} ${y}L${x} ${y + r}L${x - r} ${y}Z`;
}

const MARGIN = 0.3; // of the picture, which the vehicle does not enter without moving it

class TrackView {
  /** @param {Element} svg @param {Flight} flight */
  constructor(svg, flight) {
    this.svg = svg;
    this.width = 640;
    this.height = 400;
    this.grid = drawn(svg, "path", { class: "grid" });
    this.tracks = [drawn(svg, "path", { class: "line ghostly" }), drawn(svg, "path", { class: "line" })];
    this.ghost = new Figure(svg, flight.ghost.model.vehicle, "craft ghostly");
    this.pilot = new Figure(svg, flight.pilot.model.vehicle, "craft");
    this.bar = drawn(svg, "path", { class: "scale" });
    this.length = drawn(svg, "text", { x: 14 });
    drawn(svg, "text", { x: 14, y: 22 }).textContent = "↑ N";
    this.scale = 50 / (2.4 * flight.pilot.model.vehicle.size);
    this.centre = [0, 0];
  }

  /** @param {number} factor */
  zoom(factor) {
    this.scale = Math.max(0.05, Math.min(5000, this.scale * factor));
  }

  /** Takes over the size on the screen, so that text has the page's size. */
  fit() {
    this.width = this.svg.clientWidth || this.width;
    this.height = this.svg.clientHeight || this.height;
    place(this.svg, { viewBox: `0 0 ${this.width} ${this.height}` });
  }

  /** @param {Flight} flight */
  draw(flight) {
    const { pilot, ghost } = flight;
    const [x, y] = [pilot.model.get("x"), pilot.model.get("y")];
    const reach = [this.height, this.width].map((px) => ((0.5 - MARGIN) * px) / this.scale);
    this.centre = [x, y].map((at, i) => Math.max(at - reach[i], Math.min(at + reach[i], this.centre[i])));
    const px = (/** @type {number} */ east) => this.width / 2 + (east - this.centre[1]) * this.scale;
    const py = (/** @type {number} */ north) => this.height / 2 - (north - this.centre[0]) * this.scale;
    this.lay(px, py);
    const { playback } = flight;
    const ghostIsThere = flight.ghostShown && (playback?.hasTrack() ?? true);
    this.tracks[0].setAttribute("d", ghostIsThere ? pathOf(ghost, px, py) : "");
    this.tracks[1].setAttribute("d", pathOf(pilot, px, py));
    this.ghost.group.setAttribute("visibility", ghostIsThere ? "visible" : "hidden");
    if (ghostIsThere) this.ghost.draw(ghost.model, px(ghost.model.get("y")), py(ghost.model.get("x")), this.scale);
    this.pilot.draw(pilot.model, px(y), py(x), this.scale);
  }

  /** Draws the grid and its scale. @param {(east: number) => number} px @param {(north: number) => number} py */
  lay(px, py) {
    const step = roundUp(60 / this.scale);
    const [left, top] = [this.centre[1] - this.width / 2 / this.scale, this.centre[0] - this.height / 2 / this.scale];
    const lines = [];
    const [east, north] = [left, top].map((edge) => Math.ceil(edge / step) * step);
    // Counted: far enough out a step more is the same number.
    for (let i = 0; i < this.width / (step * this.scale); i++)
      lines.push(`M${px(east + i * step).toFixed(1)} 0V${this.height}`);
    for (let i = 0; i < this.height / (step * this.scale); i++)
      lines.push(`M0 ${py(north + i * step).toFixed(1)}H${this.width}`);
    this.grid.setAttribute("d", lines.join(""));
    this.bar.setAttribute("d", `M14 ${this.height - 14}h${step * this.scale}`);
    place(this.length, { y: this.height - 22 });
    this.length.textContent = step < 1 ? `${Math.round(step * 100)} cm` : `${step} m`;
  }
}

/** @param {Craft} craft @param {(east: number) => number} px @param {(north: number) => number} py */
function pathOf({ track, model }, px, py) {
  const stride = 2 * Math.max(1, Math.ceil(track.length / 3000));
  const places = [];
  for (let i = 0; i < track.length; i += stride)
    places.push(`${px(track[i + 1]).toFixed(1)} ${py(track[i]).toFixed(1)}`);
  places.push(`${px(model.get("y")).toFixed(1)} ${py(model.get("x")).toFixed(1)}`);
  return `M${places.join("L")}`;
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

const CHART = { left: 40, right: 296, top: 26, bottom: 132 };

/** A chart of an axis over time: the velocity with V_ss and Tau, or the measured position. */
class Chart {
  /** @param {Element} svg @param {Axis} axis @param {number} number */
  constructor(svg, axis, number) {
    this.axis = axis;
    this.number = number;
    this.title = drawn(svg, "text", { class: "title", x: 2, y: 14 });
    this.frame = drawn(svg, "path", { class: "grid" });
    this.ticks = [0, 1, 2, 3, 4, 5].map(() => drawn(svg, "text", { x: CHART.left - 5, class: "right" }));
    this.ends = [CHART.left, CHART.right].map((x, n) =>
      drawn(svg, "text", { x, y: CHART.bottom + 15, class: n ? "right" : "" }),
    );
    this.steady = drawn(svg, "path", { class: "steady" });
    this.lines = ["line ghostly", "line"].map((kind) => drawn(svg, "path", { class: kind }));
    this.measured = drawn(svg, "path", { class: "measured" });
    this.Tau = drawn(svg, "circle", { class: "tau", r: 4 });
    this.point = drawn(svg, "circle", { class: "point", r: 4.5 });
  }

  /** @param {Flight} flight @param {number} span The time span in s. @param {boolean} ghost */
  draw(flight, span, ghost) {
    const { number, axis } = this;
    const { times, time, pilot, playback, test } = flight;
    const signal = playback?.recording.signals.find((s) => s.axis === number) ?? null;
    const isPosition = signal?.isPosition ?? false;
    const tracesOf = (/** @type {Craft} */ craft) => (isPosition ? craft.positions : craft.velocities)[number];
    const start = Math.max(0, time - span);
    const [V, Tau] = pilot.model.marks.subarray(2 * number, 2 * number + 2);
    const mine = tracesOf(pilot);
    const other = ghost && (playback === null || signal) ? this.ghostTrace(flight, isPosition) : null;
    const published =
      test && test.axis === number && test.V !== null
        ? { V: test.command < 0 ? -test.V : test.V, Tau: test.Tau }
        : null;
    let first = times.findIndex((t) => t >= start);
    first = Math.max(0, first - 1);
    const sizes = isPosition ? [] : [0, V, published?.V ?? 0];
    let [low, high] = [Math.min(...sizes), Math.max(...sizes)];
    for (const trace of other ? [mine, other] : [mine]) {
      for (let i = first; i < trace.length; i++) {
        if (trace[i] < low) low = trace[i];
        if (trace[i] > high) high = trace[i];
      }
    }
    const step = roundUp(Math.max((high - low) / 3.5, 0.05));
    low = Math.floor(low / step + 1e-9) * step;
    high = Math.max(low + 2 * step, Math.ceil(high / step - 1e-9) * step);
    const px = (/** @type {number} */ t) => CHART.left + ((t - start) / span) * (CHART.right - CHART.left);
    const py = (/** @type {number} */ v) => CHART.bottom - ((v - low) / (high - low)) * (CHART.bottom - CHART.top);
    const rows = [0, 1, 2, 3, 4, 5].map((n) => low + n * step).filter((v) => v < high + step / 2);
    this.frame.setAttribute("d", rows.map((v) => `M${CHART.left} ${py(v).toFixed(1)}H${CHART.right}`).join(""));
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    this.ticks.forEach((text, n) => {
      text.textContent = n < rows.length ? shown(rows[n], digits) : "";
      if (n < rows.length) text.setAttribute("y", (py(rows[n]) + 4).toFixed(1));
    });
    this.ends[0].textContent = `${shown(start, 0)} s`;
    this.ends[1].textContent = `${shown(start + span, 0)} s`;
    this.lines[1].setAttribute("d", lineOf(times, mine, first, px, py));
    this.lines[0].classList.toggle("measured", playback !== null);
    this.lines[0].setAttribute("d", other ? lineOf(times, other, first, px, py) : "");
    const since = flight.since[number];
    const fromRest = V !== 0 && Math.abs(since.velocity) < 0.02 * Math.abs(V) && Number.isFinite(Tau);
    const hasSteady = !isPosition && V !== 0 && Number.isFinite(V);
    this.steady.setAttribute(
      "d",
      hasSteady ? `M${Math.max(CHART.left, px(since.time)).toFixed(1)} ${py(V).toFixed(1)}H${CHART.right}` : "",
    );
    const p = 1 - Math.exp(-1);
    mark(this.Tau, hasSteady && fromRest ? [px(since.time + Tau), py(p * V)] : null);
    this.measured.setAttribute("d", published ? `M${CHART.left} ${py(published.V).toFixed(1)}H${CHART.right}` : "");
    mark(this.point, published?.Tau ? [px(since.time + published.Tau), py(p * published.V)] : null);
    const value = mine[mine.length - 1];
    const what = isPosition
      ? `${axis.position ?? "distance"} ${shown(value, 2)} ${axis.positionUnit}`
      : `${axis.velocity} ${shown(value, 3)} ${axis.unit}`;
    const marks = hasSteady ? ` · V_ss ${shown(V, 3)}${fromRest ? ` · Tau ${shown(Tau, 2)} s` : ""}` : "";
    this.title.textContent = `${axis.name}: ${what}${marks}`;
  }

  /** Returns the ghost's trace of the same axis, which may have another number. @param {Flight} flight @param {boolean} isPosition */
  ghostTrace(flight, isPosition) {
    const number = flight.ghost.axis(this.axis.name);
    const traces = isPosition ? flight.ghost.positions : flight.ghost.velocities;
    return number < 0 ? null : traces[number];
  }
}

/** @param {SVGElement} dot @param {[number, number] | null} at */
function mark(dot, at) {
  const visible = at !== null && at[0] >= CHART.left && at[0] <= CHART.right;
  dot.setAttribute("visibility", visible ? "visible" : "hidden");
  if (visible) place(dot, { cx: at[0].toFixed(1), cy: at[1].toFixed(1) });
}

/** @param {number[]} times @param {number[]} trace @param {number} first @param {(t: number) => number} px @param {(v: number) => number} py */
function lineOf(times, trace, first, px, py) {
  const stride = Math.max(1, Math.floor((times.length - first) / 400));
  /** @type {string[]} */
  const places = [];
  const add = (/** @type {number} */ i) =>
    places.push(`${Math.max(CHART.left, px(times[i])).toFixed(1)} ${py(trace[i]).toFixed(1)}`);
  for (let i = first - (first % stride) + stride * (first % stride ? 1 : 0); i < times.length - 1; i += stride) add(i);
  add(times.length - 1);
  return `M${places.join("L")}`;
}
