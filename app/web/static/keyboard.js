// Keys of the page, their list, and the ways out of the viewer, whose canvas keeps every key that reaches it.

import { byId, dialogTitle, element } from "./elements.js";

/**
 * @typedef {object} Key
 * @property {string[]} keys as `KeyboardEvent.key` names them
 * @property {string} shown in the list
 * @property {string} label what it does
 * @property {(event: KeyboardEvent) => void} act
 * @property {boolean} [moves] whether it is left to the buttons, sliders and lists that have a use of their own for it
 */

const TEXT = "textarea, select, input:not([type=range]):not([type=checkbox])";
const CONTROL = `${TEXT}, input, button, summary, a`;
const STOPS = ["a[href]", "button", "input", "select", "summary", "[tabindex]"]
  .map((stop) => `${stop}:not([tabindex="-1"], :disabled)`).join();

export class Keyboard {
  /** @type {Map<string, Key>} */
  #keys = new Map();

  constructor(/** @type {Key[]} */ keys) {
    byId("help").onclick = () => this.list.showModal();
    const help = { keys: ["?"], shown: "?", label: "This list", act: () => this.list.showModal() };
    const all = [...keys, help];
    for (const key of all) for (const name of key.keys) this.#keys.set(name, key);
    const fixed = [
      ["Tab, Shift+Tab", "To the next or previous control, out of the viewer, too"],
      ["Esc", "Close what is open; from the viewer to the strip above it"],
      ["↑ ↓ Page↑ Page↓", "On a slider: one step, ten steps"],
    ];
    const rows = [...all.map(({ shown, label }) => [shown, label]), ...fixed].map(([shown, label]) =>
      element("tr", {}, element("th", {}, element("kbd", {}, shown)), element("td", {}, label))
    );
    const close = element("button", { onclick: () => this.list.close() }, "Close");
    const title = dialogTitle("Keys", { id: "keys-title" });
    const table = element("table.numbers", {}, element("tbody", {}, ...rows));
    this.list = element("dialog.keys", { id: "keys", "aria-labelledby": "keys-title" }, title, table, close);
    document.body.append(this.list);
    globalThis.addEventListener("keydown", (event) => this.#pressed(event), { capture: true });
    for (const skip of document.querySelectorAll("button.skip")) {
      const { target = "" } = /** @type {HTMLElement} */ (skip).dataset;
      skip.addEventListener("click", () => byId(target).querySelector("input, button, summary, [tabindex]").focus());
    }
  }

  #pressed(/** @type {KeyboardEvent} */ event) {
    const target = /** @type {HTMLElement} */ (event.target);
    if (document.querySelector("dialog[open]")) return;
    const isInViewer = byId("viewer").contains(target) && !document.body.classList.contains("coach");
    if (event.key === "Tab") return isInViewer && this.#take(event, () => besideViewer(event.shiftKey)?.focus());
    if (event.key === "Escape") return isInViewer ? this.#take(event, leaveViewer) : closeOpen();
    const key = this.#keys.get(named(event));
    if (!key || event.altKey || target.closest?.(key.moves && !isInViewer ? CONTROL : TEXT)) return;
    this.#take(event, key.act);
  }

  // The viewer has keys of its own, and the browser scrolls by some.
  #take(/** @type {KeyboardEvent} */ event, /** @type {Key["act"]} */ act) {
    event.preventDefault();
    event.stopImmediatePropagation();
    act(event);
  }
}

/**
 * Name of a key with Ctrl or Cmd; Shift is told by the letter.
 * @param {KeyboardEvent} event
 */
function named({ key, ctrlKey, metaKey }) {
  return ctrlKey || metaKey ? `Ctrl+${key}` : key;
}

// The viewer keeps the browser's own Tab to itself.
/** @param {boolean} isBefore @returns {HTMLElement | undefined} */
function besideViewer(isBefore) {
  const viewer = byId("viewer");
  const side = isBefore ? Node.DOCUMENT_POSITION_PRECEDING : Node.DOCUMENT_POSITION_FOLLOWING;
  const stops = [.../** @type {NodeListOf<HTMLElement>} */ (document.querySelectorAll(STOPS))].filter((stop) =>
    !viewer.contains(stop) && stop.getClientRects().length && viewer.compareDocumentPosition(stop) & side
  );
  return isBefore ? stops.at(-1) : stops[0];
}

const leaveViewer = () => byId("overview").querySelector("[tabindex]").focus();

function closeOpen() {
  /** @type {HTMLDetailsElement | null} */
  const menu = document.querySelector("details.menu[open]");
  if (!menu) return byId("notices").lastElementChild?.click();
  menu.open = false;
  menu.querySelector("summary")?.focus();
}
