// Comparison of players, kinds, wings, drills or days: spread, trend, table, and the answers in words.

/** @import { CoachShot } from "../messages.d.ts" */
/** @import { Series } from "./charts.js" */

import { attempt, element } from "../elements.js";
import { daysChart, legendMark, spreadChart, trendChart } from "./charts.js";
import { nameWords, ShotFilter } from "./shot_list.js";
import { Shots } from "./shots.js";
import { dayOf, mainKind, speedWords, spinWords, term, text, wordsQuery } from "./texts.js";

const GROUPINGS = ["player", "kind", "wing", "stroke", "drill", "day", "session"];
const FEWEST = 3; // shots of a group that is called the most constant

/** Name of a shot's group. @param {CoachShot} shot @param {string} by */
function groupOf(shot, by) {
  if (by === "kind") return text(mainKind(shot) ?? "not_seen");
  if (by === "day") return dayOf(shot);
  return nameWords(/** @type {any} */ (shot)[by]) || text("none");
}

/**
 * Series of shots with their statistics.
 * @param {CoachShot[]} list in order of time
 * @param {(shot: CoachShot) => string} name of a shot's series
 * @param {number | null} since_s begin of the later part that is compared with the earlier; null for halves
 * @returns {Promise<Series[]>}
 */
export async function seriesOf(list, name, since_s = null) {
  const groups = [...Map.groupBy(list, name).entries()];
  if (!groups.length) return [];
  const series = Object.fromEntries(groups.map(([one, own]) => {
    const ids = [...Map.groupBy(own, (shot) => shot.session).entries()];
    return [one, Object.fromEntries(ids.map(([session, shots]) => [session, shots.map((shot) => shot.id)]))];
  }));
  const { series: statistics, order, is_clear } = await Shots.statistics({ series, since_s });
  return groups.map(([one, own]) => {
    const rank = order.indexOf(one);
    return { name: one, shots: own, statistics: statistics[one], rank, isStrongest: rank === 0 && is_clear };
  });
}

/** What the series answer, in sentences. @param {Series[]} series @param {string} since words for what is compared */
function answers(series, since) {
  const sentences = [];
  const ranked = series.filter(({ rank }) => rank >= 0).sort((a, b) => a.rank - b.rank);
  const [first, second] = ranked;
  if (second) {
    const kinds = new Set(ranked.flatMap(({ shots }) => shots.map(mainKind)).filter((kind) => kind !== null));
    const kind = text(kinds.size === 1 ? [...kinds][0] ?? "spin_noun" : "spin_noun");
    const [value, other_value] = [first, second].map(({ statistics }) => spinWords(statistics.median_rps));
    const words = { group: first.name, other: second.name, kind, value, other_value };
    sentences.push(text(first.isStrongest ? "answer_more" : "answer_even", words));
  }
  for (const { name, statistics } of series) {
    const value = spinWords(Math.abs(statistics.change_rps ?? 0));
    sentences.push(text(statistics.trend, { group: name, value, since }));
  }
  return sentences;
}

export class Comparison {
  #by = "player";
  #isOfAll = false;
  /** @type {number | null} first instant of the day from which on "after" counts; null for halves */
  #since_s = null;
  #hasBegun = false;
  #filled = 0;
  /** @type {CoachShot[]} */
  #list = [];
  filter = new ShotFilter();

  /** @param {{shots: Shots, sessions: string[], openShot: (shot: CoachShot) => void, show: () => Promise<void>}} page */
  constructor(page) {
    this.page = page;
    this.root = element("section.comparison");
    this.content = element("div.content");
    this.filter.addEventListener("change", () => this.#fill());
  }

  async show() {
    const { shots, sessions } = this.page;
    this.#list = this.#isOfAll ? await shots.ofSessions(sessions) : shots.list;
    if (!this.#hasBegun) this.filter.values.kind = this.#usualKind();
    this.#hasBegun = true;
    const by = element(
      "select",
      { name: "by", onchange: () => (this.#by = by.value, this.#fill()) },
      GROUPINGS.map((value) => element("option", { value, selected: value === this.#by }, text(value))),
    );
    const all = element("input", {
      type: "checkbox",
      name: "all-sessions",
      checked: this.#isOfAll,
      onchange: () => (this.#isOfAll = all.checked, this.page.show()),
    });
    const bar = this.filter.bar(this.#list);
    bar.prepend(element("label.name", {}, text("by"), by));
    bar.append(
      this.#sinceSelect(),
      sessions.length > 1 ? element("label.check", {}, all, text("all_sessions")) : "",
      element(
        "a.button",
        { href: shots.path(`report.html?${wordsQuery()}`), target: "_blank" },
        text("download_report"),
      ),
      element(
        "button",
        { onclick: () => attempt(() => shots.save(`report.pdf?${wordsQuery()}`, `${shots.session}.pdf`)) },
        text("download_pdf"),
      ),
    );
    this.root.replaceChildren(bar, this.content);
    this.#fill();
    return this.root;
  }

  // What "did it get better" compares: the halves of each series, or what was before a day and after.
  #sinceSelect() {
    const days = [...Map.groupBy(this.#list, dayOf).values()].map(([first]) => first).slice(1);
    if (!days.some((shot) => shot.recorded_s === this.#since_s)) this.#since_s = null;
    const made = element(
      "select",
      { name: "since", onchange: () => (this.#since_s = made.value ? Number(made.value) : null, this.#fill()) },
      element("option", { value: "" }, text("halves")),
      days.map((shot) =>
        element(
          "option",
          { value: String(shot.recorded_s), selected: shot.recorded_s === this.#since_s },
          text("since", { day: dayOf(shot) }),
        )
      ),
    );
    return element("label.name", {}, text("before_after"), made);
  }

  // Spins of different kinds are not compared unless somebody wishes it.
  #usualKind() {
    const groups = [...Map.groupBy(this.#list, (shot) => mainKind(shot) ?? "not_seen").entries()];
    return groups.sort(([, a], [, b]) => b.length - a.length)[0]?.[0] ?? "";
  }

  async #fill() {
    const filled = ++this.#filled;
    const list = this.filter.of(this.#list), since_s = this.#since_s;
    const group = (/** @type {CoachShot} */ shot) => groupOf(shot, this.#by);
    const [series, days] = await Promise.all([
      seriesOf(list, group, since_s),
      seriesOf(list, (shot) => JSON.stringify([group(shot), dayOf(shot)])),
    ]);
    if (filled !== this.#filled) return;
    const daysOf = (/** @type {Series} */ one) => days.filter(({ shots: [first] }) => group(first) === one.name);
    const open = this.page.openShot;
    const legend = element(
      "ul.legend",
      {},
      series.map(({ name }, index) => element("li", {}, legendMark(index), ` ${name}`)),
    );
    const figure = (/** @type {any} */ chart, /** @type {string} */ key) =>
      chart &&
      element(
        "figure.card",
        {},
        element("h3", {}, text(key)),
        chart,
        element("figcaption.note", {}, text(`${key}_help`)),
      );
    const first = list.find((shot) => shot.recorded_s === since_s);
    const since = first ? text("since", { day: dayOf(first) }) : text("halves");
    this.content.replaceChildren(
      element("ul.answers", {}, answers(series, since).map((sentence) => element("li", {}, sentence))),
      legend,
      element(
        "div.two",
        {},
        figure(spreadChart(series, open), "spread"),
        figure(trendChart(series, series.map(daysOf), open), "trend"),
        figure(daysChart(series, series.map(daysOf)), "days"),
      ),
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
        one.isStrongest ? element("span.badge.sure", {}, text("strongest")) : "",
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
      element("td.speed", {}, speedWords(statistics.median_speed_m_s)),
    );
  });
  return element("table.statistics", {}, element("thead", {}, element("tr", {}, head)), element("tbody", {}, rows));
}
