// A recording of tank tests (docs/identify-formats.md, "Logs") that is flown again, to compare the prediction with the measurements.

const MOST_BYTES = 20e6;
const MOST_ROWS = 200000;

/** The end of a message about a missing column. */
const RENAMING = "if another header stands for it, rename that one: this page does not read [columns] of rov.toml";

/** The error of a file that is not a recording of this vehicle. Its text says why. */
class Unreadable extends Error {}

/** The measurements of an axis: positions or velocities at their own times.
 * @typedef {{axis: number, isPosition: boolean, times: number[], values: number[]}} Signal */
/**
 * A recording: the times in s from which commands hold, the commands by name, or the loads of a wrench, signals, sentences about what is not
 * as in the file, and the number of rows that were left out.
 * @typedef {{name: string, times: number[], commands: Record<string, number[]>, signals: Signal[], notes: string[], left: number}} Recording
 */

/** Reads a recording. @param {string} text @param {string} name The file's name. @param {Vehicle} vehicle @returns {Recording} */
function readRecording(text, name, vehicle) {
  const lines = text
    .replace(/^\uFEFF/, "")
    .split(/\r\n|\r|\n/)
    .filter((line) => line.trim() !== "");
  const rules = vehicle.csv;
  const { separator, start: begin, headers } = headerOf(lines, rules);
  if (lines.length < begin + 3) throw new Unreadable("it has less than two rows below its header");
  if (lines.length > MOST_ROWS) throw new Unreadable(`it has more than ${MOST_ROWS} rows`);
  if (headers.length < 2) throw new Unreadable("its first line is no header of columns");
  const pattern = new RegExp(`^(?:${rules.number})$`);
  const hasCommas = separator !== "," || lines.some((line) => hasDecimalComma(line, rules));
  /** @param {string} cell */
  const number = (cell) => {
    const plain = hasCommas ? pointed(cell) : cell;
    return pattern.test(plain) ? Number(plain) : Number.NaN;
  };
  const below = lines
    .slice(begin + 1)
    .map((line) => cellsOf(line, separator))
    .filter((cells) => cells.slice(headers.length).every((cell) => cell === ""));
  const columns = headers.map((header) => columnOf(header, name, vehicle));
  const { time, date } = timeColumns(headers, below, columns, rules.clock);
  if (time < 0) throw new Unreadable(`it has no column “time [s]”; ${RENAMING}`);
  columns[time] ??= { ...NO_COLUMN, unit: "s", isTime: true, convert: (x) => x };
  const commanding = columns.flatMap((column, place) => (column?.command ? [{ place, ...column.command }] : []));
  if (commanding.length === 0) {
    throw new Unreadable(`it has no column of a command, such as “${vehicle.commands[0]} [%]”; ${RENAMING}`);
  }
  for (const [units, most, mistake] of rules.slips) {
    const own = commanding.filter(({ place }) => units.map(folded).includes(columns[place]?.unit ?? ""));
    const largest = below.reduce((sum, cells) => {
      const sizes = own.map(({ place }) => Math.abs(number(cells[place] ?? "")));
      return Math.max(sum, ...sizes.filter(Number.isFinite));
    }, 0);
    if (largest > 0 && largest <= most) throw new Unreadable(mistake);
  }
  const read = below.map((cells) =>
    columns.map((column, n) => (column ? inUnits(column, number(cells[n] ?? ""), cells[n]) : Number.NaN)),
  );
  const isOfDay = below.filter((cells, n) => cells[time] && !Number.isFinite(read[n][time])).length > below.length / 2;
  if (isOfDay)
    timesOfDay(below, time, date, rules.clock).forEach((one, n) => {
      read[n][time] = one;
    });
  const usable = read.filter((row) => Number.isFinite(row[time]));
  const timed = usable.filter((row) => commanding.some(({ place }) => Number.isFinite(row[place])));
  if (timed.length < 2) throw new Unreadable("no two of its rows have a time and a command");
  const places = columns.flatMap((column, n) => (column && n !== time ? [n] : []));
  const clocks = places.map((n) => restarts(timesOf(usable, time, n), rules));
  if (Math.max(...clocks.map(({ back }) => back)) > rules.mostUnordered * usable.length) {
    throw new Unreadable("its time goes back, and stays back, as with two logs in one file");
  }
  const isRestarted = clocks.some(({ starts }) => starts.length > 1);
  const end = isRestarted ? restarts(timesOf(usable, time, time), rules).starts[1] : usable.length;
  const ordered = usable.slice(0, end).sort((one, other) => one[time] - other[time]);
  const rows = whileCommanded(ordered, time, commanding, rules);
  const start = rows[0][time];
  if (rows[rows.length - 1][time] - start > 1e5) throw new Unreadable("it lasts longer than a day");
  if (commanding.some(({ kind }) => kind !== commanding[0].kind)) {
    throw new Unreadable("it must have the commands of inputs, of thrusters or of an axis, but only one kind of these");
  }
  if (new Set(commanding.map((column) => column.name)).size < commanding.length) {
    throw new Unreadable("it has a command twice");
  }
  const times = rows.map((row) => row[time] - start);
  const commands = rows.map((row) => given(commanding, row, vehicle));
  const off = rows.reduce((most, row, n) => Math.max(most, difference(commanding, row, commands[n], vehicle)), 0);
  const { used, reason } = measured(columns, rows, headers, vehicle);
  if (used.length === 0) {
    const example = `such as “${vehicle.axes[0].name} velocity [${vehicle.axes[0].unit}]”`;
    throw new Unreadable(reason || `it has no motion of an axis of this vehicle, ${example}; ${RENAMING}`);
  }
  return {
    name,
    times,
    commands: Object.fromEntries(vehicle.commands.map((one) => [one, commands.map((row) => row[one])])),
    signals: used.map(({ axis, isPosition, values }) => ({
      axis,
      isPosition,
      times: times.filter((_, n) => Number.isFinite(values[n])),
      values: values.filter(Number.isFinite),
    })),
    notes: [...(reason ? [`The pressure is not used: ${reason}.`] : []), ...nearness(off)],
    left: lines.length - begin - 1 - rows.length,
  };
}

/** @typedef {CommandColumn & {place: number}} Commanding A column of commands, and its place in a row. */

/** Returns the times of the rows that have a number in a column. @param {number[][]} rows @param {number} time @param {number} place */
function timesOf(rows, time, place) {
  return rows.filter((row) => Number.isFinite(row[place])).map((row) => row[time]);
}

/** Returns the rows from the first commands on, each with the commands that hold there. A command that begins late is 0 until then, as in
 * `in_rows` of rov_fmu/tank/clocks.py. @param {number[][]} rows @param {number} time @param {Commanding[]} commanding @param {Rules} rules */
function whileCommanded(rows, time, commanding, { late }) {
  const firsts = commanding.map(({ place }) => timesOf(rows, time, place)[0] ?? Number.POSITIVE_INFINITY);
  const first = Math.min(...firsts);
  const start = Math.max(...firsts.filter((one) => one <= first + late));
  const held = commanding.map(() => 0);
  return rows.flatMap((row) => {
    const full = [...row];
    for (const [n, { place }] of commanding.entries()) {
      if (Number.isFinite(row[place])) held[n] = row[place];
      full[place] = held[n];
    }
    return row[time] < start ? [] : [full];
  });
}

/** Returns the commands of the vehicle by which a row's commands are given best. @param {Commanding[]} commanding @param {number[]} row
 * @param {Vehicle} vehicle @returns {Record<string, number>} */
function given(commanding, row, vehicle) {
  const sum = (/** @type {string} */ name) =>
    commanding.reduce((total, { shares, place }) => total + (shares[name] ?? 0) * saturated(row[place]), 0);
  return Object.fromEntries(vehicle.commands.map((name) => [name, saturated(sum(name))]));
}

/** Returns the largest difference between the commands in a row, 0 for one that is missing, and those that the vehicle's commands give.
 * @param {Commanding[]} commanding @param {number[]} row @param {Record<string, number>} commands @param {Vehicle} vehicle */
function difference(commanding, row, commands, vehicle) {
  const differences = vehicle.columns
    .filter(({ kind }) => kind === commanding[0].kind)
    .map(({ name, gains }) => {
      const actual = Object.entries(gains).reduce((total, [command, gain]) => total + gain * commands[command], 0);
      const column = commanding.find((one) => one.name === name);
      return Math.abs(saturated(actual) - (column ? saturated(row[column.place]) : 0));
    });
  return Math.max(0, ...differences);
}

/** Returns the sentence about commands that those of the vehicle do not give exactly. @param {number} off The largest difference. */
function nearness(off) {
  return off > 0.005 ? [`The inputs of this vehicle give these commands only to ${Math.ceil(100 * off)} %.`] : [];
}

/** Returns the signals that are compared, the best one of each axis, and why a pressure is not used, if one is not.
 * @param {(Column | null)[]} columns @param {number[][]} rows @param {string[]} headers @param {Vehicle} vehicle */
function measured(columns, rows, headers, vehicle) {
  let reason = "";
  const signals = columns.flatMap((column, n) => {
    if (!column?.quantity) return [];
    const { axis, rank, quantity } = column;
    const values = rows.map((row) => row[n]);
    const known = values.filter(Number.isFinite);
    if (known.some((value) => Math.abs(value) > quantity.largest)) {
      throw new Unreadable(`“${headers[n].slice(0, 40)}” has numbers that no vehicle reaches`);
    }
    const against = quantity.isPressure ? reasonAgainst(known, vehicle.csv) : "";
    reason ||= against;
    if (known.length === 0 || against) return [];
    const isWeak = known.length < vehicle.csv.leastSamples || known.every((value) => value === known[0]);
    const depths = quantity.isPressure ? values.map((value) => depthOf(value, vehicle.csv)) : values;
    return { axis, isPosition: quantity.isPosition, rank, isWeak, values: quantity.wraps ? unwrapped(depths) : depths };
  });
  const twice = signals.find((one, n) =>
    signals.slice(0, n).some(({ axis, rank }) => axis === one.axis && rank === one.rank),
  );
  if (twice) throw new Unreadable(`two of its columns tell the same of ${vehicle.axes[twice.axis].name}`);
  const used = signals.filter(
    (one) =>
      !signals.some((other) => other.axis === one.axis && (+other.isWeak - +one.isWeak || other.rank - one.rank) < 0),
  );
  return { used, reason };
}

/** Returns the depth in fresh water that a pressure tells, m. @param {number} pressure In Pa. @param {Rules} rules */
function depthOf(pressure, { pressures: { atmosphere, gradient } }) {
  return (pressure - atmosphere) / gradient;
}

/** Returns why no depth follows from pressures in Pa, or an empty text. It must equal `_reason_against_pressure` of
 * rov_fmu/tank/channels.py. @param {number[]} known @param {Rules} rules */
function reasonAgainst(known, { pressures: { atmosphere, gradient, hull, least } }) {
  const [low, high] = known.reduce(([a, b], value) => [Math.min(a, value), Math.max(b, value)], [Infinity, -Infinity]);
  if (known.length > 0 && high < least)
    return "its pressures are below 1 % of an atmosphere, so their unit is another one";
  const isOfHull = (high - low) / gradient < hull[0] && Math.abs(high / atmosphere - 1) < hull[1];
  return isOfHull
    ? "its pressure hardly changes and is that of the air, so the barometer seems to be inside the hull"
    : "";
}

/** Returns the text of a file. It must equal what `open_text` of rov_fmu/io/csv_table.py reads. @param {ArrayBuffer} content */
function textOf(content) {
  const mark = new DataView(content).byteLength > 1 ? new DataView(content).getUint16(0) : 0;
  if (mark === 0xfffe || mark === 0xfeff)
    return new TextDecoder(mark === 0xfffe ? "utf-16le" : "utf-16be").decode(content);
  try {
    return new TextDecoder("utf-8", { fatal: true }).decode(content);
  } catch {
    return new TextDecoder("windows-1252").decode(content);
  }
}

/** The header of a table: its place among the lines, its cells, and what separates them.
 * @typedef {{start: number, separator: string, headers: string[]}} Header */

/** Returns the header of a table with these lines, of which none is blank. It must equal `_dialect` of rov_fmu/io/csv_table.py, which
 * says why. @param {string[]} lines @param {Rules} rules @returns {Header} */
function headerOf(lines, rules) {
  const given = /^ *"?sep=([,;\t])"? *$/i.exec(lines[0] ?? "");
  const value = new RegExp(`^(?:${rules.value})$`);
  /** @type {Header[]} */
  const candidates = [];
  /** @type {Header | undefined} */
  let first;
  for (let start = given ? 1 : 0; start < Math.min(lines.length, rules.mostBefore); start++) {
    const line = lines[start];
    const separator = given?.[1] ?? [",", ";", "\t"].reduce((a, b) => (count(line, b) > count(line, a) ? b : a));
    const own = { start, separator, headers: filledCells(line, separator) };
    if (own.headers.length === 0) continue;
    first ??= own;
    if (!line.startsWith("#")) {
      const above = [...candidates.filter(hasUnit), ...candidates.filter((one) => !hasUnit(one))];
      const header = above.find((one) => isAbove(one, line, value));
      if (header)
        return { ...header, headers: header.headers.map((cell, n) => (n ? cell : cell.replace(/^#+ */, ""))) };
      if (own.headers.length > 1 && isRow(own.headers, value)) break;
    }
    if (!own.headers.some((cell) => value.test(cell))) candidates.push(own);
  }
  return first ?? { start: 0, separator: ",", headers: [] };
}

/** @param {Header} header */
function hasUnit({ headers }) {
  return headers.some((cell) => /^[^[\]]+\[[^[\]]+\]$/.test(cell));
}

/** Returns whether a line is a row below a header. @param {Header} header @param {string} line @param {RegExp} value */
function isAbove(header, line, value) {
  const { length } = header.headers;
  const row = filledCells(line, header.separator);
  return (hasUnit(header) ? row.length <= length : row.length > 1 && row.length === length) && isRow(row, value);
}

/** Returns whether most of the cells that are not blank are numbers or times. @param {string[]} cells @param {RegExp} value */
function isRow(cells, value) {
  const filled = cells.filter((cell) => !/^([-.]*|nan)$/i.test(cell));
  return 2 * filled.filter((cell) => value.test(cell)).length > filled.length;
}

/** Returns the cells of a line, without empty ones at its end. @param {string} line @param {string} separator */
function filledCells(line, separator) {
  const cells = cellsOf(line, separator).map(pointed);
  while (cells[cells.length - 1] === "") cells.pop();
  return cells;
}

/** Returns a number with a decimal point. @param {string} cell */
function pointed(cell) {
  return /^[-+.,\deE]+$/.test(cell) ? cell.replace(",", ".") : cell;
}

/** Returns whether a line has a number in quotes whose comma separates no thousands. @param {string} line @param {Rules} rules */
function hasDecimalComma(line, { quoted, thousands }) {
  const numbers = [...line.matchAll(new RegExp(quoted, "g"))].map((match) => match[1]);
  return numbers.some((number) => !new RegExp(`^(?:${thousands})$`).test(number));
}

/** @param {string} text @param {string} mark */
function count(text, mark) {
  return text.split(mark).length;
}

/** Returns the cells of a line without their quotation marks. @param {string} line @param {string} separator */
function cellsOf(line, separator) {
  const cells = [""];
  let quoted = false;
  for (const character of line) {
    if (character === '"') quoted = !quoted;
    else if (character === separator && !quoted) cells.push("");
    else cells[cells.length - 1] += character;
  }
  return cells.map((cell) => cell.trim());
}

/** Returns a number in SI units, from the number or the text of a cell. Only times may be texts. @param {Column} column @param {number} number
 * @param {string} cell */
function inUnits(column, number, cell) {
  return Number.isNaN(number) && column.isTime ? seconds(cell ?? "") : column.convert(number);
}

/** @param {ClockRules} rules */
function clockPattern({ pattern }) {
  return new RegExp(pattern, "i");
}

/** Returns a text without a time of day: the date, or nothing. @param {string} text @param {ClockRules} rules */
function dateIn(text, rules) {
  const rest = text.replace(new RegExp(rules.pattern, "gi"), " ").trim().replace(/\s+/g, " ");
  return rest.replace(new RegExp(rules.between, "g"), "");
}

/** Returns the places of the time and of the date of times of day, or -1. It must equal `time_columns` of
 * rov_fmu/tank/readers/times_of_day.py. @param {string[]} headers @param {string[][]} rows @param {(Column | null)[]} columns
 * @param {ClockRules} rules */
function timeColumns(headers, rows, columns, rules) {
  const cells = headers.map((_, n) => rows.slice(0, rules.firstRows - 1).find((row) => row[n])?.[n] ?? "");
  const words = headers.map(wordsIn);
  /** @param {number} n @param {string[]} known */
  const has = (n, known) =>
    words[n].some((word) => known.some((one) => word === one || (one.length > 4 && word.endsWith(one))));
  const places = headers.map((_, n) => n);
  const times = places.filter((n) => new RegExp(rules.like).test(cells[n]) && has(n, rules.titles));
  const told = columns.findIndex((column) => column?.isTime);
  const time =
    told >= 0
      ? told
      : (times.find((n) => words[n].length === 1 && /^(time|zeit)$/.test(words[n][0])) ?? times[0] ?? -1);
  const dates = places.filter((n) => n !== time && has(n, rules.dates));
  const named = dates.find((n) => headers[n].trim().toLowerCase() === "date");
  return {
    time,
    date: named ?? dates.find((n) => Number.isFinite(dayOf(dateIn(cells[n], rules), rules))) ?? -1,
  };
}

/** Returns the words of a header in small letters, without accents. @param {string} header */
function wordsIn(header) {
  const plain = header
    .normalize("NFKD")
    .replace(/\p{M}/gu, "")
    .replace(/([a-z])(?=[A-Z])/g, "$1 ");
  return plain.toLowerCase().match(/\p{L}+|\d+/gu) ?? [];
}

const DATE_PARTS = /** @type {Record<string, string>} */ ({
  Y: "(?<Y>\\d{4})",
  m: "(?<m>\\d\\d?)",
  d: "(?<d>\\d\\d?)",
});
const DAY = 86400;

/** Returns the number of days since 1970 of a date, or NaN for another text. @param {string} text @param {ClockRules} rules */
function dayOf(text, { days }) {
  for (const form of days) {
    const pattern = form.replace(/[.]/g, "\\.").replace(/%(.)/g, (_, part) => DATE_PARTS[part]);
    const found = new RegExp(`^${pattern}$`).exec(text)?.groups;
    if (!found) continue;
    const [year, month, day] = [found.Y, found.m, found.d].map(Number);
    const date = new Date(Date.UTC(year, month - 1, day));
    if (date.getUTCMonth() === month - 1 && date.getUTCDate() === day) return date.getTime() / (1000 * DAY);
  }
  return Number.NaN;
}

/** Returns the times of rows with times of day, s, or NaN. It must equal `times_of_day` of rov_fmu/tank/readers/times_of_day.py, which
 * says why. @param {string[][]} rows @param {number} time @param {number} date @param {ClockRules} rules */
function timesOfDay(rows, time, date, rules) {
  const parts = rows.flatMap((cells, row) => {
    const text = cells[time] ?? "";
    const found = clockPattern(rules).exec(text);
    const beside = dateIn(text, rules);
    if (!found || (beside && Number.isNaN(dayOf(beside, rules)))) return [];
    const [minutes, whole] = found[2].slice(1).split(":").map(Number);
    const decimals = found[3] ? Number(`0.${found[3].slice(1)}`) : 0;
    const day = dayOf(beside || dateIn(cells[date] ?? "", rules), rules);
    return [{ row, clock: 3600 * Number(found[1]) + 60 * minutes + whole + decimals, day }];
  });
  if (parts.length === 0) throw new Unreadable(`its times are in another form; ${rules.how}`);
  const isOfDay = parts.every(({ clock }) => clock < DAY);
  let turns = 0;
  const goesOn = parts.map(({ clock }, n) => {
    if (n && isOfDay) turns -= Math.round((clock - parts[n - 1].clock) / DAY);
    return clock + DAY * turns;
  });
  const isDated = parts.every(({ day }) => Number.isFinite(day));
  const isApart = parts.some(
    ({ day, clock }, n) => n > 0 && day === parts[n - 1].day && clock - parts[n - 1].clock < -DAY / 2,
  );
  const first = parts[0].day || 0;
  const times = rows.map(() => Number.NaN);
  for (const [n, { row, clock, day }] of parts.entries()) {
    times[row] = isDated && !isApart ? DAY * day + clock : DAY * first + goesOn[n];
  }
  return times;
}

/** Returns the time since 1970 of a text by ISO 8601, s, or NaN; UTC if it names no offset. @param {string} text */
function seconds(text) {
  const parts = /^(\d{4}-\d\d-\d\d)[t ](\d\d:\d\d)(?::(\d\d(?:[.,]\d+)?))?(?:z|([+-]\d\d):?(\d\d))?$/i.exec(text);
  if (!parts) return Number.NaN;
  const [, date, minute, second = "0", hours = "+00", minutes = "00"] = parts;
  return Date.parse(`${date}T${minute}${hours}:${minutes}`) / 1000 + Number(second.replace(",", "."));
}

/** Returns the rows at which the clock begins: the first, and those from which times go on that are earlier than those before; and the
 * number of rows that only arrived late. It must equal `restart_rows` of rov_fmu/tank/clocks.py, which says why, and what `_add_pieces`
 * of rov_fmu/tank/readers/tables.py counts. @param {number[]} times @param {Rules} rules */
function restarts(times, rules) {
  const starts = [0];
  let back = 0;
  let [first, latest] = [Number.POSITIVE_INFINITY, Number.NEGATIVE_INFINITY];
  let n = 0;
  while (n < times.length) {
    let end = n + 1;
    if (times[n] < latest) {
      while (end < times.length && times[end] < latest && times[end] >= times[end - 1]) end += 1;
      const last = times[end - 1];
      const before = end - n >= rules.leastAfter ? times.slice(starts[starts.length - 1], n) : [];
      const again = before.filter((time) => time >= times[n] && time <= last).length;
      if (before.length > 0 && (again >= rules.again * (end - n) || last < first)) {
        starts.push(n);
        [first, latest] = [times[n], last];
      } else {
        back += end - n;
      }
    }
    first = Math.min(first, times[n]);
    latest = Math.max(latest, times[end - 1]);
    n = end;
  }
  return { starts, back };
}

/** A column that is read: the time, a command, or a quantity of an axis, with its rank among those of this axis.
 * @typedef {{unit: string, isTime: boolean, command: CommandColumn | null, quantity: Quantity | null, axis: number, rank: number,
 *   convert: (x: number) => number}} Column */

const NO_COLUMN = { unit: "", isTime: false, command: null, quantity: null, axis: -1, rank: 0 };

/** Returns the kind of a column by its header, or null for a column that is not used.
 * @param {string} header @param {string} file @param {Vehicle} vehicle @returns {Column | null} */
function columnOf(header, file, vehicle) {
  const plain = vehicle.csv.renamed[header] ?? header;
  if (plain.startsWith("-")) {
    const column = columnOf(plain.slice(1), file, vehicle);
    return column && { ...column, convert: (x) => -column.convert(x) };
  }
  const parts = /^(.*?)\s*\[(.*)\]$/.exec(plain);
  if (!parts) return null;
  const [title, unit] = [parts[1].trim().toLowerCase().replace(/\s+/g, " "), folded(parts[2].trim())];
  const none = { ...NO_COLUMN, unit };
  if (title === "time") {
    const convert = converter(header, vehicle.csv.times, unit, false);
    return convert && { ...none, isTime: true, convert };
  }
  const { axes } = vehicle;
  const ofFile = axes.findIndex(({ name }) => new RegExp(`^log_${name}`, "i").test(file));
  const alone = ofFile < 0 && axes.length === 1 ? 0 : ofFile;
  const command =
    vehicle.columns.find(({ name, also }) => [name, ...also].some((one) => folded(one) === title)) ??
    (title === "command" ? ofAxis(axes, alone) : null);
  if (command) {
    const isShort = title !== "command" && title !== folded(command.name);
    const convert = special(unit, vehicle.csv) ?? converter(header, vehicle.csv.fractions, unit, isShort);
    if (convert) return { ...none, command, convert };
  }
  for (const [axis, { quantities }] of axes.entries()) {
    for (const [rank, quantity] of quantities.entries()) {
      const [short, ...others] = axis === alone ? quantity.short : [];
      const isFull = title === quantity.name || title === short;
      if (!isFull && !quantity.also.includes(title) && !others.includes(title)) continue;
      const convert = converter(header, quantity.units, unit, !isFull);
      if (convert) return { ...none, quantity, axis, rank, convert };
    }
  }
  return null;
}

/** Returns the column of the command of an axis. @param {Axis[]} axes @param {number} alone The axis, or -1. @returns {CommandColumn} */
function ofAxis(axes, alone) {
  if (alone >= 0) return { name: "command", also: [], kind: "axis", gains: {}, shares: axes[alone].signs };
  const example = `log_${axes[0].name}.csv`;
  throw new Unreadable(`the name of the file does not tell whose axis its command is: call it ${example} or the like`);
}

/** Returns a unit without differences of case, and with one of the two letters mu. @param {string} unit */
function folded(unit) {
  return unit.toLowerCase().replace("\u00b5", "\u03bc");
}

/** Returns the conversion to SI. It is null for a short name with a foreign unit, such as “v [V]”, which is another quantity.
 * @param {string} header @param {Record<string, number>} units @param {string} unit @param {boolean} isShort
 * @returns {((x: number) => number) | null} */
function converter(header, units, unit, isShort) {
  const known = Object.keys(units).find((name) => folded(name) === unit);
  if (known === undefined) {
    if (isShort) return null;
    throw new Unreadable(`“${header.slice(0, 40)}” has no unit that this column can have`);
  }
  return (x) => x / units[known];
}

/** Returns the conversion from the pulse of a speed controller, or from a force with its full command, or null for another unit.
 * @param {string} unit @param {Rules} rules */
function special(unit, { pulses, forces }) {
  const [word, ...numbers] = unit.split(/\s+/);
  const [first, second] = numbers.length ? numbers.map(Number) : [pulses.neutral, pulses.span];
  if (forces.map(folded).includes(word) && numbers.length === 1 && first > 0) {
    return (/** @type {number} */ x) => x / first;
  }
  if (!pulses.units.map(folded).includes(word) || !Number.isFinite(first) || !second) return null;
  return (/** @type {number} */ x) => {
    const command = (x - first) / second;
    return pulses.none.includes(x) && Math.abs(command) > 1 ? 0 : command;
  };
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
  const columns = axes.flatMap(({ velocity, unit, position, positionUnit }) => [
    { name: velocity, unit },
    ...(position ? [{ name: position, unit: positionUnit }] : []),
  ]);
  const titles = columns.map(({ name, unit }) => `${name} [${unit}]`);
  const head = ["time [s]", ...names.map((name) => `${name} [%]`), ...titles];
  const rows = times.map((time, n) => [
    Number(time.toFixed(6)),
    ...commands[n].map((x) => 100 * x),
    ...columns.map(({ name }) => pilot.at(n, name)),
  ]);
  return [head, ...rows].map((row) => `${row.join(",")}\n`).join("");
}
