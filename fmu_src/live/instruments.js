// The instruments on the picture: the compass, which is the only north of the page, the attitude, the depth and the scale of the grid.

/** Returns the roll angle, the pitch angle and the heading (from 0 to 359) in degrees. @param {Model} model */
function attitudeOf(model) {
  const [phi, theta, psi] = ["phi", "theta", "psi"].map((name) => (model.get(name) * 180) / Math.PI);
  return [phi, theta, ((Math.round(psi) % 360) + 360) % 360];
}

const GAP = 8; // px around an instrument
const HORIZON = 0.8; // px per degree
const TAPE = 22; // px per metre of depth

class Instruments {
  /** @param {Model} model */
  constructor(model) {
    this.hasHeading = model.has("psi");
    this.hasAttitude = model.has("phi");
    this.hasDepth = model.has("z");
    /** Where the compass, the horizon, the tape of depths and the scale are on the picture. */
    this.compass = new DOMRect();
    this.horizon = new DOMRect();
    this.tape = new DOMRect();
    this.scale = new DOMRect();
  }

  /** Those that are drawn. */
  get boxes() {
    const { compass, horizon, tape, scale } = this;
    return [compass, horizon, tape, scale].filter(({ width }) => width > 0);
  }

  /** Lays the instruments along the upper edge and the right edge of a picture. @param {number} width @param {number} height Of what is free. */
  fit(width, height) {
    const size = Math.max(66, Math.min(104, 0.21 * width, 0.36 * height));
    this.compass = this.hasHeading ? new DOMRect(GAP, GAP, size, size + LINE) : new DOMRect();
    const left = this.hasHeading ? this.compass.right + GAP : GAP;
    this.scale = new DOMRect(left, GAP, 86, 26);
    this.horizon = this.hasAttitude ? new DOMRect(width - GAP - size, GAP, size, size + LINE) : new DOMRect();
    const top = this.hasAttitude ? this.horizon.bottom + GAP : GAP;
    const tall = Math.min(150, height - top - GAP);
    this.tape = this.hasDepth && tall > 60 ? new DOMRect(width - GAP - 58, top, 58, tall) : new DOMRect();
  }

  /** @param {Board} board @param {Flight} flight @param {{azimuth: number}} camera @param {number} bar The step of the grid, px.
   * @param {string} length The same in words. */
  draw(board, { pilot, ghost, ghostShown }, { azimuth }, bar, length) {
    const others = ghostShown ? [ghost.model] : [];
    if (this.compass.width) this.rose(board, [...others, pilot.model], azimuth);
    if (this.horizon.width) this.attitude(board, [...others, pilot.model]);
    if (this.tape.width) this.depths(board, [...others, pilot.model]);
    const { left, top } = this.scale;
    board.text(`Grid ${length}`, left, top + 10);
    board.line(
      [
        [left, top + 18],
        [left + Math.min(bar, this.scale.width), top + 18],
      ],
      board.colours.muted,
      2,
    );
  }

  /** Draws the heading on a rose that turns with the camera: its north is that of the picture and of the track.
   * @param {Board} board @param {Model[]} models The ghost's, if it is shown, and the pilot's. @param {number} azimuth */
  rose(board, models, azimuth) {
    const { left, top, width } = this.compass;
    const { grey, blue, muted, ink, page } = board.colours;
    const [x, y, r] = [left + width / 2, top + width / 2, width / 2 - 13];
    const at = (/** @type {number} */ angle, /** @type {number} */ far) => [
      x + far * Math.sin(angle - azimuth),
      y - far * Math.cos(angle - azimuth),
    ];
    board.pen.globalAlpha = 0.75;
    board.circle(x, y, r + 13, page);
    board.pen.globalAlpha = 1;
    board.pen.beginPath();
    for (let n = 0; n < 12; n++) board.run([at((n * Math.PI) / 6, r), at((n * Math.PI) / 6, r - (n % 3 ? 4 : 8))]);
    board.stroke(muted, 1);
    ["N", "E", "S", "W"].forEach((letter, n) => {
      const [u, v] = at((n * Math.PI) / 2, r + 6);
      board.text(letter, u, v + 4, { align: "center", colour: n ? muted : ink, isBold: n === 0 });
    });
    models.forEach((model, n) => {
      const psi = model.get("psi");
      const needle = [at(psi, 0.8 * r), at(psi + 2.8, 0.62 * r), at(psi, -0.4 * r), at(psi - 2.8, 0.62 * r)];
      if (n === models.length - 1) board.area([needle], blue);
      else board.line([...needle, needle[0]], grey);
    });
    const [, , heading] = attitudeOf(models[models.length - 1]);
    board.text(`heading ${heading}°`, x, top + width + 10, { align: "center", hasBorder: true });
  }

  /** Draws a horizon that sinks when the bow rises, and leans to port when the starboard side goes down.
   * @param {Board} board @param {Model[]} models */
  attitude(board, models) {
    const { left, top, width } = this.horizon;
    const { page, band, muted, grey, blue, metal } = board.colours;
    const [x, y, half] = [left + width / 2, top + width / 2, width / 2];
    const { pen } = board;
    pen.save();
    board.area([rectangle(left, left + width, top, top + width)], page);
    pen.beginPath();
    pen.rect(left, top, width, width);
    pen.clip();
    models.forEach((model, n) => {
      const [phi, theta] = attitudeOf(model);
      pen.save();
      pen.translate(x, y);
      pen.rotate((-phi * Math.PI) / 180);
      pen.translate(0, theta * HORIZON);
      if (n < models.length - 1)
        board.line(
          [
            [-200, 0],
            [200, 0],
          ],
          grey,
        );
      else {
        board.area([rectangle(-200, 200, 0, 400)], band);
        board.line(
          [
            [-200, 0],
            [200, 0],
          ],
          muted,
        );
        for (const angle of [-60, -30, 30, 60]) {
          board.line(
            [
              [-10, angle * HORIZON],
              [10, angle * HORIZON],
            ],
            muted,
            1,
          );
          board.text(`${Math.abs(angle)}`, 13, angle * HORIZON + 4);
        }
      }
      pen.restore();
    });
    board.line(
      [
        [x - 0.68 * half, y],
        [x - 0.28 * half, y],
        [x - 0.16 * half, y + 6],
      ],
      blue,
      2.4,
    );
    board.line(
      [
        [x + 0.68 * half, y],
        [x + 0.28 * half, y],
        [x + 0.16 * half, y + 6],
      ],
      blue,
      2.4,
    );
    pen.restore();
    board.line([...rectangle(left, left + width, top, top + width), [left, top]], metal, 1);
    const [phi, theta] = attitudeOf(models[models.length - 1]).map((angle) => shown(angle, 0));
    board.text(`φ ${phi}°`, left, top + width + 11, { hasBorder: true });
    board.text(`θ ${theta}°`, left + width, top + width + 11, { align: "right", hasBorder: true });
  }

  /** Draws a tape of depths that runs past a mark. @param {Board} board @param {Model[]} models */
  depths(board, models) {
    const { left, top, width, height } = this.tape;
    const { page, muted, grey, blue } = board.colours;
    const z = models[models.length - 1].get("z");
    const [low, high] = [top + LINE + 6, top + height - 6];
    const middle = (low + high) / 2;
    const py = (/** @type {number} */ depth) => middle + (depth - z) * TAPE;
    board.area([rectangle(left, left + width, top, top + height)], page, "", 0.75);
    board.text("depth, m", left + width / 2, top + 11, { align: "center" });
    board.pen.beginPath();
    const reach = (high - middle - 4) / TAPE;
    for (let n = Math.ceil(2 * (z - reach)); n <= 2 * (z + reach); n++) {
      board.run([
        [left + 16, py(n / 2)],
        [left + (n % 2 ? 21 : 26), py(n / 2)],
      ]);
    }
    board.stroke(muted, 1);
    for (let n = Math.ceil(z - reach); n <= z + reach; n++) board.text(shown(n, 0), left + 30, py(n) + 4);
    models.forEach((model, n) => {
      const v = Math.max(low, Math.min(high, py(model.get("z"))));
      const mark = [
        [left + 14, v],
        [left + 3, v - 7],
        [left + 3, v + 7],
      ];
      if (n === models.length - 1) board.area([mark], blue);
      else board.line([...mark, mark[0]], grey);
    });
  }
}
