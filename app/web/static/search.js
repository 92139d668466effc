// Tune for me: parameters, an objective, and what was found so far.

import { chart } from "./chart.js";
import { element, notice, number } from "./elements.js";
import { post } from "./server.js";

const COMMON = ["logo.pad_px", "flow.reach_px", "rate.ema_us"];

export class Search {
  constructor(parent, { connection, settings, opening }) {
    Object.assign(this, { connection, settings, names: [], before: null });
    const fit = opening.sections.filter(({ is_setup }) => !is_setup).flatMap(({ controls }) => controls);
    const options = fit.filter(({ kind }) => kind !== "numbers").map(({ name }) => element("option", { value: name }, name));
    this.add = element("select", { "aria-label": "Parameter to tune", onchange: () => this.#add(this.add.value) }, element("option", { value: "" }, "add a parameter ..."), ...options);
    this.chips = element("div.chips");
    const objectives = [["stated", "stated uncertainty and track residual"]];
    if (opening.recording.has_truth) objectives.unshift(["truth", "error against the truth"]);
    this.objective = element("select", { "aria-label": "Objective" }, ...objectives.map(([value, name]) => element("option", { value }, name)));
    this.trials = element("input.number", { type: "text", value: "30", "aria-label": "trials" });
    this.start = element("button.primary", { onclick: () => this.#start() }, "Tune for me");
    this.stop = element("button", { hidden: true, onclick: () => post(connection.path("cancel"), { kind: "search" }) }, "Cancel");
    this.progress = element("progress", { hidden: true, max: 1, value: 0 });
    this.found = element("div.found");
    parent.append(
      element("div.row", {}, this.add),
      this.chips,
      element("div.row", {}, "make small", this.objective),
      element("div.row", {}, "in", this.trials, "trials"),
      element("div.row", {}, this.start, this.stop, this.progress),
      this.found,
    );
    const known = new Set(options.map(({ value }) => value));
    for (const name of COMMON) if (known.has(name)) this.#add(name);
    connection.addEventListener("search", ({ detail }) => this.#told(detail));
  }

  #add(name) {
    this.add.value = "";
    if (!name || this.names.includes(name)) return;
    this.names.push(name);
    const chip = element("button.chip", {
      title: "Click to leave it out",
      onclick: () => {
        this.names.splice(this.names.indexOf(name), 1);
        chip.remove();
      },
    }, `${name} ×`);
    this.chips.append(chip);
  }

  async #start() {
    const [start_us, end_us] = this.settings.clip;
    const { parameters } = this.settings;
    this.before = structuredClone(parameters);
    const request = { names: this.names, objective: this.objective.value, trials: Number(this.trials.value) || 0 };
    try {
      await post(this.connection.path("search"), { ...request, parameters, start_us, end_us });
    } catch (error) {
      notice(error.message);
    }
  }

  #told(message) {
    this.stop.hidden = this.progress.hidden = message.state !== "running";
    if (message.error) notice(message.error);
    const { trials, total, best, values } = message.trials ? message : (this.latest ?? {});
    if (message.trials) this.latest = message;
    if (!trials?.length) return;
    this.progress.value = trials.length / total;
    let least = Infinity;
    const soFar = trials.map((cost, i) => ({ x: i + 1, y: (least = Math.min(least, cost)) }));
    const each = trials.map((cost, i) => ({ x: i + 1, y: Math.min(cost, 1) }));
    const picture = chart({
      title: `Objective, trial 1 to ${trials.length}`,
      low: 0,
      series: [
        { name: "trial", colour: "#93a0ac", points: each },
        { name: "best so far", colour: "#4cd964", points: soFar },
      ],
    });
    const rows = Object.entries(values).map(([name, value]) => element("tr", {}, element("th", {}, name), element("td", {}, number(value))));
    const take = element("button.primary", { onclick: () => this.#take(values) }, "Take the best");
    const back = element("button", { onclick: () => this.settings.setAll(this.before), disabled: !this.before }, "Way back");
    const said = element("p.note", {}, `Best so far ${number(best, 3)}, the settings of the start ${number(trials[0], 3)}.`);
    this.found.replaceChildren(picture, said, element("table.numbers", {}, ...rows), element("div.row", {}, take, back));
  }

  #take(values) {
    const changes = {};
    for (const [name, value] of Object.entries(values)) {
      const [group, field] = name.split(".");
      (changes[group] ??= {})[field] = value;
    }
    this.settings.setAll(changes);
  }
}
