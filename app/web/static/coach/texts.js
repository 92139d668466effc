// Texts, numbers and units in the language and units that were chosen; both are remembered by the browser.

/** @import { CoachShot } from "../messages.d.ts" */

import { element } from "../elements.js";

/** @type {Record<string, Record<string, string>>} */
let table = {};

/** @param {string} name @param {string} usual @param {string[]} allowed */
function remembered(name, usual, allowed) {
  const kept = localStorage.getItem(`spinscope.coach.${name}`);
  return kept !== null && allowed.includes(kept) ? kept : usual;
}

export const chosen = {
  language: remembered("language", navigator.language.startsWith("de") ? "de" : "en", ["en", "de"]),
  spin: remembered("spin", "rps", ["rps", "rpm"]),
  speed: remembered("speed", "km_h", ["km_h", "m_s"]),
};

/** @param {"language" | "spin" | "speed"} name @param {string} value */
export function choose(name, value) {
  chosen[name] = value;
  localStorage.setItem(`spinscope.coach.${name}`, value);
  document.documentElement.lang = chosen.language;
}

export async function loadTexts() {
  table = await (await fetch("/api/coach/texts")).json();
  document.documentElement.lang = chosen.language;
}

/** The text of a key, with {name} replaced. @param {string} key @param {Record<string, any>} values */
export function text(key, values = {}) {
  const found = table[chosen.language][key] ?? key;
  return found.replace(/\{(\w+)\}/g, (_, name) => String(values[name] ?? ""));
}

export const hasText = (/** @type {string} */ key) => key in table[chosen.language];

/** A word with its explanation on hover, focus and touch. @param {string} key @param {string} [about] */
export function term(key, about = key) {
  const explanation = text(`about.${about}`);
  const open = (/** @type {any} */ event) => {
    event.stopPropagation();
    const shown = made.classList.contains("open");
    for (const other of document.querySelectorAll(".term.open")) other.classList.remove("open");
    made.classList.toggle("open", !shown);
  };
  const made = element(
    "span.term",
    { tabIndex: 0, role: "button", "aria-label": `${text(key)}: ${explanation}`, onclick: open },
    text(key),
    element("span.about", { "aria-hidden": "true" }, explanation),
  );
  made.addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => event.key === "Enter" && open(event));
  return made;
}

/** @type {Map<string, any>} making a formatter takes longer than drawing a row of the list */
const formatters = new Map();

/** @template T @param {string} key @param {(language: string) => T} make @returns {T} */
function formatter(key, make) {
  const whole = `${chosen.language} ${key}`;
  if (!formatters.has(whole)) formatters.set(whole, make(chosen.language));
  return formatters.get(whole);
}

/** @param {number} value @param {number} digits */
export const decimal = (value, digits = 0) =>
  formatter(
    `number ${digits}`,
    (language) => new Intl.NumberFormat(language, { minimumFractionDigits: digits, maximumFractionDigits: digits }),
  ).format(value);

export const inSpinUnit = (/** @type {number} */ rps) => (chosen.spin === "rpm" ? 60 * rps : rps);
export const inSpeedUnit = (/** @type {number} */ m_s) => (chosen.speed === "km_h" ? 3.6 * m_s : m_s);

/** @param {number | null} rps */
export const spinNumber = (rps) => rps === null ? "–" : decimal(inSpinUnit(rps));

/** @param {number | null} rps */
export const spinWords = (rps) => rps === null ? "–" : `${spinNumber(rps)} ${text(chosen.spin)}`;

/** @param {number | null} m_s */
export const speedWords = (m_s) =>
  m_s === null ? "–" : `${decimal(inSpeedUnit(m_s), chosen.speed === "km_h" ? 0 : 1)} ${text(chosen.speed)}`;

/** The kind with what else is in it: "topspin with some right sidespin". @param {string[]} kind */
export function kindWords(kind) {
  const words = (/** @type {string} */ code) => code.split(" ").map((part) => text(part)).join(" ");
  const [main, second, third] = kind;
  if (!third) return [main, second].filter(Boolean).map(words).join(" ");
  // "with some right corkscrew and topspin": the last two as one addition
  return `${words(main)} ${words(second)} ${text("and")} ${text(third.split(" ")[1])}`;
}

/** Main component of a shot's kind; null where the spin is not seen. @param {CoachShot} shot */
export const mainKind = (shot) => shot.kind[0] ?? null;

/** @param {CoachShot} shot */
export const capitalized = (shot) => {
  const words = kindWords(shot.kind);
  return words.charAt(0).toUpperCase() + words.slice(1);
};

/** What is said of a shot's spin beside its number. @param {CoachShot} shot */
export function toldBy(shot) {
  const key = shot.told_by && shot.told_by !== "logo" ? `from_${shot.told_by}` : null;
  return key && element("span.told", {}, term(key));
}

/** Language and units, for what the server writes. */
export const wordsQuery = () => `language=${chosen.language}&spin_unit=${chosen.spin}&speed_unit=${chosen.speed}`;

/** @type {Record<string, Intl.DateTimeFormatOptions>} */
const TIMES = {
  time: { hour: "2-digit", minute: "2-digit", second: "2-digit" },
  "day and time": { day: "numeric", month: "short", hour: "2-digit", minute: "2-digit" },
  day: { year: "numeric", month: "short", day: "numeric" },
};

/** @param {CoachShot} shot @param {string} what */
const dateWords = (shot, what) =>
  formatter(what, (language) => new Intl.DateTimeFormat(language, TIMES[what])).format(1000 * shot.recorded_s);

/** Time of day, or with the day. @param {CoachShot} shot */
export const timeWords = (shot, withDay = false) => dateWords(shot, withDay ? "day and time" : "time");

/** @param {CoachShot} shot */
export const dayOf = (shot) => dateWords(shot, "day");
