// Entries of the glossary in a dialog.

import { dialogTitle, element } from "./elements.js";

/** @type {Promise<Map<string, string>> | null} */
let loading = null;

/**
 * Definitions by term.
 * @returns {Promise<Map<string, string>>}
 */
function glossary() {
  loading ??= (async () => entries(await (await fetch("/static/glossary.md")).text()))();
  return loading;
}

// A term stands at the start of its line, its definition is indented below it; roles and links are for the printed one.
function entries(/** @type {string} */ text) {
  /** @type {Map<string, string>} */
  const found = new Map();
  for (const [, term, definition] of text.matchAll(/^(\S.*)\n((?: {2}.*\n?)+)/gm)) {
    const plain = definition
      .replaceAll(/\{term\}`([^`<]*?)\s*(?:<[^>]*>)?`/g, "$1")
      .replaceAll(/\[([^\]]*)\]\([^)]*\)/g, "$1")
      .replaceAll("`", "")
      .replaceAll(/\s+/g, " ");
    found.set(term.trim(), plain.trim());
  }
  return found;
}

/**
 * Shows what a group of settings does.
 * @param {string} title
 * @param {string | undefined} help one sentence
 * @param {string[]} terms
 */
export async function explain(title, help, terms) {
  const known = await glossary();
  const list = terms.flatMap((term) => [element("dt", {}, term), element("dd", {}, known.get(term) ?? "")]);
  const close = element("button", { onclick: () => dialog.close() }, "Close");
  const parts = [dialogTitle(title), help ? element("p", {}, help) : null, element("dl", {}, ...list), close];
  const dialog = element("dialog.glossary", { "aria-label": title, onclose: () => dialog.remove() }, ...parts);
  document.body.append(dialog);
  dialog.showModal();
}
