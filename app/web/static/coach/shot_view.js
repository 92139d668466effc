// One shot: the turning ball, its numbers, the parts of its spin, the clock, the flight, the proof, its names.

/** @import { CoachShot, ShotDetail } from "../messages.d.ts" */
/** @import { Shots } from "./shots.js" */

import { attempt, element } from "../elements.js";
import { clock, componentBars, FlightDrawing, proofDiscs } from "./drawings.js";
import { nameCode, nameInputs, nameWords } from "./shot_list.js";
import {
  capitalized,
  chosen,
  decimal,
  kindWords,
  mainKind,
  speedWords,
  spinNumber,
  spinWords,
  term,
  text,
  timeWords,
  toldBy,
  wordsQuery,
} from "./texts.js";
import { SlowMotion, TurningBall } from "./turning_ball.js";

const SLOWNESS = [10, 30, 100, 300, 1000];
const STEP_TURN = 1 / 24; // of a turn
const SWIPE_PX = 60;

// The ball of a shot with the controls of its slow motion.
export class BallPlayer {
  /** @param {CoachShot} shot @param {ShotDetail} detail @param {(t_us: number) => void} [follow] */
  constructor(shot, detail, follow = () => {}) {
    const rate = Math.max(shot.spin_rps ?? 1, 1);
    this.step_us = 1e6 * STEP_TURN / rate;
    const label = `${spinWords(shot.spin_rps)} ${kindWords(shot.kind)}`;
    this.canvas = element("canvas.ball", { role: "img", "aria-label": label });
    this.slider = element("input", {
      type: "range",
      "aria-label": text("instant"),
      min: shot.start_us,
      max: shot.end_us,
      step: "any",
      oninput: () => (this.pause(), this.motion.seek(Number(this.slider.value))),
    });
    this.time = element("output.time");
    this.button = element("button.play", { onclick: () => this.toggle() });
    const slow = element(
      "select",
      { "aria-label": text("slow"), onchange: () => this.motion.slowness = Number(slow.value) },
      SLOWNESS.map((value) => element("option", { value, selected: value === 100 }, `1/${value}`)),
    );
    const eye = element(
      "select",
      { "aria-label": text("view"), title: text("drag"), onchange: () => this.ball?.look(eye.value) },
      ["corner", "hitter", "camera"].map((value) => element("option", { value }, text(`view_${value}`))),
    );
    this.root = element(
      "div.player",
      {},
      this.canvas,
      element(
        "div.controls",
        {},
        element("button", { "aria-label": text("step_back"), onclick: () => this.step(-1) }, "◂"),
        this.button,
        element("button", { "aria-label": text("step"), onclick: () => this.step(1) }, "▸"),
        this.slider,
        this.time,
        element("label", {}, slow),
        element("label", {}, eye),
      ),
    );
    this.motion = new SlowMotion(shot.start_us, shot.end_us, (t_us) => {
      this.ball?.draw(t_us);
      this.slider.value = String(t_us);
      this.time.textContent = `${decimal((t_us - shot.start_us) / 1000, 1)} ms`;
      follow(t_us);
    });
    this.#setButton();
    this.ball = new TurningBall(this.canvas, detail);
    const begin = () => {
      this.ball.ready.then(() =>
        matchMedia("(prefers-reduced-motion: reduce)").matches ? this.motion.seek(shot.start_us) : this.play()
      );
    };
    requestAnimationFrame(begin); // when the canvas has its size
  }

  play() {
    this.motion.play();
    this.#setButton();
  }

  pause() {
    this.motion.pause();
    this.#setButton();
  }

  toggle() {
    if (this.motion.isPlaying) this.pause();
    else this.play();
  }

  /** @param {number} sign */
  step(sign) {
    this.pause();
    this.motion.seek(this.motion.t_us + sign * this.step_us);
  }

  #setButton() {
    const { isPlaying } = this.motion;
    this.button.textContent = isPlaying ? "❚❚" : "▶";
    this.button.setAttribute("aria-label", text(isPlaying ? "pause" : "play"));
  }
}

/** The large number with its words. @param {CoachShot} shot */
export function headline(shot) {
  if (shot.spin_rps === null) {
    return element(
      "div.headline",
      {},
      element("p.number", {}, term("not_seen")),
      element("p.reason", {}, shot.reason ?? ""),
    );
  }
  return element(
    "div.headline",
    {},
    element(
      "p.number",
      {},
      element("span.value", {}, spinNumber(shot.spin_rps)),
      " ",
      element("span.unit", {}, text(chosen.spin)),
    ),
    element("p.kind", {}, capitalized(shot), toldBy(shot)),
  );
}

/** Numbers beside the headline. @param {CoachShot} shot */
export function numbers(shot) {
  const kind = mainKind(shot);
  const margin = shot.spin_std_rps === null ? null : text("error_margin", {
    value: `${
      decimal((chosen.spin === "rpm" ? 60 : 1) * Math.max(shot.spin_std_rps, 0.1), chosen.spin === "rpm" ? 0 : 1)
    } ${text(chosen.spin)}`,
  });
  /** @type {[any, any][]} */
  const rows = [
    [term("speed"), element("strong", {}, speedWords(shot.speed_m_s))],
    [term("effect"), shot.effect_word === null ? "–" : `${text(shot.effect_word)} (${decimal(shot.effect ?? 0, 1)})`],
    [
      term("confidence"),
      shot.confidence === null ? "–" : [
        element(`span.badge.${shot.confidence}`, {}, text(shot.confidence)),
        margin && element("small", {}, ` ${margin}`),
      ],
    ],
  ];
  if (kind !== null) {
    rows.push([text("kind"), [term(kind), ...shot.kind.slice(1).flatMap((code) => [", ", term(code.split(" ")[1])])]]);
  }
  return element(
    "dl.numbers",
    {},
    rows.map(([name, value]) => [element("dt", {}, name), element("dd", {}, value)]).flat(),
  );
}

export class ShotView {
  /** @type {BallPlayer[]} */
  #players = [];

  /** @param {{shots: Shots, go: (place: string) => void, order: () => number[]}} page */
  constructor({ shots, go, order }) {
    this.shots = shots;
    this.go = go;
    this.order = order;
    this.root = element("section.shot");
    /** @type {number | null} */
    this.id = null;
    this.#followSwipes();
  }

  get player() {
    return this.#players[0] ?? null;
  }

  close() {
    for (const player of this.#players) player.pause();
    this.#players = [];
    this.id = null;
  }

  /** @param {number} id */
  async show(id) {
    const detail = await this.shots.detail(id);
    this.close();
    this.id = id;
    const shot = this.shots.get(id) ?? detail.shot;
    const order = this.order(), place = order.indexOf(id);
    const flight = new FlightDrawing(detail.flight);
    const step = (/** @type {number} */ sign, /** @type {string} */ key, /** @type {string} */ sign_text) =>
      element("button", {
        disabled: order[place + sign] === undefined,
        onclick: () => this.move(sign),
        "aria-label": text(key),
      }, sign_text);
    const bar = element(
      "nav.steps",
      { "aria-label": text("shots") },
      element("a.button", { href: "#shots" }, text("back")),
      step(-1, "previous", "←"),
      element("h2", {}, `${text("shot", { number: place + 1 })} ${text("of", { count: order.length })}`),
      step(1, "next", "→"),
      element("span.note", {}, `${timeWords(shot, true)} ${nameWords(shot.player)}`),
      shot.spin_rps === null
        ? ""
        : element("button", { onclick: () => attempt(() => this.#saveVideo(id)) }, text("download_video")),
    );
    const picture = element("div.stage");
    if (shot.spin_rps === null) {
      picture.append(
        element("p.note.large", {}, text("no_picture")),
        element("p", {}, `${text("why_not")}: ${shot.reason ?? ""}`),
      );
    } else {
      const player = new BallPlayer(shot, detail, (t_us) => flight.show(t_us));
      this.#players.push(player);
      picture.append(player.root);
    }
    const isNamed = shot.kind.length > 0 && shot.clock_hours !== null;
    const card = (/** @type {string} */ key, /** @type {any[]} */ ...children) =>
      element("div.card", {}, element("h3", {}, text(key)), children);
    const parts = isNamed
      ? card("components", element("div.parts", {}, componentBars(shot), clock(shot.clock_hours ?? 0)))
      : "";
    const proof = shot.spin_rps === null ? "" : card("proof", proofDiscs(detail.proof));
    this.root.replaceChildren(
      bar,
      element("div.column", {}, picture, parts, proof),
      element(
        "div.column",
        {},
        element("div.facts", {}, headline(shot), numbers(shot), this.#names(shot)),
        card("flight", flight.root),
        this.#bounce(shot) ?? "",
      ),
    );
    return this.root;
  }

  /** @param {number} sign */
  move(sign) {
    const order = this.order();
    const next = order[order.indexOf(this.id ?? -1) + sign];
    if (next !== undefined) this.go(`shot/${next}`);
  }

  /** @param {CoachShot} shot */
  #names(shot) {
    const inputs = nameInputs(this.shots, {
      player: shot.player,
      wing: shot.wing,
      stroke: shot.stroke,
      drill: shot.drill,
    });
    const change = (/** @type {Event} */ event) => {
      const input = /** @type {HTMLInputElement} */ (event.target);
      attempt(() => this.shots.change([shot.id], { [input.name]: nameCode(input.value) }));
    };
    const star = element(
      "button.star",
      {
        "aria-pressed": shot.marked,
        onclick: () => attempt(() => this.shots.change([shot.id], { marked: !shot.marked })),
      },
      shot.marked ? "★ " : "☆ ",
      text(shot.marked ? "unmark" : "mark"),
    );
    const remove = element("button.danger", { onclick: () => this.remove(shot.id) }, text("delete"));
    return element("div.names", { onchange: change }, inputs, element("div", {}, star, " ", remove));
  }

  /** @param {number} id */
  async remove(id) {
    const order = this.order(), place = order.indexOf(id);
    const next = order[place + 1] ?? order[place - 1];
    await attempt(() => this.shots.change([id], { deleted: true }));
    this.go(next === undefined ? "shots" : `shot/${next}`);
  }

  /** @param {number} id */
  #saveVideo(id) {
    return this.shots.save(`shots/${id}/video.mp4?${wordsQuery()}`, `shot-${id}.mp4`);
  }

  /** Before and after a bounce side by side. @param {CoachShot} shot */
  #bounce(shot) {
    const before = this.shots.neighbour(shot, true), after = this.shots.neighbour(shot, false);
    const [first, second] = before ? [before, shot] : after ? [shot, after] : [null, null];
    if (!first || !second) return null;
    const side = (/** @type {CoachShot} */ one, /** @type {string} */ key) =>
      element(
        "div",
        {},
        element("h4", {}, one.id === shot.id ? text(key) : element("a", { href: `#shot/${one.id}` }, text(key))),
        headline(one),
        element("p", {}, speedWords(one.speed_m_s)),
        one.clock_hours === null ? "" : componentBars(one),
      );
    return element(
      "div.card",
      {},
      element("h3", {}, text("bounce")),
      element("div.two.bounce", {}, side(first, "before_bounce"), side(second, "after_bounce")),
    );
  }

  #followSwipes() {
    /** @type {number[] | null} */
    let begin = null;
    const isFree = (/** @type {any} */ target) => !target.closest("canvas, input, select, button");
    this.root.addEventListener("touchstart", (/** @type {TouchEvent} */ event) => {
      const touch = event.touches[0];
      begin = isFree(event.target) && event.touches.length === 1 ? [touch.clientX, touch.clientY] : null;
    }, { passive: true });
    this.root.addEventListener("touchend", (/** @type {TouchEvent} */ event) => {
      if (!begin) return;
      const touch = event.changedTouches[0];
      const [dx, dy] = [touch.clientX - begin[0], touch.clientY - begin[1]];
      if (Math.abs(dx) > SWIPE_PX && Math.abs(dx) > 2 * Math.abs(dy)) this.move(dx < 0 ? 1 : -1);
      begin = null;
    });
  }
}

/** Two shots side by side. @param {Shots} shots @param {number[]} ids */
export async function pairView(shots, ids) {
  const details = await Promise.all(ids.map((id) => shots.detail(id)));
  const players = /** @type {BallPlayer[]} */ ([]);
  const sides = details.map((detail) => {
    const shot = shots.get(detail.shot.id) ?? detail.shot;
    const flight = new FlightDrawing(detail.flight);
    const made = element("div.side");
    made.append(
      element(
        "h3",
        {},
        element("a", { href: `#shot/${shot.id}` }, timeWords(shot, true)),
        ` ${nameWords(shot.player)}`,
      ),
    );
    if (shot.spin_rps !== null) {
      const player = new BallPlayer(shot, detail, (t_us) => flight.show(t_us));
      players.push(player);
      made.append(player.root);
    }
    made.append(headline(shot), numbers(shot));
    if (shot.clock_hours !== null) made.append(componentBars(shot), clock(shot.clock_hours));
    made.append(flight.root);
    return made;
  });
  const root = element(
    "section",
    {},
    element("nav.steps", {}, element("a.button", { href: "#shots" }, text("back"))),
    element("div.two.pair", {}, sides),
  );
  return { root, close: () => players.forEach((player) => player.pause()) };
}
