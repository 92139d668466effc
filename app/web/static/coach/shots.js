// The shots of the open session, kept up to date with the server, and the changes that can be undone.

/** @import { AnalysisState, CoachGets, CoachPosts, CoachShot, Names, ShotDetail } from "../messages.d.ts" */
/** @import { Landings, Statistics, StatisticsRequest, TableMarks } from "../messages.d.ts" */

import { download, notice } from "../elements.js";
import { text } from "./texts.js";

const JSON_HEADERS = { "content-type": "application/json" };

/** @param {Response} response */
async function answered(response) {
  if (response.ok) return response.json();
  const { error } = await response.json().catch(() => ({ error: response.statusText }));
  throw new Error(error);
}

/** @param {string} path @param {any} content */
const posted = async (path, content) =>
  answered(await fetch(path, { method: "POST", headers: JSON_HEADERS, body: JSON.stringify(content) }));

/** Those that are not deleted, in order of time. @param {Iterable<CoachShot>} shots */
const inOrder = (shots) =>
  [...shots].filter((shot) => !shot.deleted).sort((a, b) => a.recorded_s - b.recorded_s || a.id - b.id);

// Events: `change` when shots, names or the work in the background have changed, `new` with a shot that has just ended,
// `lost` and `back` with the connection.
// Where the events of a shot come from: of a running camera, each of whose shots is a recording, the folder.
const source = (/** @type {CoachShot} */ { recording }) =>
  recording.match(/^(.*_shots)[\\/]shot_\d+\.h5$/)?.[1] ?? recording;
const SAME_CONTACT_US = 2000; // as told by the flight before and by that after it

export class Shots extends EventTarget {
  /** @type {Map<number, CoachShot>} */
  #all = new Map();
  /** @type {{ids: number[], values: Record<string, any>}[][]} */
  #undo = [];
  #revision = -1;
  /** @type {Promise<void>} the newest question to the server */
  #updated = Promise.resolve();
  /** @type {Promise<void>} the newest change of names, marks or deletion */
  #changed = Promise.resolve();
  /** @type {EventSource | null} */
  #stream = null;
  /** @type {Map<number, Promise<ShotDetail>>} of the present revision */
  #details = new Map();
  session = "";
  /** @type {AnalysisState} */
  analysis = { total: 0, done: 0, is_working: false, failures: {}, camera_notice: null };
  /** @type {Names} */
  now = { player: null, wing: null, stroke: null, drill: null };

  /** @returns {Promise<string[]>} */
  static async sessions() {
    return (await answered(await fetch("/api/coach/sessions"))).sessions;
  }

  async open(/** @type {string} */ session) {
    this.#stream?.close();
    this.session = session;
    this.#all.clear();
    this.#details.clear();
    this.#undo = [];
    this.#revision = -1;
    await this.update();
    const stream = this.#stream = new EventSource(this.path("messages"));
    stream.onmessage = () => this.update().catch(() => {});
    stream.onerror = () => this.dispatchEvent(new Event("lost"));
    stream.onopen = () => this.dispatchEvent(new Event("back"));
  }

  path(/** @type {string} */ rest) {
    return `/api/coach/${encodeURIComponent(this.session)}/${rest}`;
  }

  get list() {
    return inOrder(this.#all.values());
  }

  /** The shots of other sessions, too, as they are now. @param {string[]} sessions */
  async ofSessions(sessions) {
    const others = sessions.filter((name) => name !== this.session);
    const answers = await Promise.all(
      others.map(async (name) => answered(await fetch(`/api/coach/${encodeURIComponent(name)}/shots`))),
    );
    return inOrder([...this.#all.values(), ...answers.flatMap(({ shots }) => shots)]);
  }

  get deletedCount() {
    return [...this.#all.values()].filter((shot) => shot.deleted).length;
  }

  get canUndo() {
    return this.#undo.length > 0;
  }

  get(/** @type {number} */ id) {
    return this.#all.get(id) ?? null;
  }

  /** The shot of the same ball before or after a bounce or hit. @param {CoachShot} shot @returns {CoachShot | null} */
  neighbour(shot, before = true) {
    const meets = (/** @type {CoachShot} */ other) =>
      other !== shot && source(other) === source(shot) && !other.deleted &&
      (before
        ? other.ended_by === "bounce" && shot.began_by === "bounce" &&
          Math.abs(other.end_us - shot.start_us) < SAME_CONTACT_US
        : other.began_by === "bounce" && shot.ended_by === "bounce" &&
          Math.abs(other.start_us - shot.end_us) < SAME_CONTACT_US);
    return [...this.#all.values()].find(meets) ?? null;
  }

  /** Asks for what has changed; one question after the other, so that no older answer replaces a newer one. */
  update() {
    return this.#updated = this.#updated.catch(() => {}).then(() => this.#ask());
  }

  async #ask() {
    const isFirst = this.#revision < 0;
    const { session } = this;
    /** @type {CoachGets["shots"]["answered"]} */
    const answer = await answered(await fetch(this.path(`shots?since=${this.#revision}`)));
    if (session !== this.session) return;
    const before = JSON.stringify([this.analysis, this.now]);
    if (answer.revision !== this.#revision) this.#details.clear();
    this.#revision = answer.revision;
    this.analysis = answer.analysis;
    this.now = answer.now;
    const fresh = answer.shots.filter((shot) => !this.#all.has(shot.id));
    for (const shot of answer.shots) this.#all.set(shot.id, shot);
    if (!answer.shots.length && before === JSON.stringify([this.analysis, this.now])) return;
    this.dispatchEvent(new Event("change"));
    if (!isFirst) { for (const shot of fresh) this.dispatchEvent(new CustomEvent("new", { detail: shot })); }
  }

  /** @param {number} id @returns {Promise<ShotDetail>} */
  detail(id) {
    const detail = this.#details.get(id) ?? fetch(this.path(`shots/${id}`)).then(answered);
    this.#details.set(id, detail);
    return detail;
  }

  /** Saves a file that takes the server some time to make. @param {string} rest @param {string} name */
  async save(rest, name) {
    const note = notice(text("file_soon"), "info", 0);
    try {
      download(name, await this.file(rest), "");
    } finally {
      note.remove();
    }
  }

  /** @param {string} rest */
  async file(rest) {
    const response = await fetch(this.path(rest));
    if (!response.ok) await answered(response); // throws the reason
    return response.blob();
  }

  /** @returns {Promise<Landings["landings"]>} */
  async landings() {
    return (await answered(await fetch(this.path("landings")))).landings;
  }

  /** @returns {Promise<TableMarks>} */
  async tableMarks() {
    return answered(await fetch(this.path("table")));
  }

  /**
   * @template {keyof CoachPosts} P
   * @param {P} rest
   * @param {CoachPosts[P]["sent"]} content
   * @returns {Promise<CoachPosts[P]["answered"]>}
   */
  post(rest, content) {
    return posted(this.path(rest), content);
  }

  /** @param {StatisticsRequest} request @returns {Promise<Statistics>} */
  static statistics(request) {
    return posted("/api/coach/statistics", request);
  }

  /**
   * Changes names, marks or deletion, and remembers how to undo it.
   * @param {number[]} ids
   * @param {Record<string, string | boolean | null>} values
   */
  change(ids, values) {
    return this.#next(async () => {
      const before = ids.map((id) => {
        const shot = /** @type {any} */ (this.#all.get(id));
        return { ids: [id], values: Object.fromEntries(Object.keys(values).map((name) => [name, shot[name]])) };
      });
      await this.post("names", { ids, values });
      this.#undo.push(before);
      await this.update();
    });
  }

  undo() {
    return this.#next(async () => {
      for (const { ids, values } of this.#undo.pop() ?? []) await this.post("names", { ids, values });
      await this.update();
    });
  }

  /** One change after the other: each begins with what the one before left. @param {() => Promise<void>} work */
  #next(work) {
    const { session } = this;
    return this.#changed = this.#changed.catch(() => {}).then(() => session === this.session ? work() : undefined);
  }

  async playNow(/** @type {Names} */ now) {
    await this.post("now", now);
    await this.update();
  }
}
