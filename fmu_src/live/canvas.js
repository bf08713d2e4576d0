// A canvas in the colours of the page. Lines, areas and texts are drawn in pixels of the page.

/** The colours of the page that drawings use, by role. */
const ROLES = ["page", "panel", "ink", "muted", "rule", "band", "grey", "blue", "orange", "steel", "metal"];

/** The height of a line of text, px. */
const LINE = 13;

/** @param {Element} element @param {Record<string, string | number>} attributes */
function place(element, attributes) {
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
}

/** @param {Element} parent @param {string} tag @param {Record<string, string | number>} [attributes] @returns {SVGElement} */
function drawn(parent, tag, attributes = {}) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  place(element, attributes);
  parent.append(element);
  return element;
}

/** Returns the smallest of 1, 2, 5 times a power of ten that is not below x. @param {number} x */
function roundUp(x) {
  const decade = 10 ** Math.floor(Math.log10(x));
  return decade * ([1, 2, 5].find((n) => n * decade >= x * (1 - 1e-9)) ?? 10);
}

/** @param {number} x @param {number} digits */
function shown(x, digits) {
  const text = Math.abs(x) < 1e7 ? x.toFixed(digits) : x.toExponential(2).replace("e+", "e");
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
}

/** Returns a length in words, "50 cm" or "2 m". @param {number} length In m. */
function lengthInWords(length) {
  return length < 1 ? `${Math.round(length * 100)} cm` : `${length} m`;
}

/** How a text is set: from its left end, around its middle, or up to its right end; in a colour; bold; with a border in the page's colour.
 * @typedef {{align?: CanvasTextAlign, colour?: string, isBold?: boolean, hasBorder?: boolean}} Setting */

class Board {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.canvas = canvas;
    this.pen = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
    /** The size in px of the page. */
    this.width = 300;
    this.height = 150;
    /** The colours of the page by their roles. @type {Record<string, string>} */
    this.colours = {};
    this.fonts = ["", ""];
    this.fit();
  }

  /** Takes over the size on the screen and the colours of the page. */
  fit() {
    const { canvas, pen } = this;
    this.width = canvas.clientWidth || this.width;
    this.height = canvas.clientHeight || this.height;
    [canvas.width, canvas.height] = [this.width, this.height].map((px) => Math.round(px * devicePixelRatio));
    pen.setTransform(canvas.width / this.width, 0, 0, canvas.height / this.height, 0, 0);
    pen.lineJoin = "round";
    const style = getComputedStyle(canvas);
    this.colours = Object.fromEntries(ROLES.map((role) => [role, style.getPropertyValue(`--${role}`).trim()]));
    this.fonts = ["", "600 "].map((weight) => `${weight}11px ${style.fontFamily}`);
  }

  clear() {
    this.pen.clearRect(0, 0, this.width, this.height);
  }

  /** Begins a path along points. @param {number[][]} points */
  trace(points) {
    const { pen } = this;
    pen.beginPath();
    this.run(points);
  }

  /** Adds a polyline to the path. @param {number[][]} points */
  run(points) {
    const { pen } = this;
    points.forEach(([x, y], n) => {
      if (n) pen.lineTo(x, y);
      else pen.moveTo(x, y);
    });
  }

  /** Draws the path that was begun. @param {string} colour @param {number} width @param {number[]} dash */
  stroke(colour, width = 1.5, dash = []) {
    const { pen } = this;
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    pen.setLineDash(dash);
    pen.stroke();
  }

  /** Draws a line through points. @param {number[][]} points @param {string} colour @param {number} width @param {number[]} dash */
  line(points, colour, width = 1.5, dash = []) {
    this.trace(points);
    this.stroke(colour, width, dash);
  }

  /** Fills the polygons within points; a polygon within another one is a hole. @param {number[][][]} polygons @param {string} fill
   * @param {string} stroke @param {number} alpha Of the area. */
  area(polygons, fill, stroke = "", alpha = 1) {
    const { pen } = this;
    pen.beginPath();
    for (const points of polygons) {
      this.run(points);
      pen.closePath();
    }
    pen.globalAlpha = alpha;
    pen.fillStyle = fill;
    pen.fill("evenodd");
    pen.globalAlpha = 1;
    if (stroke) this.stroke(stroke, 1);
  }

  /** @param {number} x @param {number} y @param {number} r @param {string} fill @param {string} stroke */
  circle(x, y, r, fill, stroke = "") {
    const { pen } = this;
    pen.beginPath();
    pen.arc(x, y, r, 0, TURN);
    if (fill) {
      pen.fillStyle = fill;
      pen.fill();
    }
    if (stroke) this.stroke(stroke);
  }

  /** @param {string} words @param {number} x @param {number} y Of the line on which the letters stand. @param {Setting} setting */
  text(words, x, y, { align = "left", colour = this.colours.muted, isBold = false, hasBorder = false } = {}) {
    const { pen } = this;
    pen.font = this.fonts[Number(isBold)];
    pen.textAlign = align;
    if (hasBorder) {
      pen.strokeStyle = this.colours.page;
      pen.lineWidth = 3;
      pen.setLineDash([]);
      pen.strokeText(words, x, y);
    }
    pen.fillStyle = colour;
    pen.fillText(words, x, y);
  }

  /** Returns the width of a text, px. @param {string} words @param {boolean} isBold */
  measure(words, isBold = false) {
    this.pen.font = this.fonts[Number(isBold)];
    return this.pen.measureText(words).width;
  }
}
