// Comparison of players, kinds, wings, drills or days: spread, trend, table, and the answers in words.

/** @import { CoachShot } from "../messages.d.ts" */
/** @import { Series } from "./charts.js" */
/** @import { Shots } from "./shots.js" */

import { element } from "../elements.js";
import { legendMark, spreadChart, trendChart } from "./charts.js";
import { nameWords, ShotFilter } from "./shot_list.js";
import { dayOf, mainKind, speedWords, spinWords, term, text, wordsQuery } from "./texts.js";

const GROUPINGS = ["player", "kind", "wing", "stroke", "drill", "day"];
const FEWEST = 3; // shots of a group that is called the most constant or the strongest

/** Name of a shot's group. @param {CoachShot} shot @param {string} by */
function groupOf(shot, by) {
  if (by === "kind") return text(mainKind(shot) ?? "not_seen");
  if (by === "day") return dayOf(shot);
  return nameWords(/** @type {any} */ (shot)[by]) || text("none");
}

/** @param {Shots} shots @param {CoachShot[]} list @param {(shot: CoachShot) => string} name @returns {Promise<Series[]>} */
export async function seriesOf(shots, list, name) {
  const groups = [...Map.groupBy(list, name).entries()];
  if (!groups.length) return [];
  const series = Object.fromEntries(groups.map(([one, own]) => [one, own.map((shot) => shot.id)]));
  const statistics = (await shots.post("statistics", { series })).series;
  return groups.map(([one, own]) => ({ name: one, shots: own, statistics: statistics[one] }));
}

/** What the series answer, in sentences. @param {Series[]} series */
export function answers(series) {
  const sentences = [];
  const large = series.filter(({ statistics }) => statistics.count >= FEWEST);
  const strongest = [...large].sort((a, b) => (b.statistics.median_rps ?? 0) - (a.statistics.median_rps ?? 0))[0];
  if (large.length > 1 && strongest) {
    const kinds = new Set(large.flatMap(({ shots }) => shots.map(mainKind)).filter((kind) => kind !== null));
    const kind = text(kinds.size === 1 ? [...kinds][0] ?? "spin_noun" : "spin_noun");
    sentences.push(
      text("answer_more", { group: strongest.name, kind, value: spinWords(strongest.statistics.median_rps) }),
    );
  }
  for (const { name, statistics } of series) {
    sentences.push(text(statistics.trend, { group: name, value: spinWords(Math.abs(statistics.change_rps ?? 0)) }));
  }
  return sentences;
}

export class Comparison {
  #by = "player";

  filter = new ShotFilter();
  #hasBegun = false;

  /** @param {{shots: Shots, go: (place: string) => void}} page */
  constructor({ shots, go }) {
    this.shots = shots;
    this.go = go;
    this.root = element("section.comparison");
    this.content = element("div.content");
    this.filter.addEventListener("change", () => this.#fill());
  }

  show() {
    if (!this.#hasBegun) this.filter.values.kind = this.#usualKind();
    this.#hasBegun = true;
    const by = element(
      "select",
      { name: "by", onchange: () => (this.#by = by.value, this.#fill()) },
      GROUPINGS.map((value) => element("option", { value, selected: value === this.#by }, text(value))),
    );
    const bar = this.filter.bar(this.shots.list);
    bar.prepend(element("label.name", {}, text("by"), by));
    const report = element("a.button", {
      href: this.shots.path(`report.html?${wordsQuery()}`),
      target: "_blank",
    }, text("download_report"));
    bar.append(report);
    this.root.replaceChildren(bar, this.content);
    this.#fill();
    return this.root;
  }

  // Spins of different kinds are not compared unless somebody wishes it.
  #usualKind() {
    const groups = [...Map.groupBy(this.shots.list, (shot) => mainKind(shot) ?? "not_seen").entries()];
    return groups.sort(([, a], [, b]) => b.length - a.length)[0]?.[0] ?? "";
  }

  async #fill() {
    const list = this.filter.of(this.shots.list);
    const series = await seriesOf(this.shots, list, (shot) => groupOf(shot, this.#by));
    const open = (/** @type {CoachShot} */ shot) => this.go(`shot/${shot.id}`);
    const legend = element(
      "ul.legend",
      {},
      series.map(({ name }, index) => element("li", {}, legendMark(index), ` ${name}`)),
    );
    const spread = spreadChart(series, open), trend = trendChart(series, open);
    const figure = (/** @type {any} */ chart, /** @type {string} */ key) =>
      chart &&
      element(
        "figure.card",
        {},
        element("h3", {}, text(key)),
        chart,
        element("figcaption.note", {}, text(`${key}_help`)),
      );
    this.content.replaceChildren(
      element("ul.answers", {}, answers(series).map((sentence) => element("li", {}, sentence))),
      legend,
      element("div.two", {}, figure(spread, "spread"), figure(trend, "trend")),
      statisticsTable(series, open),
    );
  }
}

/** @param {Series[]} series @param {(shot: CoachShot) => void} open */
function statisticsTable(series, open) {
  const large = series.filter(({ statistics }) => statistics.count >= FEWEST);
  const share = (/** @type {Series} */ one) =>
    (one.statistics.spread_rps ?? Infinity) / (one.statistics.median_rps ?? 1);
  const constant = large.length > 1 ? [...large].sort((a, b) => share(a) - share(b))[0] : null;
  const strongest = large.length > 1
    ? [...large].sort((a, b) => (b.statistics.median_rps ?? 0) - (a.statistics.median_rps ?? 0))[0]
    : null;
  const head = ["", "count", "unseen", "median", "deviation", "best", "speed"].map((key) =>
    element("th", { scope: "col" }, key === "median" || key === "deviation" ? term(key) : key && text(key))
  );
  const rows = series.map((one, index) => {
    const { statistics, shots } = one;
    const best = shots.find((shot) => shot.id === statistics.best_id);
    return element(
      "tr",
      {},
      element(
        "th",
        { scope: "row" },
        legendMark(index),
        ` ${one.name} `,
        one === strongest ? element("span.badge.sure", {}, text("strongest")) : "",
        one === constant ? element("span.badge.good", {}, text("most_constant")) : "",
      ),
      element("td", {}, String(statistics.count)),
      element("td", {}, String(statistics.unseen)),
      element("td", {}, element("strong", {}, spinWords(statistics.median_rps))),
      element("td", {}, spinWords(statistics.spread_rps)),
      element(
        "td",
        {},
        best ? element("button.link", { onclick: () => open(best) }, spinWords(statistics.best_rps)) : "–",
      ),
      element("td", {}, speedWords(statistics.median_speed_m_s)),
    );
  });
  return element("table.statistics", {}, element("thead", {}, element("tr", {}, head)), element("tbody", {}, rows));
}
