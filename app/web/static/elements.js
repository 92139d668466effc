// Making elements: element("div.name", {title: "..."}, child, "text").

/** @typedef {any} Child */

/**
 * @param {string} kind tag and classes
 * @param {Record<string, any>} properties
 * @param {...Child} children
 * @returns {any}
 */
export function element(kind, properties = {}, ...children) {
  const [tag, ...classes] = kind.split(".");
  /** @type {any} */
  const made = document.createElement(tag || "div");
  if (classes.length) made.className = classes.join(" ");
  for (const [name, value] of Object.entries(properties)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (name in made) made[name] = value;
    else made.setAttribute(name, value);
  }
  made.append(...children.flat().filter((child) => child !== null && child !== undefined && child !== false));
  return made;
}

/**
 * @param {string} id
 * @returns {any}
 */
export function byId(id) {
  return document.getElementById(id);
}

const SVG = "http://www.w3.org/2000/svg";

/**
 * @param {string} tag
 * @param {Record<string, any>} attributes
 * @param {...Child} children
 */
export function drawing(tag, attributes = {}, ...children) {
  const made = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, String(value));
  made.append(...children);
  return made;
}

/**
 * A number for people: as many digits as it needs, at most `digits` significant ones.
 * @param {any} value
 */
export function number(value, digits = 4) {
  if (value === null || value === undefined) return "–";
  if (typeof value !== "number") return String(value);
  if (Number.isInteger(value)) return value.toLocaleString("en");
  return String(Number(value.toPrecision(digits)));
}

export const milliseconds = (/** @type {number} */ ms) =>
  ms < 9.95 ? `${ms.toFixed(1)} ms` : ms < 999.5 ? `${ms.toFixed(0)} ms` : `${(ms / 1000).toFixed(1)} s`;

/**
 * @param {string} text
 * @param {"error" | "warning" | "info"} kind
 * @param {number} seconds 0 for as long as nobody closes it
 */
export function notice(text, kind = "error", seconds = 8) {
  const made = element(`div.notice.${kind}`, { title: "Click to close", onclick: () => made.remove() }, text);
  const list = byId("notices");
  for (const other of [...list.children]) if (other.textContent === text) other.remove();
  list.append(made);
  if (seconds) setTimeout(() => made.remove(), 1000 * seconds);
  return made;
}

/**
 * Does something and shows the error when it fails.
 * @param {() => any} work
 */
export async function attempt(work) {
  try {
    return await work();
  } catch (error) {
    notice(/** @type {Error} */ (error).message);
  }
}

export const pause = (/** @type {number} */ ms) => new Promise((resolve) => setTimeout(resolve, ms));

export function download(/** @type {string} */ name, /** @type {BlobPart} */ content, /** @type {string} */ type) {
  const url = URL.createObjectURL(new Blob([content], { type }));
  element("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}
