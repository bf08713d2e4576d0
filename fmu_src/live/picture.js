// The picture of a flight: the vehicle with its jets, the tracks, the surface and the grid below, and the instruments on it.

/** How a frame is seen: where its origin is on the picture, which of its directions point right, down and toward the viewer, and px per m.
 * @typedef {{origin: number[], right: Vector, down: Vector, toward: Vector, scale: number}} View */

/** @param {View} view @param {Vector} p @returns {number[]} To the right and down in px, and toward the viewer in m. */
function seen({ origin, right, down, toward, scale }, p) {
  return [origin[0] + scale * dot(right, p), origin[1] + scale * dot(down, p), dot(toward, p)];
}

/** Returns the view of another frame. @param {View} view @param {Vector[]} axes Of the other frame, in the first one.
 * @param {Vector} at Its origin. @returns {View} */
function viewOfFrame(view, axes, at) {
  const [right, down, toward] = [view.right, view.down, view.toward].map(
    (direction) => /** @type {Vector} */ (axes.map((axis) => dot(direction, axis))),
  );
  return { origin: seen(view, at), right, down, toward, scale: view.scale };
}

/** Returns the area that two rectangles share. @param {DOMRect} one @param {DOMRect} other */
function shared(one, other) {
  const wide = Math.min(one.right, other.right) - Math.max(one.left, other.left);
  return Math.max(0, wide) * Math.max(0, Math.min(one.bottom, other.bottom) - Math.max(one.top, other.top));
}

/** Returns the distance between a rectangle and a point. @param {DOMRect} box @param {number[]} point */
function gap({ left, right, top, bottom }, [x, y]) {
  return Math.hypot(Math.max(left - x, 0, x - right), Math.max(top - y, 0, y - bottom));
}

/** Returns whether a point lies within polygons; a polygon within another one is a hole. @param {number[][][]} polygons @param {number[]} point */
function isInside(polygons, [x, y]) {
  const left = polygons.flatMap((points) =>
    points.filter(([u, v], n) => {
      const [p, q] = points[(n + 1) % points.length];
      return v > y !== q > y && u + ((p - u) * (y - v)) / (q - v) < x;
    }),
  );
  return left.length % 2 === 1;
}

/** The directions in which a label may lie beside its thruster. */
const SIDES = [0, 1, 2, 3, 4, 5, 6, 7].map((n) => [Math.cos((n * Math.PI) / 4), Math.sin((n * Math.PI) / 4)]);
/** The distances from its thruster at which a label may lie, in radii of the thruster. */
const DISTANCES = [1.6, 3.2];
/** The area in square pixels that a label may cover before it lies beside its thruster instead of away from the vehicle. */
const TURN_COST = 60;

/** The colours of the ends, the sides and the edges of the parts of a vehicle. @type {Record<string, [string, string, string]>} */
const PAINT = {
  float: ["#f5c542", "#d9a520", "#8a6a10"],
  fin: ["#f5c542", "#d9a520", "#8a6a10"],
  skid: ["#37474f", "#37474f", "#263238"],
  plate: ["#2f3b45", "#46545f", "#151c22"],
  foam: ["#3a8dde", "#1f6dbd", "#124a85"],
  hull: ["#e3ebf1", "#a9b6c1", "#5d6f7e"],
  arm: ["#46545f", "#46545f", "#263238"],
  tube: ["#5d6f7e", "#22303d", "#10171e"],
};

/** Returns where a jet ends, along the direction of its thruster; 0 without a jet. @param {number} share Of the strongest force.
 * @param {number} r @param {number} size */
function jetOf(share, r, size) {
  return Math.abs(share) < 0.004 ? 0 : -Math.sign(share) * (0.6 * r + (0.3 + 1.7 * Math.abs(share)) * size);
}

/** The least share of a thruster, or of the end of its jet, that is seen where it has a label. */
const SEEN = 0.25;

/** A vehicle in the picture. */
class Figure {
  /** @param {Vehicle} vehicle */
  constructor(vehicle) {
    this.vehicle = vehicle;
    this.shape = new Shape(vehicle);
    /** What was drawn, the nearest part last. @type {Drawn[]} */
    this.parts = [];
    /** Where the labels were drawn. @type {DOMRect[]} */
    this.boxes = [];
  }

  /** Draws the vehicle. @param {Board} board @param {View} view Of the body frame. @param {Model} model @param {boolean} isGhost */
  draw(board, view, model, isGhost) {
    const { prisms, tubes, thrusters, fins, radius } = this.shape;
    this.parts = [
      ...prisms.flatMap((one) => this.prism(one, view)),
      ...tubes.flatMap((one) => this.tube(one, view)),
      ...fins.map((corners) => this.part("fin", [corners.map((p) => seen(view, p))], corners, view)),
      ...thrusters.flatMap(({ at, along }, n) => {
        const tube = {
          kind: "tube",
          at,
          along,
          r: radius,
          ends: /** @type {[number, number]} */ ([-0.6 * radius, 0.6 * radius]),
        };
        const own = [...this.tube(tube, view), ...this.jets(n, this.share(n, model), view)];
        return own.map((part) => ({ ...part, thruster: n }));
      }),
    ].sort((one, other) => one.layer - other.layer || one.near - other.near);
    const { grey, blue } = board.colours;
    for (const { kind, polygons } of this.parts) {
      const [part, tone] = kind.split(" ");
      if (part === "jet") board.area(polygons, isGhost ? grey : blue, "", tone ? 0.5 : 0.28);
      else if (isGhost) board.area(polygons, grey, grey, 0.18);
      else {
        const [end, side, edge] = PAINT[part];
        board.area(polygons, tone ? side : end, edge);
      }
    }
  }

  /** Returns the force of a thruster as a share of the largest. @param {number} n @param {Model} model */
  share(n, model) {
    const { force, most } = this.vehicle.thrusters[n];
    return model.get(force) / most;
  }

  /** @param {string} kind @param {number[][][]} polygons @param {Vector[]} points What the part consists of, in the body frame.
   * @param {View} view @returns {Drawn} */
  part(kind, polygons, points, view) {
    const middle = /** @type {Vector} */ (
      [0, 1, 2].map((i) => points.reduce((sum, p) => sum + p[i], 0) / points.length)
    );
    const { plates } = this.shape;
    const beyond = Math.abs(middle[1]) - plates;
    const layer = Math.abs(beyond) < 1e-9 ? 1 : beyond > 0 ? 2 : 0;
    return {
      kind,
      polygons,
      layer: layer * Math.sign(middle[1]) * Math.sign(view.toward[1]),
      near: dot(view.toward, middle),
    };
  }

  /** @param {Prism} prism @param {View} view */
  prism({ kind, face, depth, holes }, view) {
    const far = face.map((p) => plus(p, [1, depth]));
    const [front, back] = [face, far].map((points) => points.map((p) => seen(view, p)));
    const isFront = area(front) > 0;
    const sides = front.flatMap((p, n) => {
      const next = (n + 1) % front.length;
      const side = [p, back[n], back[next], front[next]];
      return area(side) > 0 ? [side] : [];
    });
    const open = holes.map((hole) => hole.map((p) => seen(view, isFront ? p : plus(p, [1, depth]))));
    const end = this.part(kind, [isFront ? front : back, ...open], [...face, ...far], view);
    return [
      ...sides.map((side) => ({ ...end, kind: `${kind} side`, polygons: [side] })),
      { ...end, near: end.near + 1e-6 },
    ];
  }

  /** @param {Tube} tube @param {View} view */
  tube({ kind, at, along, r, ends }, view) {
    const [first, last] = ends.map((x) => ring(plus(at, [x, along]), along, r).map((p) => seen(view, p)));
    const points = ends.map((x) => plus(at, [x, along]));
    const whole = this.part(`${kind} side`, [hull([...first, ...last])], points, view);
    const mouth = dot(view.toward, along) > 0 ? last : first;
    return [whole, { ...whole, kind, polygons: [mouth], near: whole.near + 1e-6 }];
  }

  /** Returns the water that a thruster throws against its force. @param {number} n @param {number} share @param {View} view */
  jets(n, share, view) {
    const { at, along } = this.shape.thrusters[n];
    const r = this.shape.radius;
    const tip = jetOf(share, r, this.vehicle.size);
    if (!tip) return [];
    const start = -Math.sign(share) * 0.6 * r;
    return [1, 0.55].map((length) => {
      const ends = [start, start + length * (tip - start)].map((x) => plus(at, [x, along]));
      const rings = ends.flatMap((end, k) => ring(end, along, (k ? 0.7 + 0.7 * length : 0.7) * r));
      return this.part(length < 1 ? "jet core" : "jet", [hull(rings.map((p) => seen(view, p)))], ends, view);
    });
  }

  /** Returns whether the last drawing hides a thruster (the kind "tube"), or the end of its "jet". @param {number} n @param {string} kind
   * @param {Vector} end @param {View} view */
  isHidden(n, kind, end, view) {
    const { along } = this.shape.thrusters[n];
    const own = this.parts.map((part) => part.thruster === n && part.kind.startsWith(kind));
    const before = this.parts.slice(own.lastIndexOf(true) + 1);
    const solid = before.filter(({ kind }) => !kind.startsWith("jet"));
    const points = ring(end, along, this.shape.radius).map((p) => seen(view, p));
    const free = points.filter((p) => !solid.some(({ polygons }) => isInside(polygons, p)));
    return free.length < SEEN * points.length;
  }

  /** Puts each label at the end of the jet of its thruster, or at a thruster whose jet is hidden: away from the vehicle's middle, or where
   * it covers less, and nearest to its own thruster. Labels without such a place, those that would cover each other, and those of what is
   * hidden are left out. @param {Board} board @param {View} view @param {Model} model @param {DOMRect[]} taken */
  label(board, view, model, taken) {
    const { thrusters } = this.vehicle;
    const [x, y] = view.origin;
    this.boxes = [];
    if (view.scale * this.vehicle.size < (thrusters.length > 4 ? 45 : 24)) return;
    const r = this.shape.radius * view.scale;
    const points = this.shape.thrusters.map(({ at, along }, n) => [
      at,
      plus(at, [jetOf(this.share(n, model), this.shape.radius, this.vehicle.size), along]),
    ]);
    const ends = points.map((own) => own.map((p) => seen(view, p)));
    const covered = ends.map(([[u, v]]) => new DOMRect(u - r, v - r, 2 * r, 2 * r));
    points.forEach(([at, tip], n) => {
      const place = !this.isHidden(n, "jet", tip, view) ? tip : at;
      if (place === at && this.isHidden(n, "tube", at, view)) return;
      const [u, v] = seen(view, place);
      const { label } = thrusters[n];
      const far = Math.hypot(u - x, v - y);
      const away = far < 2 ? [1, 0] : [(u - x) / far, (v - y) / far];
      const width = board.measure(label, true);
      const places = [away, ...SIDES].flatMap(([dx, dy]) =>
        DISTANCES.map((distance) => {
          const left = u + distance * r * dx - (width / 2) * (Math.abs(dx) < 0.3 ? 1 : 1 - Math.sign(dx));
          const box = new DOMRect(left, v + (distance * r + 6) * dy - 6, width, LINE);
          const turned = TURN_COST * (1 - dx * away[0] - dy * away[1] + distance - DISTANCES[0]);
          return { box, cost: [...covered, ...taken].reduce((sum, other) => sum + shared(box, other), turned) };
        }),
      );
      const own = places.filter(({ box }) => {
        const [mine, ...others] = [ends[n], ...ends].map((points) => Math.min(...points.map((p) => gap(box, p))));
        return mine <= Math.min(...others) + 1;
      });
      if (!own.length) return;
      const { box } = own.reduce((one, other) => (other.cost < one.cost ? other : one));
      if ([...taken, ...this.boxes].some((other) => shared(box, other) > 0)) return;
      this.boxes.push(box);
      covered.push(box);
      board.text(label, box.x, box.y + 10, { colour: board.colours.ink, isBold: true, hasBorder: true });
    });
  }
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
  /** @param {HTMLCanvasElement} canvas @param {Flight} flight @param {Instruments} instruments */
  constructor(canvas, flight, instruments) {
    this.board = new Board(canvas);
    this.instruments = instruments;
    this.size = flight.pilot.model.vehicle.size;
    /** Where no label should lie: beyond the sides, and under the instruments and the sticks. @type {DOMRect[]} */
    this.taken = [];
    this.ghost = new Figure(flight.ghost.model.vehicle);
    this.pilot = new Figure(flight.pilot.model.vehicle);
    this.magnified = 1;
    this.camera = { ...OBLIQUE };
    /** The place of the vehicle at the last drawing, and then its distance from the middle of the picture, in m. */
    this.last = positionOf(flight.pilot.model);
    this.offset = [0, 0];
    /** True when the vehicle is drawn above the seabed. */
    this.isBedded = false;
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

  /** Takes over the size on the screen. */
  fit() {
    const { board } = this;
    board.fit();
    const { left, top, bottom } = board.canvas.getBoundingClientRect();
    const above = [...document.querySelectorAll(".over > * > *")].map((element) => element.getBoundingClientRect());
    const foot = Math.min(bottom, ...above.filter(({ width }) => width).map((box) => box.top)) - top;
    this.instruments.fit(board.width, foot);
    this.taken = [
      new DOMRect(-1e4, 0, 1e4, board.height),
      new DOMRect(board.width, 0, 1e4, board.height),
      new DOMRect(-1e4, -1e4, 2e4, 1e4),
      new DOMRect(-1e4, board.height, 2e4, 1e4),
      ...above.map((box) => new DOMRect(box.x - left, box.y - top, box.width, box.height)),
      ...this.instruments.boxes,
    ];
  }

  /** Returns the view of the camera, with the vehicle in the origin of an earth frame. @param {Vector} here @returns {View} */
  look(here) {
    const { width, height } = this.board;
    const scale = (this.magnified * 0.15 * Math.min(height, width)) / this.size;
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
    const reach = [width, height].map((px) => ((0.5 - MARGIN) * px) / scale);
    this.offset = [right, down].map((direction, i) =>
      Math.max(-reach[i], Math.min(reach[i], this.offset[i] + dot(moved, direction))),
    );
    const origin = [width / 2 + this.offset[0] * scale, height / 2 + this.offset[1] * scale];
    return { origin, right, down, toward, scale };
  }

  /** @param {Flight} flight */
  draw(flight) {
    const { board, size } = this;
    const { grey, blue, ink } = board.colours;
    const { pilot, ghost } = flight;
    const here = positionOf(pilot.model);
    const view = this.look(here);
    const step = roundUp(80 / view.scale);
    const water = step * (Math.floor((here[2] + 0.8 * size) / step) + 1) - here[2];
    const bed = flight.replay ? Number.POSITIVE_INFINITY : flight.bed - here[2];
    const floor = Math.min(water, bed);
    this.isBedded = bed <= water;
    board.clear();
    if (this.isBedded) board.area([rectangle(0, board.width, 0, board.height)], "#d9a520", "", 0.16);
    this.lay(view, step, floor, here);
    const axes = rotationOf(pilot.model);
    const shadow = this.pilot.shape.plan.map(([u, v]) => plus([0, 0, 0], [u, axes[0]], [v, axes[1]]));
    board.area([shadow.map(([u, v]) => seen(view, [u, v, floor]))], ink, "", 0.08);
    const last = placeOf(flight.times, flight.time);
    const track = (/** @type {Craft} */ craft, /** @type {string} */ colour) =>
      board.line(
        trackOf(craft, last, 600).map((p) => seen(view, plus(p, [-1, here]))),
        colour,
        1.8,
      );
    if (flight.hasGhostTrack) track(ghost, grey);
    track(pilot, blue);
    if (flight.hasGhostTrack) {
      const away = plus(positionOf(ghost.model), [-1, here]);
      this.ghost.draw(board, viewOfFrame(view, rotationOf(ghost.model), away), ghost.model, true);
    }
    const body = viewOfFrame(view, axes, [0, 0, 0]);
    this.pilot.draw(board, body, pilot.model, false);
    if (here[2] < 8 * size)
      for (const d of [5, 3.5, 2]) {
        const edge = rectangle(-d * size, d * size, -d * size, d * size).map(([p, q]) => seen(view, [p, q, -here[2]]));
        board.area([edge], blue, "", 0.04);
        board.pen.globalAlpha = 0.35;
        board.line([...edge, edge[0]], blue, 1);
        board.pen.globalAlpha = 1;
      }
    this.pilot.label(board, body, pilot.model, this.taken);
    this.instruments.draw(board, flight, this.camera, step * view.scale, lengthInWords(step));
  }

  /** Draws the grid below the vehicle. @param {View} view @param {number} step In m. @param {number} floor In m below the vehicle.
   * @param {Vector} here */
  lay(view, step, floor, here) {
    const { board } = this;
    const { azimuth, elevation } = this.camera;
    const [s, c] = [Math.sin(azimuth), Math.cos(azimuth)];
    const corners = [-1, 1].flatMap((i) =>
      [-1, 1].map((j) => {
        const aside = (i * board.width) / 2 / view.scale - this.offset[0];
        const up = (j * board.height) / 2 / view.scale + this.offset[1];
        const ahead = (up + Math.cos(elevation) * floor) / Math.sin(elevation);
        return [ahead * c - aside * s, ahead * s + aside * c];
      }),
    );
    const ends = [0, 1].map((i) => [Math.min(...corners.map((p) => p[i])), Math.max(...corners.map((p) => p[i]))]);
    board.pen.beginPath();
    for (const i of [0, 1]) {
      const [low, high] = ends[i];
      const first = low + step - ((((here[i] + low) % step) + step) % step);
      // Counted: far enough out a step more is the same number.
      for (let n = 0; n < (high - low) / step; n++) {
        const x = first + n * step;
        board.run(ends[1 - i].map((end) => seen(view, i ? [end, x, floor] : [x, end, floor])));
      }
    }
    board.stroke(board.colours.rule, 1);
  }
}

/** Returns the places before the n-th time, and the present one. @param {Craft} craft @param {number} last @param {number} most
 * The largest number of places. */
function trackOf(craft, last, most) {
  const stride = 2 ** Math.max(0, Math.ceil(Math.log2(last / most))); // so that the same places stay when the track grows
  /** @type {Vector[]} */
  const places = [];
  for (let n = 0; n < last; n += stride) places.push([craft.at(n, "x"), craft.at(n, "y"), craft.at(n, "z")]);
  return [...places, positionOf(craft.model)];
}
