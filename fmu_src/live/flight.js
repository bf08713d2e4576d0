// A flight: the pilot's vehicle and a ghost, which is another tuning, another vehicle, or what a recording measured.

const LONGEST_STEP = 0.05; // s, so that curves and the track are smooth at any speed
const MOST_KEPT = 20000;
const RESTING = 0.55; // of the vehicle's size: the height of its middle above the seabed on which it rests
const SHALLOW = 0.02; // m; a vehicle that bobs at the surface is not deeper
const NO_SURFACE = 1e30; // m; over such a height, nothing of buoyancy and thrust fades out
const PIECE = 10; // s after which the prediction of a recording begins anew, as that of a report does
const NEAR_SURFACE = 0.25; // m of depth, within which a vehicle without commands rests at the surface; above, it is in air
const STEADY = [2, 0.1]; // s, m: while a vehicle rests, its depth stays so long within so little
const REST = 1e-3; // m/s, rad/s, m/s2, rad/s2; a vehicle that moves less is at rest

/** Returns the last place at which ascending numbers are at most x, or 0. @param {number[]} numbers @param {number} x */
function placeOf(numbers, x) {
  let [low, high] = [0, numbers.length];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (numbers[middle] <= x) low = middle;
    else high = middle;
  }
  return low;
}

/** Returns the place at which ascending times are at most a time, and how far it is from there to the next one, from 0 to 1.
 * @param {number[]} times @param {number} time @returns {[number, number]} */
function shareOf(times, time) {
  const n = placeOf(times, time);
  return [n, n + 1 < times.length ? Math.max(0, (time - times[n]) / (times[n + 1] - times[n])) : 0];
}

/** Returns what the n-th of ascending times has, at a time between them.
 * @param {number[]} times @param {(n: number) => number} value @param {number} time */
function between(times, value, time) {
  const [n, share] = shareOf(times, time);
  return share ? value(n) + share * (value(n + 1) - value(n)) : value(n);
}

/** @param {number} x @param {number} most */
const within = (x, most) => Math.max(-most, Math.min(most, x));

/** Returns the variable of a signal, or null for the distance along its axis. @param {Axis} axis @param {boolean} isPosition */
function variableOf({ velocity, position }, isPosition) {
  return isPosition ? position : velocity;
}

/** Returns the unit in which the page shows a signal: degrees for angles. @param {Axis} axis @param {boolean} isPosition */
function unitOf({ unit, positionUnit }, isPosition) {
  return (isPosition ? positionUnit : unit).replace("rad", "°");
}

/** Returns how many of this unit one SI unit is. @param {Axis} axis */
function factorOf({ unit }) {
  return unit.startsWith("rad") ? 180 / Math.PI : 1;
}

/** A vehicle with its history: the values of all variables, and then the distances along the axes, at the times of the flight. */
class Craft {
  /** @param {Model} model */
  constructor(model) {
    this.model = model;
    /** What holds it. @type {Helm | null} */
    this.helm = null;
    /** @type {Float64Array[]} */
    this.states = [];
    /** The distance covered along each axis. */
    this.distances = model.vehicle.axes.map(() => 0);
  }

  /** Begins anew, with the states as they are set. */
  begin() {
    this.states = [];
    this.model.observe();
    this.keep();
  }

  /** Steps h seconds from a time on, under the commands that are set or by sticks. Returns false when the step fails.
   * @param {number} time @param {number} h @param {Sticks | null} sticks @param {string} name Of the autopilot. */
  step(time, h, sticks, name = "") {
    const { model, distances } = this;
    const { axes } = model.vehicle;
    const before = axes.map(({ velocity }) => model.get(velocity));
    const law = model.lawOf(name);
    if (sticks && law) {
      if (this.helm?.until !== time || this.helm.law !== law) this.helm = new Helm(model, law, time);
      if (!this.helm.step(h, sticks)) return false;
    } else {
      if (sticks) model.give(commandsOf(model.vehicle, sticks.demands, sticks.most));
      if (!model.step(h)) return false;
    }
    model.observe();
    axes.forEach(({ velocity }, a) => {
      distances[a] += (h / 2) * (before[a] + model.get(velocity));
    });
    return true;
  }

  /** Keeps the vehicle above a depth, and below the surface if its model has none. @param {number} bed */
  confine(bed) {
    const { model } = this;
    const z = model.get("z");
    const top = model.has("height") ? Number.NEGATIVE_INFINITY : 0;
    if (z >= top && z <= bed) return;
    const edge = z < top ? top : bed;
    const sinks = model.get("der(z)");
    model.set("z", edge);
    if (sinks * (z - edge) > 0)
      rotationOf(model).forEach((direction, n) => {
        model.set("uvw"[n], model.get("uvw"[n]) - sinks * direction[2]);
      });
    model.observe();
  }

  keep() {
    const { values } = this.model;
    const state = new Float64Array(values.length + this.distances.length);
    state.set(values);
    state.set(this.distances, values.length);
    this.states.push(state);
  }

  /** Returns to what it was between the n-th time and the next. @param {number} n @param {number} share From 0 to 1 of the way. */
  show(n, share) {
    const [state, next] = [this.states[n], this.states[n + 1] ?? this.states[n]];
    const { values } = this.model;
    for (let i = 0; i < values.length; i++) values[i] = state[i] + share * (next[i] - state[i]);
    this.distances = this.distances.map((_, a) => state[values.length + a]);
  }

  /** Returns a variable at the n-th time, or 0 if the vehicle does not have it. @param {number} n @param {string} name */
  at(n, name) {
    const place = this.model.places.get(name);
    return place === undefined ? 0 : this.states[n][place];
  }

  /** Returns the position or the velocity along an axis at the n-th time. @param {number} a @param {boolean} isPosition @param {number} n */
  along(a, isPosition, n) {
    const name = variableOf(this.model.vehicle.axes[a], isPosition);
    return name ? this.at(n, name) : this.states[n][this.model.values.length + a];
  }

  /** Returns the position or the velocity along an axis now. @param {number} a @param {boolean} isPosition */
  now(a, isPosition) {
    const name = variableOf(this.model.vehicle.axes[a], isPosition);
    return name ? this.model.get(name) : this.distances[a];
  }

  /** Sets the position or the velocity along an axis. @param {number} a @param {boolean} isPosition @param {number} value */
  put(a, isPosition, value) {
    const name = variableOf(this.model.vehicle.axes[a], isPosition);
    if (name) this.model.set(name, value);
    else this.distances[a] = value;
  }

  /** Returns the number of an axis, or -1 if the vehicle does not have it. @param {string} name */
  axis(name) {
    return this.model.vehicle.axes.findIndex((axis) => axis.name === name);
  }
}

class Flight {
  /** @param {Model} pilot @param {Model | null} other The ghost's vehicle; by default the pilot's, with the file's tuning. */
  constructor(pilot, other) {
    this.pilot = new Craft(pilot);
    this.isOther = other !== null;
    this.ghost = new Craft(other ?? pilot.twin());
    this.ghostShown = this.isOther;
    this.time = 0;
    /** @type {number[]} */
    this.times = [];
    /** The commands that hold from each of the times on. @type {number[][]} */
    this.commands = [];
    /** By axis: the time of the last change of an input, and the velocity at that time. */
    this.since = pilot.vehicle.axes.map(() => ({ time: 0, velocity: 0 }));
    /** @type {StepTest | null} */
    this.test = null;
    /** @type {Replay | null} */
    this.replay = null;
    /** The name of the autopilot that holds the vehicle while the sticks steer it; none at first where it keeps level by itself. */
    this.held = pilot.vehicle.laws.find(({ held }) => held.includes("roll") || held.includes("pitch"))?.name ?? "";
    /** @type {Sticks} */
    this.sticks = { demands: new Map(), added: {} };
    /** The depth of the seabed, m, which recordings and step tests do not have, and whether it and the surface stop the vehicle. */
    this.bed = 10;
    this.isBounded = true;
    /** True after the first input. Until then, time stands still. */
    this.begun = false;
    this.reset();
  }

  /** Returns to the start. Commands and loads stay as they are. */
  reset() {
    this.test = null;
    this.replay = null;
    for (const craft of [this.pilot, this.ghost]) {
      craft.model.reset();
      craft.distances = craft.distances.map(() => 0);
    }
    this.begin();
  }

  /** Begins the history with the states as they are set. */
  begin() {
    this.surface();
    this.time = 0;
    this.times.splice(0, Number.POSITIVE_INFINITY, 0); // the charts keep this list
    this.commands = [this.given()];
    this.pilot.begin();
    this.ghost.begin();
    for (const since of this.since) Object.assign(since, { time: 0, velocity: 0 });
  }

  /** Lets the surface of the models act, except in recordings and step tests, where the vehicles move as deep under water. */
  surface() {
    const acts = this.isBounded && !this.test && !this.replay;
    for (const { model } of [this.pilot, this.ghost]) {
      const height = acts ? model.start("height") : NO_SURFACE;
      if (model.has("height") && model.get("height") !== height) model.tune({ height });
    }
  }

  /** Returns true if the surface keeps the vehicle from moving along an axis. @param {number} a @param {number} velocity Along it. */
  floats(a, velocity) {
    const { model } = this.pilot;
    const acts = this.isBounded && !this.test && !this.replay;
    return acts && model.vehicle.axes[a].position === "z" && velocity < 0 && model.get("z") <= SHALLOW;
  }

  /** Returns the commands that act. */
  given() {
    const { model } = this.pilot;
    return model.vehicle.commands.map((name) => model.get(name));
  }

  /** Returns true while nothing is asked of the vehicle and it does not move, so that time can stand still. */
  isAtRest() {
    const { model } = this.pilot;
    const { variables, inputs, axes } = model.vehicle;
    return (
      !this.begun ||
      (this.test === null &&
        this.replay === null &&
        !(this.held && this.sticks.demands.size > 0) &&
        variables.slice(0, inputs).every(([name, start]) => model.get(name) === start) &&
        axes.every(({ velocity }) => [velocity, `der(${velocity})`].every((name) => Math.abs(model.get(name)) < REST)))
    );
  }

  /** Begins anew with another Euler angle at the start. @param {string} name @param {number} angle */
  beginAt(name, angle) {
    for (const { model } of [this.pilot, this.ghost]) model.set(name, angle);
    this.reset();
  }

  /** Sets inputs of both vehicles by name. @param {Record<string, number>} given */
  set(given) {
    const { model } = this.pilot;
    const changed = Object.entries(given).filter(([name, value]) => model.get(name) !== value);
    if (changed.length === 0) return;
    model.give(given);
    const { vehicle } = model;
    this.ghost.model.give(handedOver(vehicle, this.ghost.model.vehicle, (name) => model.get(name)));
    model.observe();
    this.ghost.model.observe();
    this.commands[this.commands.length - 1] = this.given();
    vehicle.axes.forEach(({ velocity, signs, external }, a) => {
      if (changed.some(([name]) => name in signs || name === external)) {
        this.since[a] = { time: this.time, velocity: model.get(velocity) };
      }
    });
    this.test = null;
    this.begun = true;
  }

  /** Sets tunable coefficients of the pilot's vehicle. Returns false, and keeps the old ones, when they are impossible.
   * @param {Record<string, number>} given */
  tune(given) {
    const isPossible = this.pilot.model.tune(given);
    if (isPossible && this.replay) this.play(this.replay.recording);
    return isPossible;
  }

  /** Takes over the sticks of a vehicle that is held. @param {Sticks} sticks */
  steer(sticks) {
    this.sticks = sticks;
    this.begun ||= sticks.demands.size > 0 || Object.values(sticks.added).some((value) => value !== 0);
  }

  /** Returns the sticks while they steer: not a recording or a step test, whose commands are those of the thrusters. */
  steering() {
    return this.held && !this.replay && !this.test ? this.sticks : null;
  }

  /** True while the ghost is shown with its track, which needs measurements of surge in a recording. */
  get hasGhostTrack() {
    const { axes } = this.pilot.model.vehicle;
    return this.ghostShown && (this.replay?.recording.signals.some(({ axis }) => axes[axis].name === "surge") ?? true);
  }

  /** Moves on by h seconds. Returns false, and returns to the start, when a step overflows. @param {number} h */
  advance(h) {
    if (this.replay) {
      this.seek(this.time + h);
      return true;
    }
    this.surface();
    for (let left = h; left > 0; ) {
      const step = Math.min(left, LONGEST_STEP);
      const sticks = this.steering();
      if (![this.pilot, this.ghost].every((craft) => craft.step(this.time, step, sticks, this.held))) {
        this.reset();
        return false;
      }
      if (this.isBounded && !this.test)
        for (const craft of [this.pilot, this.ghost]) craft.confine(this.bed - RESTING * craft.model.vehicle.size);
      this.time += step;
      left -= step;
      this.keep();
      if (this.times.length > MOST_KEPT)
        for (const list of [this.times, this.commands, this.pilot.states, this.ghost.states])
          list.splice(0, MOST_KEPT / 2);
    }
    return true;
  }

  keep() {
    this.times.push(this.time);
    this.commands.push(this.given());
    this.pilot.keep();
    this.ghost.keep();
  }

  /** Flies a whole recording, and shows its start. The ghost is what was measured. Returns false when a step overflows.
   * @param {Recording} recording */
  play(recording) {
    const { time } = this.replay ? this : { time: 0 };
    this.reset();
    this.replay = new Replay(recording, this);
    if (!this.replay.fly(this)) {
      this.reset();
      return false;
    }
    this.ghostShown = true;
    this.begun = true;
    this.seek(time);
    return true;
  }

  /** Shows a recording at a time. @param {number} time */
  seek(time) {
    const last = this.times[this.times.length - 1];
    this.time = Math.max(0, Math.min(last, time));
    const [n, share] = shareOf(this.times, this.time);
    for (const craft of [this.pilot, this.ghost]) craft.show(n, share);
    this.pilot.model.give(
      Object.fromEntries(this.pilot.model.vehicle.commands.map((name, c) => [name, this.commands[n][c]])),
    );
  }

  /** Ends the recording; the flight goes on from where it is shown, without the loads of the recording. */
  leave() {
    const n = placeOf(this.times, this.time) + 1;
    for (const list of [this.times, this.commands, this.pilot.states, this.ghost.states]) list.splice(n);
    this.pilot.model.turn();
    const { variables, inputs, commands } = this.pilot.model.vehicle;
    const loads = variables.slice(0, inputs).filter(([name]) => !commands.includes(name));
    const own = loads.filter(([name]) => this.replay && name in this.replay.recording.commands);
    this.replay = null;
    this.set(Object.fromEntries(own));
  }

  /** Flies a step test: from rest, with all other inputs at their start values. @param {StepTest} test */
  run(test) {
    const { vehicle } = this.pilot.model;
    const { signs } = vehicle.axes[test.axis];
    const inputs = vehicle.variables.slice(0, vehicle.inputs);
    const given = inputs.map(([name, start]) => [name, name in signs ? signs[name] * test.command : start]);
    this.set(Object.fromEntries(given));
    this.reset();
    this.test = test;
    this.begun = true;
  }
}

/** A recording that is flown again. The pilot's vehicle gets its commands, and the ghost shows the measured motion. */
class Replay {
  /** @param {Recording} recording @param {Flight} flight */
  constructor(recording, { pilot, ghost }) {
    this.recording = recording;
    const { axes } = pilot.model.vehicle;
    /** By signal: predicted minus measured, at the times of the signal. @type {number[][]} */
    this.errors = recording.signals.map(() => []);
    /** By signal: the axis of the ghost, which may be another vehicle, or -1. */
    this.places = recording.signals.map(({ axis }) => ghost.axis(axes[axis].name));
  }

  /** Flies all of it. Returns false when a step overflows. @param {Flight} flight */
  fly(flight) {
    const { times, commands, signals } = this.recording;
    const { pilot, ghost } = flight;
    signals.forEach((signal, n) => {
      for (const [craft, axis] of /** @type {[Craft, number][]} */ ([
        [pilot, signal.axis],
        [ghost, this.places[n]],
      ])) {
        if (axis >= 0) craft.put(axis, signal.isPosition, signal.values[0]);
      }
    });
    for (const craft of [pilot, ghost]) craft.model.turn();
    flight.begin();
    const stops = [...new Set([...times, ...signals.flatMap((signal) => signal.times)])].sort(
      (one, other) => one - other,
    );
    const next = signals.map(() => 0);
    let [row, pieces] = [0, 1];
    for (const stop of stops) {
      while (flight.time < stop) {
        const step = Math.min(LONGEST_STEP, stop - flight.time);
        this.move(ghost, flight.time, step);
        if (!pilot.step(flight.time, step, null)) return false;
        flight.time = step < LONGEST_STEP ? stop : flight.time + step;
        if (flight.time >= PIECE * pieces || this.rests(flight.time, pilot)) {
          this.beginAnew(pilot, flight.time);
          pieces = Math.floor(flight.time / PIECE) + 1;
        }
        if (flight.time - flight.times[flight.times.length - 1] >= stops[stops.length - 1] / MOST_KEPT) flight.keep();
      }
      signals.forEach((signal, n) => {
        if (signal.times[next[n]] !== stop) return;
        this.errors[n].push(pilot.now(signal.axis, signal.isPosition) - signal.values[next[n]]);
        next[n] += 1;
      });
      if (times[row] === stop) {
        flight.set(Object.fromEntries(Object.entries(commands).map(([name, values]) => [name, values[row]])));
        row += 1;
      }
    }
    return true;
  }

  /** Returns the rate of a signal at a time, over a quarter of a second to either side. @param {Signal} signal @param {number} time */
  rate({ times, values }, time) {
    const [from, to] = [Math.max(times[0], time - 0.25), Math.min(times[times.length - 1], time + 0.25)];
    const [one, other] = [from, to].map((t) => between(times, (k) => values[k], t));
    return to > from ? (other - one) / (to - from) : 0;
  }

  /** Returns true while the vehicle was on a deck, or at the surface without commands, of which the equation knows nothing.
   * @param {number} time @param {Craft} pilot */
  rests(time, { model }) {
    const { axes } = model.vehicle;
    const depth = this.recording.signals.find(({ axis, isPosition }) => isPosition && axes[axis].name === "heave");
    if (!depth) return false;
    const [long, little] = STEADY;
    const at = (/** @type {number} */ t) => between(depth.times, (k) => depth.values[k], t);
    const z = at(time);
    const isSteady = [-long, long].some((end) => {
      const isMeasured = time + end >= depth.times[0] && time + end <= depth.times[depth.times.length - 1];
      return isMeasured && [0.25, 0.5, 0.75, 1].every((share) => Math.abs(at(time + share * end) - z) < little);
    });
    if (!isSteady) return false;
    const isIdle = Object.keys(this.recording.commands).every((name) => Math.abs(model.get(name)) < REST);
    return z < -NEAR_SURFACE || (z < NEAR_SURFACE && isIdle);
  }

  /** Puts the pilot's vehicle where it was measured, with the velocity that was measured. @param {Craft} pilot @param {number} time */
  beginAnew(pilot, time) {
    for (const signal of this.recording.signals) {
      const { axis, isPosition, times, values } = signal;
      pilot.put(
        axis,
        isPosition,
        between(times, (k) => values[k], time),
      );
      if (isPosition) pilot.put(axis, false, this.rate(signal, time));
    }
    pilot.model.turn();
    pilot.model.observe();
  }

  /** Moves the ghost from a time on along the measured motion. @param {Craft} ghost @param {number} time @param {number} h */
  move(ghost, time, h) {
    const { model } = ghost;
    this.recording.signals.forEach(({ isPosition, times, values }, n) => {
      const axis = this.places[n];
      if (axis < 0) return;
      const [now, then] = [time, time + h].map((t) => between(times, (k) => values[k], t));
      ghost.put(axis, true, isPosition ? then : ghost.now(axis, true) + now * h);
      ghost.put(axis, false, isPosition ? (then - now) / h : then);
    });
    const [u, v, psi] = ["u", "v", "psi"].map((name) => model.get(name));
    model.turn();
    model.set("x", model.get("x") + h * (u * Math.cos(psi) - v * Math.sin(psi) + model.get("V_N")));
    model.set("y", model.get("y") + h * (u * Math.sin(psi) + v * Math.cos(psi) + model.get("V_E")));
    model.observe();
  }

  /** Returns a sentence about the deviations (root mean square) of the prediction. @param {Vehicle} vehicle */
  verdict(vehicle) {
    const deviations = this.recording.signals.map(({ axis, isPosition }, n) => {
      const own = vehicle.axes[axis];
      const squares = this.errors[n].reduce((sum, error) => sum + error ** 2, 0);
      const error = factorOf(own) * Math.sqrt(squares / Math.max(1, this.errors[n].length));
      return `${own.name} ${error.toPrecision(2)} ${unitOf(own, isPosition)}`;
    });
    const left = this.recording.left;
    return `The end of the recording. The prediction, which begins anew every ${PIECE} s, is off by (root mean square): ${deviations.join(", ")}.${left ? ` Rows that could not be used: ${left}.` : ""}`;
  }
}

/**
 * Returns the inputs of one vehicle for another. Commands of other names follow from the demands along the axes.
 * @param {Vehicle} from @param {Vehicle} to @param {(name: string) => number} get
 * @returns {Record<string, number>}
 */
function handedOver(from, to, get) {
  /** @type {Record<string, number>} */
  const given = {};
  for (const [name] of from.variables.slice(0, from.inputs)) given[name] = get(name);
  if (to.commands.every((name) => from.commands.includes(name))) return given;
  /** @param {number[]} values */
  const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;
  const demands = new Map(
    from.axes.map(({ name, signs }) => {
      const driving = Object.entries(signs).map(([command, sign]) => sign * get(command));
      if (!MOVES.includes(name)) return [name, mean(driving)];
      const force = mean(driving.map((command) => command * Math.abs(command))); // see turningAbout
      return [name, Math.sign(force) * Math.sqrt(Math.abs(force))];
    }),
  );
  return { ...given, ...commandsOf(to, demands) };
}

/** The axes along which a vehicle moves. It turns about the others. */
const MOVES = ["surge", "sway", "heave"];
const ROOM = 0.25; // of the largest command, which a move leaves to a turn

/**
 * Returns the command of a move about which a pair of thrusters turns, one with a turn more and one with a turn less.
 *
 * Their force is the same as without the turn, if thrust is quadratic in the command.
 * @param {number} move @param {number} turn
 */
function turningAbout(move, turn) {
  if (2 * turn ** 2 < move ** 2) return Math.sign(move) * Math.sqrt(move ** 2 - turn ** 2); // both push along the move
  return (move * Math.abs(move)) / (2 * Math.abs(turn) || 1);
}

/**
 * Returns the commands for demands along axes. Each axis drives its commands by their shares.
 *
 * A turn is a difference about the commands of the moves, whose force it leaves: the difference shrinks where a command
 * would become larger than `most`. Saturation of one side would change the force, and with it the speed.
 * @param {Vehicle} vehicle @param {Map<string, number>} demands @param {number} most @returns {Record<string, number>}
 */
function commandsOf({ commands, axes }, demands, most = 1) {
  const [turns, moves] = [false, true].map((areMoves) =>
    commands.map((command) =>
      axes
        .filter(({ name }) => MOVES.includes(name) === areMoves)
        .reduce((sum, { name, shares }) => sum + (shares[command] ?? 0) * (demands.get(name) ?? 0), 0),
    ),
  );
  const room = Math.min(ROOM * most, Math.max(0, ...turns.map(Math.abs)));
  const excess = Math.max(1, ...moves.map((move, n) => Math.abs(move) / (turns[n] ? most - room : most)));
  const reduced = moves.map((move) => move / excess);
  const part = Math.min(
    1,
    ...turns.map((turn, n) => (turn ? (most - reduced[n] * Math.sign(turn)) / Math.abs(turn) : 1)),
  );
  const given = reduced.map((move, n) => turningAbout(move, part * turns[n]) + part * turns[n]);
  return Object.fromEntries(commands.map((command, n) => [command, within(given[n], most)]));
}

/** Returns true for a command that is larger than those for which the model was identified. @param {Vehicle} vehicle @param {number} command */
function isBeyond(vehicle, command) {
  return Math.abs(command) > vehicle.tested + 1e-9;
}
