// How keys and sticks steer a vehicle that an autopilot holds. Its law is that of fmu_src/autopilot/autopilot.c, in the vehicle's module.

const [STICK, RATE, PLACE] = [0, 1, 2]; // the modes of an axis: its aim is a share of the largest force, a rate, or a place or an angle
const HELD_AXES = ["surge", "sway", "heave", "roll", "pitch", "yaw"]; // in the order of the law
const LEAN = Math.PI / 4; // rad, by a full stick of roll or pitch
const COAST = 0.25; // s, for which a turn is braked before the heading is held
const SLOW = 0.05; // m/s; a slower vehicle holds its depth

/** The demands along the axes, from -1 to 1, the commands that the sliders add, and the largest command that the demands give.
 * @typedef {{demands: Map<string, number>, added: Record<string, number>, most?: number}} Sticks */

/** It holds what was when it was made. */
class Helm {
  /** @param {Model} model @param {Law} law @param {number} time */
  constructor(model, law, time) {
    this.model = model;
    this.law = law;
    /** The time of the flight up to which it has held. */
    this.until = time;
    this.coast = 0;
    this.dives = false;
    this.depth = model.get("z");
    this.heading = model.get("psi");
    model.take(law);
  }

  /** Steps h seconds. Returns false when a step fails. @param {number} h @param {Sticks} sticks */
  step(h, { demands, added, most = 1 }) {
    const modes = HELD_AXES.map((name) => this.mode(name, demands.get(name) ?? 0, h));
    this.until += h;
    return this.model.hold(h, Math.ceil(h * this.law.rate - 1e-9), modes, most, added);
  }

  /** Returns the mode of an axis and its aim. @param {string} name @param {number} stick @param {number} h @returns {[number, number]} */
  mode(name, stick, h) {
    const { model, law } = this;
    if (!law.held.includes(name)) return [STICK, stick];
    if (name === "heave") {
      this.dives = stick !== 0 || (this.dives && Math.abs(model.get("der(z)")) > SLOW);
      if (stick) return [STICK, stick];
      if (this.dives) this.depth = model.get("z");
      return this.dives ? [RATE, 0] : [PLACE, this.depth];
    }
    if (name !== "yaw") return [PLACE, stick * LEAN];
    this.coast = stick ? COAST : Math.max(0, this.coast - h);
    if (this.coast > 0) this.heading = model.get("psi");
    if (this.coast > 0) return law.turn ? [RATE, stick * law.turn] : [STICK, stick];
    return [PLACE, this.heading];
  }
}
