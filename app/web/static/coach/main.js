// The coach's page: its places, the header, the keys.

/** @import { CoachShot } from "../messages.d.ts" */

import { attempt, byId, element, notice } from "../elements.js";
import { Comparison } from "./comparison.js";
import { Live } from "./live.js";
import { Protocols } from "./protocols.js";
import { ShotFilter, ShotList } from "./shot_list.js";
import { Shots } from "./shots.js";
import { pairView, ShotView } from "./shot_view.js";
import { TableMarking } from "./table_marking.js";
import { choose, chosen, loadTexts, text } from "./texts.js";

const PLACES = ["shots", "compare", "tests", "live"];
const LANGUAGES = { en: "English", de: "Deutsch" };

/** Whether somebody is in a text field, or has filled in names that are not yet sent. */
function isTyping() {
  const focused = document.activeElement;
  return Boolean(focused?.matches("input") && focused.closest("form, .names, .filter")) ||
    [.../** @type {NodeListOf<HTMLInputElement>} */ (document.querySelectorAll("form.names input"))]
      .some((input) => input.value !== input.defaultValue);
}

class Page {
  shots = new Shots();
  filter = new ShotFilter();
  /** @type {string[]} */
  sessions = [];
  /** @type {{close: () => void} | null} */
  #pair = null;
  #shown = 0;
  /** @type {Promise<void>} */
  #showing = Promise.resolve();

  constructor() {
    this.list = new ShotList(this);
    this.view = new ShotView(this);
    this.comparison = new Comparison(this);
    this.protocols = new Protocols(this);
    this.live = new Live(this);
    this.tableMarking = new TableMarking(this);
  }

  async begin() {
    [this.sessions] = await Promise.all([Shots.sessions(), loadTexts()]);
    const kept = sessionStorage.getItem("spinscope.coach.session") ?? ""; // of this tab, before it was loaded anew
    await this.shots.open(this.sessions.includes(kept) ? kept : this.sessions[0]);
    this.shots.addEventListener("change", () => this.#refresh());
    this.shots.addEventListener("lost", () => document.body.classList.add("lost"));
    this.shots.addEventListener("back", () => document.body.classList.remove("lost"));
    addEventListener("hashchange", () => this.show());
    addEventListener("keydown", (event) => this.#key(event));
    addEventListener(
      "click",
      () => document.querySelectorAll(".term.open").forEach((one) => one.classList.remove("open")),
    );
    await this.show();
    document.body.dataset.ready = "true";
  }

  get place() {
    return location.hash.slice(1) || "shots";
  }

  go = (/** @type {string} */ place) => {
    location.hash = place;
  };

  /** Opens a shot of whatever session. @param {CoachShot} shot */
  openShot = async (shot) => {
    if (shot.session !== this.shots.session) await this.#switchTo(shot.session);
    this.go(`shot/${shot.id}`);
  };

  /** Ids in the order of the list. */
  order = () => (this.filter.of(this.shots.list).map((shot) => shot.id));

  /** One place after the other, so that what is drawn last is what was asked for last. */
  show(isRefreshed = false) {
    const shown = ++this.#shown;
    const draw = () => shown === this.#shown ? this.#draw(isRefreshed) : undefined;
    return this.#showing = this.#showing.catch(() => {}).then(draw);
  }

  /** @param {boolean} isRefreshed */
  async #draw(isRefreshed) {
    const shown = this.#shown;
    const [name, ...rest] = this.place.split("/");
    this.view.close();
    this.#pair?.close();
    this.#pair = null;
    this.#header(name);
    const root = await attempt(() => this.#content(name, rest.map(Number)));
    if (shown !== this.#shown || !root || (isRefreshed && isTyping())) return;
    byId("main").replaceChildren(root);
    document.body.dataset.place = this.place;
    scrollTo(0, 0);
  }

  /** @param {string} name @param {number[]} ids */
  async #content(name, ids) {
    if (name === "shot") return this.view.show(ids[0]);
    if (name === "pair") {
      const { root, close } = await pairView(this.shots, ids);
      this.#pair = { close };
      return root;
    }
    if (name === "compare") return this.comparison.show();
    if (name === "tests") return this.protocols.show();
    if (name === "live") return this.live.show();
    if (name === "table") return this.tableMarking.show();
    return this.list.show();
  }

  // Shots have changed: the present place is drawn anew, but neither what is being played nor what is being typed.
  async #refresh() {
    const [name] = this.place.split("/");
    this.#header(name);
    if (name === "live" || name === "table" || isTyping()) return;
    if (name !== "shot") {
      const focused = document.activeElement?.getAttribute("aria-label");
      const scroll = scrollY;
      await this.show(true);
      scrollTo(0, scroll);
      if (focused) {
        /** @type {HTMLElement | null} */ (document.querySelector(`[aria-label="${CSS.escape(focused)}"]`))?.focus();
      }
    } else if (this.view.id !== null) {
      const { t_us, isPlaying } = this.view.player?.motion ?? { t_us: 0, isPlaying: true };
      await this.show(true);
      this.view.player?.motion.seek(t_us);
      if (!isPlaying) this.view.player?.pause();
    }
  }

  /** @param {string} name */
  #header(name) {
    const { analysis } = this.shots;
    const choice = (
      /** @type {"language" | "spin" | "speed"} */ what,
      /** @type {string[]} */ values,
      /** @type {(value: string) => string} */ label,
      /** @type {string} */ title,
    ) => {
      const made = element(
        "select",
        {
          name: what,
          "aria-label": text(title),
          title: text(title),
          onchange: () => (choose(what, made.value), this.show()),
        },
        values.map((value) => element("option", { value, selected: value === chosen[what] }, label(value))),
      );
      return made;
    };
    const session = element(
      "select",
      {
        name: "session",
        "aria-label": text("session"),
        title: text("session"),
        onchange: () => attempt(() => this.#showSession(session.value)),
      },
      this.sessions.map((one) => element("option", { value: one, selected: one === this.shots.session }, one)),
    );
    const failures = Object.entries(analysis.failures);
    const failed = failures.length
      ? element(
        "details.failures",
        {},
        element("summary", {}, text("failed", { count: failures.length })),
        element(
          "ul",
          {},
          failures.map(([file, error]) => element("li", {}, element("strong", {}, file), `: ${error}`)),
        ),
      )
      : null;
    const camera = analysis.camera_notice && element(
      "span.failures",
      { role: "status", title: analysis.camera_notice.text },
      text(`camera_${analysis.camera_notice.kind}`),
    );
    const working = analysis.is_working
      ? element(
        "span.working",
        { title: text("analyzing", analysis) },
        element("progress", { value: analysis.done, max: analysis.total, "aria-label": text("analyzing", analysis) }),
        `${analysis.done}/${analysis.total}`,
      )
      : null;
    const current = PLACES.includes(name) ? name : "shots";
    const link = (/** @type {string} */ place) =>
      element(
        "a",
        place === current ? { href: `#${place}`, "aria-current": "page" } : { href: `#${place}` },
        text(place),
      );
    byId("header").replaceChildren(
      element("h1", {}, element("img", { src: "/static/icon.svg", alt: "" }), "Spinscope"),
      element("nav", { "aria-label": text("title") }, PLACES.map(link)),
      element("span.gap"),
      ...[camera, working, failed].filter(Boolean),
      element("span.lost", { role: "alert" }, text("connection_lost")),
      session,
      choice("spin", ["rps", "rpm"], (value) => text(value), "spin_unit"),
      choice("speed", ["km_h", "m_s"], (value) => text(value), "speed_unit"),
      choice("language", ["en", "de"], (value) => /** @type {any} */ (LANGUAGES)[value], "language"),
      element("button.help", {
        "aria-label": text("help"),
        title: text("keys"),
        onclick: () => notice(text("keys"), "info", 12),
      }, "?"),
    );
    document.title = `Spinscope – ${text(current)}`;
  }

  /** @param {string} name */
  async #showSession(name) {
    await this.#switchTo(name);
    this.go("shots");
    await this.show();
  }

  /** @param {string} session */
  async #switchTo(session) {
    sessionStorage.setItem("spinscope.coach.session", session);
    await this.shots.open(session);
  }

  #key(/** @type {KeyboardEvent} */ event) {
    const target = /** @type {HTMLElement} */ (event.target);
    if (
      (event.ctrlKey || event.metaKey) && event.key === "z" && !target.matches("input[type=text], input:not([type])")
    ) {
      event.preventDefault();
      attempt(() => this.shots.undo());
      return;
    }
    if (event.ctrlKey || event.metaKey || event.altKey || target.matches("input, select, textarea")) return;
    const { id, player } = this.view;
    if (id === null) return;
    const shot = this.shots.get(id);
    /** @type {Record<string, () => any>} */
    const keys = {
      ArrowLeft: () => this.view.move(-1),
      ArrowRight: () => this.view.move(1),
      " ": () => player?.toggle(),
      ",": () => player?.step(-1),
      ".": () => player?.step(1),
      m: () => attempt(() => this.shots.change([id], { marked: !shot?.marked })),
      Delete: () => this.view.remove(id),
      Escape: () => this.go("shots"),
    };
    const act = keys[event.key];
    if (!act || (event.key === " " && target.matches("button, a, .term"))) return;
    event.preventDefault();
    act();
  }
}

const page = new Page();
/** @type {any} */ (window).coach = page; // for tests and the browser's console
attempt(() => page.begin());
