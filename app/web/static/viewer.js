// The embedded viewer: shows one recording after another at the same playhead.

import { pause } from "./elements.js";
import { HeldFrames } from "./held_frames.js";

const TIMELINE = "t";
const POLL_MS = 15;
const PATIENCE_MS = 120_000; // without a graphics card a picture may take seconds
const PICTURE_MS = 10_000;
const LAYOUT_MS = 30_000;
const ANSWER_MS = 3000;
const JPEG_QUALITY = 0.92;
const APPLICATION = "spinscope";

/** @typedef {Record<string, any>} Blueprint */
/** @typedef {"paused" | "playing" | "following"} PlayState */

// The viewer asks elsewhere for its newest version; this page talks to its own server alone.
function stayAtHome() {
  const ask = globalThis.fetch;
  globalThis.fetch = (/** @type {any} */ target, options) => {
    const { origin } = new URL(target.url ?? target, location.href);
    return origin === location.origin ? ask(target, options) : Promise.resolve(new Response(null, { status: 404 }));
  };
}

// A canvas that has been shown loses its picture, which is to be saved: this keeps it.
function keepPictures() {
  const made = HTMLCanvasElement.prototype.getContext;
  /** @type {any} */ (HTMLCanvasElement.prototype).getContext = function (
    /** @type {string} */ kind,
    /** @type {any} */ options,
  ) {
    return made.call(
      this,
      /** @type {any} */ (kind),
      kind.startsWith("webgl") ? { ...options, preserveDrawingBuffer: true } : options,
    );
  };
}

const storeOf = (/** @type {string} */ id) => `Recording:${APPLICATION}:${id}`;

const CLICKED_MS = 300; // until a click on a tab has been painted

// Events: `moved` with the playhead's time in us, `turned` to another tab.
export class Viewer extends EventTarget {
  /** @type {any} */
  #viewer = null;
  /** @type {any} */
  #channel = null;
  /** @type {Promise<any>} */
  #queue = Promise.resolve();
  /** @type {Set<string>} ids of the recordings in the viewer */
  #sent = new Set();
  /** @type {string | null} the one that is to be shown next, whatever waits before it */
  #newest = null;
  /** @type {string | null} the one that is seen */
  #shown = null;
  /**
   * Its playhead, as the viewer tells of every move: asking it would have it paint, which takes long in software.
   * @type {number | null}
   */
  #time_ns = null;
  /** @type {PlayState} */
  #play = "paused";
  /** @type {string | null} name of the tab in front */
  front = null;
  /** @type {string | null} name of the tab that was asked for last */
  #asked = null;
  #isLaidOut = false; // before our first layout there is one of the viewer's own
  #isAlone = false;
  #working = 0; // how much has been asked of it and is not done
  #restsUntil = -Infinity;

  /**
   * Loads the viewer, when something has happened; whatever else is asked of it meanwhile waits.
   * @param {string} version
   * @param {HTMLElement} parent
   * @param {Promise<unknown>} happened
   */
  start(version, parent, happened) {
    return this.#next(async () => {
      await happened;
      await this.#start(version, parent);
    });
  }

  async #start(/** @type {string} */ version, /** @type {HTMLElement} */ parent) {
    stayAtHome();
    keepPictures();
    const { WebViewer, setFrames } = await import(`/rerun/${version}/widget.js`);
    // It paints when it is given a frame: while it rests it gets none, and its last picture stays.
    setFrames(new HeldFrames((time) => !this.#working && time < this.#restsUntil));
    const viewer = new WebViewer();
    const ready = new Promise((resolve) => viewer.once("ready", resolve));
    const base_url = new URL(`/rerun/${version}/`, location.href).toString();
    const size = { width: "100%", height: "100%" };
    const plain = { hide_welcome_screen: true, notebook: true, allow_fullscreen: false, theme: "dark" };
    const focused = /** @type {HTMLElement | null} */ (document.activeElement);
    await viewer.start(null, parent, { base_url, ...size, ...plain });
    await ready;
    // The viewer's own field for what is typed into it, which is not to be seen and no stop of Tab.
    for (const field of document.querySelectorAll('input[autocapitalize="off"]')) {
      field.setAttribute("aria-label", "Typing into the viewer");
      field.setAttribute("tabindex", "-1");
    }
    viewer.canvas.blur(); // it takes the focus from whoever has begun to work
    focused?.focus();
    this.#viewer = viewer;
    viewer.canvas.tabIndex = 0;
    viewer.canvas.setAttribute("role", "application");
    viewer.canvas.setAttribute("aria-label", "Viewer of all stages; Tab and Escape leave it");
    this.#channel = viewer.open_channel("spinscope");
    this.#follow();
    for (const panel of ["top", "blueprint", "selection"]) viewer.override_panel_state(panel, "hidden");
  }

  /**
   * Paints nothing for so long, unless something is asked of it: without a graphics card each of its pictures takes the
   * browser a second or two, in which the rest of the page stands still.
   * @param {number} ms
   */
  rest(ms) {
    this.#restsUntil = performance.now() + ms;
  }

  /**
   * Everything that touches the viewer, one after the other.
   * @template T
   * @param {() => T | Promise<T>} work
   * @returns {Promise<T>}
   */
  #next(work) {
    this.#working++;
    const done = this.#queue.then(work).finally(() => this.#working--);
    this.#queue = done.catch(() => {});
    return done;
  }

  /**
   * Takes a layout; any but the first is there at the end, not some frames later over another one.
   * @param {{content: Uint8Array, root: string}} layout
   */
  layout({ content, root }) {
    return this.#next(async () => {
      const { front } = this; // it was asked for before somebody turned to this tab
      this.#channel.send_rrd(content);
      if (!this.#isLaidOut) return;
      const until = performance.now() + PATIENCE_MS;
      const present = async () => (await this.#viewer.get_blueprint()).blueprint["/viewport"]?.ViewportBlueprint;
      while ((await present())?.root_container !== root) { // one that was sent before may come late
        if (performance.now() > until) throw new Error("the viewer does not take the layout");
        await pause(POLL_MS);
      }
      if (front !== null) await this.#bring(front);
    });
  }

  #follow() {
    const told = (/** @type {string} */ kind, /** @type {(event: any) => void} */ note) =>
      this.#viewer.on(kind, (/** @type {any} */ event) => event.recording_id === this.#shown && note(event));
    told("time_update", ({ time }) => this.#moved(time));
    told("play", () => (this.#play = "playing"));
    told("pause", () => (this.#play = "paused"));
    // It does not tell of its tabs.
    const look = () => setTimeout(() => this.#isAlone || this.tab().catch(() => {}), CLICKED_MS);
    this.#viewer.canvas.addEventListener("pointerup", look);
  }

  #moved(/** @type {number} */ time_ns) {
    this.#time_ns = time_ns;
    this.dispatchEvent(new CustomEvent("moved", { detail: this.playhead_us }));
  }

  // Where the playhead is; null while nothing is shown.
  get playhead_us() {
    return this.#time_ns === null ? null : this.#time_ns / 1000;
  }

  // The next recording is shown where it opens, not at the present playhead.
  leave() {
    this.#time_ns = null;
  }

  /**
   * Shows a recording in place of the present one, at the same playhead; at `time_us` when there is none. False where a
   * newer one has taken its place while it waited.
   * @param {Uint8Array} bytes
   * @param {string} id
   * @param {number} time_us
   */
  show(bytes, id, time_us) {
    this.#newest = id;
    return this.#next(async () => {
      if (this.#newest !== id) return false;
      if (this.#shown === id) return true; // the way back came before what it leads back from
      const taken = this.#taken_in(id);
      this.#sent.add(id);
      this.#channel.send_rrd(bytes);
      await this.#awake(taken);
      const time_ns = Math.round(this.#time_ns ?? time_us * 1000);
      const time = { timeline: TIMELINE, duration_nanos: BigInt(time_ns), play_state: this.#play };
      const old = [...this.#sent].filter((other) => other !== id);
      // Both at once: each for itself would have it paint once more.
      const closing = old.length ? this.#viewer.close({ store_ids: old.map(storeOf) }) : null;
      await Promise.all([this.#placed({ recording: storeOf(id), ...time }), closing]);
      this.#sent = new Set([id]);
      this.#shown = id;
      this.#moved(time_ns);
      await new Promise(requestAnimationFrame); // what was set is drawn now
      return true;
    });
  }

  // Sets the playhead. A recording may be open before the viewer knows of its times: then it refuses, and is asked again.
  async #placed(/** @type {any} */ where) {
    const until = performance.now() + PATIENCE_MS;
    for (;;) {
      try {
        return await this.#viewer.set_time(where);
      } catch (error) {
        if (performance.now() > until) throw error;
        await pause(POLL_MS);
      }
    }
  }

  // Has the viewer paint until something happened: data alone does not always wake it.
  async #awake(/** @type {Promise<void>} */ happened) {
    let waiting = true;
    const over = () => (waiting = false);
    happened.then(over, over);
    while (waiting) {
      const painted = this.#viewer.get_state().catch(() => {}); // busy painting
      await Promise.race([painted, pause(ANSWER_MS)]); // an answer can get lost while the viewer starts
      await pause(POLL_MS);
    }
    return happened;
  }

  // The viewer takes a recording in with its next picture, and knows nothing of it until then.
  /**
   * @param {string} id
   * @returns {Promise<void>}
   */
  #taken_in(id) {
    return new Promise((resolve, reject) => {
      const late = setTimeout(() => reject(new Error("the viewer does not take the recording in")), PATIENCE_MS);
      const stop = this.#viewer.on("recording_open", (/** @type {any} */ { recording_id }) => {
        if (recording_id !== id) return;
        clearTimeout(late);
        stop();
        resolve();
      });
    });
  }

  // The playhead of a link: the next recording is shown there, too.
  place(/** @type {number} */ time_us) {
    this.#moved(Math.round(time_us * 1000));
    return this.seek(time_us);
  }

  seek(/** @type {number} */ time_us, /** @type {PlayState} */ play_state = "paused") {
    if (this.#shown === null) this.#moved(Math.round(time_us * 1000)); // where the first recording is shown
    return this.#next(async () => {
      if (this.#shown === null) return;
      const duration_nanos = BigInt(Math.round(time_us * 1000));
      await this.#viewer.set_time({ recording: storeOf(this.#shown), timeline: TIMELINE, duration_nanos, play_state });
    });
  }

  play(/** @type {PlayState} */ play_state) {
    return this.#next(() => this.#viewer.set_time({ play_state }));
  }

  toggle() {
    return this.play(this.#play === "playing" ? "paused" : "playing");
  }

  bringToFront(/** @type {string} */ title) {
    this.#asked = title;
    if (!this.#isLaidOut) this.#turned(title); // the first layout opens there
    return this.#next(async () => {
      if (this.#isLaidOut && this.#asked === title) await this.#bring(title); // else another one was asked for since
    });
  }

  async #bring(/** @type {string} */ title) {
    const blueprint = await this.#layout();
    const tab = tabs(blueprint).find((one) => one.title === title);
    if (!tab || tab.front) return;
    rootOf(blueprint).active_tab = tab.path;
    await this.#take(blueprint);
    this.#turned(title);
  }

  /**
   * Shows the tab of this name without the others, without the time line and without its view of that origin;
   * returns what `together` takes to undo it.
   * @param {string} name
   * @param {string} left_out
   */
  alone(name, left_out) {
    return this.#next(async () => {
      if (this.#shown === null) return null;
      const blueprint = await this.#layout();
      const tab = tabs(blueprint).find(({ title }) => title === name);
      if (!tab) return null;
      this.#isAlone = true;
      await this.#take(only(blueprint, tab.id, left_out));
      this.#viewer.override_panel_state("time", "hidden");
      return blueprint;
    });
  }

  together(/** @type {Blueprint | null} */ blueprint) {
    return this.#next(async () => {
      this.#viewer.override_panel_state("time", null);
      if (blueprint) await this.#take(blueprint);
      this.#isAlone = false;
    });
  }

  #take(/** @type {Blueprint} */ blueprint) {
    const recording = storeOf(this.#shown ?? "");
    return this.#viewer.set_blueprint(blueprint, { kind: "recording", recording });
  }

  /**
   * The layout; right after its recording the viewer may still show one of its own making, without our tabs.
   * @returns {Promise<Blueprint>}
   */
  async #layout(patience_ms = LAYOUT_MS) {
    const until = performance.now() + patience_ms;
    this.#working++;
    try {
      for (;;) {
        const { blueprint } = await this.#viewer.get_blueprint();
        if (performance.now() > until || tabs(blueprint).some(({ title }) => title)) return blueprint;
        await pause(POLL_MS);
      }
    } finally {
      this.#working--;
    }
  }

  // Whether our first layout has come; the tab that was chosen until then is in front.
  laidOut(patience_ms = LAYOUT_MS) {
    return this.#next(async () => {
      this.#isLaidOut = tabs(await this.#layout(patience_ms)).some(({ title }) => title);
      if (this.#isLaidOut) await (this.front === null ? this.tab() : this.#bring(this.front));
      return this.#isLaidOut;
    });
  }

  // The name of the tab in front.
  async tab() {
    this.#turned(tabs(await this.#layout()).find(({ front }) => front)?.title ?? null);
    return this.front;
  }

  #turned(/** @type {string | null} */ title) {
    if (title === this.front) return;
    this.front = title;
    this.dispatchEvent(new CustomEvent("turned", { detail: title }));
  }

  // What is seen, as PNG or JPEG. The canvas keeps its picture until the browser has shown it: it is copied right after
  // it was drawn, which a change of the playhead to where it is makes happen.
  picture(type = "image/png") {
    return this.#next(async () => {
      if (this.#shown === null) throw new Error("the viewer shows nothing yet, or cannot run in this browser");
      const { canvas } = this.#viewer;
      const copy = document.createElement("canvas");
      [copy.width, copy.height] = [canvas.width, canvas.height];
      const until = performance.now() + PICTURE_MS;
      while (performance.now() < until) {
        canvas.dispatchEvent(new PointerEvent("pointermove", { bubbles: true, clientX: Math.random(), clientY: 1 }));
        await new Promise((resolve) => requestAnimationFrame(resolve));
        copy.getContext("2d")?.drawImage(canvas, 0, 0);
        if (hasContent(copy)) return new Promise((resolve) => copy.toBlob(resolve, type, JPEG_QUALITY));
      }
      throw new Error("the browser does not give the picture: take a screenshot instead");
    });
  }

  get api() {
    return this.#viewer;
  }
}

function rootOf(/** @type {Blueprint} */ blueprint) {
  const { root_container } = blueprint["/viewport"]?.ViewportBlueprint ?? {};
  return blueprint[`/container/${root_container}`]?.ContainerBlueprint ?? {};
}

/**
 * The tabs of the layout.
 * @param {Blueprint} blueprint
 * @returns {{id: string, path: string, title: string | undefined, front: boolean}[]}
 */
function tabs(blueprint) {
  const root = rootOf(blueprint);
  // Of one view the viewer names it alone, not in a list.
  return [root.contents ?? []].flat().map((/** @type {any} */ path) => {
    const id = path.split("/").pop();
    const title = blueprint[`/container/${id}`]?.ContainerBlueprint.display_name;
    return { id, path, title, front: root.active_tab === path };
  });
}

const NEARER = 0.62; // the ball as large as its ring allows

/**
 * The layout with one container for its root: panels, and the views in it side by side, but for those of an origin;
 * the first one seen from nearer by.
 * @param {Blueprint} blueprint
 * @param {string} root
 * @param {string} left_out
 */
function only(blueprint, root, left_out) {
  /** @type {Blueprint} */
  const kept = {};
  for (const [path, content] of Object.entries(blueprint)) {
    if (!/^\/(container|view)\//.test(path)) kept[path] = content;
  }
  /** @type {string[]} */
  const views = [];
  const gather = (/** @type {string} */ path) => {
    const inner = blueprint[path]?.ContainerBlueprint?.contents;
    if (inner) return inner.forEach((/** @type {string} */ next) => gather(`/${next}`));
    if (blueprint[path]?.ViewBlueprint?.space_origin !== left_out) views.push(path);
  };
  gather(`/container/${root}`);
  for (const [name, content] of Object.entries(blueprint)) {
    if (views.some((path) => name === path || name.startsWith(`${path}/`))) kept[name] = content;
  }
  const eye = structuredClone(kept[`${views[0]}/EyeControls3D`]);
  if (eye?.EyeControls3D.position) {
    eye.EyeControls3D.position = eye.EyeControls3D.position.map((/** @type {number} */ value) => NEARER * value);
    kept[`${views[0]}/EyeControls3D`] = eye;
  }
  const { ContainerBlueprint, ...rest } = structuredClone(blueprint[`/container/${root}`]);
  const contents = views.map((path) => path.slice(1));
  kept[`/container/${root}`] = {
    ...rest,
    ContainerBlueprint: { ...ContainerBlueprint, contents, col_shares: views.map((_, i) => (i ? 2 : 3)) },
  };
  kept["/viewport"] = structuredClone(blueprint["/viewport"]);
  kept["/viewport"].ViewportBlueprint.root_container = root;
  return kept;
}

function hasContent(/** @type {HTMLCanvasElement} */ canvas) {
  const context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  const { data } = context.getImageData(0, 0, canvas.width, Math.min(canvas.height, 80));
  return data.some((value, i) => i % 4 < 3 && value > 60);
}
