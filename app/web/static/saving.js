// The Save menu: results, pictures, links, presets.

/** @import { Linked } from "./link.js" */

import { attempt, byId, download, element, notice } from "./elements.js";
import { linkOf } from "./link.js";
import { filmed } from "./video.js";

export class Saving {
  /**
   * @param {Linked & {connection: any, viewer: any, runner: any, overview: any}} app
   * @param {string[]} builtIn names of the presets that a file must not replace
   */
  constructor(app, builtIn) {
    this.app = app;
    this.builtIn = builtIn;
    const load = { type: "file", accept: ".toml", hidden: true, onchange: () => attempt(() => this.#load()) };
    this.file = element("input", load);
    const menu = byId("save");
    const exports = app.opening.exports.map((
      { name, label },
    ) => /** @type {const} */ ([label, () => this.#fetch(name)]));
    /** @type {(readonly [string, () => any])[]} */
    const entries = [
      ...exports,
      ["Picture of the view (PNG)", () => this.#picture()],
      ["Video of the view (MP4)", () => this.#video()],
      ["Copy the link to this view", () => this.#copyLink()],
      ["Copy as command line", () => this.#copyCommand()],
      ["Save as preset (TOML)", () => this.#savePreset()],
      ["Load a preset (TOML)", () => this.file.click()],
    ];
    const act = (/** @type {() => any} */ work) => () => {
      menu.open = false;
      return attempt(work);
    };
    const buttons = entries.map(([label, work]) => element("button", { onclick: act(work) }, label));
    menu.querySelector(".items").append(...buttons, this.file);
    document.addEventListener("pointerdown", (event) => menu.contains(event.target) || (menu.open = false));
  }

  #fetch(/** @type {string} */ name) {
    element("a", { href: this.app.connection.path(`export/${name}`), download: "" }).click();
  }

  async #picture() {
    download(this.#named("png"), await this.app.viewer.picture(), "image/png");
  }

  async #video() {
    const video = await filmed(this.app);
    if (video) download(this.#named("mp4"), video, "video/mp4");
  }

  #named(/** @type {string} */ suffix) {
    return `${this.app.connection.recording.replace(/\.\w+$/, "")}.${suffix}`;
  }

  async #copyLink() {
    await copied(new URL(linkOf(this.app), location.href).toString(), "The link");
  }

  async #copyCommand() {
    const { command, needs } = await this.#written();
    await copied(command, "The command");
    if (needs) notice(`It needs the biases as ${needs} beside it: Biases, Save .bias.`, "info", 0);
  }

  async #savePreset() {
    const { toml } = await this.#written();
    download("spinscope.toml", toml, "application/toml");
  }

  #written() {
    return this.app.connection.post("presets/write", this.app.settings.request);
  }

  async #load() {
    const [file] = this.file.files;
    if (!file) return;
    const { connection, settings, opening } = this.app;
    try {
      const { parameters, notices } = await connection.post("presets/read", { text: await file.text() });
      for (const text of notices) notice(text, "info", 12);
      const plain = file.name.replace(/\.toml$/, "");
      const name = this.builtIn.includes(plain) ? file.name : plain;
      opening.presets[name] = parameters;
      const list = byId("preset");
      if (![...list.options].some(({ value }) => value === name)) {
        list.append(element("option", { value: name }, name));
      }
      list.value = name;
      settings.takePreset(name, parameters);
    } finally {
      this.file.value = "";
    }
  }
}

async function copied(/** @type {string} */ text, /** @type {string} */ what) {
  try {
    await navigator.clipboard.writeText(text);
    notice(`${what} is in the clipboard.`, "info", 3);
  } catch {
    notice(text, "info", 30);
  }
}
