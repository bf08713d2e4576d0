// The charts of a flight over time, and its tracks from above.

/** A line of a chart: whose it is, its times, and its value at the n-th of them.
 * @typedef {{kind: "own" | "ghost" | "measured", times: number[], value: (n: number) => number}} Trace */
/** What a chart shows: its place in the page, its title, the unit and the digits of its readings, its lines, the axis whose V_ss and Tau
 * it marks, the number of the recording's signal that the second line is, and the commands that act on it, if any.
 * `more` follows where it fits; `factor` is how many of the unit one SI unit is.
 * @typedef {{id: string, title: string, unit: string, digits: number, traces: Trace[], axis?: number, signal?: number, commands?: string[],
 *   more?: string, factor?: number}} Graph */

/** The choices of charts, which are empty without what they show, by the words of the list. @type {Record<string, (flight: Flight) => Graph[]>} */
const PANELS = {
  velocities: (flight) => axisPanels(flight, () => false),
  positions: (flight) => axisPanels(flight, () => true),
  thrust: ({ pilot, times }) =>
    pilot.model.vehicle.thrusters.map(({ force, commands, label }) => ({
      id: force,
      title: `${label}: ${force}`,
      unit: "N",
      digits: 2,
      traces: [{ kind: "own", times, value: (n) => pilot.at(n, force) }],
      commands,
    })),
  measured: (flight) => {
    const { signals } = flight.replay?.recording ?? { signals: [] };
    return signals.length ? axisPanels(flight, (a) => signals.find(({ axis }) => axis === a)?.isPosition ?? false) : [];
  },
  error: ({ replay, pilot }) =>
    (replay?.recording.signals ?? []).map(({ axis, isPosition, times }, s) => {
      const own = pilot.model.vehicle.axes[axis];
      const [factor, values] = [factorOf(own), replay?.errors[s] ?? []];
      const value = (/** @type {number} */ n) => factor * (values[n] ?? 0);
      const unit = unitOf(own, isPosition);
      return { id: own.name, title: `${own.name}: error`, unit, digits: 3, traces: [{ kind: "own", times, value }] };
    }),
};

/** Returns a chart for each axis: of its position or of its velocity. In a recording, the second line is what was measured.
 * @param {Flight} flight @param {(a: number) => boolean} ofPosition @returns {Graph[]} */
function axisPanels({ pilot, ghost, times, replay }, ofPosition) {
  return pilot.model.vehicle.axes.map((axis, a) => {
    const [id, isPosition] = [axis.name, ofPosition(a)];
    const factor = factorOf(axis);
    /** @type {Trace[]} */
    const traces = [{ kind: "own", times, value: (n) => factor * pilot.along(a, isPosition, n) }];
    const other = ghost.axis(id);
    const signal = replay?.recording.signals.findIndex((one) => one.axis === a) ?? -1;
    const measured = replay?.recording.signals[signal];
    const isMeasured = measured?.isPosition === isPosition;
    if (isMeasured) traces.push({ kind: "measured", times: measured.times, value: (n) => factor * measured.values[n] });
    else if (other >= 0 && (!replay || measured))
      traces.push({ kind: "ghost", times, value: (n) => factor * ghost.along(other, isPosition, n) });
    const title = `${id}: ${variableOf(axis, isPosition) ?? "distance"}`;
    const graph = {
      id,
      title,
      unit: unitOf(axis, isPosition),
      factor,
      digits: factor > 1 ? 1 : isPosition ? 2 : 3,
      traces,
      commands: Object.keys(axis.signs),
    };
    const more = !isPosition && axis.unit === "m/s" ? { more: "through the water" } : {};
    return { ...graph, ...more, ...(isPosition ? {} : { axis: a }), ...(isMeasured ? { signal } : {}) };
  });
}

/** The tracks from above, turned like the picture, in a scale that shows all of both. */
class Track {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.board = new Board(canvas);
  }

  /** Takes over the size on the screen. */
  fit() {
    this.board.fit();
  }

  /** @param {Flight} flight @param {boolean} ghost @param {number} azimuth Of the picture's camera, rad. */
  draw({ pilot, ghost: other, times, time }, ghost, azimuth) {
    const { board } = this;
    const { width, height } = board;
    const { grey, blue, muted, ink } = board.colours;
    const last = placeOf(times, time);
    const [s, c] = [Math.sin(azimuth), Math.cos(azimuth)];
    const turned = (/** @type {number[]} */ [x, y]) => [y * c - x * s, -x * c - y * s];
    const tracks = (ghost ? [other, pilot] : [pilot]).map((craft) => trackOf(craft, last, 400).map(turned));
    const ends = [0, 1].map((i) => {
      const all = tracks.flatMap((points) => points.map((p) => p[i]));
      return all.reduce(([low, high], x) => [Math.min(low, x), Math.max(high, x)], [Infinity, -Infinity]);
    });
    const middle = ends.map(([low, high]) => (low + high) / 2);
    const reach = ends.map(([low, high]) => Math.max(2, 1.15 * (high - low)));
    const scale = Math.min(width / reach[0], (height - 30) / reach[1]);
    const see = (/** @type {number[]} */ [x, y]) => [
      width / 2 + (x - middle[0]) * scale,
      height / 2 + 13 + (y - middle[1]) * scale,
    ];
    board.clear();
    tracks.forEach((points, n) => {
      board.line(points.map(see), n === tracks.length - 1 ? blue : grey, 1.8);
    });
    const [x, y] = see(turned(positionOf(pilot.model)));
    const angle = pilot.model.get("psi") - azimuth;
    const at = (/** @type {number} */ turn, /** @type {number} */ far) => [
      x + far * Math.sin(angle + turn),
      y - far * Math.cos(angle + turn),
    ];
    board.area([[at(0, 9), at(2.5, 8), at(0, -3), at(-2.5, 8)]], blue);
    const step = roundUp(30 / scale);
    board.text("track from above", 6, 13, { colour: ink, isBold: true });
    board.line(
      [
        [6, 21],
        [6 + step * scale, 21],
      ],
      muted,
      2,
    );
    board.text(lengthInWords(step), 12 + step * scale, 25);
  }
}

/** A chart over time. */
class Chart {
  /** @param {Element} parent @param {Graph} panel */
  constructor(parent, panel) {
    const canvas = document.createElement("canvas");
    place(canvas, { id: `live-chart-${panel.id}`, role: "img" });
    parent.append(canvas);
    this.panel = panel;
    /** True for a chart whose numbers grow downward. */
    this.isDepth = panel.id === "dive";
    this.board = new Board(canvas);
    /** The edges of the plot in px. */
    this.plot = { left: 0, right: 0, top: 0, bottom: 0 };
    /** What it says: its title with the present value, and words beside it. */
    this.title = "";
    this.words = "";
    /** Where it marks Tau, in px. @type {number[] | null} */
    this.Tau = null;
    this.fit();
  }

  /** Takes over the size on the screen. */
  fit() {
    this.board.fit();
    const { width, height } = this.board;
    this.plot = { left: 40, right: width - 4, top: 22, bottom: height - 17 };
  }

  /** @param {Flight} flight @param {number} span The time span in s. @param {boolean} ghost
   * @param {number | null} pointed The place of the pointer, from 0 to 1 of the span. */
  draw(flight, span, ghost, pointed) {
    const { board } = this;
    const { ink, blue, page, muted } = board.colours;
    const { axis } = this.panel;
    const traces = this.panel.traces.filter(({ kind }) => ghost || kind !== "ghost");
    const { time } = flight;
    const start = Math.max(0, time - span);
    const marked = axis !== undefined && !flight.steering();
    const isSecondLine = board.width < 300 && (marked || flight.replay !== null || pointed !== null);
    this.plot.top = isSecondLine ? 34 : 22;
    const { left, right, top, bottom } = this.plot;
    const { factor = 1 } = this.panel;
    const [steady, Tau] = marked ? flight.pilot.model.marks.subarray(2 * axis, 2 * axis + 2) : [0, 0];
    const V = marked && flight.floats(axis, steady) ? 0 : factor * steady;
    const windows = traces.map(({ times }) => [placeOf(times, start), placeOf(times, time)]);
    const levels = axis === undefined ? [] : [0, V];
    const [low, high, step] = rangeOf(levels, traces, windows, bottom - top);
    const px = (/** @type {number} */ t) => Math.max(left, left + ((t - start) / span) * (right - left));
    const share = (/** @type {number} */ v) => (v - low) / (high - low);
    const py = (/** @type {number} */ v) => bottom - (this.isDepth ? 1 - share(v) : share(v)) * (bottom - top);
    board.clear();
    this.lay(low, high, step, py);
    board.text(`${shown(start, 0)} s`, left, bottom + 13);
    board.text(`${shown(start + span, 0)} s`, right, bottom + 13, { align: "right" });
    if (this.panel.commands) this.untested(flight, this.panel.commands, start, px);
    for (let n = traces.length - 1; n >= 0; n--) this.trace(traces[n], windows[n], px, py);
    const since = flight.since[axis ?? 0];
    const fromRest = marked && V !== 0 && Math.abs(since.velocity) < 0.02 * Math.abs(steady) && Number.isFinite(Tau);
    const hasSteady = marked && V !== 0 && Number.isFinite(V);
    const level = (/** @type {number} */ x, /** @type {number} */ v) => [
      [x, py(v)],
      [right, py(v)],
    ];
    if (hasSteady) board.line(level(px(since.time), V), ink, 1, [9, 4, 2, 4]);
    const p = 1 - Math.exp(-1);
    const inside = (/** @type {number} */ t, /** @type {number} */ v) =>
      px(t) <= right && t >= start ? [px(t), py(v)] : null;
    this.Tau = hasSteady && fromRest ? inside(since.time + Tau, p * V) : null;
    if (this.Tau) board.circle(this.Tau[0], this.Tau[1], 4, page, blue);
    const at = pointed === null ? time : start + pointed * span;
    const isPointed = pointed !== null && at <= time;
    if (isPointed)
      board.line(
        [
          [px(at), top],
          [px(at), bottom],
        ],
        muted,
        1,
      );
    this.words = this.marks(flight, traces[1], at, isPointed, hasSteady ? V : null, fromRest ? Tau : null).join(" · ");
    this.title = `${this.panel.title} ${this.reading(traces[0], at, time)} ${this.panel.unit}`;
    const all = [this.title, this.panel.more].filter(Boolean).join(" ");
    const fits = board.measure(all, true) + (isSecondLine ? 0 : board.measure(this.words, false)) + 12 < right;
    board.text(fits ? all : this.title, 2, 12, { colour: ink, isBold: true });
    board.text(this.words, right, board.width < 300 ? 26 : 12, { align: "right" });
  }

  /** Tells what it says to who cannot see it. */
  tell() {
    place(this.board.canvas, {
      "aria-label": [`Over time: ${this.title}`, this.panel.more, this.words].filter(Boolean).join(", "),
    });
  }

  /** Returns what a line shows at a time, as text. @param {Trace} trace @param {number} at @param {number} time */
  reading({ times, value }, at, time) {
    return shown(between(times, value, Math.min(at, time)), this.panel.digits);
  }

  /** Returns the words beside the title. @param {Flight} flight @param {Trace | undefined} other @param {number} at The time.
   * @param {boolean} isPointed
   * @param {number | null} V @param {number | null} Tau */
  marks({ time, replay }, other, at, isPointed, V, Tau) {
    const { signal, digits, factor = 1 } = this.panel;
    const words = [];
    if (signal !== undefined && replay && other) {
      const error = replay.errors[signal][placeOf(other.times, Math.min(at, time))] ?? 0;
      words.push(`error ${shown(factor * error, digits)}`);
    } else if (isPointed && other) words.push(`ghost ${this.reading(other, at, time)}`);
    else if (V !== null && !isPointed)
      words.push(`V_ss ${shown(V, digits)}`, ...(Tau !== null ? [`Tau ${shown(Tau, 2)} s`] : []));
    if (isPointed) words.push(`at ${shown(at, 2)} s`);
    return words;
  }

  /** Draws a line. @param {Trace} trace @param {number[]} window @param {(t: number) => number} px @param {(v: number) => number} py */
  trace(trace, window, px, py) {
    const { blue, grey, orange } = this.board.colours;
    const [colour, dash] = { own: [blue, []], ghost: [grey, []], measured: [orange, [2, 3]] }[trace.kind];
    this.board.line(lineOf(trace, window, px, py), /** @type {string} */ (colour), 1.8, /** @type {number[]} */ (dash));
  }

  /** Draws a strip at the foot of the chart while a command is beyond the tested range. @param {Flight} flight @param {string[]} commands
   * @param {number} start @param {(t: number) => number} px */
  untested({ times, commands: given, time, pilot }, commands, start, px) {
    const { vehicle } = pilot.model;
    const places = commands.map((name) => vehicle.commands.indexOf(name));
    const { bottom } = this.plot;
    const last = placeOf(times, time);
    for (let n = placeOf(times, start); n <= last; n++) {
      if (!places.some((place) => isBeyond(vehicle, given[n][place]))) continue;
      const [from, to] = [times[n], n < last ? times[n + 1] : time].map(px);
      this.board.area([rectangle(from, to + 0.5, bottom - 4, bottom)], this.board.colours.orange);
    }
  }

  /** Draws the horizontal lines and their numbers. @param {number} low @param {number} high @param {number} step
   * @param {(v: number) => number} py */
  lay(low, high, step, py) {
    const { board } = this;
    const { left, right } = this.plot;
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    const rows = [0, 1, 2, 3, 4, 5].map((n) => low + n * step).filter((v) => v < high + step / 2);
    board.pen.beginPath();
    for (const v of rows)
      board.run([
        [left, py(v)],
        [right, py(v)],
      ]);
    board.stroke(board.colours.rule, 1);
    const every = Math.ceil(LINE / Math.abs(py(low) - py(low + step))); // in a low chart, the numbers of all lines overlap
    rows.forEach((v, n) => {
      if (n % every === 0) board.text(shown(v, digits), left - 5, py(v) + 4, { align: "right" });
    });
  }
}

/** Returns the ends of a chart's range, and the distance of its lines, for levels, windows of traces and a height in px.
 * @param {number[]} levels @param {Trace[]} traces @param {number[][]} windows @param {number} height */
function rangeOf(levels, traces, windows, height) {
  let [low, high] = [Math.min(...levels), Math.max(...levels)];
  traces.forEach(({ value }, t) => {
    for (let n = windows[t][0]; n <= windows[t][1]; n++) {
      low = Math.min(low, value(n));
      high = Math.max(high, value(n));
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
  return [...places, [px(times[last]), py(value(last))]];
}
