// Parameter sweep: one parameter over its range; a click on a point takes its value.

/** @import { ControlInfo, Opening, ParameterSweep, SweepMessage, SweepPoint } from "./messages.d.ts" */
/** @import { Connection } from "./server.js" */
/** @import { Settings } from "./settings.js" */
/** @import { Point } from "./chart.js" */

import { Chart, hasPoints } from "./chart.js";
import { attempt, element, notice } from "./elements.js";

export class Sweep {
  /** @type {ParameterSweep | null} */
  #latest = null;
  /** @type {Map<string, Chart>} */
  #charts = new Map();
  /** @type {Map<string, ControlInfo>} */
  #controls = new Map();
  /** @type {Record<string, number>} */
  #highs = {};

  /**
   * @param {any} parent
   * @param {{connection: Connection, settings: Settings, opening: Opening}} app
   */
  constructor(parent, { connection, settings, opening }) {
    this.connection = connection;
    this.settings = settings;
    this.opening = opening;
    const groups = opening.sections.map(({ title, controls }) => {
      const fit = controls.filter(({ kind }) => kind !== "numbers");
      for (const control of fit) this.#controls.set(control.name, control);
      return element("optgroup", { label: title }, ...fit.map(({ name }) => element("option", { value: name }, name)));
    });
    this.which = element("select", { "aria-label": "Parameter", onchange: () => this.#range() }, ...groups);
    this.low = element("input.number", { type: "text", "aria-label": "from" });
    this.high = element("input.number", { type: "text", "aria-label": "to" });
    this.points = element("input.number", { type: "text", value: "13", "aria-label": "points" });
    this.start = element("button.primary", { onclick: () => attempt(() => this.#start()) }, "Run the sweep");
    const cancel = () => connection.post("cancel", { kind: "sweep" });
    this.stop = element("button", { hidden: true, onclick: cancel }, "Cancel");
    this.progress = element("progress", { hidden: true, max: 1, value: 0 });
    this.note = element("p.note");
    this.range = element("div.row", {}, "from", this.low, "to", this.high, "in", this.points, "points");
    this.charts = element("div.charts");
    const buttons = element("div.row", {}, this.start, this.stop, this.progress);
    parent.append(element("div.row", {}, this.which), this.range, buttons, this.note, this.charts);
    this.which.value = opening.suggested[0];
    this.#range();
    connection.on("sweep", (message) => this.#receive(message));
    settings.onChange((settled) => settled && this.#draw());
  }

  // Upper ends that make sense for the ball that is seen.
  take(/** @type {Record<string, number>} */ highs) {
    const isAsOffered = this.high.value === String(this.#top);
    this.#highs = highs;
    if (isAsOffered) this.#range();
  }

  get #top() {
    return this.#highs[this.which.value] ?? this.#controls.get(this.which.value)?.high ?? "";
  }

  #range() {
    const { low, high, scale } = /** @type {ControlInfo} */ (this.#controls.get(this.which.value));
    this.low.value = low ?? "";
    this.high.value = this.#top;
    this.range.hidden = scale === "none" && low === null && high === null;
  }

  async #start() {
    const name = this.which.value;
    const { low, high } = /** @type {ControlInfo} */ (this.#controls.get(name));
    const wanted = [this.low, this.high].map(({ value }) => (value.trim() ? Number(value) : NaN));
    if (!this.range.hidden && wanted.some(Number.isNaN)) {
      notice("The range of the sweep needs two numbers: from and to.");
      return;
    }
    const isWhole = this.range.hidden || (wanted[0] === low && wanted[1] === high);
    const request = { ...this.settings.request, name, points: Number(this.points.value) || 0 };
    await this.connection.post("sweep", isWhole ? request : { ...request, low: wanted[0], high: wanted[1] });
  }

  #receive(/** @type {SweepMessage} */ { state, content, error }) {
    this.stop.hidden = this.progress.hidden = state !== "running";
    if (error) notice(error);
    if (!content) return;
    this.progress.value = content.points.length / content.total;
    this.#latest = content;
    this.#draw();
  }

  #draw() {
    if (!this.#latest) return;
    const { name, points } = this.#latest;
    const { kind, choices, scale, unit } = /** @type {ControlInfo} */ (this.#controls.get(name));
    const categories = kind === "choice" ? choices : kind === "switch" ? ["off", "on"] : null;
    const x = (/** @type {any} */ value) => (kind === "switch" ? (value ? "on" : "off") : value);
    const good = points.filter(({ error }) => !error);
    const common = {
      x: unit ? `${name} [${unit}]` : name,
      categories,
      scale: categories ? /** @type {const} */ ("linear") : scale,
      present: x(this.settings.get(name)),
      onpick: (/** @type {any} */ value) => this.settings.set(name, value),
    };
    const at = (/** @type {SweepPoint} */ { value }, /** @type {object} */ more) => /** @type {Point} */ ({
      x: x(value),
      value,
      label: `${name} = ${x(value)}`,
      ...more,
    });
    this.note.textContent = `${name}; spins of the shot with the most logo events`;
    for (const { name: metric, label, unit: own } of this.opening.estimate_metrics) {
      const series = this.opening.methods.map((method) => ({
        name: method.name.replaceAll("_", " "),
        colour: method.colour,
        points: good.map((point) => at(point, banded(point.spin[method.name], metric))),
      }));
      const refused = points.flatMap(({ value, error, spin }) => {
        const reasons = error ? [error] : this.opening.methods
          .filter((method) => spin[method.name]?.reason)
          .map((method) => `${method.label}: ${spin[method.name].reason}`);
        return reasons.map((reason) => ({ x: x(value), value, reason }));
      });
      const y = own;
      this.#chart(label, { ...common, y, series, refused, fromZero: metric !== "magnitude_rps" });
    }
    for (const { name: metric, label, unit: own } of this.opening.run_metrics) {
      const factor = own === "%" ? 100 : 1;
      const value = (/** @type {any} */ point) => point[metric] === null ? null : factor * point[metric];
      const series = [{ colour: this.opening.colours.plain, points: good.map((one) => at(one, { y: value(one) })) }];
      const refused = points.filter(({ error }) => error)
        .map((one) => ({ x: x(one.value), value: one.value, reason: one.error ?? "" }));
      this.#chart(label, { ...common, y: own, series, refused, fromZero: true });
    }
  }

  #chart(/** @type {string} */ title, /** @type {any} */ spec) {
    let chart = this.#charts.get(title);
    if (!hasPoints(spec.series)) {
      if (chart) chart.node.hidden = true;
      return;
    }
    if (!chart) {
      chart = new Chart();
      this.#charts.set(title, chart);
      this.charts.append(chart.node);
    }
    chart.node.hidden = false;
    attempt(() => chart.draw({ ...spec, title }));
  }
}

/**
 * A metric of an estimate, the spin with its uncertainty.
 * @param {any} estimate
 * @param {string} metric
 */
function banded(estimate, metric) {
  return { y: estimate?.[metric], std: metric === "magnitude_rps" ? estimate?.magnitude_std_rps : null };
}
