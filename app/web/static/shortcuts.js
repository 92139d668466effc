// What the keys of the page do.

/** @import { Key } from "./keyboard.js" */
/** @import { Opening } from "./messages.d.ts" */
/** @import { Live } from "./live.js" */
/** @import { Overview } from "./overview.js" */
/** @import { Settings } from "./settings.js" */
/** @import { Viewer } from "./viewer.js" */

import { byId } from "./elements.js";

/**
 * @param {{viewer: Viewer, overview: Overview, settings: Settings, opening: Opening, live: Live | undefined}} app
 * @param {boolean} hasTools
 * @returns {Key[]}
 */
export function shortcuts({ viewer, overview, settings, opening, live }, hasTools) {
  const moves = true;
  const tick_us = () => settings.get("track.tick_us");
  const seek = (/** @type {number} */ time_us) => {
    const [start_us, end_us] = settings.clip;
    return viewer.seek(Math.min(Math.max(time_us, start_us), end_us));
  };
  const step = (/** @type {number} */ ticks) => seek((viewer.playhead_us ?? overview.playhead_us) + ticks * tick_us());
  const tabs = opening.tabs.slice(0, 9).map(({ label }, index) => ({
    keys: [String(index + 1)],
    shown: String(index + 1),
    label: `Tab ${label}`,
    act: () => viewer.bringToFront(label),
  }));
  const viewing = [
    { keys: [" "], shown: "Space", label: "Play, pause", moves, act: () => viewer.toggle() },
    { keys: ["ArrowLeft"], shown: "←", label: "One tick back", moves, act: () => step(-1) },
    { keys: ["ArrowRight"], shown: "→", label: "One tick on", moves, act: () => step(1) },
    { keys: ["PageUp"], shown: "Page↑", label: "Previous shot", moves, act: () => overview.goToShot(-1) },
    { keys: ["PageDown"], shown: "Page↓", label: "Next shot", moves, act: () => overview.goToShot(1) },
    { keys: ["Home"], shown: "Home", label: "Start of the clip", moves, act: () => seek(-Infinity) },
    { keys: ["End"], shown: "End", label: "End of the clip", moves, act: () => seek(Infinity) },
    ...tabs,
    { keys: ["f"], shown: "f", label: "Full screen of the viewer, and back", act: fullScreen },
  ];
  const press = (/** @type {string} */ id) => () => byId(id).click();
  const openMenu = (/** @type {string} */ id) => () => {
    byId(id).open = true;
    byId(id).querySelector(".items button").focus();
  };
  const tools = [
    { keys: ["a"], shown: "a", label: "Pin the present settings as A", act: press("pin") },
    { keys: ["z", "Ctrl+z"], shown: "z, Ctrl+Z", label: "Undo", act: () => settings.undo() },
    { keys: ["Z", "Ctrl+Z", "Ctrl+y"], shown: "Shift+Z, Ctrl+Y", label: "Redo", act: () => settings.redo() },
    { keys: ["s"], shown: "s", label: "Save", act: openMenu("save") },
    { keys: ["o"], shown: "o", label: "Open another recording", act: press("recording") },
    { keys: ["["], shown: "[", label: "Show or fold the settings", act: press("fold-controls") },
    { keys: ["]"], shown: "]", label: "Show or fold the results and tools", act: press("fold-side") },
    { keys: ["/"], shown: "/", label: "Search the settings", act: () => byId("search").focus() },
  ];
  const recording = live
    ? [
      { keys: ["r"], shown: "r", label: "Record the camera, and end the recording", act: () => live.toggleRecording() },
      { keys: ["m"], shown: "m", label: "Mark this moment in the recording", act: () => live.beginMarker() },
    ]
    : [];
  return [...viewing, ...(hasTools ? [...tools, ...recording] : [])];
}

function fullScreen() {
  if (document.fullscreenElement) document.exitFullscreen();
  else document.documentElement.requestFullscreen?.().catch(() => {});
}
