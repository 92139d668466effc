// The coach's view: the Coach tab alone on the whole screen, the shot playing slowly over and over.

import { byId, element } from "./elements.js";

export class Coach {
  #before = null;
  #playhead = null;

  constructor({ viewer, results }) {
    Object.assign(this, { viewer, results });
    byId("coach").onclick = () => this.enter();
    document.addEventListener("fullscreenchange", () => document.fullscreenElement || this.leave());
    document.addEventListener("keydown", (event) => event.key === "Escape" && this.leave());
    const end = { id: "leave", hidden: true, title: "Back to the sliders (Esc)", onclick: () => this.leave() };
    this.end = element("button", end, "×");
    this.words = element("p", { id: "sentence", hidden: true });
    byId("middle").append(this.words, this.end);
    results.addEventListener("shown", () => this.#say());
  }

  get on() {
    return document.body.classList.contains("coach");
  }

  async enter() {
    if (this.on) return;
    document.body.classList.add("coach");
    this.end.hidden = this.words.hidden = false;
    this.#say();
    await byId("middle").requestFullscreen?.().catch(() => {});
    this.#playhead = this.viewer.playhead_us;
    // The page's own words are larger than the card among the pictures.
    this.#before = await this.viewer.alone("Coach", "/coach");
    await this.viewer.play("playing");
  }

  async leave() {
    if (!this.on) return;
    document.body.classList.remove("coach");
    this.end.hidden = this.words.hidden = true;
    if (document.fullscreenElement) await document.exitFullscreen().catch(() => {});
    await this.viewer.together(this.#before);
    if (this.#playhead !== null) await this.viewer.seek(this.#playhead);
  }

  // The spin and its kind on a line of their own, what else is known below.
  #say() {
    const [first, ...others] = (this.results.sentence ?? "No shot").split(", ");
    this.words.replaceChildren(element("strong", {}, first), element("span", {}, others.join(", ")));
  }
}
