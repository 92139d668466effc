// List of all notices since the page was opened, behind the button that counts those not yet looked at.

import { byId, dialogTitle, element } from "./elements.js";

export class Notices {
  #unread = 0;

  constructor() {
    this.button = byId("all-notices");
    this.rows = element("tbody");
    const title = dialogTitle("Notices", { id: "notices-title" });
    const close = element("button", { onclick: () => this.list.close() }, "Close");
    const properties = { id: "notices-list", "aria-labelledby": "notices-title" };
    this.list = element("dialog", properties, title, element("table.numbers", {}, this.rows), close);
    document.body.append(this.list);
    this.button.onclick = () => this.#show();
    document.addEventListener("notice", (event) => this.#add(/** @type {CustomEvent} */ (event).detail));
  }

  #add(/** @type {{text: string, kind: string}} */ { text, kind }) {
    const time = element("td", {}, new Date().toLocaleTimeString());
    this.rows.prepend(element("tr", {}, time, element("td", {}, kind), element("td", {}, text)));
    this.#count(this.#unread + 1);
  }

  #show() {
    byId("notices").replaceChildren();
    this.#count(0);
    this.list.showModal();
  }

  #count(/** @type {number} */ unread) {
    this.#unread = unread;
    this.button.hidden = !this.rows.childElementCount;
    this.button.textContent = unread ? `Notices: ${unread} new` : "Notices";
  }
}
