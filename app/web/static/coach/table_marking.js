// Marking of the table's corners in a picture of the events, from which the camera's place follows.

/** @import { TableMarks } from "../messages.d.ts" */
/** @import { Shots } from "./shots.js" */

import { attempt, drawing, element, notice } from "../elements.js";
import { decimal, text } from "./texts.js";

const INSET = 0.25; // of the picture, where the corners are before anybody has marked them
const LOUPE_PX = 24; // shown on each side of a corner
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const FAST = 10; // pixels of an arrow key with Shift

export class TableMarking {
  /** @type {number[][]} */
  #corners = [];
  /** @type {Set<number>} corners that somebody has placed */
  #placed = new Set();
  #next = 0; // corner that a click on the picture places
  #recording = "";
  #url = ""; // of the picture

  /** @param {{shots: Shots, go: (place: string) => void}} page */
  constructor({ shots, go }) {
    this.shots = shots;
    this.go = go;
    this.root = element("section.marking");
    this.picture = element("div.picture");
    this.loupe = element("div.loupe");
    this.outline = drawing("polygon", { class: "outline" });
    this.view = drawing("svg", { "aria-hidden": "true" });
    /** @type {any[]} */
    this.handles = [];
  }

  async show() {
    const marks = await this.shots.tableMarks();
    const { recordings } = marks;
    if (!recordings.length) {
      this.root.replaceChildren(element("p.note.large", {}, text("no_table_recording")));
      return this.root;
    }
    this.#recording = recordings.includes(marks.recording ?? "") ? marks.recording ?? "" : recordings[0];
    this.#corners = this.#recording === marks.recording ? marks.corners_px ?? [] : [];
    const select = element(
      "select",
      {
        name: "recording",
        onchange: () => (this.#recording = select.value, this.#corners = [], attempt(() => this.#load())),
      },
      recordings.map((path) =>
        element("option", { value: path, selected: path === this.#recording }, path.split(/[\\/]/).pop())
      ),
    );
    this.root.replaceChildren(
      element("h2", {}, text("mark_table")),
      element("p", {}, text("mark_table_help")),
      element(
        "div.row",
        {},
        element("label.name", {}, text("recording"), select),
        element("button.primary", { onclick: () => attempt(() => this.#keep()) }, text("keep_table")),
        marks.height_m === null ? "" : element("span.note", {}, this.#words(marks)),
      ),
      element("div.marks", {}, this.picture, this.loupe),
    );
    await attempt(() => this.#load()); // of a damaged recording: another one can be chosen
    return this.root;
  }

  /** @param {TableMarks} marks */
  #words({ height_m, off_px }) {
    const height = text("camera_height", { value: decimal(height_m ?? 0, 2) });
    return off_px === null ? height : `${height} ${text("corner_off", { value: decimal(off_px, 1) })}`;
  }

  async #load() {
    this.picture.replaceChildren();
    this.loupe.replaceChildren();
    const image = new Image();
    const picture = await this.shots.file(`table.png?recording=${encodeURIComponent(this.#recording)}`);
    URL.revokeObjectURL(this.#url);
    image.src = this.#url = URL.createObjectURL(picture);
    await image.decode();
    const { src, width, height } = image;
    this.#next = 0;
    this.#placed = new Set(this.#corners.keys());
    if (this.#corners.length !== 4) {
      const [x0, x1] = [INSET * width, (1 - INSET) * width], [y0, y1] = [INSET * height, (1 - INSET) * height];
      this.#corners = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]];
    }
    const layer = () => drawing("image", { href: src, width, height });
    this.handles = this.#corners.map((_, index) => this.#handle(index, width / 60));
    const svg = drawing("svg", { viewBox: `0 0 ${width} ${height}` }, layer(), this.outline, ...this.handles);
    this.picture.replaceChildren(svg);
    this.view.replaceChildren(layer());
    this.loupe.replaceChildren(this.view, element("span.cross"));
    this.#followPointer(svg, width);
    this.#draw(0);
  }

  /** @param {number} index @param {number} radius */
  #handle(index, radius) {
    const label = text("corner", { number: index + 1 });
    const made = drawing(
      "g",
      { class: "corner", tabindex: 0, role: "img", "aria-label": label },
      drawing("circle", { r: radius }),
      drawing("path", { d: `M${-radius} 0H${radius}M0 ${-radius}V${radius}` }),
      drawing("text", { x: 1.2 * radius, y: -0.8 * radius, "font-size": 1.6 * radius }, String(index + 1)),
    );
    made.addEventListener("focus", () => this.#draw(index));
    made.addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => {
      const arrow = /** @type {Record<string, number[]>} */ (ARROWS)[event.key];
      if (!arrow) return;
      event.preventDefault();
      const [x, y] = this.#corners[index], far = event.shiftKey ? FAST : 1;
      this.#place(index, [x + far * arrow[0], y + far * arrow[1]]);
    });
    return made;
  }

  // A press on a corner that has been placed drags it; any other brings the next corner there.
  /** @param {any} svg @param {number} width */
  #followPointer(svg, width) {
    /** @type {number | null} */
    let dragged = null;
    const at = (/** @type {PointerEvent} */ event) => {
      const box = svg.getBoundingClientRect();
      return [event.clientX - box.left, event.clientY - box.top].map((one) => one * width / box.width - 0.5);
    };
    svg.addEventListener("pointerdown", (/** @type {PointerEvent} */ event) => {
      const pressed = this.handles.findIndex((handle) => handle.contains(/** @type {Node} */ (event.target)));
      const isHeld = this.#placed.has(pressed);
      dragged = isHeld ? pressed : this.#next;
      if (!isHeld) this.#place(dragged, at(event));
      this.#next = (dragged + 1) % 4;
      svg.setPointerCapture(event.pointerId);
    });
    svg.addEventListener("pointermove", (/** @type {PointerEvent} */ event) => {
      if (dragged !== null) this.#place(dragged, at(event));
    });
    for (const end of ["pointerup", "pointercancel"]) svg.addEventListener(end, () => dragged = null);
  }

  /** @param {number} index @param {number[]} corner */
  #place(index, corner) {
    this.#corners[index] = corner;
    this.#placed.add(index);
    this.#draw(index);
  }

  /** @param {number} magnified corner under the loupe */
  #draw(magnified) {
    // Pixels are named by their centres, which lie half a pixel from the picture's edge.
    const places = this.#corners.map(([x, y]) => [x + 0.5, y + 0.5]);
    this.outline.setAttribute("points", places.map((place) => place.join(",")).join(" "));
    places.forEach(([x, y], index) => this.handles[index].setAttribute("transform", `translate(${x} ${y})`));
    const [x, y] = places[magnified];
    this.view.setAttribute("viewBox", `${x - LOUPE_PX} ${y - LOUPE_PX} ${2 * LOUPE_PX} ${2 * LOUPE_PX}`);
  }

  async #keep() {
    const marks = await this.shots.post("table", { recording: this.#recording, corners_px: this.#corners });
    notice(this.#words(marks), "info");
    this.go("shots");
  }
}
