// The ball of a shot in three dimensions, painted on a canvas: its own logo, the axis of its spin, and its turning.

/** @import { ShotDetail } from "../messages.d.ts" */

const BALL_SHARE = 0.7; // of the canvas's half side
const MOST_PX = 400; // painted; the browser enlarges it: 20 pictures a second by software on two cores
const SMOOTH = 4; // as in app/coach/ball_picture.py
const AXIS_LENGTH = 1.38; // in ball radii
const LIGHT = [-0.35, 0.6, 0.72]; // from above, as in a hall
const WHITE = [252, 250, 244], INK = [34, 48, 110];
const AXIS_COLOUR = "#c2410c", FLIGHT_COLOUR = "#0f766e";

/** @typedef {number[][]} Matrix rows */
/** @typedef {"corner" | "hitter" | "camera"} Eye */

/** @param {Matrix} a @param {Matrix} b */
const product = (a, b) => a.map((row) => [0, 1, 2].map((j) => row[0] * b[0][j] + row[1] * b[1][j] + row[2] * b[2][j]));

/** @param {Matrix} m @param {number[]} v */
const applied = (m, v) => m.map((row) => row[0] * v[0] + row[1] * v[1] + row[2] * v[2]);

/** @param {number[]} a @param {number[]} b */
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

/** @param {number[]} v */
const unit = (v) => {
  const length = Math.hypot(...v) || 1;
  return v.map((one) => one / length);
};

/** Rotation about a unit axis. @param {number[]} axis @param {number} angle @returns {Matrix} */
export function rotation(axis, angle) {
  const [x, y, z] = axis, c = Math.cos(angle), s = Math.sin(angle), v = 1 - c;
  return [
    [c + x * x * v, x * y * v - z * s, x * z * v + y * s],
    [y * x * v + z * s, c + y * y * v, y * z * v - x * s],
    [z * x * v - y * s, z * y * v + x * s, c + z * z * v],
  ];
}

/** Ink of a texture in base64, 0 to 255, interpolated to SMOOTH pixels each way, and its side. @param {string} base64 */
async function inkOf(base64) {
  const image = new Image();
  image.src = `data:image/png;base64,${base64}`;
  await image.decode();
  const canvas = document.createElement("canvas");
  const side = canvas.width = canvas.height = SMOOTH * image.width;
  const context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d", { willReadFrequently: true }));
  context.drawImage(image, 0, 0, side, side);
  const { data } = context.getImageData(0, 0, side, side);
  return { ink: data.filter((_, i) => i % 4 === 0), side };
}

export class TurningBall {
  /** @type {Uint8ClampedArray | null} */
  #ink = null;
  #side = 0;
  /** @type {Matrix} rows right, up, towards the eye in the camera frame */
  #frame;
  /** @type {Float32Array} x, y, z of each pixel's normal in the eye's frame */
  #normals = new Float32Array();
  /** @type {Int32Array} its place in the picture */
  #places = new Int32Array();
  /** @type {Float32Array} */
  #shades = new Float32Array();
  /** @type {ImageData | null} */
  #image = null;
  #layer = document.createElement("canvas");
  t_us = 0;

  /** @param {HTMLCanvasElement} canvas @param {ShotDetail} detail */
  constructor(canvas, detail) {
    this.canvas = canvas;
    this.detail = detail;
    this.spin = detail.spin_rps ?? [0, 0, 0];
    this.axis = unit(this.spin);
    this.rate = Math.hypot(...this.spin);
    this.t_us = detail.reference_us;
    this.#frame = this.frameOf("corner");
    this.ready = detail.texture === null ? Promise.resolve() : inkOf(detail.texture).then(({ ink, side }) => {
      this.#ink = /** @type {Uint8ClampedArray} */ (ink);
      this.#side = side;
    });
    this.#resize();
    new ResizeObserver(() => this.#resize() && this.draw()).observe(canvas);
    this.#followPointer();
  }

  /** @param {Eye} eye @returns {Matrix} */
  frameOf(eye) {
    const { hitter } = this.detail;
    if (eye === "camera" || hitter === null) return [[1, 0, 0], [0, -1, 0], [0, 0, -1]];
    const [right, up, forward] = hitter;
    const [a, b, c] = eye === "hitter" ? [0, 0.12, -1] : [0.62, 0.42, -0.66];
    const towards = unit([0, 1, 2].map((i) => a * right[i] + b * up[i] + c * forward[i]));
    const across = unit(cross(up, towards));
    return [across, cross(towards, across), towards];
  }

  look(/** @type {Eye} */ eye) {
    this.#frame = this.frameOf(eye);
    this.draw();
  }

  /** Paints the ball at a file time. */
  draw(t_us = this.t_us) {
    this.t_us = t_us;
    const context = this.canvas.getContext("2d");
    if (!context || !this.#image) return;
    this.#paint();
    const size = this.canvas.width;
    context.clearRect(0, 0, size, size);
    const axis = applied(this.#frame, this.axis);
    const behind = axis[2] < 0;
    if (this.rate) this.#drawAxis(context, axis, behind ? 1 : -1);
    context.drawImage(this.#layer, 0, 0);
    if (this.rate) {
      this.#drawAxis(context, axis, behind ? -1 : 1);
      this.#drawTurn(context, axis);
    }
    this.#drawFlight(context);
  }

  #resize() {
    const wide = this.canvas.clientWidth * Math.min(devicePixelRatio, 2);
    const size = Math.round(Math.min(Math.max(wide, 80), MOST_PX));
    if (this.#image?.width === size) return false;
    this.canvas.width =
      this.canvas.height =
      this.#layer.width =
      this.#layer.height =
        size;
    this.#image = new ImageData(size, size);
    const normals = [], places = [], shades = [];
    for (let row = 0; row < size; row++) {
      for (let column = 0; column < size; column++) {
        const x = ((column + 0.5) / size * 2 - 1) / BALL_SHARE, y = (1 - (row + 0.5) / size * 2) / BALL_SHARE;
        const z2 = 1 - x * x - y * y;
        if (z2 <= 0) continue;
        const z = Math.sqrt(z2);
        normals.push(x, y, z);
        places.push(4 * (row * size + column));
        shades.push(0.62 + 0.38 * Math.max(0, x * LIGHT[0] + y * LIGHT[1] + z * LIGHT[2]));
      }
    }
    this.#normals = new Float32Array(normals);
    this.#places = new Int32Array(places);
    this.#shades = new Float32Array(shades);
    return true;
  }

  // Looks every pixel's direction up in the octahedral texture (app/coach/logo_texture.py).
  #paint() {
    const { data } = /** @type {ImageData} */ (this.#image);
    const turn = rotation(this.axis, -2 * Math.PI * this.rate * (this.t_us - this.detail.reference_us) * 1e-6);
    // From the eye's frame to the camera's (transposed), then back to the reference time.
    const frame = this.#frame;
    const [r0, r1, r2] = product(turn, [0, 1, 2].map((i) => [frame[0][i], frame[1][i], frame[2][i]]));
    const normals = this.#normals, places = this.#places, shades = this.#shades, ink = this.#ink, side = this.#side;
    const half = side / 2, last = side - 1;
    for (let i = 0, n = 0; i < places.length; i++, n += 3) {
      const u = normals[n], v = normals[n + 1], w = normals[n + 2];
      let cover = 0;
      if (ink) {
        const x = r0[0] * u + r0[1] * v + r0[2] * w, y = r1[0] * u + r1[1] * v + r1[2] * w;
        const z = r2[0] * u + r2[1] * v + r2[2] * w;
        const sum = Math.abs(x) + Math.abs(y) + Math.abs(z);
        let column = x / sum, row = y / sum;
        if (z < 0) {
          const folded = (1 - Math.abs(row)) * (column < 0 ? -1 : 1);
          row = (1 - Math.abs(column)) * (row < 0 ? -1 : 1);
          column = folded;
        }
        const across = Math.min(last, Math.trunc((column + 1) * half));
        const down = Math.min(last, Math.trunc((row + 1) * half));
        cover = ink[down * side + across] / 255;
      }
      const shade = shades[i], at = places[i];
      data[at] = shade * (WHITE[0] + cover * (INK[0] - WHITE[0]));
      data[at + 1] = shade * (WHITE[1] + cover * (INK[1] - WHITE[1]));
      data[at + 2] = shade * (WHITE[2] + cover * (INK[2] - WHITE[2]));
      data[at + 3] = 255;
    }
    this.#layer.getContext("2d")?.putImageData(/** @type {ImageData} */ (this.#image), 0, 0);
  }

  /** @param {number[]} point in the eye's frame, ball radii */
  #place(point) {
    const half = this.canvas.width / 2;
    return [half + half * BALL_SHARE * point[0], half - half * BALL_SHARE * point[1]];
  }

  /** One end of the axis; the positive one has an arrow's head. @param {CanvasRenderingContext2D} context @param {number[]} axis @param {number} sign */
  #drawAxis(context, axis, sign) {
    const [x0, y0] = this.#place(axis.map((one) => sign * one));
    const [x1, y1] = this.#place(axis.map((one) => sign * AXIS_LENGTH * one));
    this.#arrow(context, x0, y0, x1, y1, AXIS_COLOUR, sign > 0);
  }

  /** @param {CanvasRenderingContext2D} context @param {number} x0 @param {number} y0 @param {number} x1 @param {number} y1 @param {string} colour @param {boolean} hasHead */
  #arrow(context, x0, y0, x1, y1, colour, hasHead) {
    const width = this.canvas.width / 70, length = Math.hypot(x1 - x0, y1 - y0);
    context.strokeStyle = context.fillStyle = colour;
    context.lineWidth = width;
    context.lineCap = "round";
    context.beginPath();
    context.moveTo(x0, y0);
    context.lineTo(x1, y1);
    context.stroke();
    if (!hasHead || length < width) return;
    const dx = (x1 - x0) / length, dy = (y1 - y0) / length;
    context.beginPath();
    context.moveTo(x1 + 2.2 * width * dx, y1 + 2.2 * width * dy);
    context.lineTo(x1 - width * dx - 2 * width * dy, y1 - width * dy + 2 * width * dx);
    context.lineTo(x1 - width * dx + 2 * width * dy, y1 - width * dy - 2 * width * dx);
    context.fill();
  }

  // An arrow round the ball in the direction in which it turns, where it lies before the ball.
  /** @param {CanvasRenderingContext2D} context @param {number[]} axis */
  #drawTurn(context, axis) {
    const towards = [0, 0, 1];
    let front = towards.map((one, i) => one - axis[2] * axis[i]);
    if (Math.hypot(...front) < 0.1) front = [0, 1, 0].map((one, i) => one - axis[1] * axis[i]);
    front = unit(front);
    const side = cross(axis, front);
    const points = [];
    for (let angle = -0.9; angle <= 0.9; angle += 0.1) {
      points.push(this.#place([0, 1, 2].map((i) => 1.04 * (Math.cos(angle) * front[i] + Math.sin(angle) * side[i]))));
    }
    context.strokeStyle = AXIS_COLOUR;
    context.lineWidth = this.canvas.width / 110;
    context.beginPath();
    points.slice(0, -1).forEach(([x, y], i) => i ? context.lineTo(x, y) : context.moveTo(x, y));
    context.stroke();
    const [[x0, y0], [x1, y1]] = points.slice(-2);
    this.#arrow(context, x0, y0, x1, y1, AXIS_COLOUR, true);
  }

  // The direction of flight, beside the ball.
  /** @param {CanvasRenderingContext2D} context */
  #drawFlight(context) {
    const { hitter } = this.detail;
    if (hitter === null) return;
    const forward = applied(this.#frame, hitter[2]);
    if (Math.hypot(forward[0], forward[1]) < 0.15) return;
    const begin = [0.9, -1.2, 0];
    const [x0, y0] = this.#place(begin);
    const [x1, y1] = this.#place([begin[0] + 0.4 * forward[0], begin[1] + 0.4 * forward[1], 0]);
    this.#arrow(context, x0, y0, x1, y1, FLIGHT_COLOUR, true);
  }

  #followPointer() {
    /** @type {number[] | null} */
    let last = null;
    this.canvas.addEventListener("pointerdown", (event) => {
      last = [event.clientX, event.clientY];
      this.canvas.setPointerCapture(event.pointerId);
    });
    this.canvas.addEventListener("pointermove", (event) => {
      if (!last) return;
      const per = Math.PI / this.canvas.clientWidth;
      const turn = product(
        rotation([1, 0, 0], (event.clientY - last[1]) * per),
        rotation([0, 1, 0], (event.clientX - last[0]) * per),
      );
      this.#frame = product(turn, this.#frame);
      last = [event.clientX, event.clientY];
      this.draw();
    });
    for (const end of ["pointerup", "pointercancel"]) this.canvas.addEventListener(end, () => last = null);
  }
}

// Time of a shot in slow motion, over and over.
export class SlowMotion {
  #frame = 0;
  #last = 0;
  #drawn = 0;
  #since = 0;
  isPlaying = false;
  slowness = 100;
  framesPerSecond = 0;

  /** @param {number} start_us @param {number} end_us @param {(t_us: number) => void} show */
  constructor(start_us, end_us, show) {
    this.start_us = start_us;
    this.end_us = end_us;
    this.show = show;
    this.t_us = start_us;
  }

  play() {
    this.isPlaying = true;
    this.#last = this.#since = performance.now();
    this.#drawn = 0;
    cancelAnimationFrame(this.#frame);
    const tick = (/** @type {number} */ now) => {
      if (!this.isPlaying) return;
      this.seek(this.t_us + 1000 * Math.max(0, now - this.#last) / this.slowness);
      this.#last = now;
      this.#drawn += 1;
      if (now - this.#since > 1000) {
        this.framesPerSecond = 1000 * this.#drawn / (now - this.#since);
        this.#since = now;
        this.#drawn = 0;
      }
      this.#frame = requestAnimationFrame(tick);
    };
    this.#frame = requestAnimationFrame(tick);
  }

  pause() {
    this.isPlaying = false;
    cancelAnimationFrame(this.#frame);
  }

  /** @param {number} t_us beyond an end it begins anew at the other */
  seek(t_us) {
    const length = Math.max(this.end_us - this.start_us, 1);
    this.t_us = this.start_us + (((t_us - this.start_us) % length) + length) % length;
    this.show(this.t_us);
  }
}
