// The coach's view: the Coach tab alone on the whole screen, the shot playing slowly over and over.

import { byId, element } from "./elements.js";

export class Coach {
  #before = null;
  #playhead = null;

  constructor({ viewer }) {
    this.viewer = viewer;
    byId("coach").onclick = () => this.enter();
    document.addEventListener("fullscreenchange", () => document.fullscreenElement || this.leave());
    document.addEventListener("keydown", (event) => event.key === "Escape" && this.leave());
    const end = { id: "leave", hidden: true, title: "Back to the sliders (Esc)", onclick: () => this.leave() };
    this.end = element("button", end, "×");
    byId("middle").append(this.end);
  }

  get on() {
    return document.body.classList.contains("coach");
  }

  async enter() {
    if (this.on) return;
    document.body.classList.add("coach");
    this.end.hidden = false;
    await byId("middle").requestFullscreen?.().catch(() => {});
    this.#playhead = await this.viewer.playhead_us();
    this.#before = await this.viewer.alone("Coach");
    await this.viewer.play("playing");
  }

  async leave() {
    if (!this.on) return;
    document.body.classList.remove("coach");
    this.end.hidden = true;
    if (document.fullscreenElement) await document.exitFullscreen().catch(() => {});
    await this.viewer.together(this.#before);
    if (this.#playhead !== null) await this.viewer.seek(this.#playhead);
  }
}
