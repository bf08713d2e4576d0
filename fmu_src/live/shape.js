// The solid of a vehicle, which follows from the places and the directions of its thrusters and fins.

/** North, east, down; in the body frame forward, starboard, down; for the camera right, down and toward the viewer.
 * @typedef {[number, number, number]} Vector */
/** A solid between a polygon and the same polygon moved by a vector. Both have the holes.
 * @typedef {{kind: string, face: Vector[], depth: Vector, holes: Vector[][]}} Prism */
/** A tube around a point and along a direction of length 1. `ends` are where it begins and ends along it.
 * @typedef {{kind: string, at: Vector, along: Vector, r: number, ends: [number, number]}} Tube */
/** A part of the vehicle as it is drawn: its polygons on the screen, its order, first by layer and then by how near it is, and the number
 * of the thruster that it belongs to, if it does.
 * @typedef {{kind: string, polygons: number[][][], layer: number, near: number, thruster?: number}} Drawn */

const HORIZONTAL = 0.3; // the largest vertical part of the direction of a thruster that drives a vehicle ahead, aside or around
const FRAME = 4; // so many thrusters that drive it horizontally stand in an open frame

/** @param {Vector} a @param {Vector} b */
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/** Returns the sum of a vector and some others, each with its factor. @param {Vector} start @param {[number, Vector][]} others */
function plus(start, ...others) {
  const sum = /** @type {Vector} */ ([...start]);
  for (const [factor, v] of others) for (let i = 0; i < 3; i++) sum[i] += factor * v[i];
  return sum;
}

/** @param {Vector} a @param {Vector} b @returns {Vector} */
function cross([a, b, c], [x, y, z]) {
  return [b * z - c * y, c * x - a * z, a * y - b * x];
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

/** Returns the corners of the convex hull of points. @param {number[][]} points */
function hull(points) {
  const sorted = [...points].sort((p, q) => p[0] - q[0] || p[1] - q[1]);
  const half = (/** @type {number[][]} */ list) => {
    /** @type {number[][]} */
    const corners = [];
    for (const p of list) {
      while (corners.length > 1 && area([corners[corners.length - 2], corners[corners.length - 1], p]) <= 0)
        corners.pop();
      corners.push(p);
    }
    return corners.slice(0, -1);
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

/** Returns a prism whose face runs clockwise for who looks at it from outside. @param {string} kind @param {Vector[]} face
 * @param {Vector} depth @param {Vector[][]} holes @returns {Prism} */
function prism(kind, face, depth, holes = []) {
  /** @type {Vector} */
  const normal = face.reduce((sum, p, n) => plus(sum, [1, cross(p, face[(n + 1) % face.length])]), [0, 0, 0]);
  return { kind, face: dot(normal, depth) > 0 ? face : [...face].reverse(), depth, holes };
}

/** Returns a prism from one height to another. @param {string} kind @param {[number, number][]} plan @param {number} top
 * @param {number} low */
function block(kind, plan, top, low) {
  return prism(
    kind,
    plan.map(([x, y]) => [x, y, top]),
    [0, 0, low - top],
  );
}

/** Returns the corners of a rectangle. @param {number} x @param {number} p @param {number} y @param {number} q
 * @returns {[number, number][]} */
const rectangle = (x, p, y, q) => [
  [x, y],
  [p, y],
  [p, q],
  [x, q],
];

/** Returns a tube from one point to another. @param {string} kind @param {Vector} from @param {Vector} to @param {number} r @returns {Tube} */
function beam(kind, from, to, r) {
  const way = plus(to, [-1, from]);
  const length = Math.hypot(...way);
  return { kind, at: from, along: plus([0, 0, 0], [1 / length, way]), r, ends: [0, length] };
}

/** Returns the largest size of a coordinate. @param {{at: Vector}[]} parts @param {number} i */
const farthest = (parts, i) => Math.max(0, ...parts.map(({ at }) => Math.abs(at[i])));

/**
 * The solid of a vehicle. Fins make it a slender hull. Thrusters that push in several horizontal directions stand in an open frame: two
 * side plates, tubes between them, and foam on top. All others are a float over a hull and two skids. A thruster outside
 * of all this is held by an arm.
 */
class Shape {
  /** @param {Vehicle} vehicle */
  constructor({ size, thrusters, fins }) {
    /** @type {Prism[]} */
    this.prisms = [];
    /** The tubes of the body and the arms. @type {Tube[]} */
    this.tubes = [];
    /** The outline of the body from above. @type {[number, number][]} */
    this.plan = [];
    /** The thrusters, each at the place where it is seen. @type {{at: Vector, along: Vector}[]} */
    this.thrusters = thrusters;
    /** The distance of the side plates from the middle, which divide the body into layers. */
    this.plates = Number.POSITIVE_INFINITY;
    /** The radius of a thruster. */
    this.radius = 0.2 * size;
    const level = thrusters.filter(({ along }) => Math.abs(along[2]) < HORIZONTAL);
    if (fins.length) this.slender(size);
    else if (level.length >= FRAME) this.frame(level);
    else this.float(size);
    this.fins = fins.map(({ at, along }) => {
      const across = cross([1, 0, 0], along);
      const corner = (/** @type {number[]} */ [x, y]) => plus(at, [x * size, [1, 0, 0]], [y * size, across]);
      return [
        [0.12, 0.12],
        [0.02, 0.34],
        [-0.1, 0.34],
        [-0.1, -0.34],
        [0.02, -0.34],
        [0.12, -0.12],
      ].map(corner);
    });
  }

  /** Makes the hull of a torpedo. @param {number} size */
  slender(size) {
    const [l, r] = [1.1 * size, 0.11 * size];
    this.radius = 0.1 * size;
    this.plan = rectangle(-l, l, -r, r);
    const stations = [
      [-1, 0.45],
      [-0.7, 1],
      [0.8, 1],
      [0.94, 0.75],
      [1, 0.3],
    ];
    for (let n = 0; n + 1 < stations.length; n++) {
      const [[x, r0], [next, r1]] = [stations[n], stations[n + 1]];
      this.tubes.push({
        kind: "float",
        at: [0, 0, 0],
        along: [1, 0, 0],
        r: r * Math.max(r0, r1),
        ends: [x * l, next * l],
      });
    }
  }

  /** Makes an open frame around thrusters. @param {{at: Vector}[]} level The thrusters that push horizontally. */
  frame(level) {
    const reach = Math.max(farthest(level, 0), farthest(level, 1), 0.05);
    this.radius = 0.3 * reach;
    const r = this.radius;
    const [l, w] = [farthest(level, 0) + 1.5 * r, Math.max(farthest(level, 1), 0.4 * reach) + 1.15 * r];
    const low = Math.max(...level.map(({ at }) => at[2])) + 1.25 * r;
    const top = Math.min(low - 1.6 * reach, Math.min(...level.map(({ at }) => at[2])) - 2 * r);
    const [h, t] = [low - top, 0.06 * reach];
    this.plates = w - t / 2;
    this.plan = rectangle(-l, l, -w, w);
    const outline = [
      [-1, 0.25],
      [-0.85, 0],
      [0.75, 0],
      [1, 0.3],
      [1, 1],
      [0.7, 1],
      [0.6, 0.9],
      [-0.6, 0.9],
      [-0.7, 1],
      [-1, 1],
    ];
    const openings = [rectangle(-0.82, -0.12, 0.36, 0.8), rectangle(0.06, 0.82, 0.36, 0.8)];
    for (const side of [-1, 1]) {
      const on = (/** @type {number[]} */ [x, z]) => /** @type {Vector} */ ([x * l, side * w, top + z * h]);
      const holes = openings.map((hole) => hole.map(on));
      this.prisms.push(prism("plate", outline.map(on), [0, -side * t, 0], holes));
    }
    const [middle, battery] = [0.38 * reach, 0.26 * reach];
    this.tubes.push({
      kind: "hull",
      at: [0, 0, top + middle + 0.05 * h],
      along: [1, 0, 0],
      r: middle,
      ends: [-0.85 * l, 0.9 * l],
    });
    this.tubes.push({
      kind: "hull",
      at: [0, 0, low - battery - 0.05 * h],
      along: [1, 0, 0],
      r: battery,
      ends: [-0.75 * l, 0.75 * l],
    });
    for (const x of [-0.7, 0.7])
      this.tubes.push(beam("arm", [x * l, t - w, low - 0.04 * h], [x * l, w - t, low - 0.04 * h], 0.05 * reach));
    const isAbove = this.thrusters.some(({ at, along }) => Math.abs(along[2]) > HORIZONTAL && Math.abs(at[1]) < w);
    const pieces = isAbove
      ? [
          [-0.85, -0.3],
          [0.3, 0.75],
        ]
      : [[-0.85, 0.75]];
    for (const side of [-1, 1])
      for (const [from, to] of pieces)
        this.prisms.push(
          block("foam", rectangle(from * l, to * l, side * 0.45 * w, side * (w - t)), top, top + 0.3 * h),
        );
    this.hold(l, w, top, low);
  }

  /** Makes a float over a hull and two skids. @param {number} size */
  float(size) {
    const depths = this.thrusters.map(({ at }) => at[2]);
    const l = Math.max(0.9 * size, 1.15 * farthest(this.thrusters, 0));
    const w = Math.max(0.4 * size, 0.72 * farthest(this.thrusters, 1));
    const [top, low] = [Math.min(-0.35 * size, ...depths), Math.max(0.45 * size, ...depths)];
    const under = top + 0.4 * size;
    /** @type {[number, number][]} */
    const half = [0.45, 1, 1, 0.8].map((y, n) => [[1, 0.75, -0.92, -1][n] * l, y * w]);
    this.plan = [...half, ...half.map(([x, y]) => /** @type {[number, number]} */ ([x, -y])).reverse()];
    this.prisms.push(block("float", this.plan, top, under));
    for (const y of [-0.8 * w, 0.8 * w])
      this.prisms.push(
        block("skid", rectangle(-0.8 * l, 0.8 * l, y - 0.05 * size, y + 0.05 * size), under, low + 0.1 * size),
      );
    const r = Math.min(0.5 * w, 0.5 * (low - under));
    this.tubes.push({ kind: "hull", at: [0, 0, under + r], along: [1, 0, 0], r, ends: [-0.8 * l, 0.95 * l] });
    // One that pushes through the float is seen at its upper side.
    this.thrusters = this.thrusters.map(({ at, along }) => {
      const isWithin = Math.abs(along[2]) > 0.9 && Math.abs(at[0]) < l && Math.abs(at[1]) < w;
      return { at: isWithin ? [at[0], at[1], top] : at, along };
    });
    this.hold(0.8 * l, 0.8 * w, top, low);
  }

  /** Holds each thruster outside of a box by an arm from the box. @param {number} l @param {number} w @param {number} top
   * @param {number} low */
  hold(l, w, top, low) {
    for (const { at } of this.thrusters) {
      const [x, y, z] = at;
      /** @type {Vector} */
      const near = [Math.max(-l, Math.min(l, x)), Math.max(-w, Math.min(w, y)), Math.max(top, Math.min(low, z))];
      if (Math.hypot(...plus(at, [-1, near])) > 0.4 * this.radius)
        this.tubes.push(beam("arm", near, at, 0.25 * this.radius));
    }
  }
}
