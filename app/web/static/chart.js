// Charts by plotly.js, which is loaded when the first one is shown.

import { download } from "./elements.js";

const FONT = { family: "system-ui, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif", size: 10, color: "#93a0ac" };
const HEIGHT = 170;
const PRINTED = { width: 640, height: 400, ink: "#222222", ground: "#ffffff", grid: "#dddddd" };
/** @type {Promise<any> | null} */
let loading = null;

/** @returns {Promise<any>} */
function plotly() {
  loading ??= new Promise((resolve, reject) => {
    const script = document.createElement("script");
    script.src = "/plotly/plotly.min.js";
    script.onload = () => resolve(/** @type {any} */ (globalThis).Plotly);
    script.onerror = () => {
      loading = null;
      reject(new Error("the charts cannot be loaded: is the server still running?"));
    };
    document.head.append(script);
  });
  return loading;
}

/** @typedef {{x: any, y: number | null | undefined, std?: number | null, label?: string, value?: any}} Point */
/** @typedef {{name?: string, colour: string, points: Point[], lines?: boolean}} Series */
/**
 * @typedef {object} ChartSpec
 * @property {string} title
 * @property {string} x title of the x axis
 * @property {string} y title of the y axis, the unit
 * @property {Series[]} series
 * @property {"linear" | "logarithmic" | "cubic" | "none"} [scale] of the x axis
 * @property {string[] | null} [categories] of the x axis
 * @property {any} [present] value of x that is in use
 * @property {{x: any, value?: any, reason: string}[]} [refused]
 * @property {boolean} [fromZero] whether the y axis begins at zero
 * @property {boolean} [isLogarithmic] whether the y axis does
 * @property {(value: any) => void} [onpick] takes the value of a point
 */

// A chart that is drawn anew with `draw`.
export class Chart {
  constructor() {
    /** @type {any} */
    this.node = document.createElement("div");
    this.node.className = "chart";
    this.node.setAttribute("role", "group");
    /** @type {ChartSpec["onpick"]} */
    this.onpick = undefined;
  }

  async draw(/** @type {ChartSpec} */ spec) {
    const { title, series, scale = "linear", refused = [], onpick } = spec;
    const first = !this.node.classList.contains("drawn");
    this.node.classList.add("drawn");
    this.node.classList.toggle("pick", Boolean(onpick));
    this.node.setAttribute("aria-label", title);
    this.onpick = onpick;
    const at = (/** @type {any} */ x) => (scale === "cubic" ? Math.cbrt(x) : x);
    const shown = series.flatMap(({ points }) => points).filter(({ y }) => Number.isFinite(y));
    const range = spec.isLogarithmic ? null : usualRange(shown, Boolean(spec.fromZero));
    /** @type {object[]} */
    const traces = series.map((one) => trace(one, at, range, Boolean(onpick)));
    if (refused.length) traces.push(refusals(refused, at, range, spec));
    const library = await plotly();
    await library.react(this.node, traces, layout(spec, at, range, [...shown, ...refused]), {
      responsive: true,
      displaylogo: false,
      modeBarButtons: [[{ name: "Save as SVG", icon: library.Icons.camera, click: printed }]],
    });
    if (first) {
      this.node.on("plotly_click", (/** @type {any} */ { points: [point] }) => this.onpick?.(point.customdata));
    }
  }
}

// Saves a chart as SVG in the colours of a printed page.
async function printed(/** @type {any} */ { data, layout }) {
  const { width, height, ink, ground, grid } = PRINTED;
  const axis = { gridcolor: grid, linecolor: ink };
  const colours = { paper_bgcolor: ground, plot_bgcolor: ground, font: { ...layout.font, color: ink } };
  const title = { ...layout.title, font: { ...layout.title.font, color: ink } };
  const [xaxis, yaxis] = [layout.xaxis, layout.yaxis].map((one) => ({ ...one, ...axis }));
  const library = await plotly();
  const figure = { data, layout: { ...layout, ...colours, title, xaxis, yaxis } };
  const url = await library.toImage(figure, { format: "svg", width, height });
  const name = layout.title.text.toLowerCase().replaceAll(/\W+/g, "_");
  download(`${name}.svg`, decodeURIComponent(url.slice(url.indexOf(",") + 1)), "image/svg+xml");
}

// Whether any of the series has something to show.
export const hasPoints = (/** @type {Series[]} */ series) =>
  series.some(({ points }) => points.some(({ y }) => Number.isFinite(y)));

/**
 * @param {Series} series
 * @param {(x: any) => any} at
 * @param {[number, number] | null} range
 * @param {boolean} canPick
 */
function trace({ name, colour, points, lines = true }, at, range, canPick) {
  const good = points.filter(({ y }) => Number.isFinite(y));
  const above = (/** @type {any} */ y) => range !== null && y > range[1];
  const below = (/** @type {any} */ y) => range !== null && y < range[0];
  const digits = (/** @type {any} */ v) => (v === null || v === undefined ? "" : Number(v).toPrecision(4));
  return {
    name: name ?? "",
    x: good.map(({ x }) => at(x)),
    // Off the scale: at its edge, with an arrow for a marker and the true value on it.
    y: good.map(({ y }) => (above(y) ? range?.[1] : below(y) ? range?.[0] : y)),
    error_y: { array: good.map(({ y, std }) => (above(y) || below(y) ? 0 : std ?? 0)), thickness: 1, width: 0 },
    customdata: good.map(({ x, value }) => value ?? x),
    text: good.map(({ y, std, label }) =>
      `${label ?? ""}: ${Number(digits(y))}${std ? ` ± ${Number(digits(std))}` : ""}${
        canPick ? "<br>click to use it" : ""
      }`
    ),
    hoverinfo: "text+name",
    mode: lines ? "lines+markers" : "markers",
    line: { color: colour, width: 1.5 },
    marker: {
      color: colour,
      size: 6,
      symbol: good.map(({ y }) => (above(y) ? "triangle-up-open" : below(y) ? "triangle-down-open" : "circle")),
    },
  };
}

/**
 * @param {{x: any, value?: any, reason: string}[]} refused
 * @param {(x: any) => any} at
 * @param {[number, number] | null} range
 * @param {ChartSpec} spec
 */
function refusals(refused, at, range, { series }) {
  const lowest = Math.min(...series.flatMap(({ points }) => points.map(({ y }) => y ?? Infinity)));
  const y = range?.[0] ?? (Number.isFinite(lowest) ? lowest : 0);
  return {
    name: "refused",
    x: refused.map(({ x }) => at(x)),
    y: refused.map(() => y),
    customdata: refused.map(({ x, value }) => value ?? x),
    text: refused.map(({ reason }) => reason.replace(/(.{40}\S*) /g, "$1<br>")),
    hoverinfo: "text+name",
    showlegend: false,
    mode: "markers",
    marker: { color: "#ff6b63", size: 7, symbol: "x-thin-open" },
  };
}

/**
 * @param {ChartSpec} spec
 * @param {(x: any) => any} at
 * @param {[number, number] | null} range
 * @param {{x: any, y?: number | null}[]} points
 */
function layout(spec, at, range, points) {
  const { title, x, y, scale, categories, present } = spec;
  const axis = { gridcolor: "#222a32", zeroline: false, linecolor: "#2b343d", ticks: "outside", ticklen: 3 };
  const known = points.map((point) => point.x).filter((value) => typeof value === "number");
  /** @type {any} */
  const across = { ...axis, title: { text: x, standoff: 4 }, type: scale === "logarithmic" ? "log" : "linear" };
  if (categories) Object.assign(across, { type: "category", categoryorder: "array", categoryarray: categories });
  if (scale === "cubic" && known.length) Object.assign(across, cubicTicks(Math.min(...known), Math.max(...known)));
  const line = { type: "line", yref: "paper", y0: 0, y1: 1, line: { color: "#e6ebef", width: 1, dash: "dot" } };
  const isKnown = present !== null && present !== undefined && (scale !== "logarithmic" || present > 0);
  return {
    title: { text: title, font: { ...FONT, size: 11, color: "#e6ebef" }, x: 0.02, xanchor: "left", y: 0.97 },
    height: HEIGHT,
    margin: { l: 44, r: 8, t: 34, b: 34 },
    font: FONT,
    paper_bgcolor: "#161b21",
    plot_bgcolor: "#11151a",
    showlegend: spec.series.filter(({ name }) => name).length > 1,
    legend: { orientation: "h", x: 0.93, xanchor: "right", y: 1.02, yanchor: "bottom", font: { ...FONT, size: 9 } },
    hovermode: "closest",
    hoverlabel: { font: { size: 11 }, namelength: -1 },
    dragmode: false,
    xaxis: across,
    yaxis: {
      ...axis,
      title: { text: y, standoff: 2 },
      ...(spec.isLogarithmic ? { type: "log", dtick: 1, range: decades(points) } : { range: range ?? undefined }),
    },
    shapes: isKnown ? [{ ...line, x0: at(present), x1: at(present) }] : [],
  };
}

/**
 * Range of a logarithmic axis, in whole decades: each end has a number.
 * @param {{y?: number | null}[]} points
 */
function decades(points) {
  const logs = points.flatMap(({ y }) => y && y > 0 ? [Math.log10(y)] : []);
  const low = Math.floor(Math.min(...logs));
  return logs.length ? [low, Math.max(Math.ceil(Math.max(...logs)), low + 1)] : undefined;
}

/**
 * Five ticks where the x axis goes by the cube root, labelled with the value.
 * @param {number} low
 * @param {number} high
 */
function cubicTicks(low, high) {
  const [from, to] = [Math.cbrt(low), Math.cbrt(high)];
  const values = [0, 0.25, 0.5, 0.75, 1].map((p) => Number(((from + p * (to - from)) ** 3).toPrecision(2)));
  return { tickvals: values.map(Math.cbrt), ticktext: values.map(String) };
}

/**
 * Range of the y axis without the few values so far off that nothing else could be seen.
 * @param {Point[]} points
 * @param {boolean} fromZero
 * @returns {[number, number] | null}
 */
function usualRange(points, fromZero) {
  const values = points.map(({ y }) => /** @type {number} */ (y)).sort((a, b) => a - b);
  if (!values.length) return null;
  const at = (/** @type {number} */ share) => values[Math.round(share * (values.length - 1))];
  const reach = 6 * (at(0.75) - at(0.25)) || Infinity;
  const usual = points.filter(({ y }) => Math.abs(/** @type {number} */ (y) - at(0.5)) <= reach);
  const low = fromZero ? 0 : Math.min(...usual.map(({ y, std }) => /** @type {number} */ (y) - (std ?? 0)));
  const high = Math.max(...usual.map(({ y, std }) => /** @type {number} */ (y) + (std ?? 0)));
  const spare = 0.08 * (high - low) || Math.abs(high) * 0.1 || 1;
  return [fromZero ? 0 : low - spare, high + spare];
}
