// Optimization: parameters, an objective, and what was found so far.

/** @import { Opening, Optimization as Found, OptimizationMessage } from "./messages.d.ts" */
/** @import { Connection } from "./server.js" */
/** @import { Settings, Values } from "./settings.js" */

import { Chart } from "./chart.js";
import { attempt, element, notice, number } from "./elements.js";

export class Optimization {
  /** @type {string[]} */
  #names = [];
  /** @type {Values | null} parameters before the optimization */
  #before = null;
  #chart = new Chart();

  /**
   * @param {any} parent
   * @param {{connection: Connection, settings: Settings, opening: Opening}} app
   */
  constructor(parent, { connection, settings, opening }) {
    this.connection = connection;
    this.settings = settings;
    this.colour = opening.colours.plain;
    const fit = opening.sections.filter(({ is_setup }) => !is_setup).flatMap(({ controls }) => controls);
    const options = fit.filter(({ kind }) => kind !== "numbers")
      .map(({ name }) => element("option", { value: name }, name));
    const first = element("option", { value: "" }, "add a parameter ...");
    const onchange = () => this.#add(this.add.value);
    this.add = element("select", { "aria-label": "Parameter to optimize", onchange }, first, ...options);
    this.chips = element("div.chips");
    const objectives = opening.objectives.map(({ name, label }) => element("option", { value: name }, label));
    this.objective = element("select", { "aria-label": "Objective" }, ...objectives);
    this.trials = element("input.number", { type: "text", value: "30", "aria-label": "trials" });
    this.start = element("button.primary", { onclick: () => attempt(() => this.#start()) }, "Optimize");
    const cancel = () => connection.post("cancel", { kind: "optimization" });
    this.stop = element("button", { hidden: true, onclick: cancel }, "Cancel");
    this.progress = element("progress", { hidden: true, max: 1, value: 0 });
    this.found = element("div.found");
    parent.append(
      element("div.row", {}, this.add),
      this.chips,
      element("div.row", {}, "minimise", this.objective),
      element("div.row", {}, "in", this.trials, "trials"),
      element("div.row", {}, this.start, this.stop, this.progress),
      this.found,
    );
    for (const name of opening.suggested) this.#add(name);
    connection.on("optimization", (message) => this.#receive(message));
  }

  #add(/** @type {string} */ name) {
    this.add.value = "";
    if (!name || this.#names.includes(name)) return;
    this.#names.push(name);
    const leave = () => {
      this.#names.splice(this.#names.indexOf(name), 1);
      chip.remove();
    };
    const chip = element("button.chip", { title: "Click to leave it out", onclick: leave }, `${name} ×`);
    this.chips.append(chip);
  }

  async #start() {
    this.#before = structuredClone(this.settings.parameters);
    const wanted = { names: this.#names, objective: this.objective.value, trials: Number(this.trials.value) || 0 };
    await this.connection.post("optimization", { ...wanted, ...this.settings.request });
  }

  #receive(/** @type {OptimizationMessage} */ { state, content, error }) {
    this.stop.hidden = this.progress.hidden = state !== "running";
    if (error) notice(error);
    if (content?.trials.length) this.#show(content);
  }

  #show(/** @type {Found} */ { trials, total, best, values }) {
    this.progress.value = trials.length / total;
    let least = Infinity;
    const soFar = trials.map((cost, i) => ({ x: i + 1, y: least = Math.min(least, cost) }));
    const each = trials.map((cost, i) => ({ x: i + 1, y: cost, label: `trial ${i + 1}` }));
    const series = [
      { name: "trial", colour: "#93a0ac", points: each },
      { name: "lowest so far", colour: this.colour, points: soFar },
    ];
    attempt(() => this.#chart.draw({ title: "Objective", x: "trial", y: "", series, fromZero: true }));
    const rows = Object.entries(values)
      .map(([name, value]) => element("tr", {}, element("th", {}, name), element("td", {}, number(value))));
    const take = element("button.primary", { onclick: () => this.#take(values) }, "Apply the best values");
    const undo = { onclick: () => this.#before && this.settings.setAll(this.#before), disabled: !this.#before };
    const back = element("button", undo, "Restore the previous values");
    const text = `Lowest so far ${number(best, 3)}; the starting values gave ${number(trials[0], 3)}.`;
    const table = element("table.numbers", {}, ...rows);
    this.found.replaceChildren(
      this.#chart.node,
      element("p.note", {}, text),
      table,
      element("div.row", {}, take, back),
    );
  }

  #take(/** @type {Record<string, any>} */ values) {
    /** @type {Values} */
    const changes = {};
    for (const [name, value] of Object.entries(values)) {
      const [group, field] = name.split(".");
      (changes[group] ??= {})[field] = value;
    }
    this.settings.setAll(changes);
  }
}
