// The settings of the page: parameters of B, of A when it is pinned, the clip; with undo and redo.

/** @typedef {Record<string, Record<string, any>>} Values */
/** @typedef {{parameters: Values, pinned: Values | null, clip: [number, number], preset: {name: string, values: Values}}} Snapshot */

/**
 * @template T
 * @param {T} value
 * @returns {T}
 */
const copy = (value) => structuredClone(value);

export class Settings extends EventTarget {
  /** @type {Values} */
  parameters = {};
  /** @type {Values | null} */
  pinned = null;
  /** @type {[number, number]} */
  clip = [0, 0];
  /** @type {{name: string, values: Values}} */
  preset = { name: "opened", values: {} };
  /** @type {{parameters: Values, clip: [number, number]} | null} */
  fallback = null;
  /** @type {Snapshot[]} */
  #past = [];
  /** @type {Snapshot[]} */
  #future = [];
  /** @type {Snapshot} */
  #settled = this.#snapshot();

  /** @param {{parameters: Values, pinned?: Values | null, clip: [number, number], preset: Snapshot["preset"]}} snapshot */
  start({ parameters, pinned, clip, preset }) {
    Object.assign(this, { parameters: copy(parameters), pinned: copy(pinned ?? null), clip: copy(clip), preset });
    this.#past = [];
    this.#future = [];
    this.#settled = this.#snapshot();
    this.#tell(true);
  }

  // What a run request asks for.
  get run() {
    return { parameters: this.parameters, pinned: this.pinned, start_us: this.clip[0], end_us: this.clip[1] };
  }

  // What a request of a tool asks about.
  get request() {
    return { parameters: this.parameters, start_us: this.clip[0], end_us: this.clip[1] };
  }

  onChange(/** @type {(settled: boolean) => void} */ listener) {
    this.addEventListener("change", (event) => listener(/** @type {CustomEvent} */ (event).detail.settled));
  }

  get(/** @type {string} */ name) {
    const [group, field] = name.split(".");
    return this.parameters[group][field];
  }

  presetValue(/** @type {string} */ name) {
    const [group, field] = name.split(".");
    return this.preset.values[group]?.[field];
  }

  /**
   * One value; while a slider is dragged it is not settled, and undo goes back to where the drag began.
   * @param {string} name
   * @param {any} value
   */
  set(name, value, settled = true) {
    const [group, field] = name.split(".");
    this.parameters[group][field] = value;
    this.#changed(settled);
  }

  setAll(/** @type {Values} */ values, settled = true) {
    for (const [group, fields] of Object.entries(values)) Object.assign(this.parameters[group], copy(fields));
    this.#changed(settled);
  }

  settle() {
    this.#changed(true);
  }

  takePreset(/** @type {string} */ name, /** @type {Values} */ values) {
    this.preset = { name, values: copy(values) };
    this.setAll(values);
  }

  takeClip(/** @type {number} */ start, /** @type {number} */ end) {
    this.clip = [start, end];
    this.#changed(true);
  }

  // What a link says; undo leads back from it.
  restore(/** @type {Snapshot} */ snapshot) {
    Object.assign(this, copy(snapshot));
    this.#changed(true);
  }

  pin() {
    this.pinned = copy(this.parameters);
    this.#changed(true);
  }

  unpin(/** @type {boolean} */ backToA) {
    if (backToA && this.pinned) this.parameters = this.pinned;
    this.pinned = null;
    this.#changed(true);
  }

  swap() {
    if (this.pinned) [this.parameters, this.pinned] = [this.pinned, this.parameters];
    this.#changed(true);
  }

  get canUndo() {
    return this.#past.length > 0;
  }

  get canRedo() {
    return this.#future.length > 0;
  }

  undo() {
    this.#go(this.#past, this.#future);
  }

  redo() {
    this.#go(this.#future, this.#past);
  }

  // The last change was refused: forget that it was made. The first settings of all may come from a mangled link:
  // then the recording is taken as it was opened.
  revert() {
    if (JSON.stringify(this.#snapshot()) !== JSON.stringify(this.#settled)) this.#take(this.#settled);
    else if (this.canUndo) this.#take(this.#settled = /** @type {Snapshot} */ (this.#past.pop()));
    else if (this.fallback) this.start({ ...this.fallback, preset: this.preset });
    this.fallback = null;
  }

  /** @returns {Snapshot} */
  #snapshot() {
    return copy({ parameters: this.parameters, pinned: this.pinned, clip: this.clip, preset: this.preset });
  }

  #go(/** @type {Snapshot[]} */ from, /** @type {Snapshot[]} */ to) {
    const next = from.pop();
    if (!next) return;
    to.push(this.#settled);
    this.#settled = next;
    this.#take(this.#settled);
  }

  #take(/** @type {Snapshot} */ snapshot) {
    Object.assign(this, copy(snapshot));
    this.#tell(true);
  }

  #changed(/** @type {boolean} */ settled) {
    if (settled) {
      const now = this.#snapshot();
      if (JSON.stringify(now) !== JSON.stringify(this.#settled)) {
        this.#past.push(this.#settled);
        if (this.#past.length > 200) this.#past.shift();
        this.#future = [];
        this.#settled = now;
      }
    }
    this.#tell(settled);
  }

  #tell(/** @type {boolean} */ settled) {
    this.dispatchEvent(new CustomEvent("change", { detail: { settled } }));
  }
}
