// A recording of tank tests (docs/identify.md, "Logs") that is flown again, to compare the prediction with the measurements.

const MOST_BYTES = 20e6;
const MOST_ROWS = 200000;
const MOST_BACK = 0.2; // of the rows: with more of them out of order the time begins anew
const MOST_POSITION = 1e7; // m, rad
const MOST_VELOCITY = 1e3; // m/s, rad/s
/** The factors from units to SI, by the quantity of a column. @type {Record<string, Record<string, number>>} */
const FACTORS = {
  s: { s: 1, ms: 0.001 },
  command: { "%": 0.01, 1: 1 },
  m: { m: 1, cm: 0.01, mm: 0.001 },
  rad: { rad: 1, deg: Math.PI / 180 },
};

/** The end of a message about a missing column. */
const RENAMING = "if another header stands for it, rename that one: this page does not read [columns] of rov.toml";

/** The error of a file that is not a recording of this vehicle. Its text says why. */
class Unreadable extends Error {}

/**
 * The measurements of an axis: positions or velocities. They are NaN in rows without a measurement.
 * @typedef {{axis: number, isPosition: boolean, values: number[]}} Signal
 */
/**
 * A recording: times in s, commands by row and name, signals, and the number of rows that were left out.
 * @typedef {{name: string, times: number[], commands: Record<string, number>[], signals: Signal[], left: number}} Recording
 */

/** Reads a recording. @param {string} text @param {string} name The file's name. @param {Vehicle} vehicle @returns {Recording} */
function readRecording(text, name, vehicle) {
  const lines = text
    .replace(/^\uFEFF/, "")
    .split(/\r\n|\r|\n/)
    .filter((line) => line.trim() !== "");
  if (lines.length < 3) throw new Unreadable("it has less than two rows below its header");
  if (lines.length > MOST_ROWS) throw new Unreadable(`it has more than ${MOST_ROWS} rows`);
  const separator = [";", "\t", ","].find((mark) => lines[0].includes(mark));
  if (separator === undefined) throw new Unreadable("its first line is no header of columns");
  const headers = lines[0].split(separator).map((cell) => cell.trim().replace(/^"(.*)"$/, "$1"));
  /** @param {string} cell */
  const number = (cell) => {
    const plain = cell.trim().replace(/^"(.*)"$/, "$1");
    return plain === "" ? Number.NaN : Number(separator === "," ? plain : plain.replace(",", "."));
  };
  const columns = headers.map((header) => columnOf(header, name, vehicle));
  const time = columns.findIndex((column) => column?.what === "time");
  if (time < 0) throw new Unreadable(`it has no column “time [s]”; ${RENAMING}`);
  const commanding = columns.flatMap((column, n) => (column?.what === "command" ? [n] : []));
  if (commanding.length === 0) {
    throw new Unreadable(`it has no column of a command, such as “${vehicle.commands[0]} [%]”; ${RENAMING}`);
  }
  const measuring = columns.flatMap((column, n) => (column?.what === "signal" ? [n] : []));
  const rows = lines
    .slice(1)
    .map((line) => line.split(separator))
    .filter((cells) => cells.slice(headers.length).every((cell) => cell.trim() === ""))
    .map((cells) => columns.map((column, n) => (column ? column.convert(number(cells[n] ?? "")) : Number.NaN)))
    .filter((row) => Number.isFinite(row[time]) && commanding.every((n) => Number.isFinite(row[n])));
  if (rows.length < 2) throw new Unreadable("no two of its rows have a time and a command");
  let latest = Number.NEGATIVE_INFINITY;
  let back = 0;
  for (const row of rows) {
    if (row[time] < latest) back += 1;
    else latest = row[time];
  }
  if (back > MOST_BACK * rows.length) {
    throw new Unreadable("its time goes back, and stays back, as with two logs in one file");
  }
  const percent = commanding.filter((n) => /\[\s*%\s*\]$/.test(headers[n]));
  const most = rows.reduce((sum, row) => Math.max(sum, ...percent.map((n) => Math.abs(row[n]))), 0);
  if (most > 0 && most <= 0.01) {
    throw new Unreadable("no command passes 1 %: if these are fractions, their unit is [1]");
  }
  rows.sort((one, other) => one[time] - other[time]);
  const start = rows[0][time];
  if (rows[rows.length - 1][time] - start > 1e5) throw new Unreadable("it lasts longer than a day");
  const signals = measuring.map((n) => {
    const { axis, isPosition } = /** @type {Column} */ (columns[n]);
    const values = rows.map((row) => row[n]);
    if (values.some((value) => Math.abs(value) > (isPosition ? MOST_POSITION : MOST_VELOCITY))) {
      throw new Unreadable(`“${headers[n].slice(0, 40)}” has numbers that no vehicle reaches`);
    }
    return {
      axis,
      isPosition,
      values: vehicle.axes[axis].position === "psi" && isPosition ? unwrapped(values) : values,
    };
  });
  const used = signals.filter(
    ({ axis, isPosition, values }) =>
      values.some(Number.isFinite) && (isPosition || !signals.some((other) => other.axis === axis && other.isPosition)),
  );
  if (used.length === 0) {
    throw new Unreadable(
      `it has no motion of an axis of this vehicle, such as “${vehicle.axes[0].name} velocity [${vehicle.axes[0].unit}]”; ${RENAMING}`,
    );
  }
  const twice = used.find(({ axis }, n) => used.findIndex((other) => other.axis === axis) < n);
  if (twice) throw new Unreadable(`two of its columns tell the same of ${vehicle.axes[twice.axis].name}`);
  const none = Object.fromEntries(vehicle.commands.map((command) => [command, 0]));
  return {
    name,
    times: rows.map((row) => row[time] - start),
    commands: rows.map((row) => {
      const commands = { ...none };
      for (const n of commanding) {
        const { drives } = /** @type {Column} */ (columns[n]);
        for (const [command, sign] of Object.entries(drives)) commands[command] = saturated(sign * row[n]);
      }
      return commands;
    }),
    signals: used,
    left: lines.length - 1 - rows.length,
  };
}

/** @typedef {{what: "time" | "command" | "signal", axis: number, isPosition: boolean, drives: Record<string, number>,
 *   convert: (x: number) => number}} Column */

/** Returns the kind of a column by its header, or null for a column that is not used.
 * @param {string} header @param {string} file @param {Vehicle} vehicle @returns {Column | null} */
function columnOf(header, file, vehicle) {
  const parts = /^(.*?)\s*\[(.*)\]$/.exec(header);
  if (!parts) return null;
  const [title, unit] = [parts[1].trim().toLowerCase().replace(/\s+/g, " "), parts[2].trim().toLowerCase()];
  const none = { axis: -1, isPosition: false, drives: {} };
  if (title === "time") {
    const convert = converter(header, FACTORS.s, unit, false);
    return convert && { ...none, what: "time", convert };
  }
  const { axes, commands } = vehicle;
  const ofFile = axes.findIndex(({ name }) => new RegExp(`^log_${name}`, "i").test(file));
  const alone = ofFile < 0 && axes.length === 1 ? 0 : ofFile;
  const isOf = (/** @type {string} */ name) => [name, vehicle.mixed ? name : name.replace("u_", "")].includes(title);
  const command = commands.find((name) => isOf(name.toLowerCase()));
  if (command !== undefined || title === "command") {
    if (command === undefined && alone < 0) {
      const example = `log_${axes[0].name}.csv`;
      throw new Unreadable(
        `the name of the file does not tell whose axis its command is: call it ${example} or the like`,
      );
    }
    const drives = command === undefined ? axes[alone].signs : { [command]: 1 };
    const isShort = command !== undefined && title !== command.toLowerCase();
    const convert = pulses(unit) ?? converter(header, FACTORS.command, unit, isShort);
    return convert && { ...none, what: "command", drives, convert };
  }
  for (const [axis, { name, velocity, position, positionUnit }] of axes.entries()) {
    const own = axis === alone;
    const words = { z: "depth", phi: "roll angle", theta: "pitch angle", psi: "heading" }[position ?? ""];
    const isPosition = [position, words, `${name} distance`].includes(title) || (own && title === "distance");
    const isVelocity = [velocity, `${name} velocity`].includes(title) || (own && title === "velocity");
    if (!isPosition && !isVelocity) continue;
    const length = isPosition ? unit : unit.replace(/\/s$/, "");
    const factors = isPosition || length !== unit ? FACTORS[positionUnit] : {};
    const convert = converter(header, factors, length, title === position || title === velocity);
    return convert && { what: "signal", axis, isPosition, drives: {}, convert };
  }
  return null;
}

/** Returns the conversion to SI. It is null for a short name with a foreign unit, such as “v [V]”, which is another quantity.
 * @param {string} header @param {Record<string, number>} factors @param {string} unit @param {boolean} isShort
 * @returns {((x: number) => number) | null} */
function converter(header, factors, unit, isShort) {
  if (!Object.hasOwn(factors, unit)) {
    if (isShort) return null;
    throw new Unreadable(`“${header.slice(0, 40)}” has no unit that this column can have`);
  }
  return (x) => x * factors[unit];
}

/** Returns the conversion from the pulse of a speed controller, or null for another unit. @param {string} unit */
function pulses(unit) {
  const parts = /^[u\u00b5\u03bc]s(?:\s+([\d.]+)\s+(-?[\d.]+))?$/.exec(unit);
  if (!parts) return null;
  const [neutral, span] = [Number(parts[1] ?? 1500), Number(parts[2] ?? 400)];
  return (/** @type {number} */ x) => (x === 0 || x === 65535 ? 0 : (x - neutral) / span);
}

/** @param {number} command */
function saturated(command) {
  return Math.max(-1, Math.min(1, command));
}

const TURN = 2 * Math.PI;

/** Returns angles without jumps of a full turn. @param {number[]} angles */
function unwrapped(angles) {
  let last = Number.NaN;
  return angles.map((angle) => {
    if (!Number.isFinite(angle)) return angle;
    last = Number.isFinite(last) ? last + (angle - last - TURN * Math.round((angle - last) / TURN)) : angle;
    return last;
  });
}

/** Returns the flight as a table: what flew it and how it moved. As a recording it can be flown again. Times are whole microseconds, as
 * the steps of the page are. @param {Flight} flight */
function tableOf({ times, commands, pilot }) {
  const { axes, commands: names } = pilot.model.vehicle;
  const columns = axes.flatMap(({ velocity, unit, position, positionUnit }, a) => [
    { title: `${velocity} [${unit}]`, values: pilot.velocities[a] },
    ...(position ? [{ title: `${position} [${positionUnit}]`, values: pilot.positions[a] }] : []),
  ]);
  const head = ["time [s]", ...names.map((name) => `${name} [%]`), ...columns.map(({ title }) => title)];
  const rows = times.map((time, n) => [
    Number(time.toFixed(6)),
    ...commands[n].map((x) => 100 * x),
    ...columns.map(({ values }) => values[n]),
  ]);
  return [head, ...rows].map((row) => `${row.join(",")}\n`).join("");
}

/** A recording that is being flown. The pilot's vehicle gets its commands, and the ghost shows the measured motion. */
class Playback {
  /** @param {Recording} recording @param {Flight} flight */
  constructor(recording, flight) {
    this.recording = recording;
    this.row = 0;
    const { axes } = flight.pilot.model.vehicle;
    /** The name of each signal's axis, which the ghost, possibly another vehicle, may have elsewhere. */
    this.names = recording.signals.map(({ axis }) => axes[axis].name);
    /** For each signal: the last measurement, its time and rate, the sum of squares and the number of deviations. */
    this.measured = recording.signals.map(({ values }) => {
      const now = values.find(Number.isFinite) ?? 0;
      return { now, time: 0, rate: 0, start: now, sum: 0, n: 0 };
    });
    for (const craft of [flight.pilot, flight.ghost]) {
      recording.signals.forEach(({ isPosition }, n) => {
        const axis = craft.axis(this.names[n]);
        if (axis < 0) return;
        const { velocity, position } = craft.model.vehicle.axes[axis];
        const name = isPosition ? position : velocity;
        if (name) craft.model.set(name, this.measured[n].now);
        else craft.distances[axis] = this.measured[n].now;
      });
      craft.model.turn();
      craft.track = [];
      craft.forget(1);
      craft.keep();
    }
    this.arrive(flight);
  }

  /** Returns true when the ghost has a track, which needs measurements of surge. */
  hasTrack() {
    return this.names.includes("surge");
  }

  /** Returns the time of the next row, or null at the end. */
  next() {
    return this.row < this.recording.times.length ? this.recording.times[this.row] : null;
  }

  /** Takes the next row: compares the prediction with it, and sets its commands. @param {Flight} flight */
  arrive(flight) {
    const { signals, commands, times } = this.recording;
    signals.forEach(({ axis, isPosition, values }, n) => {
      const value = values[this.row];
      if (!Number.isFinite(value)) return;
      const { pilot } = flight;
      const predicted = isPosition ? pilot.position(axis) : pilot.model.get(pilot.model.vehicle.axes[axis].velocity);
      const signal = this.measured[n];
      const passed = times[this.row] - signal.time;
      signal.rate = passed > 0 ? (value - signal.now) / passed : signal.rate;
      signal.sum += (predicted - value) ** 2;
      signal.n += 1;
      signal.now = value;
      signal.time = times[this.row];
    });
    flight.set(commands[this.row]);
    this.row += 1;
  }

  /** Moves the ghost h seconds along the measured motion. @param {Craft} ghost @param {number} h */
  move(ghost, h) {
    const { model, distances } = ghost;
    this.recording.signals.forEach(({ isPosition }, n) => {
      const axis = ghost.axis(this.names[n]);
      if (axis < 0) return;
      const { velocity, position } = model.vehicle.axes[axis];
      const { now, rate } = this.measured[n];
      model.set(velocity, isPosition ? rate : now);
      if (isPosition && position) model.set(position, now);
      else if (position) model.set(position, model.get(position) + now * h);
      else distances[axis] = isPosition ? now : distances[axis] + now * h;
    });
    const [u, v, psi] = ["u", "v", "psi"].map((name) => model.get(name));
    model.turn();
    model.set("x", model.get("x") + h * (u * Math.cos(psi) - v * Math.sin(psi) + model.get("V_N")));
    model.set("y", model.get("y") + h * (u * Math.sin(psi) + v * Math.cos(psi) + model.get("V_E")));
    return true;
  }

  /** Returns a sentence about the deviations (root mean square) of the prediction. @param {Vehicle} vehicle */
  verdict(vehicle) {
    const deviations = this.recording.signals.map(({ axis, isPosition }, n) => {
      const { name, unit, positionUnit } = vehicle.axes[axis];
      const { sum, n: many } = this.measured[n];
      return `${name} ${Math.sqrt(sum / Math.max(1, many)).toPrecision(2)} ${isPosition ? positionUnit : unit}`;
    });
    const left = this.recording.left;
    return `The end of the recording. The prediction is off by (root mean square): ${deviations.join(", ")}.${left ? ` Rows that could not be used: ${left}.` : ""}`;
  }
}
