// The list of shots: filter, sort, select, mark, name, delete and undo.

/** @import { CoachShot } from "../messages.d.ts" */
/** @import { Shots } from "./shots.js" */

import { attempt, element } from "../elements.js";
import {
  capitalized,
  dayOf,
  decimal,
  hasText,
  kindWords,
  mainKind,
  speedWords,
  spinWords,
  term,
  text,
  timeWords,
  toldBy,
} from "./texts.js";

export const NAMES = ["player", "wing", "stroke", "drill"];
const COLUMNS = ["time", "player", "kind", "spin", "speed", "effect", "confidence"];
// Names that are offered, and translated.
const OUR_NAMES = [
  "forehand",
  "backhand",
  "topspin",
  "backspin",
  "push",
  "serve",
  "smash",
  "maximum topspin",
  "backspin rally",
  "serves",
];
const OFFERED = {
  wing: ["forehand", "backhand"],
  stroke: ["topspin", "push", "serve", "smash"],
  drill: ["maximum topspin", "backspin rally", "serves"],
};
const ROWS_AT_ONCE = 24; // a projector shows 20
const NEAR_PX = 800; // below what is seen, where the next rows are made
const CONFIDENCE = ["rough", "good", "sure"];
/** @type {Record<string, (shot: CoachShot) => string | number | null>} */
const SORT_BY = {
  time: (shot) => shot.recorded_s,
  player: (shot) => shot.player,
  kind: (shot) => kindWords(shot.kind),
  spin: (shot) => shot.spin_rps,
  speed: (shot) => shot.speed_m_s,
  effect: (shot) => shot.effect,
  confidence: (shot) => shot.confidence && CONFIDENCE.indexOf(shot.confidence),
};

/** What is said where there is no spin. @param {CoachShot} shot */
export const notSeen = (shot) => element("span.unseen", { title: shot.reason ?? "" }, term("not_seen"));

/** A name in the language, where it is one of ours. @param {string | null} name */
export const nameWords = (name) => name === null ? "" : hasText(name) ? text(name) : name;

/** A name as it is kept: ours by its key, in whatever language it was written. @param {string} words @returns {string | null} */
export const nameCode = (words) => OUR_NAMES.find((key) => text(key) === words.trim()) ?? (words.trim() || null);

/** Values of a name among shots, in alphabetical order. @param {CoachShot[]} shots @param {string} name @returns {string[]} */
export const valuesOf = (shots, name) =>
  [...new Set(shots.map((shot) => /** @type {any} */ (shot)[name]).filter((value) => value !== null))].sort();

/** Takes what stands in the inputs of `nameInputs`, to be sent. @param {any[]} labels @returns {Record<string, string | null>} */
export function takeNames(labels) {
  const inputs = labels.map((label) => label.querySelector("input"));
  for (const input of inputs) {
    input.defaultValue = input.value;
    input.blur();
  }
  return Object.fromEntries(inputs.map((input) => [input.name, nameCode(input.value)]));
}

/** Inputs of the four names, with those in use as suggestions. @param {Shots} shots @param {Record<string, string | null>} values */
export function nameInputs(shots, values) {
  return NAMES.map((name) => {
    const options = new Set(valuesOf(shots.list, name));
    /** @type {Record<string, string[]>} */ (OFFERED)[name]?.forEach((value) => options.add(value));
    const id = `names-${name}-${Math.random().toString(36).slice(2)}`;
    const input = element("input", {
      name,
      defaultValue: nameWords(values[name] ?? null),
      maxLength: 80,
      autocomplete: "off",
    });
    input.setAttribute("list", id);
    return element(
      "label.name",
      {},
      text(name),
      input,
      element("datalist", { id }, [...options].map((value) => element("option", { value: nameWords(value) }))),
    );
  });
}

// What is shown of the shots, shared by the list and the comparison.
export class ShotFilter extends EventTarget {
  /** @type {Record<string, string>} */
  values = { player: "", kind: "", wing: "", stroke: "", drill: "", day: "" };
  search = "";
  isMarked = false;

  /** @param {CoachShot[]} shots */
  of(shots) {
    const { search, values } = this;
    const has = (/** @type {CoachShot} */ shot) =>
      Object.entries(values).every(([name, value]) =>
        value === "" ||
        (name === "kind"
          ? (mainKind(shot) ?? "not_seen") === value
          : name === "day"
          ? dayOf(shot) === value
          : /** @type {any} */ (shot)[name] === value)
      );
    const words = (/** @type {CoachShot} */ shot) =>
      [shot.id, kindWords(shot.kind), ...NAMES.map((name) => nameWords(/** @type {any} */ (shot)[name]))].join(" ")
        .toLowerCase();
    return shots.filter((shot) =>
      has(shot) && (!this.isMarked || shot.marked) && words(shot).includes(search.toLowerCase())
    );
  }

  /** @param {CoachShot[]} shots */
  bar(shots) {
    const changed = () => this.dispatchEvent(new Event("change"));
    const select = (/** @type {string} */ name, /** @type {string[]} */ options) => {
      if (options.length < 2 && !this.values[name]) return null;
      const made = element(
        "select",
        { name: `filter-${name}`, onchange: () => (this.values[name] = made.value, changed()) },
        element("option", { value: "" }, text("all")),
        options.map((value) => element("option", { value, selected: value === this.values[name] }, nameWords(value))),
      );
      return element("label.name", {}, text(name), made);
    };
    const kinds = [...new Set(shots.map((shot) => mainKind(shot) ?? "not_seen"))];
    const search = element("input", {
      type: "search",
      value: this.search,
      oninput: () => (this.search = search.value, changed()),
    });
    const marked = element("input", {
      type: "checkbox",
      checked: this.isMarked,
      onchange: () => (this.isMarked = marked.checked, changed()),
    });
    return element(
      "div.filter",
      {},
      select("player", valuesOf(shots, "player")),
      select("kind", kinds),
      ["wing", "stroke", "drill"].map((name) => select(name, valuesOf(shots, name))),
      select("day", [...new Set(shots.map(dayOf))]),
      element("label.name", {}, text("search"), search),
      element("label.check", {}, marked, text("marked")),
    );
  }
}

export class ShotList {
  /** @type {Set<number>} */
  #selected = new Set();
  /** @type {CoachShot[]} */
  #shots = [];
  #rowCount = ROWS_AT_ONCE;
  #sort = { column: "time", isFalling: true };
  #nearEnd = new IntersectionObserver(([end]) => end.isIntersecting && this.#extend(), {
    rootMargin: `${NEAR_PX}px`,
  });

  /** @param {{shots: Shots, filter: ShotFilter, go: (place: string) => void}} page */
  constructor({ shots, filter, go }) {
    this.shots = shots;
    this.filter = filter;
    this.go = go;
    this.root = element("section.list");
    this.rows = element("tbody");
    this.actions = element("div.actions");
    this.end = element("div");
    filter.addEventListener("change", () => this.#begin());
  }

  show() {
    const { shots } = this;
    this.filterBar = this.filter.bar(shots.list);
    const heading = (/** @type {string} */ column) => {
      const isSorted = this.#sort.column === column;
      const order = isSorted ? (this.#sort.isFalling ? "descending" : "ascending") : "none";
      const button = element(
        "button.sort",
        { onclick: () => this.#sortBy(column) },
        text(column),
        element("span", { "aria-hidden": "true" }, isSorted ? (this.#sort.isFalling ? " ▼" : " ▲") : ""),
      );
      return element("th", { scope: "col", "aria-sort": order, className: column }, button);
    };
    this.all = element("input", {
      type: "checkbox",
      "aria-label": text("select_all"),
      onchange: () => this.#selectAll(),
    });
    const table = element(
      "table.shots",
      {},
      element(
        "thead",
        {},
        element(
          "tr",
          {},
          element("th.check", {}, this.all),
          element("th.picture", { "aria-label": text("view") }),
          COLUMNS.map(heading),
          element("th.mark", { "aria-label": text("mark") }),
        ),
      ),
      this.rows,
    );
    this.root.replaceChildren(this.#latest(), this.filterBar, this.actions, table, this.end);
    this.#fill();
    return this.root;
  }

  /** Answer to "what spin was my last serve": the newest shot that is shown, large. */
  #latest() {
    this.latest = element("p.latest", { "aria-live": "polite" });
    return this.latest;
  }

  #shown() {
    const { column, isFalling } = this.#sort;
    const value = SORT_BY[column], sign = isFalling ? -1 : 1;
    return this.filter.of(this.shots.list).sort((a, b) => {
      const [x, y] = [value(a), value(b)];
      if (x === null || y === null) return Number(x === null) - Number(y === null);
      return sign * (typeof x === "string" ? x.localeCompare(String(y)) : x - Number(y));
    });
  }

  // Other shots or another order: from the top.
  #begin() {
    this.#rowCount = ROWS_AT_ONCE;
    this.#fill();
  }

  #fill() {
    const shown = this.#shots = this.#shown();
    this.ids = shown.map((shot) => shot.id);
    for (const id of [...this.#selected]) if (!this.ids.includes(id)) this.#selected.delete(id);
    this.rows.replaceChildren(...shown.slice(0, this.#rowCount).map((shot) => this.#row(shot)));
    this.#watchEnd();
    if (!shown.length) {
      const why = this.shots.list.length ? text("empty") : text("no_shots_yet");
      this.rows.append(element("tr", {}, element("td.empty", { colSpan: COLUMNS.length + 3 }, why)));
    }
    const newest = [...shown].sort((a, b) => b.recorded_s - a.recorded_s)[0];
    this.latest?.replaceChildren(
      ...(newest
        ? [`${text("latest")}: `, element("strong", {}, this.#words(newest)), ` ${nameWords(newest.player)}`]
        : []),
    );
    this.#showActions();
  }

  // The rest of a long list is made as it is scrolled into view.
  #extend() {
    const first = this.#rowCount;
    if (first >= this.#shots.length) return;
    this.#rowCount += ROWS_AT_ONCE;
    this.rows.append(...this.#shots.slice(first, this.#rowCount).map((shot) => this.#row(shot)));
    this.#watchEnd();
  }

  // Begun anew, the observer tells once more whether the end is near.
  #watchEnd() {
    this.#nearEnd.disconnect();
    this.#nearEnd.observe(this.end);
  }

  /** @param {CoachShot} shot */
  #words(shot) {
    return shot.spin_rps === null
      ? text("not_seen")
      : `${spinWords(shot.spin_rps)} ${kindWords(shot.kind)}, ${speedWords(shot.speed_m_s)}`;
  }

  /** @param {CoachShot} shot */
  #row(shot) {
    const check = element("input", {
      type: "checkbox",
      checked: this.#selected.has(shot.id),
      "aria-label": text("select", { number: shot.id }),
      onchange:
        () => (check.checked ? this.#selected.add(shot.id) : this.#selected.delete(shot.id), this.#showActions()),
    });
    const open = {
      href: `#shot/${shot.id}`,
      "aria-label": `${text("open", { number: shot.id })}: ${this.#words(shot)}`,
    };
    const picture = shot.has_picture
      ? element("img", {
        src: this.shots.path(`pictures/${shot.id}?${shot.revision}`),
        alt: "",
        loading: "lazy",
        width: 48,
        height: 48,
      })
      : element("span.nothing", {}, "–");
    const star = element("button.star", {
      "aria-label": text(shot.marked ? "unmark" : "mark"),
      "aria-pressed": shot.marked,
      onclick: () => attempt(() => this.shots.change([shot.id], { marked: !shot.marked })),
    }, shot.marked ? "★" : "☆");
    const cells = shot.spin_rps === null
      ? [element("td.kind", { colSpan: 2 }, notSeen(shot), element("span.reason", {}, ` ${shot.reason ?? ""}`))]
      : [
        element("td.kind", {}, capitalized(shot), toldBy(shot)),
        element("td.spin", {}, element("strong", {}, spinWords(shot.spin_rps))),
      ];
    return element(
      "tr",
      { className: this.#selected.has(shot.id) ? "selected" : "" },
      element("td", {}, check),
      element("td.picture", {}, element("a", open, picture)),
      element("td.time", {}, element("a", { href: open.href }, timeWords(shot, true))),
      element("td.player", {}, [
        nameWords(shot.player),
        element(
          "small",
          {},
          [shot.wing, shot.stroke, shot.drill].filter((one) => one !== null).map(nameWords).join(", "),
        ),
      ]),
      ...cells,
      element("td.speed", {}, speedWords(shot.speed_m_s)),
      element(
        "td.effect",
        {},
        shot.effect_word === null
          ? ""
          : [`${decimal(shot.effect ?? 0, 1)} `, element("small", {}, text(shot.effect_word))],
      ),
      element(
        "td.confidence",
        {},
        shot.confidence === null ? "" : element(`span.badge.${shot.confidence}`, {}, text(shot.confidence)),
      ),
      element("td", {}, star),
    );
  }

  #sortBy(/** @type {string} */ column) {
    const isSame = this.#sort.column === column;
    this.#sort = { column, isFalling: isSame ? !this.#sort.isFalling : column !== "player" && column !== "kind" };
    this.#rowCount = ROWS_AT_ONCE;
    this.show();
    this.root.querySelector(`th.${column} button`)?.focus();
  }

  #selectAll() {
    this.#selected = new Set(this.all.checked ? this.ids : []);
    this.#fill();
  }

  #showActions() {
    const ids = [...this.#selected];
    const undo = element("button", {
      disabled: !this.shots.canUndo,
      onclick: () => attempt(() => this.shots.undo()),
    }, text("undo"));
    const gone = this.shots.deletedCount;
    const deleted = gone ? element("span.note", {}, text("deleted", { count: gone })) : null;
    const downloads = ["csv", "parquet"].map((kind) =>
      element(
        "a.button",
        { href: this.shots.path(`shots.${kind}`), download: `${this.shots.session}.${kind}` },
        text(`download_${kind}`),
      )
    );
    if (!ids.length) {
      this.actions.replaceChildren(...[undo, ...downloads, deleted].filter((one) => one !== null));
      return;
    }
    const inputs = nameInputs(this.shots, {});
    const form = element(
      "form.names",
      { "aria-label": text("name_them") },
      inputs,
      element("button.primary", {}, text("apply")),
    );
    form.addEventListener("submit", (/** @type {Event} */ event) => {
      event.preventDefault();
      const given = Object.fromEntries(Object.entries(takeNames(inputs)).filter(([, value]) => value !== null));
      attempt(() => this.shots.change(ids, given));
    });
    const remove = () =>
      attempt(async () => {
        this.#selected.clear();
        await this.shots.change(ids, { deleted: true });
      });
    const [first, second] = ids;
    this.actions.replaceChildren(
      element("strong", {}, text("selected", { count: ids.length })),
      form,
      ids.length === 2
        ? element("button.primary", { onclick: () => this.go(`pair/${first}/${second}`) }, text("compare_two"))
        : "",
      element("button.danger", { onclick: remove }, text("delete")),
      undo,
    );
  }
}
