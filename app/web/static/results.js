// Results in numbers of the shot that is seen: B alone, or A and B beside each other with what differs. Event: `shown`.

/** @import { EstimateMetrics, MetricInfo, Opening, RunMessage, RunMetrics, ShotMetrics } from "./messages.d.ts" */
/** @import { Settings } from "./settings.js" */
/** @import { Viewer } from "./viewer.js" */

import { element, milliseconds, number } from "./elements.js";

const SPIN_HELP = "Magnitude ± 1 sigma that the method states. ✔: the one answer that the program itself trusts.";
const WITNESS_HELP =
  "What each tells by itself, and how many times as likely it makes the combined spin as the next one.";
const AXIS_HELP = "Unit vector in the camera frame (x right, y down, z into the scene), right-hand rule; ± 1 sigma.";

export class Results extends EventTarget {
  /** @type {string | null} of the shot that is seen, for the coach */
  sentence = null;
  /** @type {RunMessage | null} */
  #latest = null;
  /** @type {string} the shots that are told of: their numbers in A and B */
  #told = "";
  /** @type {Set<string>} of all runs so far: what is still being computed keeps its place */
  #methods = new Set();

  /**
   * @param {any} parent
   * @param {{opening: Opening, viewer: Viewer, settings: Settings}} app
   */
  constructor(parent, { opening, viewer, settings }) {
    super();
    this.settings = settings;
    this.parent = parent;
    this.opening = opening;
    this.viewer = viewer;
    viewer.addEventListener("moved", () => {
      if (this.#latest && this.#told !== String(this.#seen)) this.show(this.#latest);
    });
  }

  // Metrics of A, where it is pinned, and of B.
  get #both() {
    const { metrics, pinned_metrics } = /** @type {RunMessage} */ (this.#latest);
    return /** @type {RunMetrics[]} */ ([pinned_metrics, metrics].filter(Boolean));
  }

  // Places in the lists of shots of what the detail views show of A and B at the playhead.
  get #seen() {
    const { picture } = /** @type {RunMessage} */ (this.#latest);
    const at_us = this.viewer.playhead_us ?? picture?.opening_us ?? 0;
    const [b, a] = picture?.seen_shots ?? [];
    return this.#both.map((_, i, both) => {
      const changes = i === both.length - 1 ? b : a;
      return (changes?.findLast(([from_us]) => from_us <= at_us) ?? changes?.[0] ?? [0, 1])[1] - 1;
    });
  }

  show(/** @type {RunMessage} */ message) {
    const { metrics, pinned_metrics, costs_ms, pinned_costs_ms, differences } = message;
    if (!metrics) return;
    this.#latest = message;
    const both = this.#both;
    const places = this.#seen;
    this.#told = String(places);
    const shots = both.map((one, i) => one.shots[places[i]] ?? null);
    const costs = pinned_metrics ? [pinned_costs_ms, costs_ms] : [costs_ms];
    for (const { spin } of both.flatMap(({ shots }) => shots)) {
      for (const name of Object.keys(spin)) this.#methods.add(name);
    }
    const parts = shots.flatMap((shot, i) => this.#answer(shot, both.length > 1 ? "AB"[i] : ""));
    if (pinned_metrics) parts.push(differing(differences));
    const all_ms = costs.map((cost) => Object.values(cost ?? {}).reduce((a, b) => a + b, 0));
    const counts = both.map(({ shots: all }, i) => all.length > 1 ? `${places[i] + 1} of ${all.length}` : "");
    parts.push(this.#table(both, shots, counts, all_ms));
    for (const reason of new Set(both.map((one) => one.no_shot_reason ?? "").filter(Boolean))) {
      parts.push(element("p.note", {}, sentence(reason)));
      if (this.settings.parameters.track.ball === "flying") {
        parts.push(element("p.note", {}, "A ball on a ball spinner: state its circle in the panel Fixed ball."));
      }
    }
    for (const doubt of new Set(both.map((one) => one.up_doubt).filter(Boolean))) {
      parts.push(element("p.note", {}, `Warning: ${doubt}`));
    }
    this.parent.replaceChildren(...parts);
    this.sentence = shots.at(-1)?.sentence ?? null;
    this.dispatchEvent(new CustomEvent("shown"));
  }

  /**
   * The trusted answer of the whole shot in a sentence, or why there is none.
   * @param {ShotMetrics | null} shot
   * @param {string} which of A and B
   */
  #answer(shot, which) {
    if (!shot) return [];
    const isEarly = [...this.#methods].some((name) => !shot.spin[name]);
    const method = this.opening.methods.find(({ name }) => name === shot.best)?.label;
    const source = method ? `whole shot, by ${method}` : isEarly ? "slower methods still to come" : "whole shot";
    const heading = element(
      "p.answer",
      {},
      `${which && `${which}: `}${shot.sentence}`,
      element("span", {}, ` · ${source}`),
    );
    const reason = method || isEarly ? null : shot.best_reason;
    return reason ? [heading, element("p.note", {}, `No spin is trusted: ${reason}`)] : [heading];
  }

  /**
   * @param {RunMetrics[]} both
   * @param {(ShotMetrics | null)[]} shots those seen of A and B
   * @param {string[]} counts which of how many they are
   * @param {number[]} costs_ms
   */
  #table(both, shots, counts, costs_ms) {
    const { run_metrics, shot_metrics, methods, estimate_metrics } = this.opening;
    const rows = [
      ...run_metrics.map((metric) => row(metric.label, compared(both, metric), metric.help)),
      ...shot_metrics.map((metric) => row(metric.label, compared(shots, metric), metric.help)),
    ];
    const errors = estimate_metrics.filter(({ name }) => name.startsWith("error_"));
    for (
      const { name, label, colour, help } of methods.filter((method) =>
        shots.some(Boolean) && this.#methods.has(method.name)
      )
    ) {
      const estimates = shots.map((shot) => shot?.spin[name]);
      const swatch = element("i.swatch", { style: `background: ${colour}` });
      const heading = element("th", { colSpan: 2 * both.length, title: help }, swatch, label);
      rows.push(element("tr.method", {}, heading));
      const trusted = shots.map((shot) => shot?.best === name);
      const magnitudes = estimates.map((e, i) => spin(e) + (trusted[i] ? " ✔ trusted" : ""));
      const apart = estimates.length > 1;
      const spins = row("spin", apart ? [...magnitudes, spinDifference(estimates)] : magnitudes, SPIN_HELP);
      const directions = estimates.map(axis);
      const axes = row("axis", apart ? [...directions, axisDifference(estimates)] : directions, AXIS_HELP);
      for (const one of estimates.some((estimate) => estimate?.axis) ? [spins, axes] : [spins]) {
        trusted.forEach((is, i) => one.cells[1 + i].classList.toggle("doubted", !is));
        rows.push(one);
      }
      for (const metric of errors) {
        const values = compared(estimates, metric);
        if (values.some((value) => value !== "–")) rows.push(row(metric.label.toLowerCase(), values, metric.help));
      }
    }
    rows.push(...witnessRows(shots));
    rows.push(row("Computing time", costs_ms.map(milliseconds), "All stages, when they were last computed."));
    const columns = both.length > 1 ? ["A", "B"] : [""];
    const names = columns.map((c, i) => [c, counts[i] && `shot ${counts[i]}`].filter(Boolean).join(": "));
    if (both.length > 1) names.push("B − A");
    const heading = headings("Whole shot", names);
    heading.title = "All results here are of the whole shot; the pictures show what is known so far at the playhead.";
    return element("table.numbers", {}, heading, ...rows);
  }
}

/**
 * Rows of the combined answer's witnesses: what each tells by itself, and the odds by it.
 * @param {(ShotMetrics | null)[]} shots
 */
function witnessRows(shots) {
  const names = new Set(shots.flatMap((shot) => Object.keys(shot?.witnesses ?? {})));
  if (!names.size) return [];
  const heading = element("th", { colSpan: 2 * shots.length, title: WITNESS_HELP }, "Witnesses of the combined answer");
  const rows = [...names].map((name) => {
    const told = shots.map((shot) => shot?.witnesses[name]);
    const words = told.map((one) => {
      const magnitude = one && one.magnitude_rps !== null ? spinWords(one.magnitude_rps, one.magnitude_std_rps) : "";
      return [magnitude, one?.odds].filter(Boolean).join(", ") || "–";
    });
    const more = told.length > 1 ? [spinDifference(told)] : [];
    return row(name.replace(/^the /, ""), [...words, ...more], WITNESS_HELP);
  });
  return [element("tr.method", {}, heading), ...rows];
}

function differing(/** @type {[string, any, any][]} */ differences) {
  if (!differences.length) {
    return element("p.note", {}, "A and B have the same parameters: change one, that is B.");
  }
  const rows = differences.map(([name, a, b]) => row(name, [String(a), String(b)]));
  return element("table.numbers", {}, headings("Parameter", ["A", "B"]), ...rows);
}

const headings = (/** @type {string} */ name, /** @type {string[]} */ columns) =>
  element("tr.heading", {}, element("th", {}, name), ...columns.map((c) => element("th", {}, c)));

const row = (/** @type {string} */ name, /** @type {string[]} */ values, title = "") =>
  element("tr", { title }, element("th", {}, name), ...values.map((value) => element("td", {}, value)));

function shown(/** @type {any} */ of, /** @type {MetricInfo} */ { name, unit }) {
  const value = of?.[name];
  if (value === null || value === undefined) return "–";
  return unit === "%" ? `${Math.round(100 * value)} %` : [number(value, 3), unit].filter(Boolean).join(" ");
}

/**
 * A metric of A and B, and what B has more; of B alone by itself.
 * @param {any[]} both
 * @param {MetricInfo} metric
 */
function compared(both, metric) {
  const values = both.map((one) => shown(one, metric));
  if (both.length < 2) return values;
  const [a, b] = both.map((one) => one?.[metric.name] ?? NaN);
  // As fine as the values are shown: what is below that is no difference to look at.
  const step = 10 ** (Math.floor(Math.log10(Math.max(Math.abs(a), Math.abs(b)))) - 2);
  const difference = step > 0 && Math.abs(b - a) < step / 2 ? 0 : b - a;
  const more = Number.isFinite(difference) ? shown({ [metric.name]: difference }, metric) : "–";
  return [...values, more.replace("-", "−")];
}

function spinDifference(/** @type {({magnitude_rps: number | null} | undefined)[]} */ [a, b]) {
  if (!a?.magnitude_rps || !b?.magnitude_rps) return "–";
  const more = (b.magnitude_rps - a.magnitude_rps).toFixed(2);
  return `${Number(more) ? more.replace("-", "−") : "0.00"} rps`;
}

// Angle between the signed axes.
function axisDifference(/** @type {(EstimateMetrics | undefined)[]} */ [a, b]) {
  if (!a?.axis || !b?.axis) return "–";
  const along = a.axis.reduce((sum, value, i) => sum + value * (b.axis?.[i] ?? 0), 0);
  return `${((180 / Math.PI) * Math.acos(Math.min(Math.max(along, -1), 1))).toFixed(1)}° apart`;
}

function spin(/** @type {EstimateMetrics | undefined} */ estimate) {
  if (!estimate) return "…";
  if (estimate.magnitude_rps === null) return `refused: ${estimate.reason}`;
  return spinWords(estimate.magnitude_rps, estimate.magnitude_std_rps);
}

const spinWords = (/** @type {number} */ rps, /** @type {number | null} */ std) =>
  `${rps.toFixed(std !== null && std < 0.05 ? 2 : 1)}${std === null ? "" : ` ± ${margin(std)}`} rps`;

function axis(/** @type {EstimateMetrics | undefined} */ estimate) {
  if (!estimate?.axis) return "–";
  const std = estimate.axis_std_deg;
  const parts = estimate.axis.map((value) => value.toFixed(2).replace("-", "−")).join(", ");
  return `${parts}${std === null ? "" : ` ± ${margin(std)}°`}`;
}

// A reason names its subject itself ("no ball: ..."): nothing is set before it.
const sentence = (/** @type {string} */ reason) => reason.charAt(0).toUpperCase() + reason.slice(1);

const margin = (/** @type {number} */ std) => std.toFixed(std < 0.05 ? 2 : 1);
