// The tuning curve: one parameter over its range; a click on a point takes its value.

import { chart } from "./chart.js";
import { element, notice } from "./elements.js";
import { post } from "./server.js";

export const METHOD_COLOURS = { triplet: "#ffa726", normal_flow: "#26c6da", contrast: "#ec407a" };
const PLAIN = "#4cd964";

export class Curve {
  constructor(parent, { connection, settings, opening }) {
    Object.assign(this, { connection, settings, opening });
    this.described = new Map();
    const groups = opening.sections.map(({ title, controls }) => {
      const fit = controls.filter(({ kind }) => kind !== "numbers");
      for (const control of fit) this.described.set(control.name, control);
      return element("optgroup", { label: title }, ...fit.map(({ name }) => element("option", { value: name }, name)));
    });
    this.which = element("select", { "aria-label": "Parameter of the curve", onchange: () => this.#range() }, ...groups);
    this.low = element("input.number", { type: "text", "aria-label": "from" });
    this.high = element("input.number", { type: "text", "aria-label": "to" });
    this.points = element("input.number", { type: "text", value: "13", "aria-label": "points" });
    this.start = element("button.primary", { onclick: () => this.#start() }, "Draw the curve");
    this.stop = element("button", { hidden: true, onclick: () => post(this.connection.path("cancel"), { kind: "curve" }) }, "Cancel");
    this.progress = element("progress", { hidden: true, max: 1, value: 0 });
    this.charts = element("div.charts");
    this.range = element("div.row", {}, "from", this.low, "to", this.high, "in", this.points, "points");
    parent.append(element("div.row", {}, this.which), this.range, element("div.row", {}, this.start, this.stop, this.progress), this.charts);
    this.which.value = "logo.pad_px";
    this.#range();
    connection.addEventListener("curve", ({ detail }) => this.#told(detail));
    settings.addEventListener("change", ({ detail }) => detail.settled && this.latest && this.#draw(this.latest));
  }

  #range() {
    const { low, high, kind } = this.described.get(this.which.value);
    this.low.value = low ?? "";
    this.high.value = high ?? "";
    this.range.hidden = !["number", "whole number"].includes(kind);
  }

  async #start() {
    const name = this.which.value;
    const { low, high } = this.described.get(name);
    const wanted = [Number(this.low.value), Number(this.high.value)];
    if (!this.range.hidden && [this.low, this.high].some(({ value }) => !value.trim() || Number.isNaN(Number(value)))) {
      notice("The curve's range needs two numbers: from and to.");
      return;
    }
    const whole = this.range.hidden || (wanted[0] === low && wanted[1] === high);
    const [start_us, end_us] = this.settings.clip;
    const request = { name, parameters: this.settings.parameters, start_us, end_us, points: Number(this.points.value) || 0 };
    try {
      await post(this.connection.path("curve"), whole ? request : { ...request, low: wanted[0], high: wanted[1] });
    } catch (error) {
      notice(error.message);
    }
  }

  #told(message) {
    const { state, points = this.latest?.points ?? [], total, error } = message;
    this.stop.hidden = this.progress.hidden = state !== "running";
    if (total) this.progress.value = points.length / total;
    if (error) notice(error);
    if (message.points) this.#draw((this.latest = message));
  }

  #draw({ name, points }) {
    const described = this.described.get(name);
    const categories = described.kind === "choice" ? described.choices : described.kind === "switch" ? ["off", "on"] : null;
    const x = (value) => (described.kind === "choice" ? described.choices.indexOf(value) : Number(value));
    const good = points.filter(({ error }) => !error);
    const common = { present: x(this.settings.get(name)), categories, scale: categories ? "linear" : described.scale, onpick: ({ value }) => this.settings.set(name, value) };
    const methods = [...new Set(good.flatMap(({ spin }) => Object.keys(spin)))];
    const series = (make) => methods.map((method) => ({
      name: method.replace("_", " "),
      colour: METHOD_COLOURS[method] ?? PLAIN,
      points: good.map(({ value, spin }) => ({ x: x(value), value, label: `${name} = ${value}`, ...make(spin[method] ?? {}) })),
    }));
    const single = (key) => [{ colour: PLAIN, points: good.map((p) => ({ x: x(p.value), value: p.value, label: `${name} = ${p.value}`, y: p[key] })) }];
    const spinBand = ({ magnitude_rps: y, magnitude_std_rps: std }) => ({ y, low: y - std, high: y + std });
    const charts = [
      chart({ ...common, title: "Spin ± 1σ [rps]", series: series(spinBand) }),
      chart({ ...common, title: "Axis, 1σ [°]", low: 0, series: series(({ axis_std_deg: y }) => ({ y })) }),
      chart({ ...common, title: "Error against truth [rps]", low: 0, series: series(({ error_rps: y }) => ({ y })) }),
      chart({ ...common, title: "Error of the axis against truth [°]", low: 0, series: series(({ error_deg: y }) => ({ y })) }),
      chart({ ...common, title: "Share of ticks tracked", low: 0, series: single("tracked_share") }),
      chart({ ...common, title: "Logo events", low: 0, series: single("logo_events") }),
      chart({ ...common, title: "Residual of the circle [px]", low: 0, series: single("residual_px") }),
    ];
    const wrong = points.filter(({ error }) => error).map(({ value, error }) => element("p.note", {}, `${value}: ${error}`));
    this.charts.replaceChildren(element("p.note", {}, name), ...charts.filter(Boolean), ...wrong);
  }
}
