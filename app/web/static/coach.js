// The coach's view: the Coach tab alone on the whole screen, the shot playing slowly over and over.

/** @import { Results } from "./results.js" */
/** @import { Viewer } from "./viewer.js" */

import { byId, element } from "./elements.js";

export class Coach {
  /** @type {any} layout to go back to */
  #before = null;
  /** @type {number | null} */
  #playhead_us = null;

  constructor(/** @type {{viewer: Viewer, results: Results}} */ { viewer, results }) {
    this.viewer = viewer;
    this.results = results;
    byId("coach").onclick = () => this.enter();
    document.addEventListener("fullscreenchange", () => document.fullscreenElement || this.leave());
    document.addEventListener("keydown", (event) => event.key === "Escape" && this.leave());
    const end = { id: "leave", hidden: true, title: "Back to the sliders (Esc)", onclick: () => this.leave() };
    this.end = element("button", end, "×");
    this.sentence = element("p", { id: "sentence", hidden: true });
    byId("middle").append(this.sentence, this.end);
    results.addEventListener("shown", () => this.#say());
  }

  get on() {
    return document.body.classList.contains("coach");
  }

  async enter() {
    if (this.on) return;
    document.body.classList.add("coach");
    this.end.hidden = this.sentence.hidden = false;
    this.#say();
    await byId("middle").requestFullscreen?.().catch(() => {});
    this.#playhead_us = this.viewer.playhead_us;
    // The page's own sentence is larger than the card among the pictures.
    this.#before = await this.viewer.alone("Coach", "/coach");
    await this.viewer.play("playing");
  }

  async leave() {
    if (!this.on) return;
    document.body.classList.remove("coach");
    this.end.hidden = this.sentence.hidden = true;
    if (document.fullscreenElement) await document.exitFullscreen().catch(() => {});
    await this.viewer.together(this.#before);
    if (this.#playhead_us !== null) await this.viewer.seek(this.#playhead_us);
  }

  // The spin and its kind on a line of their own, what else is known below.
  #say() {
    const { sentence } = this.results;
    const [first, ...others] = sentence ? [...sentence.split(", "), "whole shot"] : ["No shot"];
    this.sentence.replaceChildren(element("strong", {}, first), element("span", {}, others.join(", ")));
  }
}
