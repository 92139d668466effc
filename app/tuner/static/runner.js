// Sends wishes to the server: the newest settings, as often as they can be fulfilled while a slider is dragged.

import { notice } from "./elements.js";
import { post, Refused } from "./server.js";

const SLOWEST_PACE_MS = 700;

export class Runner extends EventTarget {
  #serial = 0;
  #dirty = false;
  #settled = false;
  #sending = false;
  #sentAt = 0;
  #running = false;
  #lastTook = 100;
  #timer = null;

  constructor(connection, settings, playhead) {
    super();
    Object.assign(this, { connection, settings, playhead });
    connection.addEventListener("run", ({ detail }) => this.#told(detail));
  }

  get serial() {
    return this.#serial;
  }

  want(settled) {
    this.#dirty = true;
    this.#settled ||= settled;
    this.#schedule();
  }

  #schedule() {
    clearTimeout(this.#timer);
    if (!this.#dirty || this.#sending) return;
    // While a run is under way its end is awaited, so that a drag shows pictures; not for long, and not once settled.
    const patience = Math.min(1.5 * this.#lastTook, SLOWEST_PACE_MS);
    const wait = this.#settled || !this.#running ? 0 : this.#sentAt + patience - performance.now();
    if (wait <= 0) this.#send();
    else this.#timer = setTimeout(() => this.#schedule(), wait);
  }

  async #send() {
    const { settings, connection } = this;
    this.#dirty = false;
    this.#settled = false;
    this.#sending = true;
    this.#running = true;
    this.#sentAt = performance.now();
    const [start_us, end_us] = settings.clip;
    const wish = { serial: ++this.#serial, parameters: settings.parameters, pinned: settings.pinned, start_us, end_us };
    try {
      await post(connection.path("run"), { ...wish, playhead_us: await this.playhead() });
    } catch (error) {
      this.#running = false;
      if (error instanceof Refused && error.status !== 409 && error.status !== 404) {
        notice(error.message);
        settings.revert();
      }
    } finally {
      this.#sending = false;
      this.#schedule();
    }
  }

  #told(message) {
    if (message.serial !== this.#serial) return;
    if (["done", "failed"].includes(message.state)) {
      this.#running = false;
      this.#lastTook = performance.now() - this.#sentAt;
      this.#schedule();
    }
  }
}
