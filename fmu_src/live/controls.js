// The page's controls (sliders, sticks, keys, a gamepad, step tests, recordings, links), and the loop that steps and draws.

const SPEEDS = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50];
const [SPAN, SPAN_REPLAYED] = [20, 30]; // s, of the charts
const LONGEST_FRAME = 0.1; // s; a page that was hidden does not fly what it missed
const DEAD_ZONE = 0.12;

/** The axis that each arrow key drives, and the direction. @type {Record<string, [string, number]>} */
const ARROWS = {
  ArrowUp: ["surge", 1],
  ArrowDown: ["surge", -1],
  ArrowRight: ["yaw", 1],
  ArrowLeft: ["yaw", -1],
};

/** The sticks of a standard gamepad and of the page, assigned as on ROVs: axis, place among the sticks' coordinates (the left one's x and
 * y, the right one's x and y), direction. @type {[string, number, number][]} */
const STICKS = [
  ["yaw", 0, 1],
  ["heave", 1, 1],
  ["sway", 2, 1],
  ["surge", 3, -1],
];
const TOLD = 100; // ms between two changes of the numbers beside the picture, which eyes read no faster

/** @param {string} id @returns {HTMLElement} */
function part(id) {
  return /** @type {HTMLElement} */ (document.getElementById(`live-${id}`));
}

/** Returns a value of a slider rounded to about a hundredth of its range. @param {number} value @param {number} most */
function rounded(value, most) {
  const step = 10 ** (Math.floor(Math.log10(most)) - 2);
  return Number((Math.round(value / step) * step).toPrecision(12));
}

/**
 * A stick on the page, for a finger or a mouse. It returns to its middle when it is let go. It moves only in the directions
 * in which it drives the vehicle, and names the keys that do the same.
 */
class Stick {
  /** @param {Element} svg @param {string[][]} letters Of the keys to the left and to the right, and up and down; none in a direction without any. */
  constructor(svg, letters) {
    const [width, height] = letters.map(({ length }) => (length ? 88 : 46));
    this.hasAxis = letters.map(({ length }) => length > 0);
    drawn(svg, "rect", { class: "rim", x: -width / 2, y: -height / 2, width, height, rx: Math.min(width, height) / 2 });
    letters.forEach((pair, isUpright) => {
      pair.forEach((letter, n) => {
        const far = 34 * (2 * n - 1);
        const at = isUpright ? { x: 0, y: far } : { x: far, y: 0 };
        drawn(svg, "text", { class: "centred", ...at, dy: 5 }).textContent = letter;
      });
    });
    this.knob = drawn(svg, "circle", { class: "knob", r: 16 });
    /** To the right and down, from -1 to 1. */
    this.at = [0, 0];
    svg.addEventListener("pointerdown", (event) => {
      svg.setPointerCapture(/** @type {PointerEvent} */ (event).pointerId);
      this.move(svg, /** @type {PointerEvent} */ (event));
    });
    svg.addEventListener("pointermove", (event) => {
      const pointer = /** @type {PointerEvent} */ (event);
      if (svg.hasPointerCapture(pointer.pointerId)) this.move(svg, pointer);
    });
    svg.addEventListener("lostpointercapture", () => this.put(0, 0));
  }

  /** @param {Element} svg @param {PointerEvent} event */
  move(svg, event) {
    const { left, top, width, height } = svg.getBoundingClientRect();
    const [x, y] = [(event.clientX - left) / width - 0.5, (event.clientY - top) / height - 0.5].map((part, n) =>
      this.hasAxis[n] ? part / 0.3 : 0,
    );
    const far = Math.max(1, Math.hypot(x, y));
    this.put(x / far, y / far);
  }

  /** @param {number} x @param {number} y */
  put(x, y) {
    this.at = [x, y];
    place(this.knob, { cx: 24 * x, cy: 24 * y });
  }
}

class Live {
  /** @param {Model} pilot @param {Model | null} other */
  constructor(pilot, other) {
    this.flight = new Flight(pilot, other);
    this.vehicle = pilot.vehicle;
    this.paused = false;
    this.speed = 1;
    /** The axis and the direction of each key, which is known by its place on the keyboard. @type {Record<string, [string, number]>} */
    this.driving = {};
    for (const { name, keys } of this.vehicle.axes.filter(({ keys }) => keys)) {
      for (const [arrow, driven] of Object.entries(ARROWS)) if (driven[0] === name) this.driving[arrow] = driven;
      this.driving[`Key${keys[0]}`] = [name, 1];
      this.driving[`Key${keys[1]}`] = [name, -1];
    }
    /** The keys that are down, with their axes and directions. @type {Map<string, [string, number]>} */
    this.keys = new Map();
    /** The sticks on the page, left and right; a vehicle may lack one. @type {(Stick | null)[]} */
    this.sticks = ["left", "right"].map((side) => {
      const svg = document.getElementById(`live-${side}`);
      return svg && new Stick(svg, this.letters(side === "left" ? [0, 1] : [2, 3]));
    });
    /** @type {HTMLInputElement[]} */
    this.sliders = [...part("controls").querySelectorAll("input")].filter((input) => input.type === "range");
    /** The commands that the sliders are set to. Keys, sticks and a gamepad add to them. @type {Record<string, number>} */
    this.held = {};
    for (const { name, value, dataset } of this.sliders)
      if (dataset.kind === "command") this.held[name] = Number(value);
    /** The place of the pointer in the charts, from 0 to 1 of their width. @type {number | null} */
    this.pointed = null;
    const picture = /** @type {HTMLCanvasElement} */ (part("picture"));
    this.picture = new Picture(picture, this.flight, new Instruments(pilot));
    /** @type {Chart[]} */
    this.charts = [];
    const map = /** @type {HTMLCanvasElement | null} */ (document.getElementById("live-map"));
    this.track = map && new Track(map);
    /** @type {Chart | null} */
    this.dive = null;
    this.rows = Number(part("section").style.getPropertyValue("--rows"));
    this.isSeen = true;
    this.changed = true;
    this.last = 0;
    /** The time in ms at which the numbers were changed. */
    this.told = 0;
    this.connect();
    const held = this.heldWords();
    this.say(
      `${held ? `${held} ` : ""}Time starts with the first command: a slider, a stick, or a key such as ${this.vehicle.axes[0].keys[0]}.`,
    );
    this.arrange();
    this.follow(location.hash);
    const recording = document.getElementById("live-recorded");
    if (recording) this.replay(JSON.parse(recording.textContent ?? ""));
    this.paused = matchMedia("(prefers-reduced-motion: reduce)").matches && this.flight.replay !== null;
    this.show();
    // The page has no other use than to fly, so keys act at once. A page embedded in another one takes no focus.
    if (document.body.matches(".flown:not(.compact)")) part("stage").focus({ preventScroll: true });
    requestAnimationFrame((now) => this.frame(now));
  }

  // ---- Controls ----

  /** Returns the letters of the keys that act like the coordinates of a stick, each to the left or up, and to the right or down.
   * @param {number[]} places Of the coordinates. */
  letters(places) {
    return places.map((n) => {
      const [name, , direction] = STICKS[n];
      const keys = [...(this.vehicle.axes.find((axis) => axis.name === name)?.keys ?? "")];
      return direction > 0 ? keys.reverse() : keys;
    });
  }

  connect() {
    const stage = part("stage");
    for (const slider of this.sliders) {
      slider.addEventListener("input", () => {
        slider.value = String(rounded(Number(slider.value), Number(slider.max)));
        this.slid(slider);
      });
    }
    for (const [id, act] of /** @type {[string, () => void][]} */ ([
      ["pause", () => this.pause(!this.paused)],
      ["slower", () => this.faster(-1)],
      ["faster", () => this.faster(1)],
      ["reset", () => this.reset()],
      ["still", () => this.still()],
      ["nearer", () => this.zoom(1.5)],
      ["farther", () => this.zoom(1 / 1.5)],
      ["above", () => this.look()],
      ["export", () => this.export()],
      ["share", () => this.share()],
      ["file", () => this.tuneAll((slider) => Number(slider.dataset.start))],
      ["ones", () => this.tuneAll(({ value, dataset }) => (dataset.unit ? Number(value) : 1))],
      ["run", () => this.run()],
    ])) {
      document.getElementById(`live-${id}`)?.addEventListener("click", act);
    }
    const ghost = /** @type {HTMLInputElement} */ (part("ghost"));
    ghost.addEventListener("change", () => {
      this.flight.ghostShown = ghost.checked;
      this.changed = true;
    });
    const hold = /** @type {HTMLSelectElement | null} */ (document.getElementById("live-hold"));
    if (hold) hold.value = this.flight.held;
    hold?.addEventListener("change", () => {
      this.takeOver();
      this.flight.held = hold.value;
      this.say(this.heldWords() || "Keys and sticks drive the thrusters alone; nothing is held.");
      this.show();
    });
    stage.addEventListener("keydown", (event) => this.pressed(event));
    stage.addEventListener("keyup", (event) => this.keys.delete(event.code));
    stage.addEventListener("blur", () => this.keys.clear());
    stage.addEventListener("pointerdown", () => stage.focus());
    const picture = part("picture");
    picture.addEventListener("pointerdown", (event) => picture.setPointerCapture(event.pointerId));
    picture.addEventListener("pointermove", (event) => {
      if (!picture.hasPointerCapture(event.pointerId)) return;
      this.picture.orbit(event.movementX, event.movementY);
      this.show();
    });
    part("charts").addEventListener("pointermove", (event) => this.point(event));
    part("charts").addEventListener("pointerleave", () => this.point(null));
    part("view").addEventListener("change", () => this.arrange());
    part("timeline").addEventListener("input", () => {
      this.flight.seek(Number(/** @type {HTMLInputElement} */ (part("timeline")).value));
      this.show();
    });
    const file = /** @type {HTMLInputElement} */ (part("recording"));
    file.addEventListener("change", () => {
      if (file.files?.[0]) this.open(file.files[0]);
      file.value = "";
    });
    const section = part("section");
    section.addEventListener("dragover", (event) => {
      event.preventDefault();
      section.classList.add("dropping");
    });
    section.addEventListener("dragleave", (event) => {
      if (!section.contains(/** @type {Node | null} */ (event.relatedTarget))) section.classList.remove("dropping");
    });
    section.addEventListener("drop", (event) => {
      event.preventDefault();
      section.classList.remove("dropping");
      const dropped = event.dataTransfer?.files[0];
      if (dropped) this.open(dropped);
      else this.say("What was dropped is not a file.");
    });
    addEventListener("hashchange", () => this.follow(location.hash));
    new IntersectionObserver(([entry]) => {
      this.isSeen = entry.isIntersecting;
    }).observe(section);
    const resized = new ResizeObserver(() => {
      this.fit();
      this.draw(); // before the new size is painted
    });
    for (const name of ["stage", "charts"]) resized.observe(part(name));
    for (const media of ["(prefers-color-scheme: dark)", "print"])
      matchMedia(media).addEventListener("change", () => {
        this.fit();
        this.draw();
      });
  }

  /** Returns what the page says about the autopilot that holds the vehicle, or about one that cannot. */
  heldWords() {
    const { model } = this.flight.pilot;
    return this.vehicle.laws.length ? (model.lawOf(this.flight.held)?.words ?? "") : this.vehicle.unheld;
  }

  /** @param {HTMLInputElement} slider */
  slid(slider) {
    const name = slider.name;
    if (slider.dataset.kind === "tuning") {
      const { model } = this.flight.pilot;
      if (!this.flight.tune({ [name]: Number(slider.value) })) {
        this.say(`${name} = ${slider.value}: the mass matrix would not be positive definite, so it stays as it was.`);
        slider.value = String(model.get(name));
      }
      this.flight.ghostShown ||= !this.flight.isOther && this.isTuned();
    } else if (slider.dataset.kind === "load") {
      this.flight.set({ [name]: Number(slider.value) });
    } else if (slider.dataset.kind === "bed") {
      this.flight.bed = Number(slider.value);
    } else if (slider.dataset.kind === "start") {
      this.takeOver();
      this.flight.beginAt(name, (Number(slider.value) * Math.PI) / 180);
    } else if (slider.dataset.kind === "command") {
      this.takeOver();
      this.held[name] = Number(slider.value);
      this.command();
    }
    this.show();
  }

  isTuned() {
    return this.sliders.some(
      ({ value, dataset }) => dataset.kind === "tuning" && Number(value) !== Number(dataset.start),
    );
  }

  /** Ends a recording that is being flown, so that the pilot has control. */
  takeOver() {
    if (!this.flight.replay) return;
    this.flight.leave();
    this.flight.ghostShown = this.flight.isOther || this.isTuned();
    this.arrange();
    this.say("You have control; the recording has ended.");
  }

  /** Shows the value of each slider, that of a command as it acts, and the state of the buttons. */
  show() {
    for (const slider of this.sliders) {
      const { kind, unit, start } = slider.dataset;
      const isShare = kind === "command" || kind === "strength";
      if (kind === "command") slider.value = String(this.flight.pilot.model.get(slider.name));
      const value = Number(slider.value);
      const words = isShare
        ? `${shown(value * 100, 0)} %`
        : `${shown(value, Number(slider.max) < 1 ? 3 : 2)} ${unit ?? ""}`;
      const output = /** @type {HTMLElement} */ (slider.parentElement?.querySelector("output"));
      if (output.textContent === words) continue;
      const isUntested = isShare && isBeyond(this.vehicle, value);
      output.textContent = words;
      output.classList.toggle("untested", isUntested);
      slider.setAttribute("aria-valuetext", isUntested ? `${words}, beyond the tested range` : words);
      const [low, high] = [Number(slider.min), Number(slider.max)];
      const ends = [Number(start ?? low), value].map((x) => (x - low) / (high - low));
      slider.style.setProperty("--from", String(Math.min(...ends)));
      slider.style.setProperty("--to", String(Math.max(...ends)));
    }
    part("above").setAttribute("aria-pressed", String(this.picture.isFromAbove));
    const timeline = /** @type {HTMLInputElement} */ (part("timeline"));
    timeline.hidden = !this.flight.replay;
    timeline.value = String(this.flight.time);
    part("pause").textContent = this.paused ? "Fly on" : "Pause";
    part("speed").textContent = `${this.speed}×`;
    /** @type {HTMLInputElement} */ (part("ghost")).checked = this.flight.ghostShown;
    this.changed = true;
  }

  /** @param {string} words */
  say(words) {
    part("message").textContent = words;
  }

  /** @param {boolean} paused */
  pause(paused) {
    this.paused = paused;
    if (!paused && this.flight.test && this.hasEnded()) this.leaveTest();
    if (!paused && this.flight.replay && this.hasEnded()) this.takeOver();
    this.show();
  }

  /** @param {number} places */
  faster(places) {
    const next = SPEEDS.indexOf(this.speed) + places;
    this.speed = SPEEDS[Math.max(0, Math.min(SPEEDS.length - 1, next))];
    this.show();
  }

  /** @param {number} factor */
  zoom(factor) {
    this.picture.zoom(factor);
    this.changed = true;
  }

  /** Changes between the views from above and from an angle. */
  look() {
    this.picture.turn();
    this.show();
  }

  /** Shows the values at the place of the pointer. @param {PointerEvent | null} event */
  point(event) {
    const chart = this.charts.find(({ board }) => board.canvas === event?.target);
    if (event && !chart) return;
    this.pointed = null;
    if (event && chart) {
      const { left } = chart.board.canvas.getBoundingClientRect();
      const { plot } = chart;
      this.pointed = Math.max(0, Math.min(1, (event.clientX - left - plot.left) / (plot.right - plot.left)));
    }
    this.changed = true;
  }

  /** Makes the charts that are chosen. @param {string} [choice] */
  arrange(choice) {
    const view = /** @type {HTMLSelectElement} */ (part("view"));
    if (choice) view.value = choice;
    for (const option of view.options) option.hidden = PANELS[option.value](this.flight).length === 0;
    if (view.selectedOptions[0].hidden) view.value = "velocities";
    const panels = PANELS[view.value](this.flight);
    part("charts").replaceChildren();
    part("section").style.setProperty("--columns", String(Math.ceil(panels.length / this.rows)));
    this.charts = panels.map((panel) => new Chart(part("charts"), panel));
    const heave = PANELS.positions(this.flight).find((_, a) => this.vehicle.axes[a].position === "z");
    this.dive?.board.canvas.remove();
    this.dive = heave ? new Chart(part("column"), { ...heave, id: "dive", title: "depth", signal: undefined }) : null;
    this.fit();
  }

  /** Takes over the sizes on the screen. */
  fit() {
    for (const one of [this.picture, this.track, this.dive, ...this.charts]) one?.fit();
    this.changed = true;
  }

  /** Restores the commands, the camera, the speed and the time. */
  reset() {
    this.still();
    this.flight.reset();
    this.arrange();
    this.flight.begun = false;
    this.picture.reset();
    this.paused = false;
    this.speed = 1;
    this.say("");
    this.show();
  }

  /** The time span of the charts, in s: that of a step test shows its Tau. */
  get span() {
    const { test, replay, pilot } = this.flight;
    const Tau = test ? pilot.model.marks[2 * test.axis + 1] : Number.NaN;
    if (test) return Math.min(60, Math.max(4, Math.ceil(6 * (Number.isFinite(Tau) ? Tau : 3))));
    return replay ? SPAN_REPLAYED : SPAN;
  }

  /** Returns true when the step test has reached the end of the charts, or the recording its end. */
  hasEnded() {
    const { time, times, replay } = this.flight;
    return time >= (replay ? times[times.length - 1] : this.span);
  }

  /** Ends a step test; from then on the charts move again. */
  leaveTest() {
    if (this.hasEnded()) this.paused = false;
    this.flight.test = null;
  }

  /** Returns all commands to their start values. */
  still() {
    this.takeOver();
    this.slideCommands({});
  }

  /** @param {Record<string, number>} commands */
  slideCommands(commands) {
    for (const { name, dataset } of this.sliders) {
      if (dataset.kind === "command") this.held[name] = commands[name] ?? Number(dataset.start);
    }
    this.command();
    this.show();
  }

  /** @param {(slider: HTMLInputElement) => number} value */
  tuneAll(value) {
    for (const slider of this.sliders) {
      if (slider.dataset.kind !== "tuning") continue;
      slider.value = String(value(slider));
      this.slid(slider);
    }
  }

  /** Runs the step test that is chosen in the list. */
  run() {
    const test = this.vehicle.tests[Number(/** @type {HTMLSelectElement} */ (part("test")).value)];
    const axis = this.vehicle.axes[test.axis];
    const { signs, name } = axis;
    this.takeOver();
    for (const slider of this.sliders) if (slider.dataset.kind === "load") slider.value = String(slider.dataset.start);
    this.flight.run(test);
    this.arrange("velocities");
    this.slideCommands(Object.fromEntries(Object.entries(signs).map(([input, sign]) => [input, sign * test.command])));
    this.paused = false;
    this.say(`${name} ${Math.round(test.command * 100)} % from rest.`);
    this.show();
  }

  /** Flies a recording. If it cannot be read, the page says why, and the flight goes on. @param {File} file */
  async open(file) {
    try {
      if (file.size > MOST_BYTES) throw new Unreadable(`it is larger than ${MOST_BYTES / 1e6} MB`);
      const recording = readRecording(textOf(await file.arrayBuffer()), file.name, this.vehicle);
      this.slideCommands({});
      this.replay(recording);
    } catch (error) {
      const reason = error instanceof Unreadable ? error.message : "it cannot be read";
      this.say(`${file.name} cannot be flown: ${reason}.`);
    }
  }

  /** Flies a recording. @param {Recording} recording */
  replay(recording) {
    if (!this.flight.play(recording)) {
      this.say(`${recording.name}: the vehicle moves too fast under these commands to be computed.`);
      return;
    }
    this.paused = false;
    this.arrange("measured");
    const end = this.flight.times[this.flight.times.length - 1];
    place(part("timeline"), { max: end });
    const words = `${recording.name}: ${shown(end, 0)} s, flown with its commands. The ghost is what was measured.`;
    this.say([words, ...recording.notes].join(" "));
    this.show();
  }

  /** Saves the flight as a CSV file. */
  export() {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([tableOf(this.flight)], { type: "text/csv" }));
    link.download = `${this.vehicle.identifier}.csv`;
    link.click();
    URL.revokeObjectURL(link.href);
    this.say(
      `${link.download}: the flight of the last ${shown(this.flight.time - this.flight.times[0], 1)} s, which this page and rov-fmu identify read.`,
    );
  }

  /** Puts the vehicle and everything that is set into the page's address, and copies it. */
  share() {
    const given = new URLSearchParams({ vehicle: this.vehicle.identifier });
    for (const { name, value, dataset } of this.sliders) {
      const set = dataset.kind === "command" ? this.held[name] : Number(value);
      if (dataset.start !== undefined && set !== Number(dataset.start)) given.set(name, String(set));
    }
    history.replaceState(null, "", `#${given}`);
    this.say("The address of this page now contains the vehicle, the commands and the tuning.");
    navigator.clipboard?.writeText(location.href).then(
      () => this.say("A link with the vehicle, the commands and the tuning has been copied."),
      () => {},
    );
  }

  /** Sets everything that a link contains. @param {string} hash */
  follow(hash) {
    const given = new URLSearchParams(hash.slice(1));
    const vehicle = given.get("vehicle");
    if (vehicle === null) return;
    given.delete("vehicle");
    if (vehicle !== this.vehicle.identifier) {
      this.say(
        `The link is for the vehicle “${vehicle.slice(0, 40)}”, and this page flies “${this.vehicle.identifier}”.`,
      );
      return;
    }
    this.reset();
    /** @type {string[]} */
    const unused = [];
    for (const slider of this.sliders) {
      const { name, min, max, dataset } = slider;
      if (dataset.start === undefined) continue;
      const words = given.get(name) ?? dataset.start;
      given.delete(name);
      const value = words.trim() === "" ? Number.NaN : Number(words);
      const isAllowed = value >= Number(min) && value <= Number(max);
      if (!isAllowed) unused.push(`${name}=${words.slice(0, 20)} (must be a number from ${min} to ${max})`);
      const used = isAllowed ? value : Number(dataset.start);
      if (used === Number(slider.value)) continue;
      slider.value = String(used);
      this.slid(slider);
    }
    for (const name of given.keys()) unused.push(`${name.slice(0, 40)} (not a value of this vehicle)`);
    const more = unused.splice(4).length;
    if (more) unused.push(`${more} more`);
    if (unused.length) this.say(`The link has values that this page cannot use: ${unused.join(", ")}.`);
  }

  /** @param {KeyboardEvent} event */
  pressed(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.code in this.driving) this.keys.set(event.code, this.driving[event.code]);
    else if (event.code === "Space") this.pause(!this.paused);
    else if (event.key === "+") this.faster(1);
    else if (event.key === "-") this.faster(-1);
    else if (event.key === "0") this.still();
    else if (event.key === "Home") this.reset();
    else return;
    event.preventDefault();
  }

  // ---- The loop ----

  /** How strongly a key pushes: a share of the full command. */
  get strength() {
    return Number(/** @type {HTMLInputElement} */ (part("strength")).value);
  }

  /** The largest command by keys and sticks: the end of the tested range, or more if the pilot lets keys push more strongly. */
  get most() {
    return Math.max(this.strength, this.vehicle.tested);
  }

  /** Returns the demands of keys, sticks and gamepad along each axis. A stick at its end asks for the largest command. */
  demands() {
    const { strength, most } = this;
    /** @type {Map<string, number>} */
    const demands = new Map();
    for (const [axis, direction] of this.keys.values())
      demands.set(axis, Math.max(-1, Math.min(1, (demands.get(axis) ?? 0) + direction)) * strength);
    const pad = navigator.getGamepads?.().find((one) => one !== null && one.mapping === "standard");
    for (const [axis, n, direction] of STICKS) {
      const value = (this.sticks[n >> 1]?.at[n % 2] ?? 0) || (pad?.axes[n] ?? 0);
      if (Math.abs(value) > DEAD_ZONE) demands.set(axis, value * direction * most);
    }
    return demands;
  }

  /** Sets the commands from sliders, keys, sticks and gamepad. */
  command() {
    const demands = this.demands();
    if (this.flight.replay) {
      if (demands.size === 0) return;
      this.takeOver();
    }
    if (this.flight.held && !this.flight.test) {
      const { begun } = this.flight;
      this.flight.steer({ demands, added: this.held, most: this.most });
      if (begun !== this.flight.begun) this.say("");
      return;
    }
    const commands = commandsOf(this.vehicle, demands, this.most);
    for (const [name, value] of Object.entries(this.held)) commands[name] = saturated(commands[name] + value);
    const { model } = this.flight.pilot;
    if (this.vehicle.commands.every((name) => model.get(name) === commands[name])) return;
    if (this.flight.test) this.leaveTest();
    if (!this.flight.begun) this.say("");
    this.flight.set(commands);
    this.show();
  }

  /** Draws a frame, and steps the flight up to it. @param {number} now The time in ms. */
  frame(now) {
    requestAnimationFrame((next) => this.frame(next));
    const passed = Math.min(LONGEST_FRAME, (now - this.last) / 1000);
    this.last = now;
    if (!this.isSeen) return;
    this.command();
    if (!this.paused && !this.flight.isAtRest()) this.fly(Math.round(passed * this.speed * 1e6) / 1e6);
    if (!this.changed) return;
    this.paint();
    if (now - this.told < TOLD) return;
    this.told = now;
    if (this.flight.replay || this.flight.steering()) this.show();
    this.tell();
    this.changed = false;
  }

  /** @param {number} h */
  fly(h) {
    const { flight } = this;
    if (!flight.advance(flight.test ? Math.min(h, this.span - flight.time) : h))
      this.say("It moved too fast to be computed, and is back at the start.");
    if (flight.replay && this.hasEnded()) {
      this.say(flight.replay.verdict(this.vehicle));
      this.pause(true);
    }
    if (flight.test && this.hasEnded()) {
      this.say(`${part("message").textContent} The test has ended.`);
      this.pause(true);
    }
    this.changed = true;
  }

  /** Returns the words about the surface or the seabed that stops the vehicle, or that it has left because they are off. */
  edge() {
    const { pilot, bed, isBounded, replay, test } = this.flight;
    const z = pilot.model.get("z");
    if (!isBounded || replay || test) return z < 0 ? " (surface off)" : test && z > bed ? " (seabed off)" : "";
    return z <= 0 ? " (at the surface)" : z >= bed - RESTING * this.vehicle.size ? " (on the seabed)" : "";
  }

  /** Draws the flight, and writes its numbers. */
  draw() {
    this.paint();
    this.tell();
  }

  /** Draws what moves. */
  paint() {
    const { flight, picture } = this;
    const ghost = flight.ghostShown;
    picture.draw(flight);
    for (const chart of this.charts) chart.draw(flight, this.span, ghost, this.pointed);
    this.track?.draw(flight, flight.hasGhostTrack, picture.camera.azimuth);
    this.dive?.draw(flight, Math.max(SPAN, flight.times[flight.times.length - 1]), ghost, null);
  }

  /** Writes the numbers beside the picture, and shows what the legend has to explain. */
  tell() {
    const { flight, vehicle } = this;
    const { model } = flight.pilot;
    const all = this.charts.flatMap(({ panel }) => panel.traces);
    part("steady").hidden = flight.steering() !== null || this.charts.every(({ panel }) => panel.axis === undefined);
    part("measured").hidden = !all.some(({ kind }) => kind === "measured");
    part("grey").hidden = !flight.ghostShown;
    const untested = vehicle.commands.filter((name) => isBeyond(vehicle, model.get(name)));
    part("untested").hidden = untested.length === 0;
    const [roll, pitch, heading] = attitudeOf(model);
    const readings = [`${shown(flight.time, 1)} s`];
    if (model.has("x")) readings.push(`north ${shown(model.get("x"), 2)} m`, `east ${shown(model.get("y"), 2)} m`);
    if (model.has("z")) readings.push(`depth ${shown(model.get("z"), 2)} m${this.edge()}`);
    if (model.has("phi")) readings.push(`roll ${shown(roll, 0)}°`, `pitch ${shown(pitch, 0)}°`);
    if (model.has("psi")) readings.push(`heading ${shown(heading, 0)}°`);
    if (untested.length) readings.push(`beyond the tested range: ${untested.join(", ")}`);
    part("readings").textContent = readings.join(" · ");
    for (const chart of [...this.charts, this.dive]) chart?.tell();
  }
}

/** The flight of this page, once it is loaded. @type {Live | undefined} */
let live;

/** Loads the vehicles and shows the section, which stays hidden in a browser without WebAssembly or scripts. */
async function start() {
  /** @type {Vehicle[]} */
  const vehicles = JSON.parse(part("vehicles").textContent ?? "");
  const [pilot, other] = await Promise.all(vehicles.map((vehicle) => Model.load(vehicle)));
  part("section").hidden = false;
  const link = document.getElementById("live-link");
  if (link) link.hidden = false;
  live = new Live(pilot, other ?? null);
}

start().catch(() => document.getElementById("live-sorry")?.removeAttribute("hidden"));
