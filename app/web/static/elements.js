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

const MOST_NOTICES = 5; // beyond them the oldest make room; the list of notices has them all

/**
 * Tells something: an error or a warning until it is closed, news for some seconds. Event of the document: `notice`.
 * @param {string} text
 * @param {"error" | "warning" | "info"} kind
 * @param {number} seconds 0 for as long as nobody closes it
 */
export function notice(text, kind = "error", seconds = kind === "info" ? 8 : 0) {
  const close = () => made.remove();
  const button = element("button", { "aria-label": "Close", onclick: close }, "×");
  const made = element(
    `div.notice.${kind}`,
    { title: "Click to close", onclick: close },
    element("span", {}, text),
    button,
  );
  const list = byId("notices");
  for (const other of [...list.children]) if (other.firstChild.textContent === text) other.remove();
  list.append(made);
  while (list.children.length > MOST_NOTICES) list.firstChild.remove();
  if (seconds) setTimeout(close, 1000 * seconds);
  document.dispatchEvent(new CustomEvent("notice", { detail: { text, kind } }));
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

// The title of a dialog that may be longer than the page: the focus goes there, not to the button at its end.
export const dialogTitle = (/** @type {string} */ text, properties = {}) =>
  element("h2", { ...properties, tabIndex: -1, autofocus: true }, text);

/**
 * Asks a question with some answers; null where it is closed without one.
 * @param {string} question
 * @param {Record<string, string>} answers labels by what is returned
 * @returns {Promise<string | null>}
 */
export function ask(question, answers) {
  const buttons = Object.entries(answers).map(([value, label]) => element("button", { value }, label));
  const form = element("form", { method: "dialog" }, element("p", {}, question), element("div.row", {}, ...buttons));
  const dialog = element("dialog.ask", { "aria-label": "Question" }, form);
  document.body.append(dialog);
  dialog.showModal();
  return new Promise((resolve) =>
    dialog.addEventListener("close", () => {
      dialog.remove();
      resolve(dialog.returnValue || null);
    })
  );
}

export const pause = (/** @type {number} */ ms) => new Promise((resolve) => setTimeout(resolve, ms));

export function download(/** @type {string} */ name, /** @type {BlobPart} */ content, /** @type {string} */ type) {
  const url = URL.createObjectURL(new Blob([content], { type }));
  element("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}
