// Panels of settings and of results: folded or not, as the browser remembers.

import { byId } from "./elements.js";

const FOLDED = "folded-panels"; // key of the browser's storage

export function startPanels() {
  /** @type {string[]} */
  const folded = JSON.parse(localStorage.getItem(FOLDED) ?? "[]");
  for (const panel of ["controls", "side"]) {
    const button = byId(`fold-${panel}`);
    const show = (/** @type {boolean} */ isFolded) => {
      document.body.classList.toggle(button.id, isFolded);
      button.setAttribute("aria-pressed", String(!isFolded));
    };
    show(folded.includes(panel));
    button.onclick = () => {
      show(!document.body.classList.contains(button.id));
      const now = ["controls", "side"].filter((one) => document.body.classList.contains(`fold-${one}`));
      localStorage.setItem(FOLDED, JSON.stringify(now));
    };
  }
}
