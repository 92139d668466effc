// A running camera beside the recordings that come from it: picture, state, plots against time, its last seconds.

/** @import { LiveRecording, LiveSecond, LiveShotRow, LiveView } from "./messages.d.ts" */

import { attempt, drawing, element, milliseconds, notice, number, pause } from "./elements.js";
import { linkOf } from "./link.js";
import { post } from "./server.js";

const VIEW_MS = 1000;
const PICTURE_MS = 120; // between two pictures; one that is late is left out
const WIDTH = 300, HEIGHT = 46;

/** @typedef {{name: keyof LiveSecond, label: string, colour: string}} Line */

/** @type {{title: string, unit: string, scale: number, lines: Line[]}[]} */
const PLOTS = [
  {
    title: "latency of the track",
    unit: "ms",
    scale: 1,
    lines: [{ name: "p50_ms", label: "p50", colour: "#4cd964" }, { name: "p99_ms", label: "p99", colour: "#ffb74d" }],
  },
  {
    title: "spin after the shot's end",
    unit: "ms",
    scale: 1,
    lines: [
      { name: "announced_ms", label: "announced", colour: "#4cd964" },
      { name: "final_ms", label: "final", colour: "#ffb74d" },
    ],
  },
  {
    title: "events beside the ball",
    unit: "kev/s",
    scale: 1e-3,
    lines: [
      { name: "noise_on_hz", label: "ON", colour: "var(--on)" },
      { name: "noise_off_hz", label: "OFF", colour: "var(--off)" },
    ],
  },
  {
    title: "events of the ball",
    unit: "kev/s",
    scale: 1e-3,
    lines: [
      { name: "ball_on_hz", label: "ON", colour: "var(--on)" },
      { name: "ball_off_hz", label: "OFF", colour: "var(--off)" },
    ],
  },
];

export class Live {
  isPaused = false;
  /** @type {LiveRecording | null} */
  recording = null;
  marked_ms = 0;
  #told = 0; // number of the last notice that was shown

  /**
   * @param {any} parent
   * @param {any} app the page
   */
  constructor(parent, app) {
    this.app = app;
    parent.style.setProperty("--on", app.opening.colours.on);
    parent.style.setProperty("--off", app.opening.colours.off);
    this.image = element("img.live", { alt: "Events of the last 20 ms, ON and OFF, with the ball's circle" });
    this.hold = element("button", { onclick: () => this.#pause(), title: "The picture stops, the camera runs on" });
    this.seconds = element("select", { "aria-label": "How much of it" });
    for (const seconds of [2, 5, 10, 30]) {
      this.seconds.append(element("option", { value: seconds, selected: seconds === 10 }, `last ${seconds} s`));
    }
    const look = {
      onclick: () => attempt(() => this.#look()),
      title: "Open the last seconds as a recording, with the sliders as they are; the camera runs on",
    };
    const apply = {
      onclick: () => attempt(() => this.#apply()),
      title: "The camera's stages go on with the sliders as they are; a shot in flight ends there",
    };
    this.record = element("button", { onclick: () => this.toggleRecording() });
    this.marker = element("input", {
      type: "text",
      maxLength: 500,
      placeholder: "Text of a marker",
      "aria-label": "Text of a marker",
      title: "Enter notes it beside the recording, with the time at which you began to type or pressed m",
      oninput: () => this.marked_ms ||= performance.now(),
    });
    const note = element("button", { title: "Note the time, and the text if there is one" }, "Mark");
    this.markers = element("form.row", {}, this.marker, note);
    this.markers.addEventListener("submit", (/** @type {Event} */ event) => {
      event.preventDefault();
      attempt(() => this.#mark());
    });
    this.recorded = element("p.note", { role: "status" });
    this.fault = element("p.fault", { role: "status", hidden: true });
    this.state = element("p.note", { role: "status" });
    this.shots = element("div.shots", { "aria-label": "Shots so far" });
    this.plots = element("div");
    parent.append(
      this.image,
      element("div.row", {}, this.hold, this.seconds, element("button.primary", look, "Look at them")),
      element("div.row", {}, element("button", apply, "Use the sliders from now on")),
      element("div.row", {}, this.record),
      this.markers,
      this.recorded,
      this.fault,
      this.state,
      this.shots,
      this.plots,
    );
    this.#name();
    this.#showRecording(null);
    this.#showPictures();
    this.#showViews();
  }

  #name() {
    this.hold.textContent = this.isPaused ? "Go on" : "Pause";
  }

  #pause() {
    this.isPaused = !this.isPaused;
    this.#name();
  }

  // The last seconds, or a shot, as the recording that is worked on; everything else of the address stays.
  async #open(/** @type {string} */ recording) {
    const words = new URLSearchParams((await linkOf(this.app)).slice(1));
    words.set("recording", recording);
    for (const name of ["clip", "shot", "t", "bias"]) words.delete(name);
    location.hash = words.toString();
  }

  async #look() {
    const { recording } = await post("/api/live/window", { seconds: Number(this.seconds.value) });
    await this.#open(recording);
  }

  async #apply() {
    await post("/api/live/parameters", { parameters: this.app.settings.parameters });
    notice("The camera's stages go on with these settings.", "info", 3);
  }

  toggleRecording() {
    return attempt(async () => {
      const { recording } = await post("/api/live/recording", { is_on: this.recording === null });
      const before = this.recording;
      this.#showRecording(recording);
      if (before && !recording) notice(`Recorded: ${words(before)}`, "info", 12);
    });
  }

  // The time is now, whatever is typed afterwards.
  beginMarker() {
    if (!this.recording) return notice("Nothing is recorded: begin a recording first.", "warning");
    this.marked_ms = performance.now();
    this.marker.focus();
  }

  async #mark() {
    const seconds_ago = this.marked_ms ? Math.min((performance.now() - this.marked_ms) / 1000, 3600) : 0;
    const { recording } = await post("/api/live/marker", { text: this.marker.value.trim(), seconds_ago });
    this.marked_ms = 0;
    this.marker.value = "";
    this.marker.blur();
    this.#showRecording(recording);
  }

  #showRecording(/** @type {LiveRecording | null} */ recording) {
    this.recording = recording;
    this.record.textContent = recording ? "End the recording" : "Record";
    this.record.title = recording ? "The camera runs on" : "Write all events from now on to a file (RAW)";
    this.markers.hidden = !recording;
    this.recorded.textContent = recording ? `recording ${words(recording)}` : "";
  }

  async #showPictures() {
    for (;;) {
      if (!this.isPaused && !document.hidden) {
        this.image.src = `/api/live/picture?${Date.now()}`;
        await this.image.decode().catch(() => {});
      }
      await pause(PICTURE_MS);
    }
  }

  async #showViews() {
    for (;;) {
      try {
        const response = await fetch("/api/live/view");
        if (response.ok) this.#show(await response.json());
      } catch {
        // The page itself tells that the server is gone.
      }
      await pause(VIEW_MS);
    }
  }

  #show(/** @type {LiveView} */ { camera, is_running, fault, kept_s, seconds, shots, notices, recording }) {
    const now = seconds.at(-1);
    const parts = [is_running ? camera : `${camera} has ended`];
    if (now) {
      parts.push(`${number(now.rate_mev_s, 3)} Mev/s`);
      if (now.p50_ms !== null && now.p99_ms !== null) {
        parts.push(`tracked after ${milliseconds(now.p50_ms)}, 99 % within ${milliseconds(now.p99_ms)}`);
      }
      parts.push(`${milliseconds(now.backlog_ms)} behind, spins ${milliseconds(now.spin_backlog_ms)}`);
      if (now.dropped) parts.push(`${now.dropped} packets lost by the camera`);
      if (now.outside) parts.push(`${now.outside} events beyond the sensor left out`);
      if (now.late) parts.push(`${now.late} events too late`);
      if (now.skipped) parts.push(`${now.skipped} ticks left out`);
    }
    parts.push(`${kept_s.toFixed(0)} s kept`);
    this.state.textContent = parts.join(" · ");
    this.fault.textContent = (is_running && fault) || "";
    this.fault.hidden = !this.fault.textContent;
    for (const { number, text } of notices) if (number > this.#told) notice(text, "warning", 12);
    this.#told = notices.at(-1)?.number ?? 0;
    this.#showRecording(recording);
    if (this.isPaused) return;
    this.shots.replaceChildren(...shots.map((shot) => this.#row(shot)));
    this.plots.replaceChildren(...PLOTS.map((plot) => drawn(plot, seconds)));
  }

  #row(/** @type {LiveShotRow} */ { text, is_final, recording }) {
    const open = () => recording && attempt(() => this.#open(recording));
    const title = recording ? "Open this shot" : is_final ? "" : "Its final spin follows";
    return element(`button.shot${is_final ? ".final" : ""}`, { onclick: open, disabled: !recording, title }, text);
  }
}

const words = (/** @type {LiveRecording} */ { file, events, markers }) =>
  `${file} · ${number(events / 1e6, 3)} Mev${markers ? ` · ${markers} marker${markers > 1 ? "s" : ""}` : ""}`;

/**
 * One plot over the seconds that are known, from zero.
 * @param {(typeof PLOTS)[number]} plot
 * @param {LiveSecond[]} seconds
 */
function drawn({ title, unit, scale, lines }, seconds) {
  const values = lines.map(({ name }) => seconds.map((one) => one[name]));
  const known = values.flat().filter((value) => value !== null);
  const most = Math.max(1e-9, ...known);
  const x = (/** @type {number} */ index) => (index / Math.max(seconds.length - 1, 1)) * WIDTH;
  const curves = lines.map(({ colour }, line) => {
    // A single point between gaps is a line of no length with round ends.
    const path = values[line].map((value, index) => {
      if (value === null) return "";
      const at = `${x(index).toFixed(1)},${(HEIGHT - 2 - (value / most) * (HEIGHT - 4)).toFixed(1)}`;
      return index && values[line][index - 1] !== null ? `L${at}` : `M${at}l0,0`;
    });
    return drawing("path", { d: path.join(""), stroke: colour });
  });
  const last = lines.map(({ label, colour }, line) => {
    const value = values[line].findLast((one) => one !== null);
    const words = `${label} ${value === undefined ? "–" : number(value * scale, 3)} `;
    return element("span", { style: `color: ${colour}` }, words);
  });
  const head = element(
    "div.plothead",
    {},
    `${title}: `,
    ...last,
    known.length ? `${unit}, 0 to ${number(most * scale, 3)}` : unit,
  );
  const box = { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, preserveAspectRatio: "none", role: "img", "aria-label": title };
  return element("div.plot", {}, head, drawing("svg", box, ...curves));
}
