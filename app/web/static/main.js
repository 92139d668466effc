// The page: opens it on the server and wires settings, controls, viewer and tools together.

import { Ball } from "./ball.js";
import { Bar } from "./bar.js";
import { Biases } from "./biases.js";
import { Coach } from "./coach.js";
import { Controls } from "./controls.js";
import { Curve } from "./curve.js";
import { byId, element, notice, pause } from "./elements.js";
import { linkOf, wantedByLink } from "./link.js";
import { Overview } from "./overview.js";
import { Results } from "./results.js";
import { Runner } from "./runner.js";
import { Saving } from "./saving.js";
import { Search } from "./search.js";
import { bytes, Connection, get, Refused } from "./server.js";
import { Settings } from "./settings.js";
import { Viewer } from "./viewer.js";

const MARGIN_US = 20_000; // shown before and after a shot
const NUMBERS_MS = 1000; // as long as numbers wait for their picture

const connection = new Connection();
const settings = new Settings();
const viewer = new Viewer();
const app = { connection, settings, viewer };

async function start() {
  const link = wantedByLink();
  let opening;
  try {
    opening = await opened(link);
  } catch (error) {
    notice(error instanceof Refused ? error.message : "The server does not answer: is `spinscope tune` still running?", "error", 0);
    return;
  }
  app.opening = opening;
  const { recording, presets } = opening;
  app.builtIn = Object.keys(presets);
  const values = presets.opened;
  settings.start({
    parameters: link.parameters(values),
    pinned: link.pinnedBy(values),
    clip: link.clip ?? recording.clip_us,
    preset: { name: "opened", values },
  });
  settings.fallback = { parameters: values, clip: recording.clip_us };
  describe(opening);
  app.bar = new Bar(byId("bar"), opening.stages);
  app.overview = new Overview(byId("overview"), recording);
  app.results = new Results(panel("Result", true));
  app.curve = new Curve(panel("Tuning curve"), app);
  app.search = new Search(panel("Tune for me"), app);
  app.ball = new Ball(panel("Fixed ball"), app);
  app.biases = new Biases(panel("Biases"), app);
  app.coach = new Coach(app);
  new Saving(app);
  new Controls(byId("controls"), opening.sections, settings);
  app.runner = new Runner(connection, settings, () => viewer.playhead_us);
  listen(link);
  viewer.start(opening.viewer, byId("viewer")).catch((error) => {
    app.runner.isBlind = true; // the numbers are still there
    notice(`The viewer does not start: ${error.message}`, "error", 0);
  });
  if (Object.keys(link.biases).length) app.biases.take(link.biases);
  app.runner.want(true);
}

// The recording of the link, or where that cannot be opened the one the program was started with.
async function opened(link) {
  try {
    return await connection.open(link.recording);
  } catch (error) {
    if (!(error instanceof Refused) || link.recording === null) throw error;
    notice(error.message);
    return connection.open(null);
  }
}

function panel(title, open = false) {
  const body = element("div.body");
  const made = element("details.section", { open }, element("summary", {}, title), body);
  made.dataset.title = title;
  byId("side").append(made);
  return body;
}

function describe({ recording, recordings, presets }) {
  document.title = `${recording.name} · Spinscope`;
  const names = recordings.map((name) => element("option", { value: name, selected: name === recording.name }, name));
  byId("recording").replaceChildren(...names);
  byId("recording").onchange = (event) => {
    location.hash = new URLSearchParams({ recording: event.target.value }).toString();
    location.reload();
  };
  const seconds = (recording.end_us - recording.start_us) / 1e6;
  const length = seconds < 1 ? `${(1000 * seconds).toFixed(0)} ms` : `${seconds.toFixed(1)} s`;
  const size = `${recording.width_px} x ${recording.height_px}`;
  byId("about").textContent = `${recording.events.toLocaleString("en")} events, ${length}, ${size}`;
  for (const warning of recording.warnings) notice(warning, "warning", 20);
  byId("preset").replaceChildren(...Object.keys(presets).map((name) => element("option", { value: name }, name === "opened" ? "as opened" : name)));
  byId("preset").value = "opened";
}

function listen(link) {
  let first = true;
  let latest = null;
  settings.addEventListener("change", ({ detail }) => {
    app.runner.change(detail.settled);
    if (detail.settled) rememberLater(REMEMBER_UNSEEN_MS);
    byId("preset").value = settings.preset.name;
    if (String(app.overview.clip) !== String(settings.clip)) app.overview.show(settings.clip, app.overview.shots);
    buttons();
  });
  const numbers = (detail) => {
    app.bar.show(detail);
    if (detail.error) notice(detail.error);
    app.results.show(detail);
    if (["done", "failed"].includes(detail.state)) document.body.dataset.done = detail.serial;
    if (detail.measures && !app.opening.recording.is_long) showShots(detail.measures);
  };
  // Fetches and shows a picture; false where a newer one took its place.
  const picture = async (detail) => {
    latest = detail.recording;
    try {
      const content = await bytes(connection.path(`pictures/${detail.recording}`));
      if (latest !== detail.recording) return false;
      if (first) await viewer.layout(await bytes(connection.path(`layout?tab=${encodeURIComponent(link.tab ?? "")}`)));
      await viewer.show(content, detail.recording, (first && link.time) || detail.opening_us);
      first = false;
      document.body.dataset.picture = detail.recording;
      if (detail.state === "done") document.body.dataset.shown = detail.serial;
      return true;
    } catch (error) {
      if (app.runner.isBlind || (error instanceof Refused && error.status === 404)) return false;
      throw error;
    }
  };
  connection.addEventListener("run", async ({ detail }) => {
    if (detail.serial !== app.runner.serial) return;
    if (!detail.recording || app.runner.isBlind) {
      numbers(detail);
      return;
    }
    const seen = picture(detail);
    // For any change of the page the browser puts the whole picture together anew: numbers come with their picture.
    if (!first) await Promise.race([seen.catch(() => {}), pause(NUMBERS_MS)]);
    numbers(detail);
    if (await seen) {
      app.runner.shown(detail.serial);
      rememberLater(REMEMBER_MS);
    }
  });
  connection.addEventListener("shots", ({ detail }) => {
    const { share, shots, error } = detail;
    if (error) notice(error);
    const words = share < 1 ? `looking for shots, ${Math.round(100 * share)} %` : `${shots.length} shots: click one`;
    app.overview.show(settings.clip, shots, words);
  });
  app.biases.addEventListener("taken", takenAgain);
  connection.addEventListener("lost", () => {
    app.bar.say("The server does not answer; trying again ...");
    document.body.classList.add("lost");
  });
  connection.addEventListener("back", () => {
    document.body.classList.remove("lost");
    notice("The server is back.", "info", 3);
    app.biases.restore();
    app.runner.want(true);
  });
  byId("undo").onclick = () => settings.undo();
  byId("redo").onclick = () => settings.redo();
  byId("pin").onclick = () => settings.pin();
  byId("swap").onclick = () => settings.swap();
  byId("keep").onclick = () => settings.unpin(false);
  byId("discard").onclick = () => settings.unpin(true);
  byId("preset").onchange = (event) => settings.takePreset(event.target.value, app.opening.presets[event.target.value]);
  app.overview.addEventListener("seek", ({ detail }) => viewer.seek(detail));
  app.overview.addEventListener("choose", ({ detail }) => chooseClip(...detail));
  app.overview.addEventListener("shot", ({ detail }) => chooseClip(detail[0] - MARGIN_US, detail[1] + MARGIN_US));
  document.addEventListener("keydown", shortcuts);
  viewer.addEventListener("moved", ({ detail }) => app.overview.move(detail));
  buttons();
}

// The scene was simulated again: other events, and hence another strip and clip.
async function takenAgain() {
  const { recording } = await get(connection.path("recording"));
  Object.assign(app.opening.recording, recording);
  const { innerHTML } = byId("about");
  describe(app.opening);
  if (byId("about").innerHTML !== innerHTML) notice("The scene was taken again with these biases.", "info", 3);
  app.overview.take(recording);
  const [start, end] = settings.clip;
  if (!recording.is_long || start < recording.start_us || end > recording.end_us) settings.takeClip(...recording.clip_us);
  app.runner.want(true); // whatever the page has asked for before, the events are others
}

function showShots(measures) {
  app.overview.show(settings.clip, measures.shots.map(({ start_us, end_us }) => [start_us, end_us]));
}

function chooseClip(from, to) {
  const { start_us, end_us, longest_us } = app.opening.recording;
  const start = Math.max(start_us, Math.round(from));
  settings.takeClip(start, Math.min(end_us, Math.round(to), start + longest_us));
  viewer.leave();
}

function buttons() {
  byId("undo").disabled = !settings.canUndo;
  byId("redo").disabled = !settings.canRedo;
  const pinned = settings.pinned !== null;
  for (const id of ["swap", "keep", "discard"]) byId(id).hidden = !pinned;
  byId("pin").textContent = pinned ? "Pin B as A" : "Pin as A";
}

function shortcuts(event) {
  const typing = event.target.matches?.("input[type=text], textarea");
  if (!(event.ctrlKey || event.metaKey) || typing) return;
  const key = event.key.toLowerCase();
  if (key === "z" && !event.shiftKey) settings.undo();
  else if ((key === "z" && event.shiftKey) || key === "y") settings.redo();
  else return;
  event.preventDefault();
}

// The address always says what is seen: a reload, or the link in another browser, comes back to it.
// While a picture is waited for it is left alone, as browser and viewer both take notice of it.
const REMEMBER_MS = 300;
const REMEMBER_UNSEEN_MS = 3000;
let later = null;
function rememberLater(wait_ms) {
  clearTimeout(later);
  later = setTimeout(async () => history.replaceState(null, "", await linkOf(app)), wait_ms);
}

window.addEventListener("pagehide", () => connection.close());
window.spinscope = app;
start();
