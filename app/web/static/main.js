// The page: opens a session on the server and connects settings, controls, viewer and tools. Without tools it is the
// viewer alone (`spinscope view`, or ?tools=off).

/** @import { Opening, RecordingDescription, RunMessage, RunMetrics } from "./messages.d.ts" */

import { Ball } from "./ball.js";
import { Bar } from "./bar.js";
import { Biases } from "./biases.js";
import { Coach } from "./coach.js";
import { Controls } from "./controls.js";
import { ask, byId, element, notice, pause } from "./elements.js";
import { Keyboard } from "./keyboard.js";
import { carriedSettings, linked, linkOf, linkTo, settingsOf } from "./link.js";
import { Labels } from "./labels.js";
import { Live } from "./live.js";
import { Notices } from "./notices.js";
import { Optimization } from "./optimization.js";
import { Overview } from "./overview.js";
import { startPanels } from "./panels.js";
import { Preview } from "./preview.js";
import { Recordings } from "./recordings.js";
import { Results } from "./results.js";
import { Saving } from "./saving.js";
import { Connection, get, Refused, RunRequests } from "./server.js";
import { Settings } from "./settings.js";
import { shortcuts } from "./shortcuts.js";
import { Sweep } from "./sweep.js";
import { Viewer } from "./viewer.js";

// The address always says what is seen: a reload, or the link in another browser, comes back to it.
// While a picture is waited for it is left alone, as browser and viewer both take notice of it.
const REMEMBER_MS = 300;
const REMEMBER_UNSEEN_MS = 3000;
// While the viewer loads, the browser has no time for anything else: the first preview goes before it, if it comes soon.
const PREVIEW_MS = 1000;

new Notices();
const connection = new Connection();
const settings = new Settings();
const viewer = new Viewer();
const link = linked();
/** @type {any} everything, for the tools and the tests */
const app = { connection, settings, viewer, biases: null };

async function start() {
  /** @type {Opening} */
  let opening;
  try {
    opening = await opened();
  } catch (error) {
    const refusal = error instanceof Refused && error.message;
    notice(refusal || "The server does not answer: is `spinscope` still running?");
    return;
  }
  app.opening = opening;
  const hasTools = opening.tools && new URLSearchParams(location.search).get("tools") !== "off";
  document.body.classList.toggle("viewing", !hasTools);
  document.body.classList.toggle("long", opening.recording.is_long);
  const { recording, presets } = opening;
  settings.start(snapshot(link));
  settings.fallback = { parameters: presets.opened, clip: recording.clip_us };
  app.runner = new RunRequests(connection, settings, viewer, { tab: link.tab ?? opening.tab, hasTools });
  app.runner.followed = link.followed ?? opening.followed;
  app.overview = new Overview(byId("overview"), recording);
  app.bar = new Bar(byId("bar"), opening.stages);
  const preview = new Preview(app);
  describe(recording);
  listen();
  if (hasTools) addTools(opening);
  new Keyboard(shortcuts(app, hasTools));
  const previewed = Promise.race([preview.first, pause(PREVIEW_MS)]);
  viewer.start(opening.viewer_version, byId("viewer"), previewed).catch((error) => {
    app.runner.isBlind = true; // the numbers and the preview are still there
    byId("viewer").replaceChildren(); // its own message
    const others = "`spinscope view --native` or `--save FILE.rrd` work without WebAssembly and WebGL";
    notice(`The viewer cannot run in this browser: ${error.message}; ${others}.`);
  });
  if (link.time_us !== null) viewer.place(link.time_us);
  if (hasTools && Object.keys(link.biases).length) app.biases.take(link.biases);
  app.runner.request(true);
}

// The settings of a link to the opened recording.
function snapshot(/** @type {ReturnType<typeof linked>} */ { parameters, pinned, clip, preset }) {
  const { presets, recording } = app.opening;
  const name = Object.hasOwn(presets, preset) ? preset : "opened";
  return {
    parameters: parameters(app.opening),
    pinned: pinned(app.opening),
    clip: clip ?? recording.clip_us,
    preset: { name, values: presets[name] },
  };
}

// Another link: pasted, or of the browser's way back. A recording that cannot be opened leaves the page as it is.
async function follow() {
  clearTimeout(later);
  remembered = null; // what comes is no new step
  const next = linked();
  if (next.recording !== null && next.recording !== connection.recording) {
    isLeaving = true;
    if (await isOpenable(next.recording)) return location.reload();
    isLeaving = false;
    return remember();
  }
  if (app.biases?.agrees(next.biases) === false) return location.reload();
  settings.restore(snapshot(next));
  if (next.tab !== null) viewer.bringToFront(next.tab);
  if (next.time_us !== null) viewer.place(next.time_us);
  app.runner.follow(next.followed ?? app.opening.followed);
}

async function isOpenable(/** @type {string} */ name) {
  const note = notice(`Opening ${name} ...`, "info", 0);
  try {
    await get("/api/openable", { name });
    return true;
  } catch (error) {
    notice(/** @type {Error} */ (error).message);
    return false;
  } finally {
    note.remove();
  }
}

// The recording of the link, or where that cannot be opened the one the program was started with.
async function opened() {
  try {
    return await connection.open(link.recording);
  } catch (error) {
    if (!(error instanceof Refused) || link.recording === null) throw error;
    notice(error.message);
    return connection.open(null);
  }
}

function describe(/** @type {RecordingDescription} */ recording) {
  document.title = `${recording.name} · Spinscope`;
  const seconds = (recording.end_us - recording.start_us) / 1e6;
  const length = seconds < 1 ? `${(1000 * seconds).toFixed(0)} ms` : `${seconds.toFixed(1)} s`;
  const size = `${recording.width_px} x ${recording.height_px}`;
  byId("about").textContent = `${recording.events.toLocaleString("en")} events, ${length}, ${size}`;
  byId("about").title = byId("about").textContent; // where it is cut
  for (const warning of recording.warnings) notice(warning, "warning");
}

function listen() {
  settings.onChange((settled) => {
    if (settled) rememberLater(REMEMBER_UNSEEN_MS);
    if (String(app.overview.clip) !== String(settings.clip)) app.overview.show(settings.clip, app.overview.shots);
  });
  app.runner.addEventListener("numbers", (/** @type {CustomEvent<RunMessage>} */ { detail }) => {
    const { state, metrics } = detail;
    app.bar.show(detail);
    document.body.dataset.state = state;
    byId("progress").textContent = app.bar.status.textContent;
    if (detail.error) notice(detail.error);
    if (["done", "failed"].includes(state)) {
      document.body.dataset.done = String(detail.serial);
      rememberLater(app.runner.isBlind ? REMEMBER_MS : REMEMBER_UNSEEN_MS);
    }
    if (metrics) {
      offerShots(metrics);
      app.controls?.take(detail.highs);
      app.sweep?.take(detail.highs);
    }
    if (metrics && !app.opening.recording.is_long) {
      app.overview.show(settings.clip, metrics.shots.map(({ start_us, end_us }) => [start_us, end_us]));
    }
  });
  app.runner.addEventListener("shown", (/** @type {CustomEvent<RunMessage>} */ { detail }) => {
    document.body.dataset.picture = detail.picture?.id;
    if (detail.state === "done") document.body.dataset.shown = String(detail.serial);
    rememberLater(REMEMBER_MS);
  });
  connection.on("shots", ({ share, shots, error }) => {
    if (error) notice(error);
    const found = shots.length ? `${shots.length} shots: click one` : "no shot found";
    app.overview.show(settings.clip, shots, share < 1 ? `searching for shots, ${Math.round(100 * share)} %` : found);
  });
  connection.addEventListener("lost", () => {
    app.bar.say("The server does not answer; trying again ...");
    document.body.classList.add("lost");
  });
  connection.addEventListener("outdated", () => {
    notice("The server was started anew: open the address that it prints.", "warning");
  });
  connection.addEventListener("back", () => {
    document.body.classList.remove("lost");
    notice("The server is back.", "info", 3);
    app.biases?.restore();
    app.runner.request(true);
  });
  const { overview } = app;
  overview.addEventListener("seek", (/** @type {CustomEvent} */ { detail }) => viewer.seek(detail));
  overview.addEventListener("choose", (/** @type {CustomEvent} */ { detail: [from, to] }) => chooseClip(from, to));
  overview.addEventListener("shot", (/** @type {CustomEvent} */ { detail: [from, to] }) => {
    const { margin_us } = app.opening.recording;
    chooseClip(from - margin_us, to + margin_us);
  });
  viewer.addEventListener("moved", (event) => overview.move(/** @type {CustomEvent} */ (event).detail));
  for (const kind of ["moved", "turned"]) viewer.addEventListener(kind, () => rememberLater(REMEMBER_MS));
  globalThis.addEventListener("pagehide", () => connection.close());
  globalThis.addEventListener("hashchange", follow);
}

// Where there are several shots: the ball that the detail views follow.
function offerShots(/** @type {RunMetrics} */ { shots }) {
  const ms = (/** @type {number} */ us) => (us / 1000).toFixed(0);
  const options = shots.map(({ start_us, end_us }, i) => {
    const span = `${ms(start_us)} to ${ms(end_us)} ms`;
    return element(
      "option",
      { value: i + 1, selected: app.runner.followed === i + 1 },
      `Follow shot ${i + 1}, ${span}`,
    );
  });
  const select = byId("follow");
  select.replaceChildren(element("option", { value: "" }, "Follow the first ball"), ...options);
  select.hidden = shots.length < 2;
  select.onchange = (/** @type {any} */ { target }) => app.runner.follow(Number(target.value) || null);
}

function addTools(/** @type {Opening} */ opening) {
  startPanels();
  const builtIn = Object.keys(opening.presets);
  const { recording, presets } = opening;
  app.recordings = new Recordings(recording.name);
  app.recordings.addEventListener("choose", (/** @type {CustomEvent} */ { detail }) => openOther(detail));
  const options = builtIn.map((name) => element("option", { value: name }, name === "opened" ? "as opened" : name));
  byId("preset").replaceChildren(...options);
  byId("preset").onchange = (/** @type {any} */ { target }) => settings.takePreset(target.value, presets[target.value]);
  if (opening.is_live) app.live = new Live(panel("Live camera", true), app);
  app.results = new Results(panel("Result", true), app);
  app.sweep = new Sweep(panel("Parameter sweep"), app);
  app.optimization = new Optimization(panel("Optimization"), app);
  app.ball = new Ball(panel("Fixed ball"), app);
  if (opening.has_labels) new Labels(panel("Labels", true), app);
  app.coach = new Coach(app);
  new Saving(app, builtIn);
  app.controls = new Controls(byId("controls"), opening, settings);
  // The paper tunes them, too: after the essential parameters, open where a slider simulates the scene again.
  const biases = panel("Biases", !opening.biases.locked);
  byId("controls").querySelector(".section").after(biases.parentElement);
  app.biases = new Biases(biases, app);
  app.runner.addEventListener("numbers", (/** @type {CustomEvent} */ { detail }) => app.results.show(detail));
  app.biases.addEventListener("taken", resimulated);
  /** @type {[string, () => void][]} */
  const buttons = [
    ["undo", () => settings.undo()],
    ["redo", () => settings.redo()],
    ["pin", () => settings.pin()],
    ["swap", () => settings.swap()],
    ["keep", () => settings.unpin(false)],
    ["discard", () => settings.unpin(true)],
  ];
  for (const [id, act] of buttons) byId(id).onclick = act;
  settings.onChange(showButtons);
  showButtons();
}

// Asked once for the tab of the browser whether the settings go along to another recording.
async function openOther(/** @type {string} */ name) {
  const carried = carriedSettings(app);
  let answer = sessionStorage.getItem("carry-settings");
  if (carried.length && answer === null) {
    const question = `Take the changed settings along, to this and other recordings? ${carried.join(", ")}`;
    answer = await ask(question, { yes: "Take them along", no: "Open it with its own" });
    if (answer === null) return;
    sessionStorage.setItem("carry-settings", answer);
  }
  location.hash = linkTo(app, name, answer === "yes" ? carried : []);
}

function panel(/** @type {string} */ title, open = false) {
  const body = element("div.body");
  const made = element("details.section", { open }, element("summary", {}, title), body);
  made.dataset.title = title;
  byId("side").append(made);
  return body;
}

// The scene was simulated again: other events, and hence another strip and clip.
async function resimulated() {
  const { recording } = await connection.get("recording");
  Object.assign(app.opening.recording, recording);
  const before = byId("about").textContent;
  describe(recording);
  if (byId("about").textContent !== before) notice("The scene was simulated again with these biases.", "info", 3);
  app.overview.take(recording);
  const [start, end] = settings.clip;
  if (!recording.is_long || start < recording.start_us || end > recording.end_us) {
    settings.takeClip(...recording.clip_us);
  }
  app.runner.request(true); // whatever was requested before, the events are others
}

function chooseClip(/** @type {number} */ from, /** @type {number} */ to) {
  const { start_us, end_us, longest_us } = app.opening.recording;
  const start = Math.max(start_us, Math.round(from));
  settings.takeClip(start, Math.min(end_us, Math.round(to), start + longest_us));
  viewer.leave();
}

function showButtons() {
  byId("preset").value = settings.preset.name;
  byId("undo").disabled = !settings.canUndo;
  byId("redo").disabled = !settings.canRedo;
  const pinned = settings.pinned !== null;
  for (const id of ["swap", "keep", "discard"]) byId(id).hidden = !pinned;
  byId("pin").textContent = pinned ? "Pin B as A" : "Pin as A";
}

/** @type {number | undefined} */
let later = undefined;
function rememberLater(/** @type {number} */ wait_ms) {
  clearTimeout(later);
  later = setTimeout(remember, wait_ms);
}

/** @type {string | null} what the address said last */
let remembered = null;
let isLeaving = false; // for another recording: the address tells of that one already
function remember() {
  if (app.runner.isWaiting || isLeaving) return; // what comes then is remembered
  const link = linkOf(app);
  const isStep = remembered !== null && settingsOf(remembered) !== settingsOf(link);
  if (link !== location.hash) history[isStep ? "pushState" : "replaceState"](null, "", link);
  remembered = link;
}

Object.assign(globalThis, { spinscope: app });
start();
