// Sliders, number boxes, switches and choices, made from the parameters' declarations.

/** @import { Choice, ControlInfo, SectionInfo } from "./messages.d.ts" */
/** @import { Settings } from "./settings.js" */

import { attempt, element, notice } from "./elements.js";
import { explain } from "./glossary.js";

const STEPS = 1000; // positions of a slider over its whole range

// Where a value lies on a slider (0..1), and back.
/** @type {Record<string, [(v: number, low: number, high: number) => number, (p: number, low: number, high: number) => number]>} */
const SCALES = {
  linear: [(v, low, high) => (v - low) / (high - low), (p, low, high) => low + p * (high - low)],
  logarithmic: [
    (v, low, high) => Math.log(v / low) / Math.log(high / low),
    (p, low, high) => low * Math.pow(high / low, p),
  ],
  cubic: [(v, low, high) => Math.cbrt((v - low) / (high - low)), (p, low, high) => low + p ** 3 * (high - low)],
};

export class Controls {
  /** @type {Map<string, Control>} */
  controls = new Map();
  /** @type {{made: any, mark: any, names: string[]}[]} */
  sections = [];
  /** @type {any[] | null} sections that were open before the search */
  #open = null;
  #told = "none yet"; // what differs from the preset, as it is shown

  /**
   * @param {any} parent
   * @param {{sections: SectionInfo[], stages: Choice[]}} opening
   * @param {Settings} settings
   */
  constructor(parent, { sections, stages }, settings) {
    this.settings = settings;
    this.help = new Map(stages.map(({ label, help }) => [label, help]));
    const search = { type: "search", id: "search", placeholder: "Search settings", "aria-label": "Search settings" };
    this.search = element("input", { ...search, oninput: () => this.#find() });
    this.changed = element("div", {
      id: "changed",
      role: "group",
      "aria-label": "Settings that differ from the preset",
    });
    parent.append(this.search, ...sections.map((section) => this.#section(section)), this.changed);
    settings.onChange(() => this.refresh());
    this.refresh();
  }

  // Nothing of the page is touched that stays as it is: a slider that is dragged has this done with every move.
  refresh() {
    for (const control of this.controls.values()) control.refresh();
    const changed = [...this.controls.values()].filter(({ isChanged }) => isChanged);
    const told = changed.map(({ name, value, before }) => `${name} ${value} ${before}`).join();
    if (told === this.#told) return;
    this.#told = told;
    for (const { mark, names } of this.sections) {
      const count = changed.filter(({ name }) => names.includes(name)).length;
      mark.textContent = count ? `${count} changed` : "";
    }
    this.changed.replaceChildren(...changed.map((control) => this.#difference(control)));
    this.changed.hidden = !changed.length;
  }

  #difference(/** @type {Control} */ control) {
    const { name, value, before } = control;
    const title = `${name} is ${value}, ${before} in the preset: click to see its control`;
    return element("button.chip", { title, onclick: () => this.#reveal(control) }, `${name} = ${value}`);
  }

  #reveal(/** @type {Control} */ { row, box }) {
    this.search.value = "";
    this.#find();
    row.closest("details").open = true;
    row.scrollIntoView({ block: "center" });
    box.focus();
  }

  // Shows the controls in whose name, label or help every word occurs, unfolded; without words, all as they were.
  #find() {
    /** @type {string[]} */
    const words = this.search.value.toLowerCase().split(/\s+/).filter(Boolean);
    if (words.length) this.#open ??= this.sections.filter(({ made }) => made.open);
    for (const section of this.sections) {
      let found = 0;
      for (const name of section.names) {
        const { row, text } = /** @type {Control} */ (this.controls.get(name));
        row.hidden = !words.every((word) => text.includes(word));
        if (!row.hidden) found += 1;
      }
      section.made.hidden = found === 0;
      if (words.length) section.made.open = found > 0;
      else if (this.#open) section.made.open = this.#open.includes(section);
    }
    if (!words.length) this.#open = null;
  }

  // Upper ends that make sense for the ball that is seen; what is typed may go beyond, up to what is allowed.
  take(/** @type {Record<string, number>} */ highs) {
    for (const [name, high] of Object.entries(highs)) this.controls.get(name)?.limit(high);
  }

  #section(/** @type {SectionInfo} */ { title, terms, is_open, controls }) {
    const mark = element("span.mark");
    const body = element("div.body");
    const onclick = () => attempt(() => explain(title, this.help.get(title), terms));
    const help = element("button.help", { onclick, title: "What this is", "aria-label": `What ${title} is` }, "?");
    const made = element("details.section", { open: is_open }, element("summary", {}, title, mark), help, body);
    made.dataset.title = title;
    for (const description of controls) {
      const control = new Control(description, this.settings);
      this.controls.set(description.name, control);
      body.append(control.row);
    }
    this.sections.push({ made, mark, names: controls.map(({ name }) => name) });
    return made;
  }
}

class Control {
  /** @type {any} */
  box = null;
  /** @type {any} */
  slider = null;
  dragging = false;
  stepping = false;
  isChanged = false; // against the preset
  #shown = ""; // value, preset and range as they are shown

  constructor(/** @type {ControlInfo} */ info, /** @type {Settings} */ settings) {
    this.info = info;
    this.name = info.name;
    this.kind = info.kind;
    this.scale = info.scale;
    this.low = info.low ?? -Infinity;
    this.high = info.high ?? Infinity;
    this.top = this.high; // upper end of the slider
    this.step = info.step ?? 1;
    this.settings = settings;
    const { allowed, unit, help, label: text } = info;
    const range = allowed ? `\nAllowed: ${allowed}.` : "";
    const start = `\nDefault: ${this.#text(info.default) || "none"}${unit ? ` ${unit}` : ""}.`;
    this.text = `${this.name} ${text} ${help}`.toLowerCase();
    this.title = `${this.name}\n${help}.${range}${start}`;
    this.reset = element("button.reset", {
      title: "Back to the preset's value",
      onclick: () => this.#put(this.settings.presetValue(this.name)),
    }, "↺");
    const id = `p-${this.name}`;
    const label = element("label", { htmlFor: id }, text);
    this.row = element("div.control", { title: this.title }, label, ...this.#inputs(id), this.reset);
    this.row.dataset.name = this.name;
  }

  limit(/** @type {number} */ high) {
    this.top = Math.min(Math.max(high, this.low + this.step), this.high);
    this.refresh();
  }

  get value() {
    return this.#withUnit(this.settings.get(this.name));
  }

  get before() {
    return this.#withUnit(this.settings.presetValue(this.name));
  }

  #withUnit(/** @type {any} */ value) {
    return `${this.#text(value) || "auto"} ${this.info.unit}`.trim();
  }

  refresh(isForced = false) {
    const value = this.settings.get(this.name);
    const [own, preset] = [value, this.settings.presetValue(this.name)].map((one) => JSON.stringify(one));
    const shown = `${own} ${preset} ${this.top}`;
    if (shown === this.#shown && !isForced) return;
    // What is in somebody's hands is drawn when it is let go of.
    this.#shown = this.dragging || document.activeElement === this.box ? "" : shown;
    this.isChanged = own !== preset;
    this.row.classList.toggle("differs", this.isChanged);
    if (this.kind === "switch") this.box.checked = value;
    else if (document.activeElement !== this.box || this.kind === "choice") this.box.value = this.#text(value);
    if (this.slider && !this.dragging) {
      const known = value ?? this.low;
      this.slider.value = Math.round(STEPS * SCALES[this.scale][0](known, this.low, this.top));
      this.slider.classList.toggle("unset", value === null);
    }
    if (this.slider) this.slider.setAttribute("aria-valuetext", `${this.#text(value)} ${this.info.unit}`);
  }

  #inputs(/** @type {string} */ id) {
    const label = `${this.name}${this.info.unit ? ` in ${this.info.unit}` : ""}`;
    if (this.kind === "switch") {
      this.box = element("input", { type: "checkbox", id, onchange: () => this.#put(this.box.checked) });
      return [element("span.wide", {}, this.box)];
    }
    if (this.kind === "choice") {
      const options = this.info.choices.map((choice) => element("option", { value: choice }, choice));
      this.box = element("select.wide", { id, onchange: () => this.#put(this.box.value) }, ...options);
      return [this.box];
    }
    const typed = { type: "text", inputMode: "decimal", autocomplete: "off", spellcheck: false };
    this.box = element("input.number", { ...typed, id, placeholder: "auto", "aria-label": label });
    this.box.addEventListener("change", () => this.#typed());
    this.box.addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => this.#keys(event));
    this.box.addEventListener("keyup", () => this.#stepped());
    this.box.addEventListener("blur", () => {
      this.#stepped();
      this.refresh(true);
    });
    const unit = element("span.unit", {}, this.info.unit);
    if (this.scale === "none") {
      this.box.classList.add("long");
      return [this.box, unit];
    }
    this.slider = element("input", { type: "range", min: 0, max: STEPS, step: 1, "aria-label": label });
    this.slider.addEventListener("input", () => this.#dragged());
    this.slider.addEventListener("change", () => this.#released());
    this.slider.addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => this.#keys(event));
    for (const end of ["keyup", "blur"]) this.slider.addEventListener(end, () => this.#stepped());
    return [this.slider, this.box, unit];
  }

  #dragged() {
    this.dragging = true;
    const value = this.#rounded(SCALES[this.scale][1](this.slider.value / STEPS, this.low, this.top));
    this.box.value = this.#text(value);
    this.settings.set(this.name, value, false);
  }

  #released() {
    this.dragging = false;
    this.settings.settle();
  }

  #typed() {
    const text = this.box.value.trim().replace(",", this.kind === "numbers" ? "," : ".");
    if (this.info.optional && ["", "auto", "none"].includes(text)) return this.#put(null);
    const numbers = text.split(/[\s,]+/).map(Number);
    const value = this.kind === "numbers" ? numbers : numbers[0];
    const wrong = numbers.some((/** @type {number} */ n) => !Number.isFinite(n) || n < this.low || n > this.high);
    const whole = this.kind !== "whole number" || Number.isInteger(value);
    if (text === "" || wrong || !whole || (this.kind !== "numbers" && numbers.length > 1)) {
      notice(`${this.name} = ${text || "nothing"} is not possible: ${this.info.allowed}${whole ? "" : ", whole"}`);
      this.box.blur();
      return this.refresh(true);
    }
    return this.#put(value);
  }

  // Arrows go by the parameter's step, Page keys by ten of them, Home and End to the ends.
  #keys(/** @type {KeyboardEvent} */ event) {
    /** @type {Record<string, number>} */
    const steps = { ArrowUp: 1, ArrowDown: -1, PageUp: 10, PageDown: -10, ArrowRight: 1, ArrowLeft: -1 };
    const inBox = event.target === this.box;
    if (inBox && ["ArrowLeft", "ArrowRight", "Home", "End"].includes(event.key)) return;
    if (this.kind === "numbers" || event.ctrlKey || event.metaKey || event.altKey) return;
    const high = inBox ? this.high : this.top;
    /** @type {number | null} */
    let value = null;
    if (event.key in steps) value = (this.settings.get(this.name) ?? this.low) + steps[event.key] * this.step;
    else if (event.key === "Home") value = this.low;
    else if (event.key === "End") value = high;
    if (value === null) return;
    event.preventDefault();
    value = Math.min(Math.max(value, this.low), high);
    value = Number(value.toPrecision(12));
    // A key that is held down moves on like a drag.
    this.stepping = true;
    this.box.value = this.#text(value);
    this.settings.set(this.name, value, false);
  }

  #stepped() {
    if (!this.stepping) return;
    this.stepping = false;
    this.settings.settle();
  }

  #put(/** @type {any} */ value) {
    this.settings.set(this.name, value);
    if (this.box.type === "text") this.box.value = this.#text(value);
  }

  // A dragged value: a multiple of the step, or where that would be too coarse three digits.
  #rounded(/** @type {number} */ value) {
    const step = this.step;
    let rounded = Math.round(value / step) * step;
    if (Math.abs(value) < 5 * step && this.kind !== "whole number") rounded = Number(value.toPrecision(2));
    if (this.kind === "whole number") rounded = Math.round(Math.abs(value) < 5 * step ? value : rounded);
    return Math.min(Math.max(Number(rounded.toPrecision(12)), this.low), this.high);
  }

  #text(/** @type {any} */ value) {
    if (value === null || value === undefined) return "";
    return Array.isArray(value) ? value.join(", ") : String(value);
  }
}
