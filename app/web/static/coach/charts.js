// Charts of series of shots in SVG: spin against speed with the ellipses of the spread, shot by shot, day by day.

/** @import { CoachShot, SeriesStatistics } from "../messages.d.ts" */

import { drawing } from "../elements.js";
import { TABLE } from "./drawings.js";
import { chosen, dayOf, decimal, inSpeedUnit, inSpinUnit, kindWords, spinWords, text } from "./texts.js";

// Okabe and Ito's palette, dark enough on white, told apart by shape as well.
export const COLOURS = ["#0072b2", "#c24e00", "#007a5a", "#a3427d", "#6b5900", "#2c7da0", "#555555"];
const SHAPES = ["circle", "square", "triangle", "diamond"];
const AROUND_M = 0.15; // of the table that is drawn
const DAY_LABEL = 84; // wide, and so far apart
const WIDTH = 560, HEIGHT = 340, LEFT = 52, RIGHT = 12, TOP = 12, BOTTOM = 44;

/** @typedef {{name: string, shots: CoachShot[], statistics: SeriesStatistics, rank: number, isStrongest: boolean}} Series */

/** @param {number} x @param {number} y @param {number} index @param {string} title @param {() => void} [open] */
function mark(x, y, index, title, open) {
  const fill = COLOURS[index % COLOURS.length], r = 4.6;
  const shape = SHAPES[index % SHAPES.length];
  const made = shape === "circle"
    ? drawing("circle", { cx: x, cy: y, r, fill })
    : shape === "square"
    ? drawing("rect", { x: x - r, y: y - r, width: 2 * r, height: 2 * r, fill })
    : drawing("path", {
      d: shape === "triangle"
        ? `M${x} ${y - r * 1.2}l${r * 1.2} ${r * 2.1}h${-r * 2.4}z`
        : `M${x} ${y - r * 1.3}l${r * 1.3} ${r * 1.3}l${-r * 1.3} ${r * 1.3}l${-r * 1.3} ${-r * 1.3}z`,
      fill,
    });
  made.append(drawing("title", {}, title));
  made.classList.add("mark");
  if (open) made.addEventListener("click", open);
  return made;
}

/** A few round numbers in a range. @param {number} low @param {number} high */
function rounds(low, high) {
  const rough = (high - low) / 5, power = 10 ** Math.floor(Math.log10(rough || 1));
  const step = [1, 2, 5, 10].map((one) => one * power).find((one) => one >= rough) ?? power;
  const found = [];
  for (let value = Math.ceil(low / step) * step; value <= high; value += step) found.push(value);
  return found;
}

/**
 * @param {string} label @param {string} xTitle @param {[number, number]} xRange @param {[number, number]} yRange
 * @param {(value: number) => string} xWords
 */
function axes(label, xTitle, xRange, yRange, xWords) {
  const x = (/** @type {number} */ v) => LEFT + (v - xRange[0]) / (xRange[1] - xRange[0]) * (WIDTH - LEFT - RIGHT);
  const y = (/** @type {number} */ v) =>
    HEIGHT - BOTTOM - (v - yRange[0]) / (yRange[1] - yRange[0]) * (HEIGHT - TOP - BOTTOM);
  const svg = drawing("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": label, class: "chart" });
  for (const value of rounds(...yRange)) {
    svg.append(
      drawing("line", { x1: LEFT, y1: y(value), x2: WIDTH - RIGHT, y2: y(value), class: "grid" }),
      drawing("text", { x: LEFT - 6, y: y(value) + 4, class: "y" }, decimal(value)),
    );
  }
  for (const value of rounds(...xRange)) {
    svg.append(drawing("text", { x: x(value), y: HEIGHT - BOTTOM + 18, class: "x" }, xWords(value)));
  }
  svg.append(
    drawing("line", { x1: LEFT, y1: HEIGHT - BOTTOM, x2: WIDTH - RIGHT, y2: HEIGHT - BOTTOM, class: "axis" }),
    drawing("text", { x: (LEFT + WIDTH) / 2, y: HEIGHT - 6, class: "x title" }, xTitle),
    drawing(
      "text",
      { x: -(HEIGHT - BOTTOM) / 2, y: 13, transform: "rotate(-90)", class: "x title" },
      `${text("spin")} (${text(chosen.spin)})`,
    ),
  );
  return { svg, x, y };
}

/** @param {number[]} values @returns {[number, number]} */
function range(values, low = Infinity) {
  const least = Math.min(low, ...values), most = Math.max(...values), margin = 0.06 * (most - least || 1);
  return [low === 0 ? 0 : least - margin, most + margin];
}

/** Spin against speed. @param {Series[]} series @param {(shot: CoachShot) => void} open */
export function spreadChart(series, open) {
  const known = series.flatMap(({ shots }) => shots).filter((shot) =>
    shot.spin_rps !== null && shot.speed_m_s !== null
  );
  if (!known.length) return null;
  const outlines = series.flatMap(({ statistics }) => statistics.ellipse ?? []);
  const speeds = [...known.map((shot) => shot.speed_m_s ?? 0), ...outlines.map(([speed]) => speed)].map(inSpeedUnit);
  const spins = [...known.map((shot) => shot.spin_rps ?? 0), ...outlines.map(([, spin]) => spin)].map(inSpinUnit);
  const title = `${text("speed")} (${text(chosen.speed)})`;
  const { svg, x, y } = axes(text("spread"), title, range(speeds), range(spins, 0), (value) => decimal(value));
  series.forEach(({ statistics }, index) => {
    if (!statistics.ellipse) return;
    const points = statistics.ellipse.map(([speed, spin]) => `${x(inSpeedUnit(speed))},${y(inSpinUnit(spin))}`).join(
      " ",
    );
    const colour = COLOURS[index % COLOURS.length];
    svg.append(drawing("polygon", { points, fill: colour, "fill-opacity": 0.1, stroke: colour, "stroke-width": 1.5 }));
  });
  series.forEach(({ name, shots }, index) => {
    for (const shot of shots) {
      if (shot.spin_rps === null || shot.speed_m_s === null) continue;
      const title = `${name}: ${spinWords(shot.spin_rps)}, ${kindWords(shot.kind)}`;
      svg.append(mark(x(inSpeedUnit(shot.speed_m_s)), y(inSpinUnit(shot.spin_rps)), index, title, () => open(shot)));
    }
  });
  return svg;
}

/**
 * Spin shot by shot, with the middle of each day.
 * @param {Series[]} series @param {Series[][]} days of each series @param {(shot: CoachShot) => void} open
 */
export function trendChart(series, days, open) {
  const seen = series.map(({ name, shots }) => ({ name, shots: shots.filter((shot) => shot.spin_rps !== null) }));
  const all = [...new Set(seen.flatMap(({ shots }) => shots))].sort((a, b) => a.recorded_s - b.recorded_s);
  if (all.length < 2) return null;
  const place = new Map(all.map((shot, index) => [shot, index + 1]));
  const spins = all.map((shot) => inSpinUnit(shot.spin_rps ?? 0));
  const { svg, x, y } = axes(
    text("trend"),
    text("shots"),
    [0, all.length + 1],
    range(spins, 0),
    (value) => Number.isInteger(value) ? decimal(value) : "",
  );
  let free = 0;
  for (const [first] of Map.groupBy(all, dayOf).values()) {
    const at = x((place.get(first) ?? 0) - 0.5);
    svg.append(drawing("line", { x1: at, y1: TOP, x2: at, y2: HEIGHT - BOTTOM, class: "day" }));
    if (at < free) continue;
    svg.append(drawing("text", { x: at + 4, y: TOP + 10, class: "day" }, dayOf(first)));
    free = at + DAY_LABEL;
  }
  seen.forEach(({ name, shots }, index) => {
    const stroke = COLOURS[index % COLOURS.length];
    for (const { shots: own, statistics } of days[index]) {
      const places = own.map((shot) => place.get(shot)).filter((one) => one !== undefined);
      if (statistics.median_rps === null) continue;
      const middle = y(inSpinUnit(statistics.median_rps));
      const ends = { x1: x(Math.min(...places) - 0.4), y1: middle, x2: x(Math.max(...places) + 0.4), y2: middle };
      svg.append(drawing("line", { ...ends, stroke, "stroke-width": 2 }));
    }
    for (const shot of shots) {
      const title = `${name}: ${spinWords(shot.spin_rps)}, ${dayOf(shot)}`;
      svg.append(mark(x(place.get(shot) ?? 0), y(inSpinUnit(shot.spin_rps ?? 0)), index, title, () => open(shot)));
    }
  });
  return svg;
}

/** Middle and spread of each day in the course of weeks and months. @param {Series[]} series @param {Series[][]} days */
export function daysChart(series, days) {
  const known = days.map((own) => own.filter(({ statistics }) => statistics.median_rps !== null));
  const at = (/** @type {Series} */ day) => day.shots[0].recorded_s;
  const ordered = known.flat().sort((a, b) => at(a) - at(b));
  if (new Set(ordered.map(({ shots: [first] }) => dayOf(first))).size < 2) return null;
  const ends = ({ statistics: { median_rps, spread_rps } } = ordered[0]) =>
    [-1, 1].map((sign) => inSpinUnit((median_rps ?? 0) + sign * (spread_rps ?? 0)));
  const { svg, x, y } = axes(
    text("days"),
    text("day"),
    range(ordered.map(at)),
    range(ordered.flatMap((day) => ends(day)), 0),
    () => "",
  );
  let free = 0;
  for (const day of ordered) {
    const inside = Math.min(Math.max(x(at(day)), LEFT + DAY_LABEL / 2), WIDTH - RIGHT - DAY_LABEL / 2);
    if (inside < free) continue;
    svg.append(drawing("text", { x: inside, y: HEIGHT - BOTTOM + 18, class: "x" }, dayOf(day.shots[0])));
    free = inside + DAY_LABEL;
  }
  known.forEach((own, index) => {
    const stroke = COLOURS[index % COLOURS.length];
    const middles = own.map((day) => [x(at(day)), y(inSpinUnit(day.statistics.median_rps ?? 0))]);
    svg.append(
      drawing("polyline", { points: middles.map((one) => one.join(",")).join(" "), fill: "none", stroke }),
    );
    own.forEach((day, i) => {
      const [x1, middle] = middles[i], [low, high] = ends(day);
      const { count, median_rps } = day.statistics;
      const title = `${series[index].name}: ${spinWords(median_rps)}, ${dayOf(day.shots[0])} (${count})`;
      svg.append(
        drawing("line", { x1, y1: y(low), x2: x1, y2: y(high), stroke, "stroke-width": 2, "stroke-opacity": 0.5 }),
        mark(x1, middle, index, title),
      );
    });
  });
  return svg;
}

/**
 * Where the shots of series bounced on the table, from above, the hitter on the left.
 * @param {{name: string, shots: CoachShot[]}[]} series @param {Record<number, number[]>} landings by id
 * @param {(shot: CoachShot) => void} open
 */
export function placementChart(series, landings, open) {
  const wide = TABLE.long + 2 * AROUND_M, high = TABLE.wide + 2 * AROUND_M, scale = WIDTH / wide;
  const x = (/** @type {number} */ m) => scale * (m + wide / 2),
    y = (/** @type {number} */ m) => scale * (high / 2 - m);
  const [left, right, top, bottom] = [x(-TABLE.long / 2), x(TABLE.long / 2), y(TABLE.wide / 2), y(-TABLE.wide / 2)];
  const svg = drawing(
    "svg",
    { viewBox: `0 0 ${WIDTH} ${scale * high}`, role: "img", "aria-label": text("placement"), class: "chart placement" },
    drawing("rect", { x: left, y: top, width: right - left, height: bottom - top, class: "table" }),
    drawing("line", { x1: left, y1: y(0), x2: right, y2: y(0), class: "line" }),
    drawing("line", { x1: x(0), y1: top - 8, x2: x(0), y2: bottom + 8, class: "net" }),
  );
  const landed = series.flatMap(({ name, shots }, index) =>
    shots.filter((shot) => landings[shot.id]).map((shot) => {
      const [along, aside] = landings[shot.id];
      const title = `${name}: ${spinWords(shot.spin_rps)}, ${kindWords(shot.kind)}`;
      return mark(x(along), y(aside), index, title, () => open(shot));
    })
  );
  svg.append(...landed);
  return landed.length ? svg : null;
}

/** The mark of a series, for legends. @param {number} index */
export const legendMark = (index) =>
  drawing("svg", { viewBox: "0 0 14 14", class: "legend", "aria-hidden": "true" }, mark(7, 7, index, ""));
