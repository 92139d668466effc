// Results in numbers: B alone, or A and B beside each other with what differs. Event: `shown`.

/** @import { EstimateMetrics, MetricInfo, Opening, RunMessage, RunMetrics, ShotMetrics } from "./messages.d.ts" */

import { element, milliseconds, number } from "./elements.js";

const SPIN_HELP = "Magnitude ± 1 sigma that the method states. ✔: the one answer that the program itself trusts.";
const WITNESS_HELP =
  "What each tells by itself, and how many times as likely it makes the combined spin as the next one.";
const AXIS_HELP = "Unit vector in the camera frame (x right, y down, z into the scene), right-hand rule; ± 1 sigma.";

export class Results extends EventTarget {
  /** @type {string | null} of the largest shot, for the coach */
  sentence = null;
  /** @type {Set<string>} of all runs so far: what is still being computed keeps its place */
  #methods = new Set();

  constructor(/** @type {any} */ parent, /** @type {Opening} */ opening) {
    super();
    this.parent = parent;
    this.opening = opening;
  }

  show(/** @type {RunMessage} */ { metrics, pinned_metrics, costs_ms, pinned_costs_ms, differences }) {
    if (!metrics) return;
    const both = pinned_metrics ? [pinned_metrics, metrics] : [metrics];
    const costs = pinned_metrics ? [pinned_costs_ms, costs_ms] : [costs_ms];
    for (const { spin } of both.flatMap(({ shots }) => shots)) {
      for (const name of Object.keys(spin)) this.#methods.add(name);
    }
    const parts = pinned_metrics ? [differing(differences)] : [];
    parts.push(this.#table(both, costs.map((cost) => Object.values(cost ?? {}).reduce((a, b) => a + b, 0))));
    for (const reason of new Set(both.map((one) => one.no_shot_reason ?? "").filter(Boolean))) {
      parts.push(element("p.note", {}, sentence(reason)));
    }
    for (const reason of new Set(both.map((one) => mainShot(one)?.best_reason).filter(Boolean))) {
      parts.push(element("p.note", {}, `No spin is trusted: ${reason}`));
    }
    for (const doubt of new Set(both.map((one) => one.up_doubt).filter(Boolean))) {
      parts.push(element("p.note", {}, `Warning: ${doubt}`));
    }
    this.parent.replaceChildren(...parts);
    this.sentence = mainShot(metrics)?.sentence ?? null;
    this.dispatchEvent(new CustomEvent("shown"));
  }

  #table(/** @type {RunMetrics[]} */ both, /** @type {number[]} */ costs_ms) {
    const { run_metrics, shot_metrics, methods, estimate_metrics } = this.opening;
    const shots = both.map(mainShot);
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
      for (const one of [spins, axes]) {
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
    const counts = both.map(({ shots: all }) => (all.length > 1 ? `${all.length} shots, the largest` : ""));
    const columns = both.length > 1 ? ["A", "B"] : [""];
    const names = columns.map((c, i) => [c, counts[i]].filter(Boolean).join(": "));
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

/**
 * @param {RunMetrics} metrics
 * @returns {ShotMetrics | null}
 */
export function mainShot({ shots }) {
  return shots.reduce(
    (/** @type {ShotMetrics | null} */ best, shot) => (best && best.logo_events >= shot.logo_events ? best : shot),
    null,
  );
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
