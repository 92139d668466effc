// Recordings that can be opened: a list of the folder with what each holds, recent ones, files dropped onto the page.
// Event: `choose` with the name of a recording.

/** @import { FolderListing, ListedRecording, RecordingSummary } from "./messages.d.ts" */

import { attempt, byId, element, milliseconds, notice } from "./elements.js";
import { get, Refused, upload } from "./server.js";

const RECENT = "recent-recordings"; // key of the browser's storage
const MOST_RECENT = 8;

export class Recordings extends EventTarget {
  /** @type {FolderListing | null} */
  #listing = null;
  /** @type {Map<string, RecordingSummary>} by name and size */
  #summaries = new Map();
  /** @type {string} recording that is open */
  #open;

  constructor(/** @type {string} */ open) {
    super();
    this.#open = open;
    this.path = element("nav.row", { "aria-label": "Folder" });
    this.recent = element("div.chips");
    this.rows = element("tbody");
    const columns = ["", "Recording", "Events", "Length", "Shots", "Spin of the shot with most logo events"];
    const head = element("tr.heading", {}, ...columns.map((text) => element("th", { scope: "col" }, text)));
    const table = element("table.numbers", {}, element("thead", {}, head), this.rows);
    const close = element("button", { onclick: () => this.list.close() }, "Close");
    const title = element("h2", { id: "recordings-title" }, "Open a recording");
    const hint = element("p.note", {}, "Or drag a file onto the page.");
    const parts = [title, this.recent, this.path, element("div.scroll", { tabIndex: 0 }, table), hint, close];
    this.list = element("dialog", { id: "recordings", "aria-labelledby": "recordings-title" }, ...parts);
    document.body.append(this.list);
    byId("recording").textContent = open;
    byId("recording").onclick = () => attempt(() => this.#show(open.split("/").slice(0, -1).join("/")));
    this.#dropping();
  }

  /** @param {string} folder */
  async #show(folder) {
    this.#listing = await get("/api/folder", { folder });
    this.#remember();
    const { root, folders, recordings } = this.#listing;
    const steps = folder.split("/").filter(Boolean);
    const enter = (/** @type {string} */ path) => () => attempt(() => this.#show(path));
    this.path.replaceChildren(
      element("button", { onclick: enter("") }, root),
      ...steps.map((step, i) => element("button", { onclick: enter(steps.slice(0, i + 1).join("/")) }, `/ ${step}`)),
      ...folders.map((name) => element("button", { onclick: enter([...steps, name].join("/")) }, `${name} ▸`)),
    );
    const rows = recordings.map((recording) => this.#row(recording));
    this.rows.replaceChildren(...rows.map(({ row }) => row));
    if (!rows.length) {
      this.rows.append(element("tr", {}, element("td", { colSpan: 6 }, "No recording in this folder.")));
    }
    if (!this.list.open) this.list.showModal();
    await this.#fill(rows);
  }

  #row(/** @type {ListedRecording} */ recording) {
    const { name, size_bytes } = recording;
    const label = name.split("/").pop();
    const button = element("button.plain", { onclick: () => this.#choose(name), title: name }, label);
    if (name === this.#open) button.setAttribute("aria-current", "true");
    const size = element("span.faint", {}, ` ${(size_bytes / 1e6).toFixed(1)} MB`);
    const row = element("tr", {}, element("td"), element("td", {}, button, size), element("td", { colSpan: 4 }, "…"));
    return { recording, row };
  }

  // One after the other, those of the folder that is seen: each is analyzed.
  async #fill(/** @type {{recording: ListedRecording, row: any}[]} */ rows) {
    for (const { recording: { name, size_bytes }, row } of rows) {
      const key = `${size_bytes} ${name}`;
      if (!this.#summaries.has(key)) {
        if (!this.list.open || !row.isConnected) return;
        this.#summaries.set(key, await get("/api/summary", { name }));
      }
      const [picture, label] = row.children;
      const summary = /** @type {RecordingSummary} */ (this.#summaries.get(key));
      if (summary.picture) picture.replaceChildren(element("img", { src: summary.picture, alt: `events of ${name}` }));
      row.replaceChildren(picture, label, ...cells(summary));
    }
  }

  #choose(/** @type {string} */ name) {
    this.list.close();
    if (name !== this.#open) this.dispatchEvent(new CustomEvent("choose", { detail: name }));
  }

  // The recording that is open goes to the front; those of other folders of the machine are kept, too.
  #remember() {
    const root = /** @type {FolderListing} */ (this.#listing).root;
    const key = `${RECENT} ${root}`;
    /** @type {string[]} */
    const before = JSON.parse(localStorage.getItem(key) ?? "[]");
    const recent = [this.#open, ...before.filter((name) => name !== this.#open)].slice(0, MOST_RECENT);
    localStorage.setItem(key, JSON.stringify(recent));
    const chips = recent.slice(1).map((name) =>
      element("button.chip", { onclick: () => this.#choose(name), title: "Opened lately" }, name)
    );
    this.recent.replaceChildren(...chips);
  }

  #dropping() {
    const isFile = (/** @type {DragEvent} */ { dataTransfer }) => dataTransfer?.types.includes("Files");
    document.addEventListener("dragover", (event) => {
      if (!isFile(event)) return;
      event.preventDefault();
      document.body.classList.add("dropping");
    });
    document.addEventListener("dragleave", ({ relatedTarget }) => {
      if (relatedTarget === null) document.body.classList.remove("dropping");
    });
    document.addEventListener("drop", (event) => {
      document.body.classList.remove("dropping");
      if (!isFile(event)) return;
      event.preventDefault();
      attempt(() => this.#take([...(event.dataTransfer?.files ?? [])]));
    });
  }

  // The first of the files that is a recording is opened; the others may belong to it. What lies in the folder under
  // this name and size is opened there, and nothing copied.
  async #take(/** @type {File[]} */ files) {
    const { recordings } = await get("/api/folder", { folder: "" });
    const known = files.map(({ name, size }) =>
      recordings.find((one) => one.name === name && one.size_bytes === size)?.name
    );
    const there = known.find(Boolean);
    if (there) return this.#choose(there);
    const names = [];
    for (const file of files) {
      const note = notice(`Copying ${file.name}, ${(file.size / 1e6).toFixed(1)} MB ...`, "info", 0);
      try {
        names.push((await upload(file)).name);
      } finally {
        note.remove();
      }
    }
    const { recordings: after } = await get("/api/folder", { folder: "" });
    const taken = names.find((name) => after.some((one) => one.name === name));
    if (!taken) throw new Refused(400, `${files.map(({ name }) => name).join(", ")}: no recording that can be read`);
    this.#choose(taken);
  }
}

function cells(/** @type {RecordingSummary} */ { events, duration_us, shots, spin, error }) {
  if (error) return [element("td.error", { colSpan: 4 }, error)];
  const texts = [
    events?.toLocaleString("en"),
    milliseconds((duration_us ?? 0) / 1000),
    shots ?? "open it: long",
    spin ?? "",
  ];
  return texts.map((text) => element("td", {}, String(text)));
}
