// Sends wishes to the server: the newest settings, as often as they can be fulfilled while a slider is dragged.

import { notice } from "./elements.js";
import { post, Refused } from "./server.js";

const PATIENCE_MS = 5000; // as long as a picture takes to draw where there is no graphics card

export class Runner extends EventTarget {
  #serial = 0;
  #dirty = false;
  #settled = false;
  #last = null; // what was asked for last
  #sending = false;
  #sentAt = 0;
  #running = false;
  #timer = null;

  isBlind = false; // there is no viewer: numbers alone

  constructor(connection, settings, playhead) {
    super();
    Object.assign(this, { connection, settings, playhead });
    connection.addEventListener("run", ({ detail }) => this.#told(detail));
  }

  get serial() {
    return this.#serial;
  }

  // The settings changed; where a drag ends at what it has already asked for, there is nothing more to ask.
  change(settled) {
    if (!settled || this.#dirty || this.#last !== JSON.stringify(this.#what())) this.want(settled);
  }

  want(settled) {
    this.#dirty = true;
    this.#settled ||= settled;
    this.#schedule();
  }

  #schedule() {
    clearTimeout(this.#timer);
    if (!this.#dirty || this.#sending) return;
    // While a slider is dragged its last picture is awaited; a change that is meant to stay does not wait.
    const wait = this.#settled || !this.#running ? 0 : this.#sentAt + PATIENCE_MS - performance.now();
    if (wait <= 0) this.#send();
    else this.#timer = setTimeout(() => this.#schedule(), wait);
  }

  async #send() {
    const { settings, connection } = this;
    const hasty = !this.#settled;
    this.#dirty = false;
    this.#settled = false;
    this.#sending = true;
    this.#running = true;
    this.#sentAt = performance.now();
    this.#last = JSON.stringify(this.#what());
    const wish = { serial: ++this.#serial, ...JSON.parse(this.#last), hasty };
    try {
      await post(connection.path("run"), { ...wish, playhead_us: this.playhead() });
    } catch (error) {
      this.#running = false;
      this.#last = null;
      if (error instanceof Refused && error.status !== 409 && error.status !== 404) {
        notice(error.message);
        settings.revert();
      }
    } finally {
      this.#sending = false;
      this.#schedule();
    }
  }

  #what() {
    const { parameters, pinned, clip } = this.settings;
    return { parameters, pinned, start_us: clip[0], end_us: clip[1] };
  }

  #told({ serial, state, recording }) {
    if (serial !== this.#serial) return;
    if (state === "failed") this.#last = null;
    // A first picture is enough to let a dragged slider go on, but it is to be seen before the next one is made.
    if (state === "failed" || (["partial", "done"].includes(state) && (!recording || this.isBlind))) this.#ended();
  }

  // The picture of a wish is on the screen.
  shown(serial) {
    if (serial === this.#serial) this.#ended();
  }

  #ended() {
    this.#running = false;
    this.#schedule();
  }
}
