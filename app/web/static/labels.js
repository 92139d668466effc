// Labels of the ball: each in the picture of its exposure, to be accepted, moved or deleted, and missed ones added. Every
// change is saved at once, in order.

/** @import { Label, LabelChangeRequest, Opening } from "./messages.d.ts" */
/** @import { Connection } from "./server.js" */
/** @import { Viewer } from "./viewer.js" */

import { attempt, drawing, element, notice, number } from "./elements.js";

const STEP_PX = 0.5; // of an arrow key and of the wheel
const FAR = 10; // times as much with Shift
const LEAST_RADIUS_PX = 1;
const SETTLED_MS = 300; // a held key or a turned wheel is one change
const VIEW_RADII = 10; // side of the picture: a ball at 12 m/s sweeps over eight of its radii in an exposure
const STEP_US = 2500; // between labels, as `spinscope label` sets them
const NEAR_US = 10_000; // an exposure: the playhead is in a flight if it is no farther from a label of it
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/** @typedef {{first: number, removed: number, labels: Label[]}} Change */

export class Labels {
  /** @type {Label[]} */
  #labels = [];
  #version = "";
  #place = 0;
  /** @type {Label | null} the label in sight, moved and not yet saved */
  #moved = null;
  #isPlaced = true; // a label of a new flight is not, until it is clicked at its place: left before, it is taken back
  /** @type {(Change & {place: number})[]} what leads back */
  #history = [];
  /** @type {Promise<void>} changes on their way to the file */
  #saving = Promise.resolve();
  #reading = 0; // how often the labels were read
  /** @type {number | undefined} */
  #timer = undefined;

  /**
   * @param {any} parent
   * @param {{connection: Connection, opening: Opening, viewer: Viewer}} app
   */
  constructor(parent, { connection, opening, viewer }) {
    this.connection = connection;
    this.recording = opening.recording;
    this.viewer = viewer;
    this.summary = element("p.note");
    this.begin = element("button", { disabled: true, onclick: () => this.#show() }, "Go through the labels");
    this.adding = element("button", {
      disabled: true,
      title: "A label that was missed, at the time shown in the viewer",
      onclick: () => this.#addAtPlayhead(),
    }, "Add one at the playhead");
    parent.append(this.summary, element("div.row", {}, this.begin, this.adding));
    this.actions = [
      { keys: ["Enter", "a"], shown: "Enter, a", label: "Accept", act: () => this.#accept() },
      { keys: ["A"], shown: "Shift+A", label: "Accept the rest of the flight", act: () => this.#acceptFlight() },
      { keys: ["Delete", "x"], shown: "Delete, x", label: "Delete", act: () => this.#delete() },
      { keys: ["i"], shown: "i", label: "Add after", act: () => this.#addBeside(1) },
      { keys: ["I"], shown: "Shift+I", label: "Add before", act: () => this.#addBeside(-1) },
      { keys: ["p", "PageUp"], shown: "p, Page↑", label: "Previous", act: () => this.#select(this.#place - 1) },
      { keys: ["n", "PageDown"], shown: "n, Page↓", label: "Next", act: () => this.#select(this.#place + 1) },
      { keys: ["z"], shown: "z, Ctrl+Z", label: "Undo", act: () => this.#undo() },
      { keys: ["+"], shown: "+, wheel", label: "Larger", act: () => this.#adjust(0, 0, STEP_PX) },
      { keys: ["-"], shown: "-, wheel", label: "Smaller", act: () => this.#adjust(0, 0, -STEP_PX) },
    ];
    /** @type {any} */
    this.circle = drawing("circle", { class: "outline" });
    this.centre = drawing("path", { class: "outline" });
    const about = "Exposure of the label with its circle";
    /** @type {any} */
    this.stage = drawing("svg", { class: "exposure", tabindex: 0, role: "img", "aria-label": about });
    this.list = element("nav.scroll", { "aria-label": "Labels" });
    this.words = element("p", { role: "status" });
    const buttons = this.actions.map(({ label, shown, act }) =>
      element("button", { title: `${label} (${shown})`, onclick: () => (act(), this.stage.focus()) }, label)
    );
    const help = "All events of 10 ms, those of the middle millisecond bright: the circle belongs on these. Drag it, " +
      "or use the arrow keys (Shift: ten times as far); the wheel, + and - change its radius. Where the ball was missed, " +
      "add a label. Every change is saved.";
    this.dialog = element(
      "dialog.labels",
      { "aria-labelledby": "labels-title" },
      element("h2", { id: "labels-title" }, "Labels of the ball"),
      element("p.note", {}, help),
      element("div.marks", {}, this.stage, this.list),
      this.words,
      element("div.row", {}, ...buttons, element("button", { onclick: () => this.dialog.close() }, "Close")),
    );
    document.body.append(this.dialog);
    this.#listen();
    const isShown = opening.shows_labels;
    attempt(async () => (await this.#read(), isShown && this.#show()));
  }

  #listen() {
    this.dialog.addEventListener("close", () => this.#isPlaced ? this.#settle() : this.#undo());
    this.dialog.addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => {
      const { key, ctrlKey, metaKey, shiftKey } = event;
      const isOfButton = key === "Enter" && /** @type {Element} */ (event.target).closest("button");
      const arrow = /** @type {Record<string, number[]>} */ (ARROWS)[key];
      const action = this.actions.find(({ keys }) => keys.includes(key));
      if (isOfButton || !(arrow || action) || ((ctrlKey || metaKey) && key !== "z")) return;
      event.preventDefault();
      const far = STEP_PX * (shiftKey ? FAR : 1);
      if (arrow) this.#adjust(far * arrow[0], far * arrow[1], 0);
      else action?.act();
    });
    this.stage.addEventListener("wheel", (/** @type {WheelEvent} */ event) => {
      event.preventDefault();
      this.#adjust(0, 0, event.deltaY < 0 ? STEP_PX : -STEP_PX);
    }, { passive: false });
    /** @type {number[] | null} */
    let held = null;
    this.stage.addEventListener("pointerdown", (/** @type {PointerEvent} */ event) => {
      if (!this.#isPlaced) return void this.#placeAt(event);
      held = [event.clientX, event.clientY];
      this.stage.setPointerCapture(event.pointerId);
    });
    this.stage.addEventListener("pointermove", (/** @type {PointerEvent} */ event) => {
      if (!held) return;
      const scale = this.stage.viewBox.baseVal.width / this.stage.getBoundingClientRect().width;
      this.#adjust(scale * (event.clientX - held[0]), scale * (event.clientY - held[1]), 0);
      held = [event.clientX, event.clientY];
    });
    for (const end of ["pointerup", "pointercancel"]) {
      this.stage.addEventListener(end, () => (held = null, this.#settle()));
    }
  }

  async #read() {
    this.#reading++;
    const { labels, version, path } = await this.connection.get("labels");
    this.#labels = labels;
    this.#version = version;
    this.#moved = null;
    this.#history = [];
    this.dialog.title = path;
    this.begin.disabled = this.adding.disabled = false; // of a damaged file they stay
    this.#drawList();
    this.#select(this.#place);
  }

  #show(place = this.#labels.findIndex(({ state }) => state === "detected")) {
    this.dialog.showModal();
    this.#drawList();
    this.#select(Math.max(place, 0));
    this.stage.focus();
  }

  get #label() {
    return this.#moved ?? this.#labels[this.#place];
  }

  #select(/** @type {number} */ place) {
    this.#settle();
    if (!this.#isPlaced) return void this.#undo();
    this.#place = Math.min(Math.max(place, 0), this.#labels.length - 1);
    if (!this.dialog.open) return;
    const { width_px: width, height_px: height } = this.recording;
    const { t_us, x_px, y_px, radius_px } = this.#label;
    const side = VIEW_RADII * radius_px, href = this.connection.path(`label.png?t_us=${t_us}`);
    this.stage.setAttribute("viewBox", `${x_px + 0.5 - side / 2} ${y_px + 0.5 - side / 2} ${side} ${side}`);
    this.stage.replaceChildren(drawing("image", { href, width, height }), this.circle, this.centre);
    for (const row of this.list.querySelectorAll("[aria-current]")) row.removeAttribute("aria-current");
    const row = this.list.children[this.#place];
    row.setAttribute("aria-current", "true");
    row.scrollIntoView({ block: "nearest" });
    this.#draw();
  }

  #draw() {
    // Pixels are named by their centres, which lie half a pixel from the picture's edge.
    const { x_px, y_px, radius_px, std_px, state } = this.#label, [x, y] = [x_px + 0.5, y_px + 0.5];
    for (const [name, value] of Object.entries({ cx: x, cy: y, r: radius_px })) this.circle.setAttribute(name, value);
    const arm = radius_px / 5;
    this.centre.setAttribute("d", `M${x - arm} ${y}h${2 * arm}M${x} ${y - arm}v${2 * arm}`);
    this.words.textContent = `${this.#place + 1} of ${this.#labels.length}: ${state}, x ${number(x_px)}, ` +
      `y ${number(y_px)}, radius ${number(radius_px)} px` + (state === "moved" ? "" : `, ± ${number(std_px, 2)} px`);
  }

  #drawList() {
    const count = (/** @type {string} */ state) => this.#labels.filter((label) => label.state === state).length;
    const flights = new Set(this.#labels.map(({ ball }) => ball)).size;
    this.summary.textContent = `${this.#labels.length} labels of ${flights} flights: ` +
      `${count("accepted")} accepted, ${count("moved")} moved by hand, ${count("detected")} to be looked at.`;
    if (!this.dialog.open) return;
    this.list.replaceChildren(...this.#labels.map(({ ball, t_us, state }, place) => {
      const text = `flight ${ball}, ${(t_us / 1000).toFixed(1)} ms: ${state}`;
      return element(`button.${state}`, { onclick: () => (this.#select(place), this.stage.focus()) }, text);
    }));
  }

  #adjust(/** @type {number} */ dx, /** @type {number} */ dy, /** @type {number} */ dr) {
    const { x_px, y_px, radius_px, ...rest } = this.#label;
    const radius = Math.max(radius_px + dr, LEAST_RADIUS_PX);
    this.#moved = { ...rest, x_px: x_px + dx, y_px: y_px + dy, radius_px: radius, state: "moved" };
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.#settle(), SETTLED_MS);
    this.#draw();
  }

  // A moved label is saved.
  #settle() {
    clearTimeout(this.#timer);
    const moved = this.#moved;
    this.#moved = null;
    if (moved) this.#change({ first: this.#place, removed: 1, labels: [moved] });
  }

  #accept() {
    this.#settle();
    const label = this.#label;
    if (label.state === "detected") {
      this.#change({ first: this.#place, removed: 1, labels: [{ ...label, state: "accepted" }] });
    }
    this.#select(this.#place + 1);
  }

  #acceptFlight() {
    this.#settle();
    const rest = this.#labels.slice(this.#place).filter(({ ball }) => ball === this.#label.ball);
    const labels = rest.map((label) => label.state === "detected" ? { ...label, state: "accepted" } : label);
    this.#change({ first: this.#place, removed: rest.length, labels: /** @type {Label[]} */ (labels) });
    this.#select(this.#place + rest.length);
  }

  #delete() {
    this.#moved = null;
    if (this.#labels.length === 1) return void (this.words.textContent = "The last label stays: delete the file.");
    this.#change({ first: this.#place, removed: 1, labels: [] });
    this.#select(this.#place);
  }

  // Beside the one in sight: a step before or after it, or in the middle of what is free there.
  #addBeside(/** @type {1 | -1} */ way) {
    this.#settle();
    const { t_us, ball } = this.#labels[this.#place], next = this.#labels[this.#place + way];
    const free_us = next?.ball === ball ? Math.abs(next.t_us - t_us) / 2 : STEP_US;
    this.#select(this.#add(t_us + way * Math.min(STEP_US, free_us), ball));
  }

  // In the flight that it falls into, else of a flight of its own, whose ball may be anywhere in the picture.
  #addAtPlayhead() {
    const t_us = this.viewer.playhead_us;
    if (t_us === null) return void notice("The viewer shows no time yet: wait until it is there.");
    const near = this.#labels.find((label) => Math.abs(label.t_us - t_us) <= NEAR_US);
    const place = this.#add(t_us, near?.ball ?? Math.max(...this.#labels.map(({ ball }) => ball)) + 1);
    this.#show(place);
    if (near) return;
    const { width_px: width, height_px: height } = this.recording;
    this.#isPlaced = false;
    this.stage.setAttribute("viewBox", `0 0 ${width} ${height}`);
    this.words.textContent = "A new flight: click the ball's middle.";
  }

  #placeAt(/** @type {PointerEvent} */ event) {
    const { x, y } = new DOMPoint(event.clientX, event.clientY).matrixTransform(this.stage.getScreenCTM().inverse());
    const label = { ...this.#label, x_px: x - 0.5, y_px: y - 0.5 };
    this.#change({ first: this.#place, removed: 1, labels: [label] });
    this.#select(this.#place);
  }

  /**
   * Adds a label where the flight's nearest two lead; in the picture's middle, as large as the others, if it has none.
   * @param {number} t_us
   * @param {number} ball
   */
  #add(t_us, ball) {
    const far = (/** @type {Label} */ label) => Math.abs(label.t_us - t_us);
    const [one, other] = this.#labels.filter((label) => label.ball === ball).sort((a, b) => far(a) - far(b));
    const { width_px, height_px } = this.recording, like = one ?? this.#labels[0];
    const middle = { x_px: (width_px - 1) / 2, y_px: (height_px - 1) / 2 };
    const share = other ? (t_us - one.t_us) / (other.t_us - one.t_us) : 0;
    const along = (/** @type {"x_px" | "y_px"} */ name) =>
      one ? one[name] + share * ((other ?? one)[name] - one[name]) : middle[name];
    /** @type {Label} */
    const label = { ...like, t_us, ball, x_px: along("x_px"), y_px: along("y_px"), state: "moved" };
    const later = this.#labels.findIndex((label) => label.ball > ball || (label.ball === ball && label.t_us > t_us));
    const first = later < 0 ? this.#labels.length : later;
    this.#change({ first, removed: 0, labels: [label] });
    return first;
  }

  #undo() {
    this.#settle();
    this.#isPlaced = true;
    const back = this.#history.pop();
    if (!back) return;
    const { place, ...change } = back;
    this.#splice(change);
    this.#select(place);
  }

  #change(/** @type {Change} */ change) {
    const { first, removed, labels } = change;
    const taken = this.#labels.slice(first, first + removed);
    this.#isPlaced = true;
    this.#history.push({ first, removed: labels.length, labels: taken, place: this.#place });
    this.#splice(change);
  }

  #splice(/** @type {Change} */ change) {
    this.#labels.splice(change.first, change.removed, ...change.labels);
    this.#drawList();
    this.#save(change);
  }

  // One after the other; after a refusal the labels are read anew, and what was changed meanwhile is dropped.
  #save(/** @type {Change} */ change) {
    const reading = this.#reading;
    this.#saving = this.#saving.then(async () => {
      if (reading !== this.#reading) return;
      try {
        /** @type {LabelChangeRequest} */
        const request = { version: this.#version, ...change };
        this.#version = (await this.connection.post("labels", request)).version;
      } catch (error) {
        this.#version = ""; // of no file, until it is read
        await attempt(() => this.#read());
        const text = `Not saved: ${/** @type {Error} */ (error).message}`;
        notice(text); // beneath the dialog, and in the list of notices
        this.words.textContent = text;
      }
    });
  }
}
