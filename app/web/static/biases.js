// Biases of the sensor: simulate a scene again, and what each bias does to noise and ball. Event: `taken`.

/** @import { BiasesMessage, BiasRange, BiasState, BiasSweep, BiasSweepMessage, BiasSweepPoint } from "./messages.d.ts" */
/** @import { Opening, SweptBias } from "./messages.d.ts" */
/** @import { Connection } from "./server.js" */

import { Chart } from "./chart.js";
import { attempt, download, element, notice } from "./elements.js";
import { post } from "./server.js";

export class Biases extends EventTarget {
  /** @type {Map<string, any>} */
  #rows = new Map();
  /** @type {Map<string, Chart>} */
  #drawn = new Map();

  /**
   * @param {any} parent
   * @param {{connection: Connection, opening: Opening}} app
   */
  constructor(parent, { connection, opening }) {
    super();
    this.connection = connection;
    this.colours = opening.colours;
    /** @type {BiasState} */
    this.state = opening.biases;
    this.values = { ...this.state.values };
    this.before = { ...this.values }; // what the events that are seen were made with
    this.unwanted = false;
    this.note = element("p.note");
    this.progress = element("progress", { hidden: true, max: 1, value: 0 });
    this.stop = element("button", { hidden: true, onclick: () => this.#cancel() }, "Cancel");
    const rows = Object.entries(this.state.ranges).map(([name, range]) => this.#row(name, range));
    const load = { type: "file", accept: ".bias,.json", hidden: true, onchange: () => attempt(() => this.#load()) };
    this.file = element("input", load);
    const options = this.state.swept.map(({ name, label }) => element("option", { value: name }, label));
    const isFixed = this.state.of_camera && Boolean(this.state.locked); // nothing can be set or swept
    this.which = element("select", { "aria-label": "Bias to sweep" }, ...options);
    this.draw = element("button", { onclick: () => attempt(() => this.#sweep()) });
    this.text = element("div");
    this.charts = element("div.charts");
    const open = element("button", { onclick: () => this.file.click() }, "Load biases");
    const save = element("button", { onclick: () => attempt(() => this.#save()) }, "Save .bias");
    parent.append(
      this.note,
      ...rows,
      element("div.row", { hidden: isFixed }, open, save, this.stop, this.progress),
      this.file,
      element("div.row", { hidden: isFixed }, this.which, this.draw),
      this.charts,
      this.text,
    );
    connection.on("biases", (message) => this.#taken(message));
    connection.on("bias_sweep", (message) => this.#receive(message));
    this.#refresh();
  }

  #row(/** @type {string} */ name, /** @type {BiasRange} */ { low, high, default: start, help }) {
    const slider = element("input", { type: "range", min: low, max: high, step: 1, "aria-label": `bias_${name}` });
    const box = element("input.number", { type: "text", "aria-label": `bias_${name}` });
    const origin = this.state.of_camera ? "When the page was opened" : "Paper";
    const back = { title: `Back to ${start}`, onclick: () => this.#put(name, start) };
    const reset = element("button.reset", back, "↺");
    slider.addEventListener("input", () => (box.value = slider.value));
    slider.addEventListener("change", () => this.#put(name, Number(slider.value)));
    box.addEventListener("change", () => {
      const value = Math.round(Number(box.value));
      if (box.value.trim() && Number.isFinite(value) && low <= value && value <= high) this.#put(name, value);
      else {
        notice(`bias_${name} = ${box.value} is not possible: ${low} to ${high}`);
        this.#refresh();
      }
    });
    const title = `bias_${name}\n${help}.\nAllowed: ${low} to ${high}. ${origin}: ${start}.`;
    const parts = [element("label", {}, name), slider, box, element("span.unit"), reset];
    const row = element("div.control", { title }, ...parts);
    row.dataset.bias = name;
    this.#rows.set(name, { row, slider, box, reset, start });
    return row;
  }

  #refresh() {
    const { locked, known, calibrated, of_camera: ofCamera } = this.state;
    for (const [name, { row, slider, box, reset, start }] of this.#rows) {
      const value = this.values[name];
      slider.value = value;
      box.value = known || !locked ? value : "";
      box.placeholder = "?";
      slider.disabled = box.disabled = reset.disabled = Boolean(locked);
      row.classList.toggle("differs", !locked && value !== start);
      row.classList.toggle("locked", Boolean(locked));
    }
    const model = calibrated ? "" : " What a bias means in physical units is a model, not calibrated.";
    this.note.textContent = locked ??
      (ofCamera
        ? `A moved slider sets the running camera.${model}`
        : `A moved slider simulates the scene again with the new setting.${model}`);
    this.draw.textContent = locked ? "Measure the folder's recordings" : "Sweep this bias";
    this.draw.title = locked
      ? "Event rates of those whose biases are known: stated in the recording, or in a .bias file of its name beside it"
      : `${ofCamera ? "Steps the camera" : "Simulates the scene"} over the whole range of this bias: ` +
        "event rates of ball and noise";
  }

  /**
   * Takes values, from a link too.
   * @param {Record<string, number>} values
   */
  take(values) {
    this.values = { ...this.values, ...values };
    this.#refresh();
    return this.#resimulate();
  }

  // Whether the present values are those of a link, which names what differs from the recording's own.
  agrees(/** @type {Record<string, number>} */ values) {
    return JSON.stringify({ ...this.state.values, ...values }) === JSON.stringify(this.values);
  }

  // The server was started anew and knows the recording as it is on disk.
  restore() {
    if (JSON.stringify(this.values) !== JSON.stringify(this.state.values)) this.#resimulate();
  }

  #swept(/** @type {string} */ name) {
    return /** @type {SweptBias} */ (this.state.swept.find((one) => one.name === name));
  }

  /**
   * @param {string} name of a swept bias
   * @param {number} value
   */
  #put(name, value) {
    for (const one of this.#swept(name).biases) this.values[one] = value;
    this.which.value = name;
    this.#refresh();
    this.#resimulate();
  }

  async #resimulate() {
    this.unwanted = false;
    try {
      await this.connection.post("biases", { biases: this.values });
    } catch (error) {
      notice(/** @type {Error} */ (error).message);
      this.#back();
    }
  }

  #taken(/** @type {BiasesMessage} */ { state, content, error }) {
    this.#working(state === "running", content?.share ?? 0);
    if (error) notice(error);
    // One that a newer one replaces is cancelled, too.
    if (state === "failed" || (state === "cancelled" && this.unwanted)) this.#back();
    if (state !== "done") return;
    this.before = { ...this.values };
    this.dispatchEvent(new CustomEvent("taken"));
  }

  // The events are still the earlier ones.
  #back() {
    this.values = { ...this.before };
    this.#refresh();
  }

  #working(/** @type {boolean} */ running, /** @type {number} */ share) {
    this.stop.hidden = this.progress.hidden = !running;
    this.progress.value = share;
  }

  #cancel() {
    this.unwanted = true;
    for (const kind of /** @type {const} */ (["biases", "bias_sweep"])) this.connection.post("cancel", { kind });
  }

  async #sweep() {
    const request = { biases: this.values, name: this.which.value, is_known: this.state.known };
    await this.connection.post("bias_sweep", request);
  }

  #receive(/** @type {BiasSweepMessage} */ { state, content, error }) {
    this.#working(state === "running", content ? content.points.length / content.total : 0);
    if (error) notice(error);
    if (content) this.#show(content);
  }

  #show(/** @type {BiasSweep} */ { name, points, proposal }) {
    const good = points.filter((point) => !point.error);
    const notes = points.filter((point) => point.error).map((point) => `${point.recording}: ${point.error}`);
    if (proposal) notes.push(proposal);
    const isRecorded = name === null;
    const varies = Object.keys(this.state.ranges)
      .filter((bias) => new Set(good.map(({ biases }) => biases[bias])).size > 1);
    if (isRecorded && good.length && !varies.length) {
      notes.push("All of them have the same biases: a point, not a curve.");
    }
    const shown = isRecorded ? (varies.length ? varies : [this.which.value]) : [name];
    this.#drawn = new Map([...this.#drawn].filter(([title]) => shown.some((bias) => title.endsWith(bias))));
    this.charts.replaceChildren(...shown.flatMap((bias) => this.#draw(this.#swept(bias), good)));
    this.text.replaceChildren(...notes.map((text) => element("p.note", {}, text)));
  }

  #draw(/** @type {SweptBias} */ { name, label, biases: [first, ...others] }, /** @type {BiasSweepPoint[]} */ points) {
    const isKnown = (!this.state.locked || this.state.known) &&
      others.every((other) => this.values[other] === this.values[first]);
    return /** @type {const} */ (["ball", "noise"]).map((kind) => {
      const key = `${kind} ${name}`;
      const chart = this.#drawn.get(key) ?? new Chart();
      this.#drawn.set(key, chart);
      const series = /** @type {const} */ (["on", "off"]).map((polarity) => ({
        name: polarity.toUpperCase(),
        colour: this.colours[polarity],
        points: points.map((point) => ({
          x: point.value ?? point.biases[first],
          y: (point[`${kind}_${polarity}_hz`] ?? NaN) / 1000,
          label: point.recording ?? `${label} = ${point.value}`,
        })),
      }));
      attempt(() =>
        chart.draw({
          title: kind === "ball" ? "Event rate of the ball" : "Event rate of the noise",
          x: `bias ${label}`,
          y: "kev/s",
          series,
          fromZero: kind === "ball",
          isLogarithmic: kind === "noise", // as the supplement draws it
          present: isKnown ? this.values[first] : null,
          onpick: this.state.locked ? undefined : (value) => this.#put(name, value),
        })
      );
      return chart.node;
    });
  }

  async #load() {
    const [file] = this.file.files;
    if (!file) return;
    try {
      const { biases } = await post("/api/biases/read", { text: await file.text() });
      if (!this.state.locked) return await this.take(biases);
      // What the recording was made with: it cannot be changed, but be shown and marked in the charts.
      Object.assign(this.values, biases);
      this.state.known = true;
      this.#refresh();
    } finally {
      this.file.value = "";
    }
  }

  async #save() {
    const { text } = await post("/api/biases/write", { biases: this.values });
    download("spinscope.bias", text, "text/plain");
  }
}
