// The settings of the page: parameters of B, of A when it is pinned, the clip; with undo and redo.

export const copy = (value) => structuredClone(value);

export class Settings extends EventTarget {
  parameters = {};
  pinned = null;
  clip = [0, 0];
  preset = { name: "opened", values: {} };
  fallback = null;
  #past = [];
  #future = [];
  #settled = null;

  start({ parameters, pinned, clip, preset }) {
    Object.assign(this, { parameters: copy(parameters), pinned: copy(pinned ?? null), clip: [...clip], preset });
    this.#past = [];
    this.#future = [];
    this.#settled = this.#snapshot();
    this.#tell(true);
  }

  get(name) {
    const [group, field] = name.split(".");
    return this.parameters[group][field];
  }

  presetValue(name) {
    const [group, field] = name.split(".");
    return this.preset.values[group]?.[field];
  }

  // One value; while a slider is dragged it is not settled, and undo goes back to where the drag began.
  set(name, value, settled = true) {
    const [group, field] = name.split(".");
    this.parameters[group][field] = value;
    this.#changed(settled);
  }

  setAll(values, settled = true) {
    for (const [group, fields] of Object.entries(values)) Object.assign(this.parameters[group], copy(fields));
    this.#changed(settled);
  }

  settle() {
    this.#changed(true);
  }

  takePreset(name, values) {
    this.preset = { name, values: copy(values) };
    this.setAll(values);
  }

  takeClip(start, end) {
    this.clip = [start, end];
    this.#changed(true);
  }

  pin() {
    this.pinned = copy(this.parameters);
    this.#changed(true);
  }

  unpin(backToA) {
    if (backToA) this.parameters = this.pinned;
    this.pinned = null;
    this.#changed(true);
  }

  swap() {
    [this.parameters, this.pinned] = [this.pinned, this.parameters];
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
    else if (this.canUndo) this.#take((this.#settled = this.#past.pop()));
    else if (this.fallback) this.start({ ...this.fallback, preset: this.preset });
    this.fallback = null;
  }

  #snapshot() {
    return copy({ parameters: this.parameters, pinned: this.pinned, clip: this.clip, preset: this.preset });
  }

  #go(from, to) {
    if (!from.length) return;
    to.push(this.#settled);
    this.#settled = from.pop();
    this.#take(this.#settled);
  }

  #take(snapshot) {
    Object.assign(this, copy(snapshot));
    this.#tell(true);
  }

  #changed(settled) {
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

  #tell(settled) {
    this.dispatchEvent(new CustomEvent("change", { detail: { settled } }));
  }
}
