// What holds a vehicle level: the depth, heading and attitude hold of ArduSub's modes stabilise and depth hold, with its default gains
// and, for a BlueROV2 Heavy, its motor matrix. verification/references/autopilot/ardusub.py is the same law in Python and names its sources.

const HOLD_RATE = 400; // Hz, of ArduSub's main loop
const STICK = 0.8; // s, the time constant with which a stick moves: a jump to full thrust ahead would turn the Heavy over
const LEAN = Math.PI / 4; // rad, by a full stick of roll or pitch
const TURNING = (3.375 * Math.PI) / 4; // rad/s, by a full stick of yaw
const COAST = 0.25; // s, for which a turn is braked before the heading is held
const SLOW = 0.05; // m/s; a slower vehicle holds its depth

/** The demands along the axes, from -1 to 1, the commands that the sliders add, and the largest command that the demands give.
 * @typedef {{demands: Map<string, number>, added: Record<string, number>, most?: number}} Sticks */

/** Returns the part of a change that passes a low-pass filter of first order. @param {number} frequency In Hz, 0 for none. @param {number} h */
const passed = (frequency, h) => (frequency ? h / (h + 0.5 / Math.PI / frequency) : 1);

/** @param {number} x @param {number} most */
const within = (x, most) => Math.max(-most, Math.min(most, x));

/** Returns the rate that removes an error: proportional at first, then with a deceleration of at most `most`.
 * @param {number} error @param {number} p @param {number} most */
function rateOf(error, p, most) {
  const linear = most / p ** 2;
  return Math.abs(error) <= linear
    ? p * error
    : Math.sign(error) * Math.sqrt(2 * most * (Math.abs(error) - 0.5 * linear));
}

/** ArduPilot's AC_PID. The filters of target, error and derivative are in Hz, 0 for none. */
class Pid {
  /** @param {number} p @param {number} i @param {number} d @param {number} most @param {number[]} filters */
  constructor(p, i, d, most, filters) {
    this.gains = [p, i, d];
    this.most = most;
    this.filters = filters;
    this.integral = 0;
    this.slope = 0;
    /** The filtered target and error of the last step. @type {[number, number] | null} */
    this.last = null;
  }

  /** @param {number} target @param {number} measured @param {number} h */
  step(target, measured, h) {
    const [p, i, d] = this.gains;
    const [ofTarget, ofError, ofSlope] = this.filters.map((frequency) => passed(frequency, h));
    const [wanted, before] = this.last ?? [target, target - measured];
    const now = wanted + ofTarget * (target - wanted);
    const error = before + ofError * (now - measured - before);
    this.slope += ofSlope * ((error - before) / h - this.slope);
    this.integral = within(this.integral + i * error * h, this.most);
    this.last = [now, error];
    return p * error + this.integral + d * this.slope;
  }
}

/** It holds what was when it was made. */
class Hold {
  /** @param {Model} model @param {number} time */
  constructor(model, time) {
    this.model = model;
    /** The time of the flight up to which it has held. */
    this.until = time;
    this.turns = [30, 30].map((f) => new Pid(0.135, 0.09, 0.0036, 0.444, [f, 0, f]));
    this.yaw = new Pid(0.18, 0.018, 0, 0.222, [5, 0, 5]);
    this.climb = new Pid(8, 0, 0, 1000, [0, 5, 0]); // from cm/s to cm/s2
    this.rise = new Pid(0.5, 0.1, 0, 100, [0, 20, 0]); // from cm/s2; 1000 is full throttle
    this.throttle = 0;
    this.ahead = 0;
    this.aside = 0;
    this.coast = 0;
    this.dives = false;
    this.depth = this.model.get("z");
    this.heading = this.model.get("psi");
  }

  /** Steps h seconds. Returns false when a step fails. @param {number} h @param {Sticks} sticks */
  step(h, sticks) {
    const count = Math.ceil(h * HOLD_RATE - 1e-9);
    for (let n = 0; n < count; n++) {
      this.model.observe();
      this.model.give(this.commands(h / count, sticks));
      if (!this.model.step(h / count)) return false;
    }
    this.until += h;
    return true;
  }

  /** Returns the commands for the next h seconds. @param {number} h @param {Sticks} sticks @returns {Record<string, number>} */
  commands(h, { demands, added, most: limit = 1 }) {
    const { axes, commands: names } = this.model.vehicle;
    const stick = (/** @type {string} */ name) => demands.get(name) ?? 0;
    const [phi, theta, psi, p, q, r] = ["phi", "theta", "psi", "p", "q", "r"].map((name) => this.model.get(name));
    this.ahead += (h / (h + STICK)) * (stick("surge") - this.ahead);
    this.aside += (h / (h + STICK)) * (stick("sway") - this.aside);
    const [roll, pitch] = [
      [stick("roll"), phi, p],
      [stick("pitch"), theta, q],
    ].map(([lean, angle, rate], n) => this.turns[n].step(6 * (lean * LEAN - angle), rate, h));
    const yaw = this.yaw.step(this.turning(stick("yaw"), psi, h), r, h);
    const throttle = this.lift(stick("heave"), h);
    /** What levels may use all thrust. @type {[number, Record<string, number>][]} */
    const groups = [
      [1, { roll, pitch, heave: -throttle }],
      [limit, { yaw, surge: this.ahead, sway: this.aside }],
    ];
    const [turns, moves] = groups.map(([largest, asked]) => {
      const sums = names.map((name) =>
        axes.reduce((sum, axis) => sum + (axis.held[name] ?? 0) * (asked[axis.name] ?? 0), 0),
      );
      const excess = Math.max(1, ...sums.map((sum) => Math.abs(sum) / largest));
      return sums.map((sum) => sum / excess);
    });
    return Object.fromEntries(
      names.map((name, n) => [name, within(within(turns[n] + moves[n], 1) + (added[name] ?? 0), 1)]),
    );
  }

  /** Returns the rate of yaw: that of the stick, and without one the rate that returns to the heading. @param {number} stick
   * @param {number} psi @param {number} h */
  turning(stick, psi, h) {
    this.coast = stick ? COAST : Math.max(0, this.coast - h);
    if (this.coast > 0) {
      this.heading = psi;
      return stick * TURNING;
    }
    const most = (2 * Math.PI) / 3;
    const error = this.heading - psi;
    return rateOf(within(error - TURN * Math.round(error / TURN), most / 6), 6, most);
  }

  /** Returns the throttle, upward positive: that of the stick, and without one what holds the depth. @param {number} stick Down.
   * @param {number} h */
  lift(stick, h) {
    const value = (/** @type {string} */ name) => this.model.get(name);
    const down = rotationOf(this.model).map((direction) => direction[2]);
    const [u, v, w, p, q, r] = ["u", "v", "w", "p", "q", "r"].map(value);
    const spun = cross([p, q, r], [u, v, w]);
    const fall = ["der(u)", "der(v)", "der(w)"].reduce((sum, name, n) => sum + down[n] * (value(name) + spun[n]), 0);
    const sinks = value("der(z)");
    this.dives = stick !== 0 || (this.dives && Math.abs(sinks) > SLOW);
    if (this.dives) this.depth = value("z");
    const rate = rateOf(100 * (value("z") - this.depth), 3, 100);
    const asked = stick ? -stick : 2e-3 * this.rise.step(this.climb.step(rate, -100 * sinks, h), -100 * fall, h);
    this.throttle += passed(2, h) * (within(asked, 1) - this.throttle);
    return this.throttle;
  }
}
