// Preview at the playhead, drawn by the page itself: while a slider is dragged, until the viewer shows its first
// picture, and where it cannot run.

/** @import { PreviewMessage } from "./messages.d.ts" */
/** @import { Overview } from "./overview.js" */
/** @import { Connection, RunRequests } from "./server.js" */
/** @import { Settings } from "./settings.js" */
/** @import { Viewer } from "./viewer.js" */

import { byId, element } from "./elements.js";

const TITLES = ["Surface", "Logo events", "Flow", "Derotated logo"];

export class Preview {
  #isDragged = false;
  #isAsking = false;
  /** @type {number | null} time that is to be shown next */
  #wanted_us = null;
  /** @type {number | null} time that is shown */
  #shown_us = null;

  /**
   * @param {{connection: Connection, settings: Settings, runner: RunRequests, viewer: Viewer, overview: Overview}} app
   */
  constructor({ connection, settings, runner, viewer, overview }) {
    this.connection = connection;
    this.viewer = viewer;
    this.overview = overview;
    this.runner = runner;
    this.image = element("img", { alt: `${TITLES.join(", ")} at the playhead` });
    const titles = element("div.titles", {}, ...TITLES.map((title) => element("span", {}, title)));
    // Settled once a first picture is to be seen.
    this.first = new Promise((resolve) => this.image.addEventListener("load", () => requestAnimationFrame(resolve)));
    this.words = element("figcaption");
    this.node = element("figure", { id: "preview", hidden: true }, titles, this.image, this.words);
    byId("middle").append(this.node);
    // Also one of an earlier request than the newest: while a slider is dragged the next one is on its way already.
    connection.on("preview", (message) => this.#show(message));
    runner.addEventListener("shown", () => (this.node.hidden = true));
    runner.addEventListener("numbers", (event) => {
      const { state } = /** @type {CustomEvent} */ (event).detail;
      const time_us = viewer.playhead_us ?? this.#shown_us;
      if (state === "done" && time_us !== null) this.#scrub(time_us);
    });
    settings.onChange((settled) => (this.#isDragged = !settled));
    viewer.addEventListener("moved", (event) => this.#scrub(/** @type {CustomEvent} */ (event).detail));
  }

  // Whether it stands in for the viewer.
  get #isAlone() {
    return this.runner.isBlind || !document.body.dataset.picture;
  }

  #show(/** @type {PreviewMessage} */ { picture, words, t_us }) {
    if (!this.#isAlone && !this.#isDragged) return;
    this.image.src = picture;
    this.words.textContent = `${words}, at ${(t_us / 1000).toFixed(1)} ms`;
    this.#shown_us = t_us;
    if (this.viewer.playhead_us === null) this.overview.move(t_us); // not yet moved by anybody
    this.node.hidden = false;
  }

  // One request after the other, always for the newest time.
  async #scrub(/** @type {number} */ time_us) {
    this.#wanted_us = time_us;
    if (this.#isAsking || !this.#isAlone) return;
    this.#isAsking = true;
    while (this.#wanted_us !== null && this.#isAlone) {
      const path = /** @type {"preview"} */ (`preview?t_us=${this.#wanted_us}`);
      this.#wanted_us = null;
      const found = await this.connection.get(path).catch(() => null); // nothing is computed yet, or it is gone
      if (found) this.#show(found);
    }
    this.#isAsking = false;
  }
}
