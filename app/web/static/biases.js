// Biases of the sensor: take a simulated scene again, and what each bias does to noise and ball.

import { chart } from "./chart.js";
import { download, element, notice } from "./elements.js";
import { post } from "./server.js";

// "Pixel sensitivity" in the paper's supplement: both thresholds at once.
const TOGETHER = { diff_on_off: ["diff_on", "diff_off"] };
const COLOURS = { on: "#ef5350", off: "#4295f5" };

export class Biases extends EventTarget {
  constructor(parent, { connection, opening }) {
    super();
    this.connection = connection;
    this.state = opening.biases;
    this.values = { ...this.state.values };
    this.before = { ...this.values }; // what the events that are seen were taken with
    this.unwanted = false;
    this.rows = new Map();
    this.note = element("p.note");
    this.progress = element("progress", { hidden: true, max: 1, value: 0 });
    this.stop = element("button", { hidden: true, onclick: () => this.#cancel() }, "Cancel");
    const rows = Object.entries(this.state.ranges).map(([name, range]) => this.#row(name, range));
    this.file = element("input", { type: "file", accept: ".bias", hidden: true, onchange: () => this.#load() });
    this.which = element("select", { "aria-label": "Bias of the curve" }, 
      element("option", { value: "diff_on_off" }, "diff_on = diff_off"),
      ...Object.keys(this.state.ranges).map((name) => element("option", { value: name }, name)),
    );
    this.draw = element("button", { onclick: () => this.#curve() });
    this.charts = element("div.charts");
    parent.append(
      this.note,
      ...rows,
      element("div.row", {}, element("button", { onclick: () => this.file.click() }, "Load .bias"), element("button", { onclick: () => this.#save() }, "Save .bias"), this.stop, this.progress),
      this.file,
      element("div.row", {}, this.which, this.draw),
      this.charts,
    );
    connection.addEventListener("biases", ({ detail }) => this.#taken(detail));
    connection.addEventListener("bias_curve", ({ detail }) => this.#drawn(detail));
    this.#refresh();
  }

  #row(name, { low, high, default: start, help }) {
    const slider = element("input", { type: "range", min: low, max: high, step: 1, "aria-label": `bias_${name}` });
    const box = element("input.number", { type: "text", "aria-label": `bias_${name}` });
    const reset = element("button.reset", { title: "Back to the paper's value", onclick: () => this.#put(name, start) }, "↺");
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
    const title = `bias_${name}\n${help}.\nAllowed: ${low} to ${high}. Paper: ${start}.`;
    const row = element("div.control", { title }, element("label", {}, name), slider, box, element("span.unit"), reset);
    row.dataset.bias = name;
    this.rows.set(name, { row, slider, box, reset, start });
    return row;
  }

  #refresh() {
    const { locked, known, calibrated } = this.state;
    for (const [name, { row, slider, box, reset, start }] of this.rows) {
      const value = this.values[name];
      slider.value = value;
      box.value = known || !locked ? value : "";
      box.placeholder = "?";
      slider.disabled = box.disabled = reset.disabled = Boolean(locked);
      row.classList.toggle("differs", !locked && value !== start);
      row.classList.toggle("locked", Boolean(locked));
    }
    this.note.textContent = locked ?? `Moving a slider takes the scene again with the new setting.${calibrated ? "" : " What a bias means in physical units is a model, not calibrated."}`;
    this.draw.textContent = locked ? "Rates of this folder's recordings" : "Rates against it";
    this.draw.title = locked ? "Of those whose biases are known: stated in the recording, or in a .bias file of its name beside it" : "Simulates the scene over the whole range of this bias";
  }

  // Takes values, from a link too.
  take(values) {
    this.values = { ...this.values, ...values };
    this.#refresh();
    return this.#again();
  }

  // The server was started anew and knows the recording as it is on disk.
  restore() {
    if (JSON.stringify(this.values) !== JSON.stringify(this.state.values)) this.#again();
  }

  #put(name, value) {
    for (const one of TOGETHER[name] ?? [name]) this.values[one] = value;
    this.which.value = name;
    this.#refresh();
    this.#again();
  }

  async #again() {
    this.unwanted = false;
    try {
      await post(this.connection.path("biases"), { biases: this.values });
    } catch (error) {
      notice(error.message);
      this.#back();
    }
  }

  #taken({ state, share = 0, error, biases }) {
    this.#working(state === "running", share);
    if (error) notice(error);
    // One that a newer one replaces is cancelled, too.
    if (state === "failed" || (state === "cancelled" && this.unwanted)) this.#back();
    if (state !== "done") return;
    this.before = { ...this.values };
    this.dispatchEvent(new CustomEvent("taken", { detail: biases }));
  }

  // The events are still the earlier ones.
  #back() {
    this.values = { ...this.before };
    this.#refresh();
  }

  #working(running, share) {
    this.stop.hidden = this.progress.hidden = !running;
    this.progress.value = share;
  }

  #cancel() {
    this.unwanted = true;
    for (const kind of ["biases", "bias_curve"]) post(this.connection.path("cancel"), { kind });
  }

  async #curve() {
    try {
      await post(this.connection.path("bias_curve"), { biases: this.values, name: this.which.value, is_known: this.state.known });
    } catch (error) {
      notice(error.message);
    }
  }

  #drawn(message) {
    const { state, points, total, name, error, source } = message;
    this.#working(state === "running", points && total ? points.length / total : 0);
    if (error) notice(error);
    if (!points) return;
    const good = points.filter((point) => !point.error);
    const wrong = points.filter((point) => point.error).map((point) => element("p.note", {}, `${point.recording}: ${point.error}`));
    const varies = Object.keys(this.state.ranges).filter((bias) => new Set(good.map(({ biases }) => biases?.[bias])).size > 1);
    const names = source === "recorded" && varies.length ? varies : [name ?? this.which.value];
    const charts = names.flatMap((bias) => this.#charts(bias, good));
    if (source === "recorded" && good.length && !varies.length) wrong.push(element("p.note", {}, "All of them have the same biases: a point, not a curve."));
    this.charts.replaceChildren(...charts, ...wrong);
  }

  #charts(bias, points) {
    const [first, ...others] = TOGETHER[bias] ?? [bias];
    const x = (point) => point.value ?? point.biases[first];
    const isKnown = (!this.state.locked || this.state.known) && others.every((other) => this.values[other] === this.values[first]);
    return ["ball", "noise"].map((kind) => chart({
      title: `${kind === "ball" ? "Ball's events" : "Noise"} [kev/s] against ${bias.replace("diff_on_off", "diff_on = diff_off")}`,
      low: kind === "ball" ? 0 : null,
      isLogarithmic: kind === "noise", // as the supplement draws it
      whole: true,
      present: isKnown ? this.values[first] : null,
      onpick: this.state.locked ? null : ({ x: value }) => this.#put(bias, value),
      series: ["on", "off"].map((polarity) => ({
        name: polarity.toUpperCase(),
        colour: COLOURS[polarity],
        points: points.map((point) => ({ x: x(point), y: point[`${kind}_${polarity}_hz`] / 1000, label: point.recording })),
      })),
    })).filter(Boolean);
  }

  async #load() {
    const [file] = this.file.files;
    if (!file) return;
    try {
      const { biases } = await post("/api/biases/read", { text: await file.text() });
      if (!this.state.locked) return await this.take(biases);
      // What the recording was taken with: it cannot be changed, but be shown and marked in the plots.
      Object.assign(this.values, biases);
      this.state.known = true;
      this.#refresh();
    } catch (error) {
      notice(error.message);
    } finally {
      this.file.value = "";
    }
  }

  async #save() {
    const { text } = await post("/api/biases/write", { biases: this.values });
    download("spinscope.bias", text, "text/plain");
  }
}
