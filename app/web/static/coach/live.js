// The newest shot, large enough to be read from three metres, and spoken if wished.

/** @import { CoachShot } from "../messages.d.ts" */
/** @import { Shots } from "./shots.js" */

import { attempt, element } from "../elements.js";
import { nameInputs, takeNames } from "./shot_list.js";
import { headline } from "./shot_view.js";
import { chosen, kindWords, speedWords, spinWords, text, timeWords } from "./texts.js";

export class Live {
  isSpoken = false;

  /** @param {{shots: Shots}} page */
  constructor({ shots }) {
    this.shots = shots;
    this.root = element("section.live");
    this.newest = element("div.newest", { "aria-live": "assertive" });
    shots.addEventListener("new", (event) => this.#announce(/** @type {CustomEvent<CoachShot>} */ (event).detail));
  }

  show() {
    const speak = element("input", {
      type: "checkbox",
      checked: this.isSpoken,
      onchange: () => this.isSpoken = speak.checked,
    });
    const inputs = nameInputs(this.shots, /** @type {any} */ (this.shots.now));
    const form = element(
      "form.names",
      { "aria-label": text("now") },
      element("strong", {}, text("now")),
      inputs,
      element("button.primary", {}, text("apply")),
    );
    form.addEventListener("submit", (/** @type {Event} */ event) => {
      event.preventDefault();
      attempt(() => this.shots.playNow(/** @type {any} */ (takeNames(inputs))));
    });
    this.root.replaceChildren(this.newest, element("label.check", {}, speak, text("speak")), form);
    const last = this.shots.list.sort((a, b) => a.id - b.id).pop();
    if (last) this.#display(last);
    else this.newest.replaceChildren(element("p.note.large", {}, text("waiting")));
    return this.root;
  }

  /** @param {CoachShot} shot */
  #display(shot) {
    this.newest.replaceChildren(
      headline(shot),
      element("p.speed", {}, speedWords(shot.speed_m_s), element("small", {}, ` ${timeWords(shot)}`)),
    );
  }

  /** @param {CoachShot} shot */
  #announce(shot) {
    this.#display(shot);
    if (!this.isSpoken || !("speechSynthesis" in window)) return;
    const words = shot.spin_rps === null
      ? text("not_seen")
      : `${kindWords(shot.kind)}, ${spinWords(shot.spin_rps)}, ${speedWords(shot.speed_m_s)}`;
    const said = new SpeechSynthesisUtterance(words);
    said.lang = chosen.language;
    speechSynthesis.cancel();
    speechSynthesis.speak(said);
  }
}
