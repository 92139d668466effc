// The bar under the viewer: which stage is computing, and what each took.

import { element } from "./elements.js";


export class Bar {
  constructor(parent, stages) {
    this.cells = new Map();
    this.share = element("div.share");
    this.status = element("span.status");
    for (const stage of [...stages, "drawing"]) {
      const time = element("span.time");
      const cell = element("span.stage", {}, element("span", {}, stage), time);
      cell.dataset.stage = stage;
      this.cells.set(stage, { cell, time });
    }
    parent.append(this.share, ...[...this.cells.values()].map(({ cell }) => cell), this.status);
  }

  show({ state, share, stages, total, error, bytes }) {
    const busy = ["loading", "computing"].includes(state) || state === "drawing" || state === "partial";
    for (const [stage, { cell, time }] of this.cells) {
      const took = stages[stage] ?? 0;
      const grown = took > (this.before?.[stage] ?? 0);
      cell.classList.toggle("computing", busy && (stage === "drawing" ? state === "drawing" : grown));
      cell.classList.toggle("kept", took === 0);
      cell.title = took ? `${stage}: ${took.toFixed(1)} ms` : `${stage}: as it was`;
      time.textContent = took ? milliseconds(took) : "–";
    }
    this.before = busy ? stages : null;
    this.share.style.width = busy ? `${100 * share}%` : "0";
    this.status.classList.toggle("failed", state === "failed");
    this.status.textContent = {
      loading: "loading the kernels; on a new machine they are compiled first, half a minute",
      computing: "computing",
      drawing: "drawing",
      partial: "the rest",
      done: `${milliseconds(total)}${bytes ? `, ${(bytes / 1e6).toFixed(1)} MB` : ""}`,
      failed: error,
    }[state];
    this.status.title = this.status.textContent;
  }

  say(text) {
    this.status.classList.add("failed");
    this.status.textContent = text;
  }
}

export const milliseconds = (ms) => (ms < 9.95 ? `${ms.toFixed(1)} ms` : ms < 999.5 ? `${ms.toFixed(0)} ms` : `${(ms / 1000).toFixed(1)} s`);
