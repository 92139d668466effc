// A small chart: lines with bands over one axis, points that can be clicked, a mark at the present value.

import { drawing, element, number } from "./elements.js";

const WIDTH = 300;
const HEIGHT = 110;
const LEFT = 38;
const BOTTOM = 17;
const TOP = 6;

// series: [{name, colour, points: [{x, y, low, high}]}]; x is a number, or the index into `categories`.
export function chart({ title, series, present = null, scale = "linear", categories = null, low = null, whole = false, isLogarithmic = false, onpick = null }) {
  const all = series.flatMap(({ points }) => points).filter(({ y }) => y !== null && y !== undefined && Number.isFinite(y));
  if (!all.length) return null;
  const known = series.flatMap(({ points }) => points.map(({ x }) => x));
  const place = placing(known, scale);
  const values = all.flatMap(({ y, low: a, high: b }) => [y, a ?? y, b ?? y]);
  const shown = whole ? values : usual(values);
  const spread = isLogarithmic ? decadesOf(shown) : scaleOf(low === null ? shown : [...shown, low]);
  const along = (value) => (isLogarithmic ? Math.log(Math.max(value, 1e-9) / spread.low) / Math.log(spread.high / spread.low) : (value - spread.low) / (spread.high - spread.low));
  const y = (value) => HEIGHT - BOTTOM - (HEIGHT - BOTTOM - TOP) * Math.min(Math.max(along(value), -0.05), 1.05);
  const svg = drawing("svg", { class: "chart", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": title });
  for (const tick of spread.ticks) {
    svg.append(drawing("line", { class: "grid", x1: LEFT, x2: WIDTH - 4, y1: y(tick), y2: y(tick) }));
    svg.append(drawing("text", { class: "label", x: LEFT - 4, y: y(tick) + 3, "text-anchor": "end" }, number(tick, 3)));
  }
  if (categories) {
    categories.forEach((name, i) => svg.append(drawing("text", { class: "label", x: place(i), y: HEIGHT - 4, "text-anchor": "middle" }, name)));
  } else {
    const ends = [Math.min(...known), Math.max(...known)];
    svg.append(drawing("text", { class: "label", x: LEFT, y: HEIGHT - 4 }, number(ends[0], 3)));
    svg.append(drawing("text", { class: "label", x: WIDTH - 4, y: HEIGHT - 4, "text-anchor": "end" }, number(ends[1], 3)));
  }
  if (present !== null && Number.isFinite(present)) {
    svg.append(drawing("line", { class: "present", x1: place(present), x2: place(present), y1: TOP, y2: HEIGHT - BOTTOM }));
  }
  for (const one of series) svg.append(...curve(one, place, y, onpick));
  const names = series.filter(({ name }) => name).map(({ name, colour }) => element("span", { style: `color: ${colour}` }, name));
  return element("figure", {}, element("figcaption", {}, title, element("span.names", {}, ...names)), svg);
}

function curve({ name, colour, points, band = true }, place, y, onpick) {
  const good = points.filter((p) => p.y !== null && p.y !== undefined && Number.isFinite(p.y)).sort((a, b) => a.x - b.x);
  const parts = [];
  const ranged = good.filter((p) => p.low !== undefined && p.low !== null);
  if (band && ranged.length > 1) {
    const there = ranged.map((p) => `${place(p.x)} ${y(p.high)}`);
    const back = [...ranged].reverse().map((p) => `${place(p.x)} ${y(p.low)}`);
    parts.push(drawing("path", { class: "band", d: `M${[...there, ...back].join("L")}Z`, fill: colour }));
  }
  parts.push(drawing("path", { class: "line", d: `M${good.map((p) => `${place(p.x)} ${y(p.y)}`).join("L")}`, stroke: colour }));
  for (const p of good) {
    const dot = drawing("circle", { class: onpick ? "dot pick" : "dot", cx: place(p.x), cy: y(p.y), r: onpick ? 3.5 : 2, fill: colour });
    const said = p.label ?? number(p.x, 4);
    dot.append(drawing("title", {}, `${name ? `${name}, ` : ""}${said}: ${number(p.y, 4)}${onpick ? ". Click to take it." : ""}`));
    if (onpick) dot.addEventListener("click", () => onpick(p));
    parts.push(dot);
  }
  return parts;
}

const SPREADS = { linear: (v) => v, logarithmic: (v) => Math.log(Math.max(v, 1e-12)), cubic: Math.cbrt };

function placing(xs, scale) {
  const [first, last] = [Math.min(...xs), Math.max(...xs)];
  const to = scale === "logarithmic" && first <= 0 ? SPREADS.linear : SPREADS[scale];
  const width = to(last) - to(first) || 1;
  return (x) => LEFT + 6 + (WIDTH - LEFT - 16) * Math.min(Math.max((to(x) - to(first)) / width, -0.02), 1.02);
}

// The values without the few that are so far off that nothing else could be seen; they are drawn at the border.
function usual(values) {
  const sorted = [...values].sort((a, b) => a - b);
  const at = (share) => sorted[Math.round(share * (sorted.length - 1))];
  const reach = 4 * (at(0.75) - at(0.25)) || Infinity;
  return sorted.filter((value) => value >= at(0.25) - reach && value <= at(0.75) + reach);
}

// Round numbers around the values, three or four of them marked.
function scaleOf(values) {
  let [low, high] = [Math.min(...values), Math.max(...values)];
  if (high - low < 1e-9 * Math.max(Math.abs(high), 1)) [low, high] = [low - (Math.abs(low) * 0.1 || 1), high + (Math.abs(high) * 0.1 || 1)];
  const raw = (high - low) / 3;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((f) => f * power).find((s) => s >= raw);
  const first = Math.floor(low / step + 1e-9) * step;
  const ticks = [];
  for (let tick = first; ticks.length < 8; tick += step) {
    ticks.push(Number(tick.toPrecision(10)));
    if (tick >= high - 1e-9 * step) break;
  }
  return { low: ticks[0], high: ticks[ticks.length - 1], ticks };
}

// Powers of ten around the values above zero.
function decadesOf(values) {
  const logs = values.filter((value) => value > 0).map(Math.log10);
  const first = logs.length ? Math.floor(Math.min(...logs)) : 0;
  const last = Math.max(logs.length ? Math.ceil(Math.max(...logs)) : 1, first + 1);
  const ticks = [];
  for (let power = first; power <= last; power += Math.max(1, Math.ceil((last - first) / 4))) ticks.push(10 ** power);
  return { low: 10 ** first, high: 10 ** last, ticks };
}
