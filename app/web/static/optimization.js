// Optimization: parameters, an objective, and what was found so far.

/** @import { HeldOut, Opening, Optimization as Found, OptimizationMessage, Trial } from "./messages.d.ts" */
/** @import { Connection } from "./server.js" */
/** @import { Overview } from "./overview.js" */
/** @import { Settings, Values } from "./settings.js" */

import { Chart } from "./chart.js";
import { attempt, element, notice, number } from "./elements.js";
import { get } from "./server.js";

const MOST_CLIPS = 12; // that are tuned at once

/**
 * As many of all as can be tuned at once, evenly spread.
 * @template T
 * @param {T[]} all
 */
const spread = (all) =>
  all.length <= MOST_CLIPS
    ? all
    : Array.from({ length: MOST_CLIPS }, (_, i) => all[Math.floor((i * all.length) / MOST_CLIPS)]);

export class Optimization {
  /** @type {string[]} */
  #names = [];
  /** @type {Values | null} parameters before values were applied */
  #before = null;
  #cost = new Chart();
  #answers = new Chart();
  #events = new Chart();

  /**
   * @param {any} parent
   * @param {{connection: Connection, settings: Settings, opening: Opening, overview: Overview}} app
   */
  constructor(parent, { connection, settings, opening, overview }) {
    this.connection = connection;
    this.recording = opening.recording;
    this.overview = overview;
    this.settings = settings;
    this.colour = opening.colours.plain;
    const fit = opening.sections.flatMap(({ controls }) => controls).filter(({ is_setup }) => !is_setup);
    const options = fit.filter(({ kind }) => kind !== "numbers")
      .map(({ name }) => element("option", { value: name }, name));
    const first = element("option", { value: "" }, "add a parameter ...");
    const onchange = () => this.#add(this.add.value);
    this.add = element("select", { "aria-label": "Parameter to optimize", onchange }, first, ...options);
    this.chips = element("div.chips");
    const objectives = opening.objectives.map(({ name, label }) => element("option", { value: name }, label));
    this.objective = element("select", { "aria-label": "Objective" }, ...objectives);
    const where = { clip: "this clip", shots: "all shots", folder: "all recordings of the folder" };
    const places = Object.entries(where).map(([value, label]) => element("option", { value }, label));
    this.where = element("select", { "aria-label": "Tuned on" }, ...places);
    this.trials = element("input.number", { type: "text", value: "30", "aria-label": "trials" });
    this.start = element("button.primary", { onclick: () => attempt(() => this.#start()) }, "Optimize");
    const cancel = () => connection.post("cancel", { kind: "optimization" });
    this.stop = element("button", { hidden: true, onclick: cancel }, "Cancel");
    this.progress = element("progress", { hidden: true, max: 1, value: 0 });
    this.found = element("div.found");
    this.back = element("button", { hidden: true, onclick: () => this.#restore() }, "Restore the previous values");
    parent.append(
      element("div.row", {}, this.add),
      this.chips,
      element("div.row", {}, "minimise", this.objective),
      element("div.row", {}, "on", this.where, "in", this.trials, "trials"),
      element("div.row", {}, this.start, this.stop, this.progress),
      this.found,
      element("div.row", {}, this.back),
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
    const wanted = { names: this.#names, objective: this.objective.value, trials: Number(this.trials.value) || 0 };
    const clips_us = this.where.value === "shots" ? this.#shots() : [];
    const recordings = this.where.value === "folder" ? await this.#recordings() : [];
    await this.connection.post("optimization", { ...wanted, ...this.settings.request, clips_us, recordings });
  }

  #shots() {
    const { start_us, end_us, margin_us, longest_us } = this.recording;
    return spread(this.overview.shots).map(([from, to]) => {
      const start = Math.max(Math.round(from) - margin_us, start_us);
      return [start, Math.min(Math.round(to) + margin_us, end_us, start + longest_us)];
    });
  }

  async #recordings() {
    const folder = this.recording.name.split("/").slice(0, -1).join("/");
    const { recordings } = await get("/api/folder", { folder });
    return spread(recordings.map(({ name }) => name));
  }

  #receive(/** @type {OptimizationMessage} */ { state, content, error }) {
    this.stop.hidden = this.progress.hidden = state !== "running";
    if (error) notice(error);
    if (content?.trials.length) this.#show(content);
  }

  #show(/** @type {Found} */ { trials, total, clips, best, values, held_out, skipped }) {
    this.progress.value = trials.length / total;
    const [first] = trials;
    const label = (/** @type {Trial} */ { objection }, /** @type {number} */ i) =>
      objection ? `trial ${i + 1}, never proposed: ${objection}` : `trial ${i + 1}`;
    const cost = { title: "Objective", x: "trial", y: "", fromZero: true, series: this.#series(trials, label) };
    const against = (/** @type {(trial: Trial) => number} */ share) =>
      this.#series(trials, label, share).map((one) => ({ ...one, lines: false }));
    const answers = against((trial) => 100 * trial.answers);
    const events = against((trial) => trial.logo_events);
    attempt(() => this.#cost.draw(cost));
    attempt(() => this.#answers.draw({ title: "Objective against answers", x: "answers [%]", y: "", series: answers }));
    attempt(() => this.#events.draw({ title: "Objective against evidence", x: "logo events", y: "", series: events }));
    const rows = Object.entries(values)
      .map(([name, value]) => element("tr", {}, element("th", {}, name), element("td", {}, number(value))));
    const take = element("button.primary", { onclick: () => this.#take(values) }, "Apply the best values");
    const refused = trials.filter(({ objection }) => objection).length;
    const isBetter = best !== null && best < first.cost;
    const where = clips === 1 ? "one clip" : `${clips} clips`;
    const start = `the starting values gave ${number(first.cost, 3)}`;
    const texts = [
      isBetter
        ? `Lowest on ${where} ${number(best, 3)}; ${start}.`
        : `On ${where} ${start}${held_out ? "" : ", and nothing better is found"}.`,
      refused ? `${refused} of ${trials.length} trials lost an answer or half of the logo events: not proposed.` : "",
      trials.length === total && (isBetter || held_out) ? heldOut(held_out) : "",
      ...skipped.map((text) => `Left out: ${text}`),
    ];
    const proposal = [element("table.numbers", {}, ...rows), element("div.row", {}, take)];
    this.found.replaceChildren(
      ...texts.filter(Boolean).map((text) => element("p.note", {}, text)),
      ...(isBetter ? proposal : []),
      ...[this.#cost, this.#answers, this.#events].map(({ node }) => node),
    );
  }

  /**
   * The trials that may be proposed and those that may not, over their numbers or over something else.
   * @param {Trial[]} trials
   * @param {(trial: Trial, i: number) => string} label
   * @param {(trial: Trial, i: number) => number} x
   */
  #series(trials, label, x = (_, i) => i + 1) {
    const points = trials.map((trial, i) => ({ x: x(trial, i), y: trial.cost, label: label(trial, i) }));
    const of = (/** @type {boolean} */ isProposable) => points.filter((_, i) => !trials[i].objection === isProposable);
    return [
      { name: "trial", colour: this.colour, points: of(true) },
      { name: "never proposed", colour: "#93a0ac", points: of(false), lines: false },
    ];
  }

  #take(/** @type {Record<string, any>} */ values) {
    /** @type {Values} */
    const changes = {};
    for (const [name, value] of Object.entries(values)) {
      const [group, field] = name.split(".");
      (changes[group] ??= {})[field] = value;
    }
    const before = structuredClone(this.settings.parameters);
    this.settings.setAll(changes);
    if (JSON.stringify(before) === JSON.stringify(this.settings.parameters)) return; // applied a second time
    this.#before = before;
    this.back.hidden = false;
  }

  #restore() {
    if (this.#before) this.settings.setAll(this.#before);
    this.#before = null;
    this.back.hidden = true;
  }
}

function heldOut(/** @type {HeldOut | null} */ held) {
  if (!held) return "No part was held out: check the values on another recording.";
  const where = `On ${held.clips === 1 ? "one clip" : `${held.clips} clips`} held out`;
  if (held.objection) return `${where} they fail (${held.objection}): nothing is proposed.`;
  const verdict = held.after <= held.before ? "" : " They do worse where they were not tuned: do not trust them.";
  return `${where}: ${number(held.after, 3)}, before ${number(held.before, 3)}.${verdict}`;
}
