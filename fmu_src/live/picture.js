// The picture of a flight: the vehicle as a solid with its thrusters and jets, its tracks, and a horizontal grid.

/** North, east, down; in the body frame forward, starboard, down; for the camera right, down and toward the viewer.
 * @typedef {[number, number, number]} Vector */
/** A part of the vehicle that can be drawn: its class, its path, and how near it is to the viewer.
 * @typedef {{kind: string, path: string, near: number}} Drawn */

/** The width of a letter of a label and the height of its line, in pixels. */
const [LETTER, LINE] = [6.6, 13];
/** The directions in which a label may lie beside its thruster. */
const SIDES = [0, 1, 2, 3, 4, 5, 6, 7].map((n) => [Math.cos((n * Math.PI) / 4), Math.sin((n * Math.PI) / 4)]);
/** The area in square pixels that a label may cover before it lies beside its thruster instead of away from the vehicle. */
const TURN_COST = 60;

/** @param {Vector} a @param {Vector} b */
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/** Returns the sum of a vector and some others, each with its factor. @param {Vector} start @param {[number, Vector][]} others */
function plus(start, ...others) {
  const sum = /** @type {Vector} */ ([...start]);
  for (const [factor, v] of others) for (let i = 0; i < 3; i++) sum[i] += factor * v[i];
  return sum;
}

/** Returns the points of a circle around a direction. @param {Vector} at @param {Vector} along @param {number} r */
function ring(at, along, r) {
  /** @type {Vector} */
  const other = Math.abs(along[2]) > 0.9 ? [1, 0, 0] : [0, 0, 1];
  const a = cross(along, other);
  const b = cross(along, a);
  const [p, q] = [r / Math.hypot(...a), r / Math.hypot(...b)];
  return Array.from({ length: 16 }, (_, n) =>
    plus(at, [p * Math.cos((n * Math.PI) / 8), a], [q * Math.sin((n * Math.PI) / 8), b]),
  );
}

/** @param {Vector} a @param {Vector} b @returns {Vector} */
function cross([a, b, c], [x, y, z]) {
  return [b * z - c * y, c * x - a * z, a * y - b * x];
}

/** Returns the area that two rectangles share. @param {DOMRect} one @param {DOMRect} other */
function shared(one, other) {
  const wide = Math.min(one.right, other.right) - Math.max(one.left, other.left);
  return Math.max(0, wide) * Math.max(0, Math.min(one.bottom, other.bottom) - Math.max(one.top, other.top));
}

/** Returns the path through points. @param {number[][]} points */
function path(points) {
  return `M${points.map(([x, y]) => `${x.toFixed(1)} ${y.toFixed(1)}`).join("L")}`;
}

/** Returns the closed path around points. @param {number[][]} points */
function outline(points) {
  return `${path(points)}Z`;
}

/** Returns the corners of the convex hull of points. @param {number[][]} points */
function hull(points) {
  const sorted = [...points].sort((p, q) => p[0] - q[0] || p[1] - q[1]);
  const half = (/** @type {number[][]} */ list) => {
    /** @type {number[][]} */
    const found = [];
    for (const p of list) {
      while (found.length > 1 && area([found[found.length - 2], found[found.length - 1], p]) <= 0) found.pop();
      found.push(p);
    }
    return found.slice(0, -1);
  };
  return [...half(sorted), ...half(sorted.reverse())];
}

/** Returns twice the area of a polygon, positive when it runs clockwise on the screen. @param {number[][]} points */
function area(points) {
  return points.reduce((sum, [x, y], n) => {
    const [u, v] = points[(n + 1) % points.length];
    return sum + x * v - u * y;
  }, 0);
}

/**
 * The shape of a vehicle, which follows from the places of its thrusters: a float over two skids; with fins, a slender hull.
 * Each block is a prism: its outline seen from above, its upper and its lower end.
 */
class Shape {
  /** @param {Vehicle} vehicle */
  constructor({ size, thrusters, fins }) {
    const farthest = (/** @type {number} */ i) => Math.max(...thrusters.map(({ at }) => Math.abs(at[i])));
    const depths = thrusters.map(({ at }) => at[2]);
    const l = fins.length ? 1.1 * size : Math.max(0.9 * size, 1.15 * farthest(0));
    const w = fins.length ? 0.13 * size : Math.max(0.4 * size, 0.72 * farthest(1));
    const top = fins.length ? -w : Math.min(-0.35 * size, ...depths);
    const low = fins.length ? w : Math.max(0.45 * size, ...depths);
    this.radius = fins.length ? 0.8 * w : 0.2 * size;
    /** @type {[number, number][]} */
    const plan = [0.45, 1, 1, 0.8].map((y, n) => [[1, 0.75, -0.92, -1][n] * l, y * w]);
    this.plan = [...plan, ...plan.map(([x, y]) => /** @type {[number, number]} */ ([x, -y])).reverse()];
    this.blocks = [{ kind: "float", plan: this.plan, top, low: fins.length ? low : top + 0.4 * size }];
    for (const side of fins.length ? [] : [-1, 1]) {
      const [y, t] = [side * 0.8 * w, 0.06 * size];
      /** @type {[number, number][]} */
      const skid = [
        [0.8 * l, y + t],
        [-0.8 * l, y + t],
        [-0.8 * l, y - t],
        [0.8 * l, y - t],
      ];
      this.blocks.push({ kind: "skid", plan: skid, top: top + 0.4 * size, low: low + 0.1 * size });
    }
    /** The thrusters. One that pushes through the float is seen at its upper side. */
    this.tubes = thrusters.map(({ at, along }) => {
      const isWithin = Math.abs(along[2]) > 0.9 && Math.abs(at[0]) < l && Math.abs(at[1]) < w;
      return { at: /** @type {Vector} */ (isWithin ? [at[0], at[1], top] : at), along };
    });
    this.fins = fins.map(({ at, along }) => {
      const across = cross([1, 0, 0], along);
      const corner = (/** @type {number} */ x, /** @type {number} */ y) =>
        plus(at, [x * size, [1, 0, 0]], [y * size, across]);
      return [
        corner(0.12, 0.12),
        corner(0.02, 0.34),
        corner(-0.1, 0.34),
        corner(-0.1, -0.34),
        corner(0.02, -0.34),
        corner(0.12, -0.12),
      ];
    });
  }
}

/** A vehicle in the picture. */
class Figure {
  /** @param {Element} parent @param {Vehicle} vehicle @param {string} kind @param {boolean} hasLabels */
  constructor(parent, vehicle, kind, hasLabels) {
    this.vehicle = vehicle;
    this.shape = new Shape(vehicle);
    this.group = drawn(parent, "g", { class: kind });
    /** @type {SVGElement[]} */
    this.paths = [];
    this.labels = drawn(this.group, "g");
    if (hasLabels)
      for (const { label } of vehicle.thrusters) drawn(this.labels, "text", { class: "centred" }).textContent = label;
  }

  /** @param {Model} model @param {(p: Vector) => number[]} see From the earth frame, from the vehicle, to px.
   * @param {number} scale px per m @param {DOMRect[]} taken Where no label should lie. */
  draw(model, see, scale, taken) {
    const frame = rotationOf(model);
    const look = (/** @type {Vector} */ p) =>
      see(plus([0, 0, 0], [p[0], frame[0]], [p[1], frame[1]], [p[2], frame[2]]));
    const parts = [
      ...this.shape.blocks.flatMap((block) => prism(block, look)),
      ...this.shape.fins.map((corners) => part3("fin", corners.map(look))),
      ...this.shape.tubes.flatMap(({ at, along }, n) => {
        const { force, most } = this.vehicle.thrusters[n];
        return thruster(at, along, this.shape.radius, model.get(force) / most, look, this.vehicle.size);
      }),
    ].sort((one, other) => one.near - other.near);
    while (this.paths.length < parts.length) {
      const path = drawn(this.group, "path");
      this.group.insertBefore(path, this.labels);
      this.paths.push(path);
    }
    this.paths.forEach((path, n) => {
      place(path, n < parts.length ? { class: parts[n].kind, d: parts[n].path } : { d: "" });
    });
    this.label(model, look, scale, taken);
  }

  /** Puts each label at the end of the jet of its thruster: away from the vehicle's middle, or where it covers less.
   * @param {Model} model @param {(p: Vector) => number[]} look @param {number} scale @param {DOMRect[]} taken */
  label(model, look, scale, taken) {
    const [x, y] = look([0, 0, 0]);
    const isLegible = scale * this.vehicle.size > (this.labels.children.length > 4 ? 45 : 24);
    place(this.labels, { visibility: isLegible ? "inherit" : "hidden" });
    const r = this.shape.radius * scale;
    const tubes = this.shape.tubes.map(({ at }) => look(at));
    const tips = this.shape.tubes.map(({ at, along }, n) => {
      const { force, most } = this.vehicle.thrusters[n];
      return look(plus(at, [jetOf(model.get(force) / most, this.shape.radius, this.vehicle.size), along]));
    });
    const covered = [...taken, ...tubes.map(([u, v]) => new DOMRect(u - r, v - r, 2 * r, 2 * r))];
    [...this.labels.children].forEach((text, n) => {
      const [u, v] = tips[n];
      const far = Math.hypot(u - x, v - y);
      const away = far < 2 ? [1, 0] : [(u - x) / far, (v - y) / far];
      const width = LETTER * (text.textContent ?? "").length;
      const places = [away, ...SIDES].map(([dx, dy]) => {
        const left = u + 1.6 * r * dx - (width / 2) * (Math.abs(dx) < 0.3 ? 1 : 1 - Math.sign(dx));
        const box = new DOMRect(left, v + (1.6 * r + 6) * dy - 6, width, LINE);
        const turned = TURN_COST * (1 - dx * away[0] - dy * away[1]);
        return { box, cost: covered.reduce((sum, other) => sum + shared(box, other), turned) };
      });
      const { box } = places.reduce((one, other) => (other.cost < one.cost ? other : one));
      covered.push(box);
      place(text, { x: box.x + width / 2, y: box.y + 10 });
    });
  }
}

/** @param {string} kind @param {number[][]} points @returns {Drawn} */
function part3(kind, points) {
  return { kind, path: outline(points), near: points.reduce((sum, p) => sum + p[2], 0) / points.length };
}

/** Returns the visible faces of a block. @param {Shape["blocks"][number]} block @param {(p: Vector) => number[]} look */
function prism({ kind, plan, top, low }, look) {
  const upper = plan.map(([x, y]) => look([x, y, top]));
  const lower = plan.map(([x, y]) => look([x, y, low]));
  const sides = upper.map((p, n) => {
    const next = (n + 1) % plan.length;
    return [p, lower[n], lower[next], upper[next]];
  });
  const visible = sides.filter((face) => area(face) > 0);
  const { near } = part3("", [...upper, ...lower]);
  const end = area(upper) > 0 ? upper : lower;
  return [
    { kind: `${kind} side`, path: visible.map(outline).join(""), near },
    { kind: `${kind} end`, path: outline(end), near },
  ];
}

/** Returns where a jet ends, along the direction of its thruster; 0 without a jet. @param {number} share Of the strongest force.
 * @param {number} r @param {number} size */
function jetOf(share, r, size) {
  return Math.abs(share) < 0.004 ? 0 : -Math.sign(share) * (0.6 * r + (0.3 + 1.7 * Math.abs(share)) * size);
}

/** Returns a thruster as a tube, and the jet of water that it throws against its force.
 * @param {Vector} at @param {Vector} along @param {number} r @param {number} share Of its strongest force.
 * @param {(p: Vector) => number[]} look @param {number} size */
function thruster(at, along, r, share, look, size) {
  const [front, back] = [0.6 * r, -0.6 * r].map((x) => ring(plus(at, [x, along]), along, r).map(look));
  const [fore, aft] = [front, back].map((points) => part3("mouth", points));
  const tube = [...front, ...back];
  const middle = (fore.near + aft.near) / 2;
  const parts = [
    { kind: "tube", path: outline(hull(tube)), near: middle },
    { ...(fore.near > aft.near ? fore : aft), near: middle + 1e-6 },
  ];
  const start = -Math.sign(share) * 0.6 * r;
  const tip = jetOf(share, r, size);
  for (const [kind, length] of /** @type {[string, number][]} */ (
    tip
      ? [
          ["jet", 1],
          ["jet core", 0.55],
        ]
      : []
  )) {
    const end = start + length * (tip - start);
    const [near, far] = [start, end].map((x, n) =>
      ring(plus(at, [x, along]), along, (n ? 0.7 + 0.7 * length : 0.7) * r).map(look),
    );
    const water = part3(kind, hull([...near, ...far]));
    parts.push({ ...water, near: part3("", [...near, ...far]).near });
  }
  return parts;
}

/** Returns the directions forward, to starboard and down of a vehicle in the earth frame. @param {Model} model @returns {Vector[]} */
function rotationOf(model) {
  const angles = ["phi", "theta", "psi"].map((name) => model.get(name));
  const [a, b, c] = angles.map(Math.sin);
  const [p, q, r] = angles.map(Math.cos);
  return [
    [q * r, q * c, -b],
    [a * b * r - p * c, a * b * c + p * r, a * q],
    [p * b * r + a * c, p * b * c - a * r, p * q],
  ];
}

/** @param {Model} model @returns {Vector} */
function positionOf(model) {
  return [model.get("x"), model.get("y"), model.get("z")];
}

const MARGIN = 0.4; // of the picture, which the vehicle does not enter without moving it
const OBLIQUE = { azimuth: 0.5, elevation: 0.62 };
const ABOVE = { azimuth: 0, elevation: Math.PI / 2 };

class Picture {
  /** @param {Element} svg @param {Flight} flight */
  constructor(svg, flight) {
    this.svg = svg;
    this.size = flight.pilot.model.vehicle.size;
    [this.width, this.height] = [640, 400];
    /** Where no label should lie: at the arrow to north, beyond the sides, under the sticks. @type {DOMRect[]} */
    this.taken = [];
    this.grid = drawn(svg, "path", { class: "grid" });
    this.shadow = drawn(svg, "path", { class: "shadow" });
    this.tracks = [drawn(svg, "path", { class: "line ghostly" }), drawn(svg, "path", { class: "line" })];
    this.ghost = new Figure(svg, flight.ghost.model.vehicle, "craft ghostly", false);
    this.pilot = new Figure(svg, flight.pilot.model.vehicle, "craft", true);
    this.surface = drawn(svg, "path", { class: "surface" });
    this.bar = drawn(svg, "path", { class: "scale" });
    this.length = drawn(svg, "text", { x: 14, y: 22 });
    this.north = drawn(svg, "path", { class: "needle" });
    this.letter = drawn(svg, "text", { class: "centred" });
    this.letter.textContent = "N";
    this.magnified = 1;
    this.camera = { ...OBLIQUE };
    /** The place of the vehicle at the last drawing, and then its distance from the middle of the picture, in m. */
    this.last = positionOf(flight.pilot.model);
    this.offset = [0, 0];
  }

  /** Restores the camera. */
  reset() {
    this.magnified = 1;
    this.camera = { ...OBLIQUE };
    this.offset = [0, 0];
  }

  get isFromAbove() {
    return this.camera.elevation === ABOVE.elevation;
  }

  /** Changes between the views from above and from an angle. */
  turn() {
    this.camera = { ...(this.isFromAbove ? OBLIQUE : ABOVE) };
    this.offset = [0, 0];
  }

  /** Moves the camera around the vehicle. @param {number} dx In px. @param {number} dy */
  orbit(dx, dy) {
    this.camera.azimuth -= 0.008 * dx;
    this.camera.elevation = Math.max(0.15, Math.min(ABOVE.elevation, this.camera.elevation + 0.008 * dy));
  }

  /** @param {number} factor */
  zoom(factor) {
    this.magnified = Math.max(0.001, Math.min(50, this.magnified * factor));
  }

  /** Takes over the size on the screen, so that text has the page's size. */
  fit() {
    this.width = this.svg.clientWidth || this.width;
    this.height = this.svg.clientHeight || this.height;
    place(this.svg, { viewBox: `0 0 ${this.width} ${this.height}` });
    const { left, top } = this.svg.getBoundingClientRect();
    const sticks = [...document.querySelectorAll(".stick")].map((stick) => stick.getBoundingClientRect());
    this.taken = [
      new DOMRect(0, 0, 62, 112),
      new DOMRect(-1e4, 0, 1e4, this.height),
      new DOMRect(this.width, 0, 1e4, this.height),
      ...sticks.map((s) => new DOMRect(s.x - left, s.y - top, s.width, s.height)),
    ];
  }

  /** @param {Flight} flight */
  draw(flight) {
    const { pilot, ghost } = flight;
    const here = positionOf(pilot.model);
    const scale = (this.magnified * 0.15 * Math.min(this.height, this.width)) / this.size;
    const { azimuth, elevation } = this.camera;
    const [s, c, se, ce] = [Math.sin(azimuth), Math.cos(azimuth), Math.sin(elevation), Math.cos(elevation)];
    /** @type {Vector[]} */
    const [right, down, toward] = [
      [-s, c, 0],
      [-se * c, -se * s, ce],
      [-ce * c, -ce * s, -se],
    ];
    const moved = plus(here, [-1, this.last]);
    this.last = here;
    const reach = [this.width, this.height].map((px) => ((0.5 - MARGIN) * px) / scale);
    this.offset = [right, down].map((direction, i) =>
      Math.max(-reach[i], Math.min(reach[i], this.offset[i] + dot(moved, direction))),
    );
    const [x, y] = this.offset;
    const see = (/** @type {Vector} */ p) => [
      this.width / 2 + (x + dot(p, right)) * scale,
      this.height / 2 + (y + dot(p, down)) * scale,
      dot(p, toward),
    ];
    const step = roundUp(80 / scale);
    const water = step * (Math.floor((here[2] + 0.8 * this.size) / step) + 1) - here[2];
    const bed = flight.replay ? Number.POSITIVE_INFINITY : flight.bed - here[2];
    const floor = Math.min(water, bed);
    this.svg.classList.toggle("bedded", bed <= water);
    const reaches = [5, 3.5, 2].map((n) => n * this.size);
    const surface = reaches.map((d) =>
      [
        [d, d],
        [d, -d],
        [-d, -d],
        [-d, d],
      ].map(([p, q]) => see([p, q, -here[2]])),
    );
    this.surface.setAttribute("d", here[2] < 8 * this.size ? surface.map(outline).join("") : "");
    this.lay(see, scale, step, floor, here);
    const frame = rotationOf(pilot.model);
    const plan = this.pilot.shape.plan.map(([u, v]) => plus([0, 0, 0], [u, frame[0]], [v, frame[1]]));
    this.shadow.setAttribute("d", outline(plan.map(([u, v]) => see([u, v, floor]))));
    const ghostIsThere = flight.hasGhostTrack;
    const from = (/** @type {Vector} */ p) => see(plus(p, [-1, here]));
    const last = placeOf(flight.times, flight.time);
    this.tracks[0].setAttribute("d", ghostIsThere ? path(trackOf(ghost, last, 1500).map(from)) : "");
    this.tracks[1].setAttribute("d", path(trackOf(pilot, last, 1500).map(from)));
    this.ghost.group.setAttribute("visibility", ghostIsThere ? "visible" : "hidden");
    const away = plus(positionOf(ghost.model), [-1, here]);
    if (ghostIsThere) this.ghost.draw(ghost.model, (p) => see(plus(p, [1, away])), scale, []);
    this.pilot.draw(pilot.model, see, scale, this.taken);
  }

  /** Draws the grid below the vehicle, its scale, and the direction of north.
   * @param {(p: Vector) => number[]} see @param {number} scale @param {number} step @param {number} floor In m below the vehicle.
   * @param {Vector} here */
  lay(see, scale, step, floor, here) {
    const { azimuth, elevation } = this.camera;
    const [s, c] = [Math.sin(azimuth), Math.cos(azimuth)];
    const corners = [-1, 1].flatMap((i) =>
      [-1, 1].map((j) => {
        const aside = (i * this.width) / 2 / scale - this.offset[0];
        const up = (j * this.height) / 2 / scale + this.offset[1];
        const ahead = (up + Math.cos(elevation) * floor) / Math.sin(elevation);
        return [ahead * c - aside * s, ahead * s + aside * c];
      }),
    );
    /** @type {string[]} */
    const lines = [];
    const ends = [0, 1].map((i) => [Math.min(...corners.map((p) => p[i])), Math.max(...corners.map((p) => p[i]))]);
    for (const i of [0, 1]) {
      const [low, high] = ends[i];
      const first = low + step - ((((here[i] + low) % step) + step) % step);
      // Counted: far enough out a step more is the same number.
      for (let n = 0; n < (high - low) / step; n++) {
        const [p, q] = ends[1 - i].map((end) =>
          see(i ? [end, first + n * step, floor] : [first + n * step, end, floor]),
        );
        lines.push(`M${p[0].toFixed(1)} ${p[1].toFixed(1)}L${q[0].toFixed(1)} ${q[1].toFixed(1)}`);
      }
    }
    this.grid.setAttribute("d", lines.join(""));
    this.bar.setAttribute("d", `M14 30h${(step * scale).toFixed(1)}`);
    this.length.textContent = step < 1 ? `${Math.round(step * 100)} cm` : `${step} m`;
    const [x, y] = [32, 84];
    const [dx, dy] = [s * -22, -22 * c * Math.sin(elevation)];
    const side = (/** @type {number} */ k) => `${x - 0.6 * dx + k * 0.3 * dy} ${y - 0.6 * dy - k * 0.3 * dx}`;
    this.north.setAttribute("d", `M${x + dx} ${y + dy}L${side(1)}L${x - 0.3 * dx} ${y - 0.3 * dy}L${side(-1)}Z`);
    place(this.letter, { x: x + 1.5 * dx, y: y + 1.5 * dy + 4 });
  }
}

/** Returns the places before the n-th time, and the present one. @param {Craft} craft @param {number} last @param {number} most
 * The largest number of places. */
function trackOf(craft, last, most) {
  const stride = Math.max(1, Math.ceil(last / most));
  /** @type {Vector[]} */
  const places = [];
  for (let n = 0; n < last; n += stride) places.push([craft.at(n, "x"), craft.at(n, "y"), craft.at(n, "z")]);
  return [...places, positionOf(craft.model)];
}
