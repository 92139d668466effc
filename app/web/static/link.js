// The page's address: recording, preset, what differs from how it was opened, biases, clip, shot, playhead and tab.

import { notice } from "./elements.js";

/** @import { Opening } from "./messages.d.ts" */
/** @import { Settings, Values } from "./settings.js" */

/**
 * @typedef {object} Linked
 * @property {{recording: string}} connection
 * @property {Settings} settings
 * @property {{playhead_us: number | null, front: string | null}} viewer
 * @property {{followed: number | null}} runner
 * @property {Opening} opening
 * @property {{values: Record<string, number>} | null} biases
 */

const OF_THE_VIEW = ["t", "tab", "shot"]; // what changes without a step in the browser's history

export function linkOf(/** @type {Linked} */ { connection, settings, viewer, runner, opening, biases }) {
  const words = new URLSearchParams();
  words.set("recording", connection.recording);
  if (settings.preset.name !== "opened") words.set("preset", settings.preset.name);
  for (const text of assignments(settings.parameters, opening.presets.opened)) words.append("set", text);
  if (settings.pinned) {
    words.set("pinned", "1");
    for (const text of assignments(settings.pinned, opening.presets.opened)) words.append("a", text);
  }
  if (String(settings.clip) !== String(opening.recording.clip_us)) words.set("clip", settings.clip.join("-"));
  if (runner.followed !== null) words.set("shot", String(runner.followed));
  const time = viewer.playhead_us;
  if (time !== null) words.set("t", String(Math.round(time)));
  const changed = Object.entries(biases?.values ?? {}).filter(([name, value]) => value !== opening.biases.values[name]);
  for (const [name, value] of changed) words.append("bias", `${name}:${value}`);
  if (viewer.front !== null) words.set("tab", viewer.front);
  return `#${words}`;
}

/**
 * The part of a link that the browser's way back leads through: settings, clip and recording.
 * @param {string} hash
 */
export function settingsOf(hash) {
  const words = new URLSearchParams(hash.slice(1));
  for (const name of OF_THE_VIEW) words.delete(name);
  return words.toString();
}

/**
 * The link to another recording in the same tab, with some settings.
 * @param {Linked} app
 * @param {string} recording
 * @param {string[]} carried assignments
 */
export function linkTo({ settings, viewer }, recording, carried) {
  const words = new URLSearchParams({ recording });
  if (carried.length && settings.preset.name !== "opened") words.set("preset", settings.preset.name);
  for (const text of carried) words.append("set", text);
  if (viewer.front !== null) words.set("tab", viewer.front);
  return `#${words}`;
}

/**
 * Assignments of the settings that differ from how the recording was opened, without its set-up.
 * @param {Linked} app
 */
export function carriedSettings({ settings, opening }) {
  const controls = opening.sections.flatMap((section) => section.controls);
  const setup = new Set(controls.filter(({ is_setup }) => is_setup).map(({ name }) => name));
  return assignments(settings.parameters, opening.presets.opened).filter((text) => !setup.has(text.split("=")[0]));
}

export function linked() {
  const words = new URLSearchParams(location.hash.slice(1));
  const clip = (words.get("clip") ?? "").match(/^(-?\d+)-(-?\d+)$/);
  const time = (words.get("t") ?? "").match(/^-?\d+$/);
  const biases = words.getAll("bias").map((text) => text.split(":"));
  return {
    recording: words.get("recording"),
    clip: clip && /** @type {[number, number]} */ ([Number(clip[1]), Number(clip[2])]),
    time_us: time && Number(time[0]),
    tab: words.get("tab"),
    preset: words.get("preset") ?? "opened",
    followed: Number(words.get("shot")) || null,
    biases: Object.fromEntries(biases.map(([name, value]) => [name, Number(value)])),
    parameters: (/** @type {Opening} */ opening) => applied(opening, words.getAll("set")),
    pinned: (/** @type {Opening} */ opening) => (words.get("pinned") ? applied(opening, words.getAll("a")) : null),
  };
}

function assignments(/** @type {Values} */ values, /** @type {Values} */ others) {
  return Object.entries(values).flatMap(([group, fields]) =>
    Object.entries(fields)
      .filter(([name, value]) => JSON.stringify(value) !== JSON.stringify(others[group][name]))
      .map(([name, value]) => `${group}.${name}=${JSON.stringify(value)}`)
  );
}

function applied(/** @type {Opening} */ { presets, renamed }, /** @type {string[]} */ texts) {
  const values = structuredClone(presets.opened);
  for (const text of texts) {
    const [, given, value] = text.match(/^(\w+\.\w+)=(.*)$/) ?? [];
    if (given in renamed) notice(`${given} is now called ${renamed[given]}`, "info", 12);
    const [group, name] = (renamed[given] ?? given ?? "").split(".");
    if (!Object.hasOwn(values, group) || !Object.hasOwn(values[group], name)) {
      notice(`The address sets ${text.slice(0, 80)}, which is no setting: it is left out.`, "warning");
      continue;
    }
    try {
      values[group][name] = JSON.parse(value);
    } catch {
      notice(`The address sets ${text.slice(0, 80)}, which is no value: it is left out.`, "warning");
    }
  }
  return values;
}
