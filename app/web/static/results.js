// What came out, in numbers: B alone, or A and B beside each other with what differs.

import { milliseconds } from "./bar.js";
import { element, number } from "./elements.js";

export class Results extends EventTarget {
  sentence = null; // of the largest shot, for the coach
  #methods = new Set(); // of all runs so far: what is still being computed keeps its place

  constructor(parent) {
    super();
    this.parent = parent;
  }

  show({ measures, pinned_measures, differs }) {
    if (!measures) return;
    const both = pinned_measures ? [pinned_measures, measures] : [measures];
    const parts = [];
    if (pinned_measures) parts.push(...differing(differs));
    for (const shot of both.flatMap(({ shots }) => shots)) Object.keys(shot.spin).forEach((method) => this.#methods.add(method));
    parts.push(table(both, [...this.#methods]));
    for (const warning of new Set(both.map((m) => m.no_shot_reason).filter(Boolean))) {
      parts.push(element("p.note", {}, `No shot: ${warning}`));
    }
    this.parent.replaceChildren(...parts);
    this.sentence = mainShot(measures)?.sentence ?? null;
    this.dispatchEvent(new CustomEvent("shown"));
  }
}

export function mainShot(measures) {
  return measures.shots.reduce((best, shot) => (best && best.logo_events >= shot.logo_events ? best : shot), null);
}

function differing(differs) {
  if (!differs.length) return [element("p.note", {}, "A and B have the same settings: turn a knob, that is B.")];
  const rows = differs.map(([name, a, b]) => row(name, [String(a), String(b)]));
  return [element("table.numbers", {}, heading("Parameter", ["A", "B"]), ...rows)];
}

function table(both, methods) {
  const columns = both.length > 1 ? ["A", "B"] : [""];
  const values = (make) => both.map((m) => make(m) ?? "–");
  const shots = both.map(mainShot);
  const rows = [
    row("Frames tracked", values((m) => `${Math.round(m.tracked_share * m.ticks)} of ${m.ticks} (${Math.round(100 * m.tracked_share)} %)`)),
    row("Residual of the circle", values((m) => unit(m.residual_px, "px", 2))),
    row("Track jitter", values((m) => unit(m.jitter_px, "px", 2))),
    row("Logo events", values((m) => number(m.logo_events))),
    row("Speed", shots.map((s) => (s?.speed_m_s ? `${number(s.speed_m_s, 3)} m/s` : "–"))),
  ];
  for (const method of shots.some(Boolean) ? methods : []) {
    const estimates = shots.map((shot) => shot?.spin[method]);
    const trusted = shots.map((shot) => shot?.best === method);
    rows.push(element("tr.method", {}, element("th", { colSpan: 1 + both.length }, method.replace("_", " "))));
    rows.push(row("spin", estimates.map((e, i) => spin(e) + (trusted[i] ? " ✔" : "")), reasons(estimates)));
    rows.push(row("axis", estimates.map(axis)));
    if (estimates.some((e) => e && e.error_rps !== null)) {
      rows.push(row("error against truth", estimates.map((e) => (e && e.error_rps !== null ? `${number(e.error_rps, 2)} rps, ${number(e.error_deg, 2)}°` : "–"))));
    }
  }
  rows.push(row("Computing", values((m) => milliseconds(Object.values(m.stage_ms).reduce((a, b) => a + b, 0)))));
  const shotWords = both.map((m) => (m.shots.length > 1 ? `${m.shots.length} shots, the largest` : ""));
  const names = columns.map((c, i) => [c, shotWords[i]].filter(Boolean).join(": "));
  return element("table.numbers", {}, names.some(Boolean) ? heading("Result", names) : null, ...rows);
}

const heading = (name, columns) => element("tr.heading", {}, element("th", {}, name), ...columns.map((c) => element("th", {}, c)));
const row = (name, values, title = "") => element("tr", { title }, element("th", {}, name), ...values.map((v) => element("td", {}, v)));
const unit = (value, name, digits) => (value === null ? null : `${number(value, digits)} ${name}`);
const reasons = (estimates) => estimates.map((e) => e?.reason).filter(Boolean).join("\n");

function spin(estimate) {
  if (!estimate) return "…";
  if (estimate.status !== "ok") return `refused: ${estimate.reason}`;
  const std = estimate.magnitude_std_rps;
  return `${estimate.magnitude_rps.toFixed(std < 0.05 ? 2 : 1)}${std === null ? "" : ` ± ${margin(std)}`} rps`;
}

function axis(estimate) {
  if (!estimate?.axis) return "–";
  const std = estimate.axis_std_deg;
  const parts = estimate.axis.map((v) => v.toFixed(2).replace("-", "−")).join(", ");
  return `${parts}${std === null ? "" : ` ± ${margin(std)}°`}`;
}

const margin = (std) => std.toFixed(std < 0.05 ? 2 : 1);
