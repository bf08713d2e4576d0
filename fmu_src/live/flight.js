// A flight: the pilot's vehicle and a ghost under the same commands, with their tracks.

const LONGEST_STEP = 0.05; // s, so that curves and the track are smooth at any speed
const MOST_KEPT = 20000;
const REST = 1e-3; // m/s, rad/s, m/s2, rad/s2; a vehicle that moves less is at rest

/** A vehicle with its track and the history of its velocities and positions. */
class Craft {
  /** @param {Model} model */
  constructor(model) {
    this.model = model;
    /** What holds it level. @type {Hold | null} */
    this.hold = null;
    /** The points of the track: north, east and depth in turn. @type {number[]} */
    this.track = [];
    /** The velocities by axis, at the times of the flight. @type {number[][]} */
    this.velocities = model.vehicle.axes.map(() => []);
    /** Depth, heading, or the distance along the axis. @type {number[][]} */
    this.positions = model.vehicle.axes.map(() => []);
    /** The distance covered along each axis. */
    this.distances = model.vehicle.axes.map(() => 0);
  }

  reset() {
    this.model.reset();
    this.track = [];
    this.velocities = this.velocities.map(() => []);
    this.positions = this.positions.map(() => []);
    this.distances = this.distances.map(() => 0);
    this.keep();
  }

  /** Steps h seconds from a time on, under the commands that are set or by sticks. Returns false when the step fails.
   * @param {number} time @param {number} h @param {Sticks | null} sticks */
  step(time, h, sticks) {
    const { model, distances } = this;
    const { axes } = model.vehicle;
    const before = axes.map(({ velocity }) => model.get(velocity));
    if (sticks && model.has("phi")) {
      if (this.hold?.until !== time) this.hold = new Hold(model, time);
      if (!this.hold.step(h, sticks)) return false;
    } else {
      if (sticks) model.give(commandsOf(model.vehicle, sticks.demands));
      if (!model.step(h)) return false;
    }
    axes.forEach(({ velocity }, a) => {
      distances[a] += (h / 2) * (before[a] + model.get(velocity));
    });
    return true;
  }

  /** Adds the current velocities and positions to the history. */
  keep() {
    const { model, track } = this;
    model.vehicle.axes.forEach(({ velocity }, a) => {
      this.velocities[a].push(model.get(velocity));
      this.positions[a].push(this.position(a));
    });
    const here = positionOf(model);
    const moved = plus(here, [-1, /** @type {Vector} */ (track.slice(-3))]);
    if (track.length === 0 || Math.hypot(...moved) > model.vehicle.size / 8) track.push(...here);
    if (track.length > 3 * MOST_KEPT) track.splice(0, 3 * (MOST_KEPT / 2));
  }

  /** Returns the number of an axis, or -1 if the vehicle does not have it. @param {string} name */
  axis(name) {
    return this.model.vehicle.axes.findIndex((axis) => axis.name === name);
  }

  /** Returns depth, heading, or the distance along an axis. @param {number} a */
  position(a) {
    const { position } = this.model.vehicle.axes[a];
    return position ? this.model.get(position) : this.distances[a];
  }

  /** Removes the oldest n entries of the history. @param {number} n */
  forget(n) {
    for (const trace of [...this.velocities, ...this.positions]) trace.splice(0, n);
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
    /** @type {Playback | null} */
    this.playback = null;
    /** True while the sticks steer a vehicle that is held level. */
    this.isHeld = pilot.has("phi");
    /** @type {Sticks} */
    this.sticks = { demands: new Map(), added: {} };
    /** True after the first input. Until then, time stands still. */
    this.begun = false;
    this.reset();
  }

  /** Returns to the start. Commands and loads stay as they are. */
  reset() {
    this.time = 0;
    this.times = [0];
    this.commands = [this.given()];
    this.test = null;
    this.playback = null;
    this.pilot.reset();
    this.ghost.reset();
    for (const since of this.since) Object.assign(since, { time: 0, velocity: 0 });
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
        this.playback === null &&
        !(this.isHeld && this.sticks.demands.size > 0) &&
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
    const handed = handedOver(vehicle, this.ghost.model.vehicle, (name) => model.get(name));
    this.ghost.model.give(handed);
    this.followed();
    this.commands[this.commands.length - 1] = this.given();
    vehicle.axes.forEach(({ velocity, signs, external }, a) => {
      if (changed.some(([name]) => name in signs || name === external)) {
        this.since[a] = { time: this.time, velocity: model.get(velocity) };
      }
    });
    this.test = null;
    this.begun = true;
  }

  /** Sets α and β of the pilot's vehicle. @param {Record<string, number>} given */
  tune(given) {
    const { model } = this.pilot;
    model.give(given);
    model.tune();
  }

  /** Takes over the sticks of a vehicle that is held level. @param {Sticks} sticks */
  steer(sticks) {
    this.sticks = sticks;
    this.begun ||= sticks.demands.size > 0 || Object.values(sticks.added).some((value) => value !== 0);
  }

  /** Returns the sticks while they steer: not a recording or a step test, whose commands are those of the thrusters. */
  steering() {
    return this.isHeld && !this.playback && !this.test ? this.sticks : null;
  }

  followed() {
    this.pilot.model.observe();
    this.ghost.model.observe();
  }

  /** Steps h seconds. Returns false, and returns to the start, when a step overflows. @param {number} h */
  advance(h) {
    let left = h;
    while (left > 0) {
      let step = Math.min(left, LONGEST_STEP);
      if (this.playback) {
        const next = this.playback.next();
        if (next === null) break;
        step = Math.min(step, next - this.time);
        if (step <= 0) {
          this.playback.arrive(this);
          continue;
        }
      }
      const sticks = this.steering();
      const followed = this.playback ? this.playback.move(this.ghost, step) : this.ghost.step(this.time, step, sticks);
      if (!this.pilot.step(this.time, step, sticks) || !followed) {
        this.reset();
        return false;
      }
      this.time += step;
      left -= step;
      this.keep();
    }
    this.followed();
    return true;
  }

  keep() {
    this.times.push(this.time);
    this.commands.push(this.given());
    this.pilot.keep();
    this.ghost.keep();
    if (this.times.length > MOST_KEPT) {
      const n = MOST_KEPT / 2;
      this.times.splice(0, n);
      this.commands.splice(0, n);
      this.pilot.forget(n);
      this.ghost.forget(n);
    }
  }

  /** Flies a recording from its start. The ghost shows the measured motion. @param {Recording} recording */
  play(recording) {
    this.reset();
    this.playback = new Playback(recording, this);
    this.ghostShown = true;
    this.begun = true;
  }

  /** Flies a published step test: from rest, with all other inputs at their start values. @param {StepTest} test */
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
  const demands = new Map(
    from.axes.map(({ name, signs }) => {
      const driving = Object.entries(signs);
      return [name, driving.reduce((sum, [command, sign]) => sum + (sign * get(command)) / driving.length, 0)];
    }),
  );
  return { ...given, ...commandsOf(to, demands) };
}

/**
 * Returns the commands for demands along axes. Each axis drives its commands by their shares.
 * @param {Vehicle} vehicle @param {Map<string, number>} demands @returns {Record<string, number>}
 */
function commandsOf(vehicle, demands) {
  /** @type {Record<string, number>} */
  const commands = Object.fromEntries(vehicle.commands.map((name) => [name, 0]));
  for (const { name, shares } of vehicle.axes) {
    for (const [command, share] of Object.entries(shares)) commands[command] += share * (demands.get(name) ?? 0);
  }
  for (const name of vehicle.commands) commands[name] = Math.max(-1, Math.min(1, commands[name]));
  return commands;
}
