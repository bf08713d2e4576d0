// The page's controls (sliders, keys, a gamepad, step tests, recordings), and the loop that steps and draws.

const SPEEDS = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50];
const SPAN = 20; // s, of the charts
const LONGEST_FRAME = 0.1; // s; a page that was hidden does not fly what it missed
const DEAD_ZONE = 0.12;

/** The axis that each arrow key drives, and the direction. @type {Record<string, [string, number]>} */
const ARROWS = {
  ArrowUp: ["surge", 1],
  ArrowDown: ["surge", -1],
  ArrowRight: ["yaw", 1],
  ArrowLeft: ["yaw", -1],
};

/** The sticks of a standard gamepad, assigned as on ROVs: axis, stick, direction. @type {[string, number, number][]} */
const STICKS = [
  ["yaw", 0, 1],
  ["heave", 1, 1],
  ["sway", 2, 1],
  ["surge", 3, -1],
];

/** @param {string} id @returns {HTMLElement} */
function part(id) {
  return /** @type {HTMLElement} */ (document.getElementById(`live-${id}`));
}

/** Returns a value of a slider rounded to about a hundredth of its range. @param {number} value @param {number} most */
function rounded(value, most) {
  const step = 10 ** (Math.floor(Math.log10(most)) - 2);
  return Number((Math.round(value / step) * step).toPrecision(12));
}

class Live {
  /** @param {Model} pilot @param {Model | null} other */
  constructor(pilot, other) {
    this.flight = new Flight(pilot, other);
    this.vehicle = pilot.vehicle;
    this.paused = false;
    this.speed = 1;
    /** The time span of the charts, in s. */
    this.span = SPAN;
    /** The axis and the direction of each key, which is known by its place on the keyboard. @type {Record<string, [string, number]>} */
    this.driving = { ...ARROWS };
    for (const { name, keys } of this.vehicle.axes) {
      this.driving[`Key${keys[0]}`] = [name, 1];
      this.driving[`Key${keys[1]}`] = [name, -1];
    }
    /** The keys that are down, with their axes and directions. @type {Map<string, [string, number]>} */
    this.keys = new Map();
    /** @type {Map<string, number>} */
    this.sticks = new Map();
    /** @type {HTMLInputElement[]} */
    this.sliders = [...part("controls").querySelectorAll("input")].filter((input) => input.type === "range");
    this.track = pilot.has("x") ? new TrackView(part("track"), this.flight) : null;
    this.compass = pilot.has("psi") ? new Compass(part("compass")) : null;
    this.horizon = pilot.has("phi") ? new Horizon(part("horizon")) : null;
    this.depth = pilot.has("z") ? new DepthTape(part("depth")) : null;
    this.charts = this.vehicle.axes.map((axis, n) => new Chart(part(`chart-${axis.name}`), axis, n));
    this.isSeen = true;
    this.changed = true;
    this.last = 0;
    this.connect();
    this.show();
    requestAnimationFrame((now) => this.frame(now));
  }

  // ---- Controls ----

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
      ["file", () => this.tuneAll((slider) => Number(slider.dataset.start))],
      ["ones", () => this.tuneAll(() => 1)],
      ["run", () => this.run()],
    ])) {
      document.getElementById(`live-${id}`)?.addEventListener("click", act);
    }
    const ghost = /** @type {HTMLInputElement} */ (part("ghost"));
    ghost.addEventListener("change", () => {
      this.flight.ghostShown = ghost.checked;
      this.changed = true;
    });
    stage.addEventListener("keydown", (event) => this.pressed(event));
    stage.addEventListener("keyup", (event) => this.keys.delete(event.code));
    stage.addEventListener("blur", () => this.keys.clear());
    stage.addEventListener("pointerdown", () => stage.focus());
    const file = /** @type {HTMLInputElement} */ (part("recording"));
    file.addEventListener("change", () => {
      if (file.files?.[0]) this.open(file.files[0]);
      file.value = "";
    });
    const section = part("section");
    section.addEventListener("dragover", (event) => event.preventDefault());
    section.addEventListener("drop", (event) => {
      event.preventDefault();
      const dropped = event.dataTransfer?.files[0];
      if (dropped) this.open(dropped);
      else this.say("What was dropped is no file.");
    });
    new IntersectionObserver(([entry]) => {
      this.isSeen = entry.isIntersecting;
    }).observe(section);
    new ResizeObserver(() => {
      this.track?.fit();
      this.draw(); // before the new size is painted
    }).observe(stage);
  }

  /** @param {HTMLInputElement} slider */
  slid(slider) {
    const name = slider.name;
    if (slider.dataset.kind === "tuning") {
      this.flight.tune({ [name]: Number(slider.value) });
      this.flight.ghostShown ||= !this.flight.isOther && this.isTuned();
    } else if (slider.dataset.kind === "load") {
      this.flight.set({ [name]: Number(slider.value) });
    } else if (slider.dataset.kind === "start") {
      this.takeOver();
      this.flight.beginAt(name, (Number(slider.value) * Math.PI) / 180);
    } else {
      this.takeOver();
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
    if (!this.flight.playback) return;
    this.flight.playback = null;
    this.flight.ghostShown = this.flight.isOther || this.isTuned();
    this.span = SPAN;
    this.say("You have control; the recording has ended.");
  }

  /** Shows the value of each slider, and the state of the buttons. */
  show() {
    for (const slider of this.sliders) {
      const output = /** @type {HTMLElement} */ (slider.parentElement?.querySelector("output"));
      const value = Number(slider.value);
      const { kind, unit } = slider.dataset;
      const isShare = kind === "command" || kind === "strength";
      const acts = kind === "command" ? this.flight.pilot.model.get(slider.name) : value;
      output.textContent = isShare ? `${shown(acts * 100, 0)} %` : `${shown(acts, 2)} ${unit ?? ""}`;
      slider.setAttribute(
        "aria-valuetext",
        isShare ? `${shown(value * 100, 0)} %` : `${shown(value, 2)} ${unit ?? ""}`,
      );
    }
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
    if (!paused && this.flight.playback?.next() === null) this.takeOver();
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
    this.track?.zoom(factor);
    this.changed = true;
  }

  reset() {
    this.takeOver();
    this.flight.reset();
    this.span = SPAN;
    this.say("");
    this.show();
  }

  /** Returns all commands to their start values. */
  still() {
    this.takeOver();
    this.slideCommands({});
  }

  /** @param {Record<string, number>} commands */
  slideCommands(commands) {
    for (const slider of this.sliders) {
      if (slider.dataset.kind === "command") slider.value = String(commands[slider.name] ?? slider.dataset.start);
    }
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
    const { signs, name, unit } = this.vehicle.axes[test.axis];
    this.takeOver();
    for (const slider of this.sliders) if (slider.dataset.kind === "load") slider.value = String(slider.dataset.start);
    this.flight.run(test);
    this.slideCommands(Object.fromEntries(Object.entries(signs).map(([input, sign]) => [input, sign * test.command])));
    const Tau = this.flight.pilot.model.marks[2 * test.axis + 1];
    this.span = Math.min(60, Math.max(4, Math.ceil(6 * (Number.isFinite(Tau) ? Tau : 3))));
    this.paused = false;
    this.say(
      `${name} ${Math.round(test.command * 100)} % from rest${test.V === null ? "" : `; measured: V_ss ${test.V} ${unit}${test.Tau === null ? "" : `, Tau ${test.Tau} s`}`}.`,
    );
    this.show();
  }

  /** Flies a recording. If it cannot be read, the page says why, and the flight goes on. @param {File} file */
  async open(file) {
    try {
      if (file.size > MOST_BYTES) throw new Unreadable(`it is larger than ${MOST_BYTES / 1e6} MB`);
      const recording = readRecording(await file.text(), file.name, this.vehicle);
      this.slideCommands({});
      this.flight.play(recording);
      this.span = 30;
      this.paused = false;
      this.say(
        `${file.name}: ${shown(recording.times[recording.times.length - 1], 0)} s, flown with its commands. The ghost is what was measured.`,
      );
      this.show();
    } catch (error) {
      const reason = error instanceof Unreadable ? error.message : "it cannot be read";
      this.say(`${file.name} cannot be flown: ${reason}.`);
    }
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

  /** Returns the demands of keys and gamepad along each axis. */
  demands() {
    const strength = Number(/** @type {HTMLInputElement} */ (part("strength")).value);
    /** @type {Map<string, number>} */
    const demands = new Map();
    for (const [axis, direction] of this.keys.values())
      demands.set(axis, Math.max(-1, Math.min(1, (demands.get(axis) ?? 0) + direction)) * strength);
    const pad = navigator.getGamepads?.().find((one) => one !== null && one.mapping === "standard");
    for (const [axis, stick, direction] of pad ? STICKS : []) {
      const value = pad?.axes[stick] ?? 0;
      if (Math.abs(value) > DEAD_ZONE) demands.set(axis, value * direction);
    }
    return demands;
  }

  /** Sets the commands from sliders, keys and gamepad. */
  command() {
    const demands = this.demands();
    if (this.flight.playback) {
      if (demands.size === 0) return;
      this.takeOver();
    }
    const commands = commandsOf(this.vehicle, demands);
    for (const { name, value, dataset } of this.sliders) {
      if (dataset.kind === "command") commands[name] = saturated(commands[name] + Number(value));
    }
    const { model } = this.flight.pilot;
    if (this.vehicle.commands.every((name) => model.get(name) === commands[name])) return;
    if (this.flight.test) this.span = SPAN;
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
    if (this.flight.begun && !this.paused) this.fly(passed * this.speed);
    if (this.changed) this.draw();
  }

  /** @param {number} h */
  fly(h) {
    const { flight } = this;
    if (!flight.advance(h)) this.say("It moved too fast to be computed, and is back at the start.");
    if (flight.playback && flight.playback.next() === null) {
      this.say(flight.playback.verdict(this.vehicle));
      this.pause(true);
    }
    if (flight.playback) this.show();
    this.changed = true;
  }

  draw() {
    this.changed = false;
    const { flight } = this;
    const { model } = flight.pilot;
    const ghost = flight.ghostShown;
    this.track?.draw(flight);
    this.compass?.draw(flight, ghost);
    this.horizon?.draw(flight, ghost);
    this.depth?.draw(flight, ghost);
    for (const chart of this.charts) chart.draw(flight, this.span, ghost);
    const [roll, pitch, heading] = attitudeOf(model);
    const readings = [`${shown(flight.time, 1)} s`];
    if (model.has("x")) readings.push(`north ${shown(model.get("x"), 2)} m`, `east ${shown(model.get("y"), 2)} m`);
    if (model.has("z")) readings.push(`depth ${shown(model.get("z"), 2)} m`);
    if (model.has("phi")) readings.push(`roll ${shown(roll, 0)}°`, `pitch ${shown(pitch, 0)}°`);
    if (model.has("psi")) readings.push(`heading ${shown(heading, 0)}°`);
    part("readings").textContent = readings.join(" · ");
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
