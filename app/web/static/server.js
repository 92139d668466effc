// Requests to the server, the stream of its messages, and the run requests: from changed settings to the new picture.

/** @import { Dropped, Gets, Opening, Picture, Posts, PreviewMessage, RunMessage, ServerMessages, SessionGets, SessionPosts } from "./messages.d.ts" */
/** @import { Settings } from "./settings.js" */
/** @import { Viewer } from "./viewer.js" */

import { byId, notice, pause } from "./elements.js";

const REOPEN_MS = 700;
const PATIENCE_MS = 5000; // as long as a picture takes to draw where there is no graphics card
const SIZE_STEP_PX = 50; // the layout is made anew for a viewer that is larger or smaller by more
const REST_MS = 500; // a slider that is held still for so long rests, one that is let go of at once
const POLL_MS = 50;
// Until the first layout is sent once more, each time twice as long: without a graphics card each takes the viewer long.
const LAYOUT_MS = 5000;
const MOST_LAYOUT_MS = 40_000;
const RESIZED_MS = 500; // a window that keeps its size for so long has it
const NUMBERS_MS = 1000; // as long as numbers wait for their picture

export class Refused extends Error {
  constructor(/** @type {number} */ status, /** @type {string} */ text) {
    super(text);
    this.status = status;
  }
}

async function answered(/** @type {Response} */ response) {
  if (response.ok) return response;
  let text = `${response.status} ${response.statusText}`;
  try {
    text = (await response.json()).error ?? text;
  } catch {
    // Not ours: the status has to do.
  }
  throw new Refused(response.status, text);
}

/**
 * @template {keyof Posts} P
 * @param {P} path
 * @param {Posts[P]["sent"]} content
 * @returns {Promise<Posts[P]["answered"]>}
 */
export async function post(path, content) {
  const headers = { "content-type": "application/json" };
  const response = await answered(await fetch(path, { method: "POST", headers, body: JSON.stringify(content) }));
  return response.json();
}

/**
 * @template {keyof Gets} P
 * @param {P} path
 * @param {Record<string, string>} query
 * @returns {Promise<Gets[P]["answered"]>}
 */
export async function get(path, query) {
  return (await answered(await fetch(`${path}?${new URLSearchParams(query)}`))).json();
}

/**
 * Copies a file to the server.
 * @param {File} file
 * @returns {Promise<Dropped>}
 */
export async function upload(file) {
  return (await sent(`/api/drop?${new URLSearchParams({ name: file.name })}`, file)).json();
}

/**
 * Has the server put pictures together to a video.
 * @param {Blob[]} pictures JPEG
 * @returns {Promise<Blob>}
 */
export async function videoOf(pictures) {
  return (await sent("/api/video", new Blob(pictures))).blob();
}

async function sent(/** @type {string} */ path, /** @type {Blob} */ body) {
  const headers = { "content-type": "application/octet-stream" };
  return answered(await fetch(path, { method: "POST", headers, body }));
}

// The session on the server: opens it, listens to its messages, opens it anew when the server comes back.
export class Connection extends EventTarget {
  session = "";
  recording = "";
  /** @type {EventSource | null} */
  #stream = null;
  /** @type {number | undefined} */
  #retry = undefined;

  /**
   * @param {string | null} recording
   * @returns {Promise<Opening>}
   */
  async open(recording) {
    const opening = await post("/api/sessions", { recording });
    this.session = opening.session;
    this.recording = opening.recording.name;
    this.#listen();
    return opening;
  }

  path(/** @type {string} */ rest) {
    return `/api/sessions/${this.session}/${rest}`;
  }

  /**
   * @template {keyof SessionPosts} P
   * @param {P} rest
   * @param {SessionPosts[P]["sent"]} content
   * @returns {Promise<SessionPosts[P]["answered"]>}
   */
  post(rest, content) {
    return post(/** @type {any} */ (this.path(rest)), /** @type {any} */ (content));
  }

  /**
   * @template {keyof SessionGets} P
   * @param {P} rest
   * @returns {Promise<SessionGets[P]["answered"]>}
   */
  async get(rest) {
    return (await answered(await fetch(this.path(rest)))).json();
  }

  async bytes(/** @type {string} */ rest) {
    return new Uint8Array(await (await answered(await fetch(this.path(rest)))).arrayBuffer());
  }

  /**
   * A layout, and the id of its root container.
   * @param {string} query
   * @returns {Promise<{content: Uint8Array, root: string}>}
   */
  async layout(query) {
    const answer = await answered(await fetch(this.path(`layout?${query}`)));
    return { content: new Uint8Array(await answer.arrayBuffer()), root: answer.headers.get("x-layout-root") ?? "" };
  }

  /**
   * @template {keyof ServerMessages} K
   * @param {K} kind
   * @param {(message: ServerMessages[K]) => void} listener
   */
  on(kind, listener) {
    this.addEventListener(kind, (event) => listener(/** @type {CustomEvent} */ (event).detail));
  }

  close() {
    this.#stream?.close();
    clearTimeout(this.#retry);
  }

  #listen() {
    this.#stream?.close();
    const stream = new EventSource(this.path("messages"));
    this.#stream = stream;
    stream.onmessage = (event) => {
      const message = JSON.parse(event.data);
      this.dispatchEvent(new CustomEvent(message.kind, { detail: message }));
    };
    stream.onerror = () => {
      stream.close();
      if (stream !== this.#stream) return;
      this.dispatchEvent(new CustomEvent("lost"));
      this.#reopen();
    };
  }

  #reopen() {
    clearTimeout(this.#retry);
    this.#retry = setTimeout(async () => {
      try {
        const opening = await this.open(this.recording);
        this.dispatchEvent(new CustomEvent("back", { detail: opening }));
      } catch (error) {
        if (error instanceof Refused && error.status === 401) this.dispatchEvent(new CustomEvent("outdated"));
        else this.#reopen();
      }
    }, REOPEN_MS);
  }
}

// Requests a run of the newest settings, as often as the server keeps up while a slider is dragged, and shows its
// picture. Events: `numbers` with the server's message, `shown` with the serial of the request that is seen.
export class RunRequests extends EventTarget {
  serial = 0;
  isBlind = false; // there is no viewer: numbers alone
  /** @type {number | null} number of the shot whose ball the detail views follow */
  followed = null;
  #hasLayout = false;
  /** @type {string | null} what the ranges and panes of the layout were made for */
  #layoutOf = null;
  /** @type {HTMLElement | null} says that the viewer has not taken it, until it has */
  #notLaidOut = null;
  #dirty = false;
  #settled = false;
  /** @type {string | null} what was requested last */
  #last = null;
  #sending = false;
  #sentAt = 0;
  #running = false;
  #isPreviewed = false;
  #movedAt = -Infinity; // when a slider that is dragged was moved last
  /** @type {number | undefined} */
  #timer = undefined;
  /** @type {number | undefined} */
  #resizing = undefined;
  /** @type {string | null} the newest picture */
  #latest = null;
  /** @type {{clip: string, time_us: number} | null} the newest preview: the playhead while the viewer has none */
  #previewed = null;

  /**
   * @param {Connection} connection
   * @param {Settings} settings
   * @param {Viewer} viewer
   * @param {{tab: string, hasTools: boolean}} start tab in front at first
   */
  constructor(connection, settings, viewer, start) {
    super();
    this.connection = connection;
    this.settings = settings;
    this.viewer = viewer;
    this.start = start;
    connection.on("run", (message) => this.#receive(message));
    connection.on("preview", (message) => this.#follow(message));
    settings.onChange((settled) => this.#change(settled));
    new ResizeObserver(() => this.#resized()).observe(byId("viewer"));
  }

  // Whether a picture is on its way.
  get isWaiting() {
    return this.#running && !this.isBlind;
  }

  follow(/** @type {number | null} */ shot) {
    this.followed = shot;
    this.request(true);
  }

  get #wanted() {
    return JSON.stringify({ ...this.settings.run, followed: this.followed });
  }

  request(/** @type {boolean} */ settled) {
    this.#dirty = true;
    this.#settled ||= settled;
    this.#schedule();
  }

  /**
   * The settings changed; where a drag ends at what has been requested already, there is nothing more to do.
   * @param {boolean} settled
   */
  #change(settled) {
    this.#movedAt = settled ? -Infinity : performance.now();
    this.viewer.rest(settled ? 0 : REST_MS);
    if (!settled || this.#dirty || this.#last !== this.#wanted) this.request(settled);
  }

  #schedule() {
    clearTimeout(this.#timer);
    if (!this.#dirty || this.#sending) return;
    // While a slider is dragged its last preview is awaited; a change that is meant to stay does not wait.
    const wait_ms = this.#settled || this.#isPreviewed || !this.#running
      ? 0
      : this.#sentAt + PATIENCE_MS - performance.now();
    if (wait_ms <= 0) this.#send();
    else this.#timer = setTimeout(() => this.#schedule(), wait_ms);
  }

  async #send() {
    const interactive = !this.#settled;
    this.#dirty = this.#settled = false;
    this.#sending = this.#running = true;
    this.#isPreviewed = false;
    this.#sentAt = performance.now();
    this.#last = this.#wanted;
    // Without one the server previews what is seen first, which it knows at the end of the clip.
    const playhead_us = this.viewer.playhead_us ?? (interactive ? this.#previewed_us : null);
    const has_preview = interactive || this.isBlind || !this.#hasLayout; // else the viewer has the picture soon
    const request = { serial: ++this.serial, ...JSON.parse(this.#last), interactive, has_preview, playhead_us };
    try {
      await this.connection.post("run", request);
    } catch (error) {
      this.#running = false;
      this.#last = null;
      if (error instanceof Refused && error.status !== 409 && error.status !== 404) {
        notice(error.message);
        this.settings.revert();
      }
    } finally {
      this.#sending = false;
      this.#schedule();
    }
  }

  get #previewed_us() {
    return this.#previewed?.clip === String(this.settings.clip) ? this.#previewed.time_us : null;
  }

  // A preview is enough to let a dragged slider go on: the viewer follows when it rests.
  #follow(/** @type {PreviewMessage} */ { serial, t_us }) {
    if (serial !== this.serial) return;
    this.#previewed = { clip: String(this.settings.clip), time_us: t_us };
    this.#isPreviewed = true;
    this.#schedule();
  }

  async #receive(/** @type {RunMessage} */ message) {
    const { serial, state, picture } = message;
    if (serial !== this.serial) return;
    if (state === "failed") this.#last = null;
    if (!picture || this.isBlind) {
      // A first picture is enough to let a dragged slider go on, but it is to be seen before the next one is made.
      if (["failed", "partial", "done"].includes(state)) this.#end(serial);
      this.#tell("numbers", message);
      return;
    }
    const seen = this.#show(picture, state === "done");
    // For any change of the page the browser composes all of it anew: numbers come with their picture.
    if (this.#hasLayout) await Promise.race([seen.catch(() => {}), pause(NUMBERS_MS)]);
    this.#tell("numbers", message);
    try {
      if (!(await seen)) return;
    } catch (error) {
      notice(`The viewer does not show the newest picture: ${/** @type {Error} */ (error).message}. Reload the page.`);
      return this.#end(serial);
    }
    this.#end(serial);
    this.#tell("shown", message);
  }

  /**
   * Fetches and shows a picture, of a run that is whole or not; false where a newer one took its place.
   * @param {Picture} picture
   * @param {boolean} isWhole
   */
  async #show(picture, isWhole) {
    const { serial } = this;
    if (!isWhole && !this.#hasLayout) return false; // its layout is of the whole run; meanwhile there is the preview
    this.#latest = picture.id;
    try {
      await this.#rest();
      if (this.#latest !== picture.id || serial !== this.serial) return false;
      const content = await this.connection.bytes(`pictures/${picture.id}`);
      if (this.#latest !== picture.id) return false;
      if (isWhole) await this.#fit();
      if (!(await this.viewer.show(content, picture.id, picture.opening_us))) return false;
      this.#hasLayout ||= await this.#laidOut();
      return true;
    } catch (error) {
      if (this.isBlind || (error instanceof Refused && error.status === 404)) return false;
      throw error;
    }
  }

  // Until a slider that is dragged rests: what the viewer takes to draw, its previews would lack.
  async #rest() {
    while (performance.now() < this.#movedAt + REST_MS) await pause(POLL_MS);
  }

  // A layout for what is shown, where the present one was made for something else: its ranges and panes are those of a
  // clip, of a ball in flight or in place, and of the viewer's size.
  async #fit() {
    if (document.body.classList.contains("coach")) return; // a layout of its own
    const { ball, fixed_radius_px } = this.settings.parameters.track;
    const { clientWidth, clientHeight } = byId("viewer");
    const [width, height] = [clientWidth, clientHeight].map((px) =>
      SIZE_STEP_PX * Math.max(1, Math.floor(px / SIZE_STEP_PX))
    );
    const layoutOf = JSON.stringify([this.settings.clip, ball, fixed_radius_px, width, height]);
    if (layoutOf === this.#layoutOf) return;
    const query = new URLSearchParams({
      tab: this.viewer.front ?? this.start.tab,
      tools: String(this.start.hasTools),
      width_px: String(width),
      height_px: String(height),
    });
    const layout = await this.connection.layout(String(query));
    if (document.body.classList.contains("coach")) return; // entered meanwhile
    await this.viewer.layout(layout);
    this.#layoutOf = layoutOf;
  }

  // Waits for the first layout: before it there is one of the viewer's own. One that comes while the viewer is starting
  // can get lost, and is not taken a second time: then it gets another one of the same panes. False where none comes:
  // then it is waited for with the next picture, and a notice says so.
  async #laidOut() {
    for (let wait_ms = LAYOUT_MS; wait_ms <= MOST_LAYOUT_MS; wait_ms *= 2) {
      if (await this.viewer.laidOut(wait_ms)) {
        this.#notLaidOut?.remove();
        return true;
      }
      this.#layoutOf = null;
      await this.#fit();
    }
    this.#notLaidOut?.remove();
    this.#notLaidOut = notice(
      "The viewer has not taken its layout: its tabs are missing. It is sent again with the next change; if that does " +
        "not help, reload the page.",
      "warning",
    );
    return false;
  }

  // The panes of a viewer of another size; a picture that is on its way brings them along.
  #resized() {
    clearTimeout(this.#resizing);
    this.#resizing = setTimeout(() => this.#hasLayout && !this.#running && this.#fit().catch(() => {}), RESIZED_MS);
  }

  #end(/** @type {number} */ serial) {
    if (serial !== this.serial) return;
    this.#running = false;
    this.#schedule();
  }

  #tell(/** @type {"numbers" | "shown"} */ name, /** @type {RunMessage} */ detail) {
    this.dispatchEvent(new CustomEvent(name, { detail }));
  }
}
