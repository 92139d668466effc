// The Save menu: results, pictures, links, presets.

import { byId, download, element, notice } from "./elements.js";
import { linkOf } from "./link.js";
import { post } from "./server.js";

export class Saving {
  constructor(app) {
    this.app = app;
    this.file = element("input", { type: "file", accept: ".toml", hidden: true, onchange: () => this.#load() });
    const menu = byId("save");
    const entries = [
      ["Recording with layout (.rrd)", () => this.#fetch("run.rrd")],
      ["Results (JSON)", () => this.#fetch("results.json")],
      ["Spin of every method (CSV)", () => this.#fetch("spins.csv")],
      ["Track (CSV)", () => this.#fetch("track.csv")],
      ["Picture of the view (PNG)", () => this.#picture()],
      ["Copy the link to this view", () => this.#copyLink()],
      ["Copy as command line", () => this.#copyCommand()],
      ["Save as preset (TOML)", () => this.#savePreset()],
      ["Load a preset (TOML)", () => this.file.click()],
    ];
    const act = (work) => async () => {
      menu.open = false;
      try {
        await work();
      } catch (error) {
        notice(error.message);
      }
    };
    menu.querySelector(".items").append(...entries.map(([name, work]) => element("button", { onclick: act(work) }, name)), this.file);
    document.addEventListener("pointerdown", (event) => menu.contains(event.target) || (menu.open = false));
  }

  #fetch(name) {
    element("a", { href: this.app.connection.path(`export/${name}`), download: "" }).click();
  }

  async #picture() {
    const blob = await this.app.viewer.picture();
    download(`${this.app.connection.recording.replace(/\.\w+$/, "")}.png`, blob, "image/png");
  }

  async #copyLink() {
    await copied(new URL(await linkOf(this.app, true), location.href).toString(), "The link");
  }

  async #copyCommand() {
    const { command, needs } = await this.#written();
    await copied(command, "The command");
    if (needs) notice(`It needs the biases as ${needs} beside it: Biases, Save .bias.`, "info", 12);
  }

  async #savePreset() {
    const { toml } = await this.#written();
    download("spinscope.toml", toml, "application/toml");
  }

  #written() {
    const { connection, settings } = this.app;
    const [start_us, end_us] = settings.clip;
    return post(connection.path("presets/write"), { parameters: settings.parameters, start_us, end_us });
  }

  async #load() {
    const [file] = this.file.files;
    if (!file) return;
    const { connection, settings, opening } = this.app;
    const { parameters } = await post(connection.path("presets/read"), { text: await file.text() }).catch((error) => {
      notice(error.message);
      return {};
    });
    this.file.value = "";
    if (!parameters) return;
    const plain = file.name.replace(/\.toml$/, "");
    const name = this.app.builtIn.includes(plain) ? file.name : plain;
    opening.presets[name] = parameters;
    const list = byId("preset");
    if (![...list.options].some(({ value }) => value === name)) list.append(element("option", { value: name }, name));
    list.value = name;
    settings.takePreset(name, parameters);
  }
}

async function copied(text, what) {
  try {
    await navigator.clipboard.writeText(text);
    notice(`${what} is in the clipboard.`, "info", 3);
  } catch {
    notice(text, "info", 30);
  }
}
