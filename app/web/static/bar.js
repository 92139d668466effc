// The bar under the viewer: which stage is computing, and what each took.

/** @import { Choice, RunMessage } from "./messages.d.ts" */

import { element, milliseconds } from "./elements.js";

const BUSY = ["loading", "computing", "drawing", "partial"];

export class Bar {
  /** @type {Map<string, {cell: any, time: any, title: string}>} */
  #cells = new Map();
  /** @type {Record<string, number>} */
  #before = {};

  constructor(/** @type {any} */ parent, /** @type {Choice[]} */ stages) {
    this.share = element("div.share");
    this.status = element("span.status");
    for (const { name, label, help } of stages) {
      const time = element("span.time");
      const cell = element("span.stage", {}, element("span", {}, name.replaceAll("_", " ")), time);
      cell.dataset.stage = name;
      this.#cells.set(name, { cell, time, title: `${label}: ${help}` });
    }
    parent.append(this.share, ...[...this.#cells.values()].map(({ cell }) => cell), this.status);
  }

  show(/** @type {RunMessage} */ { state, share, stages_ms, total_ms, error, picture }) {
    const busy = BUSY.includes(state);
    for (const [stage, { cell, time, title }] of this.#cells) {
      const took_ms = stages_ms[stage] ?? 0;
      const grown = took_ms > (this.#before[stage] ?? 0);
      cell.classList.toggle("computing", busy && grown);
      cell.classList.toggle("kept", took_ms === 0);
      cell.title = `${title}\n${took_ms ? `${took_ms.toFixed(1)} ms` : "not computed again"}`;
      time.textContent = took_ms ? milliseconds(took_ms) : "–";
    }
    this.#before = busy ? stages_ms : {};
    this.share.style.width = busy ? `${100 * share}%` : "0";
    this.status.classList.toggle("failed", state === "failed");
    this.status.textContent = {
      loading: "loading the kernels; on a new machine they are compiled first, half a minute",
      computing: "computing",
      drawing: "drawing",
      partial: "computing the slower stages",
      done: `${milliseconds(total_ms)}${picture ? `, ${(picture.size_bytes / 1e6).toFixed(1)} MB` : ""}`,
      failed: error,
    }[state];
    this.status.title = this.status.textContent;
  }

  say(/** @type {string} */ text) {
    this.status.classList.add("failed");
    this.status.textContent = text;
  }
}
