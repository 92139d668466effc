// The strip above the viewer: event rate of the whole recording, its shots, the clip that is worked on, the playhead.
// Events: `seek` with a time, `choose` and `shot` with a span, all in us.

/** @import { RecordingDescription } from "./messages.d.ts" */
/** @typedef {[number, number]} Span */

import { drawing, element } from "./elements.js";

const WIDTH = 1200;
const HEIGHT = 44;

export class Overview extends EventTarget {
  /** @type {Span} */
  clip = [0, 0];
  /** @type {Span[]} */
  shots = [];
  playhead_us = 0;

  constructor(/** @type {any} */ parent, /** @type {RecordingDescription} */ recording) {
    super();
    const role = { role: "slider", tabindex: 0, "aria-label": "Playhead" };
    this.svg = drawing("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, preserveAspectRatio: "none", ...role });
    this.chosen = drawing("rect", { class: "chosen", y: 0, height: HEIGHT });
    this.bands = drawing("g");
    this.drag = drawing("rect", { class: "drag", y: 0, height: HEIGHT, width: 0 });
    this.playhead = drawing("line", { class: "playhead", y1: 0, y2: HEIGHT });
    this.curve = drawing("g");
    this.svg.append(this.chosen, this.curve, this.bands, this.drag, this.playhead);
    this.words = element("span.words");
    const click = recording.is_long ? "click a shot to work on it" : "click to move the playhead";
    parent.title = `Event rate of the whole recording; ${click}, drag to choose a part`;
    parent.replaceChildren(this.svg, this.words);
    this.recording = recording;
    this.#dragging();
    this.take(recording);
  }

  take(/** @type {RecordingDescription} */ recording) {
    this.recording = recording;
    this.curve.replaceChildren(this.#curve());
    this.show(recording.clip_us, []);
    this.move(null);
  }

  show(/** @type {Span} */ clip, /** @type {Span[]} */ shots, words = "") {
    this.clip = clip;
    this.shots = shots;
    this.chosen.setAttribute("x", String(this.#x(clip[0])));
    this.chosen.setAttribute("width", String(Math.max(this.#x(clip[1]) - this.#x(clip[0]), 1)));
    this.bands.replaceChildren(...shots.map((shot, index) => this.#band(shot, index)));
    const { start_us, end_us } = this.recording;
    const times = `${(start_us / 1000).toFixed(0)} to ${(end_us / 1000).toFixed(0)} ms`;
    this.words.textContent = [times, words].filter(Boolean).join(" · ");
  }

  move(/** @type {number | null} */ time_us) {
    const { start_us, end_us } = this.recording;
    const at_us = time_us ?? start_us;
    const x = String(this.#x(at_us));
    this.playhead_us = at_us;
    const values = {
      valuemin: start_us,
      valuemax: end_us,
      valuenow: at_us,
      valuetext: `${(at_us / 1000).toFixed(1)} ms`,
    };
    for (const [name, value] of Object.entries(values)) this.svg.setAttribute(`aria-${name}`, String(value));
    this.playhead.setAttribute("x1", x);
    this.playhead.setAttribute("x2", x);
  }

  // To the start of the shot before or after the present one; of a long recording, to work on it.
  goToShot(/** @type {-1 | 1} */ direction) {
    const [from_us, to_us] = this.clip;
    const inside = this.shots.find(([start, end]) => from_us <= start && end <= to_us);
    const here_us = this.recording.is_long ? inside?.[0] ?? from_us : this.playhead_us;
    const shots = direction > 0 ? this.shots : [...this.shots].reverse();
    const next = shots.find(([start]) => direction * (start - here_us) > 0);
    if (next && this.recording.is_long) this.#tell("shot", next);
    else if (next) this.#tell("seek", next[0]);
  }

  #x(/** @type {number} */ time_us) {
    const { start_us, end_us } = this.recording;
    return (WIDTH * (time_us - start_us)) / (end_us - start_us);
  }

  #time(/** @type {PointerEvent} */ event) {
    const box = this.svg.getBoundingClientRect();
    const { start_us, end_us } = this.recording;
    const share = Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1);
    return Math.round(start_us + share * (end_us - start_us));
  }

  #curve() {
    const { counts } = this.recording.rate;
    const most = Math.max(...counts, 1);
    const step = WIDTH / counts.length;
    let path = `M0 ${HEIGHT}`;
    counts.forEach((count, i) => {
      const y = (HEIGHT - 4 - (HEIGHT - 8) * (count / most)).toFixed(1);
      path += `L${(i * step).toFixed(1)} ${y}L${((i + 1) * step).toFixed(1)} ${y}`;
    });
    return drawing("path", { class: "rate", d: `${path}L${WIDTH} ${HEIGHT}Z` });
  }

  #band(/** @type {Span} */ [start, end], /** @type {number} */ index) {
    const band = drawing("rect", {
      class: "shot",
      x: this.#x(start),
      width: Math.max(this.#x(end) - this.#x(start), 3),
      y: HEIGHT - 7,
      height: 7,
    });
    const length = ((end - start) / 1000).toFixed(0);
    band.append(
      drawing(
        "title",
        {},
        `Shot ${index + 1}: ${(start / 1000).toFixed(1)} ms, ${length} ms long. Click to ${
          this.recording.is_long ? "work on it" : "go there"
        }.`,
      ),
    );
    return band;
  }

  // A click on a shot chooses it, a click elsewhere moves the playhead, a drag chooses a part.
  #dragging() {
    /** @type {number | null} */
    let from = null;
    this.svg.addEventListener("pointerdown", (event) => {
      from = this.#time(event);
      this.svg.setPointerCapture(event.pointerId);
    });
    this.svg.addEventListener("pointermove", (event) => {
      if (from === null) return;
      const [a, b] = [from, this.#time(event)].sort((p, q) => p - q);
      this.drag.setAttribute("x", String(this.#x(a)));
      this.drag.setAttribute("width", String(this.#x(b) - this.#x(a)));
    });
    this.svg.addEventListener("pointerup", (event) => {
      if (from === null) return;
      const [a, b] = [from, this.#time(event)].sort((p, q) => p - q);
      from = null;
      this.drag.setAttribute("width", "0");
      const wide = this.#x(b) - this.#x(a) > 8;
      const shot = this.shots.find(([start, end]) => start <= b && b < end);
      if (wide) this.#tell("choose", [a, b]);
      else if (shot && this.recording.is_long) this.#tell("shot", shot);
      else this.#tell("seek", b);
    });
  }

  #tell(/** @type {string} */ name, /** @type {any} */ detail) {
    this.dispatchEvent(new CustomEvent(name, { detail }));
  }
}
