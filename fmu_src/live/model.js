"use strict";
// The vehicle of a page: the module that a build has compiled from the FMU's C, with the names of the FMU's variables.

/**
 * An axis: the names of its velocity, load and position, their units, the commands that drive it with their signs, and the letters
 * of the keys that drive it in its positive and in its negative direction, if any command does. `shares` are the commands by which the keys drive it.
 * `quantities` are those of its motion that a recording may have.
 * @typedef {{name: string, velocity: string, unit: string, external: string, position: string | null, positionUnit: string, quantities: Quantity[],
 *   signs: Record<string, number>, shares: Record<string, number>, keys: string}} Axis
 */
/**
 * A quantity of rov_fmu/tank/catalogue.py: the names of its column, that in a recording of one axis, and those that need a known unit;
 * how many of each unit make one SI unit; and the largest number.
 * @typedef {{name: string, short: string[], also: string[], units: Record<string, number>, isPressure: boolean, isPosition: boolean, wraps: boolean,
 *   largest: number}} Quantity
 */
/**
 * A column of commands of a recording: its name, others that need a known unit, and its kind, of which a recording has one. `gains` are
 * those of the vehicle's commands in it. `shares` are the commands that give it best.
 * @typedef {{name: string, also: string[], kind: string, gains: Record<string, number>, shares: Record<string, number>}} CommandColumn
 */
/**
 * The rules by which times of day are read, from rov_fmu/tank/readers/times_of_day.py: the pattern of one, of what one in any form contains,
 * and of what is between it and a date; the forms of dates; what to write in place of other forms; the number of first rows that tell which
 * columns are these; and the words in their headers.
 * @typedef {{pattern: string, like: string, between: string, days: string[], how: string, firstRows: number, titles: string[],
 *   dates: string[]}} ClockRules
 */
/**
 * The rules by which tables are read, from rov_fmu/tank/readers/tables.py: the patterns of a number, of a cell of a row, of a number
 * with a comma in quotes, and of one whose comma may separate thousands; the number of lines among which the header is; the units of times and commands, and how many of each make 1 s or full command; the pulses;
 * the units of forces; other names of headers; units of commands with the largest number that shows a slip and what is wrong then; the
 * largest share of rows out of order; the time after which a command begins late, s; what shows that a clock began anew; the samples that a
 * preferred quantity has at least; and the pressures, in Pa, by which a barometer inside the hull and another unit are recognised.
 * @typedef {{number: string, value: string, quoted: string, thousands: string, mostBefore: number,
 *   times: Record<string, number>, clock: ClockRules, fractions: Record<string, number>,
 *   pulses: {units: string[], neutral: number, span: number, none: number[]}, forces: string[],
 *   renamed: Record<string, string>,
 *   slips: [string[], number, string][], mostUnordered: number, late: number, leastAfter: number, again: number, leastSamples: number,
 *   pressures: {atmosphere: number, gradient: number, hull: [number, number], least: number}}} Rules
 */
/**
 * A thruster: the variable of its force, the commands that drive it, its label, its place and direction in the body frame, its strongest
 * force in N.
 * @typedef {{force: string, commands: string[], label: string, at: Vector, along: Vector, most: number}} Thruster
 */
/**
 * A step test: a command along an axis from rest.
 * @typedef {{axis: number, command: number}} StepTest
 */
/**
 * An autopilot: its samples in a second, the rate of yaw by a full stick (rad/s, 0: the stick is a force), the axes that it holds, what the
 * page says about it, and its numbers as fmu_src/live/module.c takes them.
 * @typedef {{name: string, rate: number, turn: number, held: string[], words: string, numbers: number[]}} Law
 */
/**
 * The data of a vehicle in a page. Variables are listed by their places, with their start values. The module is deflated, in Base64.
 * Commands are fractions in the page; `tested` is the largest for which the model was identified, and `pulse` has the pulse widths of full reverse, neutral and full thrust if the model takes these.
 * `sensors` are the places of what an autopilot measures.
 * @typedef {{identifier: string, name: string, module: string, variables: [string, number][], inputs: number, states: number, commands: string[],
 *   columns: CommandColumn[], csv: Rules, pulse: [number, number, number] | null, tested: number, axes: Axis[], thrusters: Thruster[], fins: {at: Vector, along: Vector}[],
 *   sensors: number[], laws: Law[], unheld: string, tests: StepTest[], size: number}} Vehicle
 */
/**
 * The exports of fmu_src/live/module.c.
 * @typedef {{memory: WebAssembly.Memory, variables: () => number, marks: () => number, tune: () => number, begin: () => void,
 *   step: (h: number) => number, observe: () => void, law: () => number, room: () => number, asked: () => number, release: () => void,
 *   hold: (h: number, samples: number) => number}} Exports
 */

class Model {
  /** @param {Vehicle} vehicle @param {WebAssembly.Module} module */
  constructor(vehicle, module) {
    const instance = new WebAssembly.Instance(module, { Math: /** @type {any} */ (Math) });
    this.vehicle = vehicle;
    this.module = module;
    this.exports = /** @type {Exports} */ (/** @type {unknown} */ (instance.exports));
    const { memory, variables, marks, law, room, asked } = this.exports;
    /** The values of the variables, by their places. */
    this.values = new Float64Array(memory.buffer, variables(), vehicle.variables.length);
    /** V_ss and Tau of each axis. */
    this.marks = new Float64Array(memory.buffer, marks(), 2 * vehicle.axes.length);
    this.law = new Float64Array(memory.buffer, law(), room());
    /** For the autopilot: the places of the sensors, the modes and the aims of the axes, the largest output, and what is added to the commands. */
    this.asked = new Float64Array(memory.buffer, asked(), vehicle.sensors.length + 13 + vehicle.commands.length);
    this.places = new Map(vehicle.variables.map(([name], place) => [name, place]));
    /** The commands as fractions, if the model takes pulse widths. @type {Map<string, number>} */
    this.fractions = new Map();
    for (const [name, start] of vehicle.variables) this.set(name, start);
    this.exports.begin();
    this.tune({});
  }

  /** @param {Vehicle} vehicle */
  static async load(vehicle) {
    const packed = Uint8Array.from(atob(vehicle.module), (c) => c.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Model(vehicle, await WebAssembly.compile(await new Response(stream).arrayBuffer()));
  }

  /** Returns another instance of the vehicle, with the coefficients of its file. */
  twin() {
    return new Model(this.vehicle, this.module);
  }

  /** @param {string} name */
  has(name) {
    return this.places.has(name);
  }

  /** Returns the start value of a variable, or 0 if the vehicle does not have it. @param {string} name */
  start(name) {
    return this.vehicle.variables[this.places.get(name) ?? -1]?.[1] ?? 0;
  }

  /** Returns the value of a variable, or 0 if the vehicle does not have it. @param {string} name */
  get(name) {
    const place = this.places.get(name);
    return this.fractions.get(name) ?? (place === undefined ? 0 : this.values[place]);
  }

  /** Sets a variable if the vehicle has it. A command saturates at full thrust, as in the FMU. @param {string} name @param {number} value */
  set(name, value) {
    const place = this.places.get(name);
    if (place === undefined) return;
    const { pulse, commands } = this.vehicle;
    const isCommand = commands.includes(name);
    const held = isCommand ? Math.max(-1, Math.min(1, value)) : value;
    this.values[place] = held;
    if (isCommand && pulse) {
      const [low, neutral, high] = pulse;
      this.fractions.set(name, held);
      this.values[place] = neutral + held * (held > 0 ? high - neutral : neutral - low);
    }
  }

  /** Sets variables by name. @param {Record<string, number>} given */
  give(given) {
    for (const [name, value] of Object.entries(given)) this.set(name, value);
  }

  /** Sets coefficients. Returns false, and keeps the old ones, when the mass matrix would not be positive definite.
   * @param {Record<string, number>} given @returns {boolean} */
  tune(given) {
    const old = Object.fromEntries(Object.keys(given).map((name) => [name, this.get(name)]));
    this.give(given);
    const isPossible = this.exports.tune() !== 0;
    if (!isPossible) this.give(old);
    this.exports.observe();
    return isPossible;
  }

  /** Returns the autopilot of a name, if the vehicle has it. @param {string} name */
  lawOf(name) {
    return this.vehicle.laws.find((law) => law.name === name);
  }

  /** Lets an autopilot begin. @param {Law} law */
  take({ numbers }) {
    this.law.set(numbers);
    this.asked.set(this.vehicle.sensors);
    this.exports.release();
  }

  /** Steps h seconds with the autopilot, which samples so many times. Returns false when a step fails. @param {number} h @param {number} samples
   * @param {[number, number][]} modes Of the axes, with their aims. @param {number} most @param {Record<string, number>} added */
  hold(h, samples, modes, most, added) {
    const { sensors, commands, pulse } = this.vehicle;
    const aims = [...modes.map(([mode]) => mode), ...modes.map(([, aim]) => aim)];
    this.asked.set([...aims, most, ...commands.map((name) => added[name] ?? 0)], sensors.length);
    const isDone = this.exports.hold(h, samples) !== 0;
    const [low, neutral, high] = pulse ?? [0, 0, 0];
    for (const name of pulse ? commands : []) {
      const off = this.values[/** @type {number} */ (this.places.get(name))] - neutral;
      this.fractions.set(name, off / (off > 0 ? high - neutral : neutral - low));
    }
    return isDone;
  }

  /** Sets all states to their start values. */
  reset() {
    const { inputs, states, variables } = this.vehicle;
    for (let i = inputs; i < inputs + states; i++) this.values[i] = variables[i][1];
    this.exports.begin();
    this.exports.observe();
  }

  /** Sets the quaternion to that of the Euler angles, which may have been set, if the vehicle has an attitude. */
  turn() {
    const angles = ["phi", "theta", "psi"].filter((name) => this.has(`${name}_0`));
    const starts = angles.map((name) => this.get(`${name}_0`));
    for (const name of angles) this.set(`${name}_0`, this.get(name));
    this.exports.begin();
    angles.forEach((name, n) => {
      this.set(`${name}_0`, starts[n]);
    });
  }

  /** Steps h seconds with the inputs held. Returns false, and changes nothing, when that overflows. @param {number} h */
  step(h) {
    return this.exports.step(h) !== 0;
  }

  /** Updates the calculated variables. */
  observe() {
    this.exports.observe();
  }
}
