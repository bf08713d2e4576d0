"use strict";
// The vehicle of a page: the module that a build compiled from the C of the FMU, by the names of the FMU's variables.

/**
 * An axis: names of its velocity, load and tuning; the commands that drive it with their signs; the position that follows.
 * @typedef {{name: string, velocity: string, unit: string, external: string, position: string | null, positionUnit: string,
 *   signs: Record<string, number>}} Axis
 */
/**
 * A thruster: the variable of its force, its place (x, y) and direction (x, y, z) in the body frame, its strongest force in N.
 * @typedef {{force: string, at: [number, number], along: [number, number, number], most: number}} Thruster
 */
/**
 * A published step test: a command along an axis from rest, with what was measured of it.
 * @typedef {{axis: number, command: number, V: number | null, Tau: number | null}} StepTest
 */
/**
 * What a page is told of a vehicle. Variables stand by their place among all variables, with their start values; the module is deflated, in Base64.
 * @typedef {{name: string, module: string, variables: [string, number][], inputs: number, states: number, commands: string[], mixed: boolean,
 *   axes: Axis[], thrusters: Thruster[], tunable: string[], tests: StepTest[], size: number}} Vehicle
 */
/**
 * What fmu_src/live/module.c exports.
 * @typedef {{memory: WebAssembly.Memory, variables: () => number, marks: () => number, tune: () => void, step: (h: number) => number,
 *   observe: () => void}} Exports
 */

class Model {
  /** @param {Vehicle} vehicle @param {WebAssembly.Module} module */
  constructor(vehicle, module) {
    const instance = new WebAssembly.Instance(module, { Math: /** @type {any} */ (Math) });
    this.vehicle = vehicle;
    this.module = module;
    this.exports = /** @type {Exports} */ (/** @type {unknown} */ (instance.exports));
    const { memory, variables, marks } = this.exports;
    /** By place. */
    this.values = new Float64Array(memory.buffer, variables(), vehicle.variables.length);
    /** V_ss and Tau of each axis. */
    this.marks = new Float64Array(memory.buffer, marks(), 2 * vehicle.axes.length);
    this.places = new Map(vehicle.variables.map(([name], place) => [name, place]));
    this.values.set(vehicle.variables.map(([, start]) => start));
    this.tune();
  }

  /** @param {Vehicle} vehicle */
  static async load(vehicle) {
    const packed = Uint8Array.from(atob(vehicle.module), (c) => c.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Model(vehicle, await WebAssembly.compile(await new Response(stream).arrayBuffer()));
  }

  /** Another of the same vehicle, with the coefficients of its file. */
  twin() {
    return new Model(this.vehicle, this.module);
  }

  /** @param {string} name */
  has(name) {
    return this.places.has(name);
  }

  /** A variable; 0 where the vehicle does not have it. @param {string} name */
  get(name) {
    const place = this.places.get(name);
    return place === undefined ? 0 : this.values[place];
  }

  /** An input or a state, where the vehicle has it. @param {string} name @param {number} value */
  set(name, value) {
    const place = this.places.get(name);
    if (place !== undefined) this.values[place] = value;
  }

  /** Takes over coefficients that were set. */
  tune() {
    this.exports.tune();
    this.exports.observe();
  }

  /** All states as at the start. */
  reset() {
    const { inputs, states, variables } = this.vehicle;
    for (let i = inputs; i < inputs + states; i++) this.values[i] = variables[i][1];
    this.exports.observe();
  }

  /** h seconds with the inputs held; false, with all as it was, where that overflows. @param {number} h */
  step(h) {
    return this.exports.step(h) !== 0;
  }

  /** Has what is calculated follow. */
  observe() {
    this.exports.observe();
  }
}
