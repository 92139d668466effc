// Tests that can be repeated: a drill by a player on a day, with counts, best, middle, spread, beside the last time.

/** @import { CoachShot } from "../messages.d.ts" */
/** @import { Series } from "./charts.js" */
/** @import { Shots } from "./shots.js" */

import { attempt, element } from "../elements.js";
import { legendMark, placementChart } from "./charts.js";
import { seriesOf } from "./comparison.js";
import { nameInputs, nameWords, takeNames, valuesOf } from "./shot_list.js";
import { dayOf, mainKind, speedWords, spinWords, term, text } from "./texts.js";

const TARGET = 10; // balls of a test, as coaches ask for
const PROTOCOLS = ["maximum topspin", "backspin rally", "serves"];

export class Protocols {
  /** @param {{shots: Shots, go: (place: string) => void}} page */
  constructor({ shots, go }) {
    this.shots = shots;
    this.go = go;
    this.root = element("section.protocols");
  }

  async show() {
    const drilled = this.shots.list.filter((shot) => shot.drill !== null);
    const key = (/** @type {CoachShot} */ shot) => JSON.stringify([shot.drill, shot.player, dayOf(shot)]);
    const [series, landings] = await Promise.all([seriesOf(drilled, key), this.shots.landings()]);
    const drills = valuesOf(drilled, "drill");
    this.root.replaceChildren(
      this.#start(),
      ...drills.map((drill) => this.#drill(drill, series.filter((one) => one.shots[0].drill === drill), landings)),
      drills.length
        ? element("button.print", { onclick: () => print() }, text("print"))
        : element("p.note", {}, text("no_tests")),
    );
    return this.root;
  }

  #start() {
    const { now } = this.shots;
    const inputs = nameInputs(this.shots, /** @type {any} */ (now));
    const presets = PROTOCOLS.map((key) =>
      element("button", {
        type: "button",
        onclick: () => inputs[3].querySelector("input").value = text(key),
      }, text(key))
    );
    const form = element(
      "form.names",
      { "aria-label": text("now") },
      inputs,
      element("button.primary", {}, text("start_test")),
    );
    form.addEventListener("submit", (/** @type {Event} */ event) => {
      event.preventDefault();
      attempt(() => this.shots.playNow(/** @type {any} */ (takeNames(inputs))));
    });
    const stop = element("button", {
      type: "button",
      onclick: () => attempt(() => this.shots.playNow({ player: null, wing: null, stroke: null, drill: null })),
    }, text("stop_test"));
    const running = now.drill === null
      ? null
      : this.shots.list.filter((shot) =>
        shot.drill === now.drill && shot.player === now.player && dayOf(shot) === today()
      ).length;
    return element(
      "div.card.start",
      {},
      element("h3", {}, text("start_test")),
      element("div.row", {}, presets),
      form,
      running === null ? "" : element(
        "p.large",
        {},
        `${nameWords(now.player)} – ${nameWords(now.drill)}: ${text("balls", { count: running, target: TARGET })} `,
        stop,
      ),
      element("p.note", {}, text("now_help")),
    );
  }

  /** @param {string} drill @param {Series[]} series @param {Record<number, number[]>} landings */
  #drill(drill, series, landings) {
    const head = ["player", "day", "count", "kind", "median", "deviation", "best", "speed", "last_time"].map((key) =>
      element("th", { scope: "col" }, key === "median" || key === "deviation" ? term(key) : text(key))
    );
    const rows = series.map((one) => {
      const { statistics, shots: [first] } = one;
      const earlier = series.filter((other) =>
        other.shots[0].player === first.player && other.shots[0].recorded_s < first.recorded_s
      ).pop();
      const change = earlier && statistics.median_rps !== null && earlier.statistics.median_rps !== null
        ? statistics.median_rps - earlier.statistics.median_rps
        : null;
      return element(
        "tr",
        {},
        element("th", { scope: "row" }, nameWords(first.player) || text("none")),
        element("td", {}, dayOf(first)),
        element(
          "td",
          {},
          String(statistics.count) + (statistics.unseen ? ` (+${statistics.unseen} ${text("not_seen")})` : ""),
        ),
        element("td", {}, kindCounts(one.shots)),
        element("td", {}, element("strong", {}, spinWords(statistics.median_rps))),
        element("td", {}, spinWords(statistics.spread_rps)),
        element(
          "td",
          {},
          element(
            "button.link",
            { onclick: () => this.go(`shot/${statistics.best_id}`) },
            spinWords(statistics.best_rps),
          ),
        ),
        element("td.speed", {}, speedWords(statistics.median_speed_m_s)),
        element(
          "td",
          {},
          change === null
            ? text("first_time")
            : text(change < 0 ? "less" : "more", { value: spinWords(Math.abs(change)) }),
        ),
      );
    });
    const players = [...Map.groupBy(series, ({ shots: [first] }) => nameWords(first.player) || text("none")).entries()]
      .map(([name, own]) => ({ name, shots: own.flatMap(({ shots }) => shots) }));
    const placement = placementChart(players, landings, (shot) => this.go(`shot/${shot.id}`));
    return element(
      "div.card",
      {},
      element("h3", {}, `${text("protocol")}: ${nameWords(drill)}`),
      element(
        "div.scroll",
        { tabIndex: 0 },
        element("table.statistics", {}, element("thead", {}, element("tr", {}, head)), element("tbody", {}, rows)),
      ),
      placement &&
        element(
          "figure.placement",
          {},
          element(
            "figcaption",
            {},
            text("placement"),
            ": ",
            players.map(({ name }, i) => [legendMark(i), ` ${name} `]).flat(),
          ),
          placement,
        ),
    );
  }
}

/** How many shots of each kind: "backspin 4, left sidespin 2". @param {CoachShot[]} shots */
const kindCounts = (shots) =>
  [...Map.groupBy(shots.filter((shot) => shot.kind.length), mainKind).entries()]
    .sort(([, a], [, b]) => b.length - a.length).map(([kind, own]) => `${text(kind ?? "")} ${own.length}`).join(", ");

const today = () => dayOf(/** @type {CoachShot} */ ({ recorded_s: Date.now() / 1000 }));
