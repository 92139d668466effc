// The embedded viewer: shows one recording after another at the same playhead.

const TIMELINE = "t";
const POLL_MS = 15;
const PATIENCE_MS = 15_000;

const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

export class Viewer extends EventTarget {
  #viewer = null;
  #channel = null;
  #queue = Promise.resolve();
  #playhead = null;

  async start(version, parent) {
    const { WebViewer } = await import(`/rerun/${version}/widget.js`);
    const viewer = new WebViewer();
    const ready = new Promise((resolve) => viewer.once("ready", resolve));
    const base_url = new URL(`/rerun/${version}/`, location.href).toString();
    await viewer.start(null, parent, {
      base_url,
      width: "100%",
      height: "100%",
      hide_welcome_screen: true,
      notebook: true,
      allow_fullscreen: false,
      theme: "dark",
      manifest_url: null,
    });
    await ready;
    this.#viewer = viewer;
    this.#channel = viewer.open_channel("spinscope");
    for (const panel of ["top", "blueprint", "selection"]) viewer.override_panel_state(panel, "hidden");
  }

  // Everything that touches the viewer, one after the other.
  #next(work) {
    const done = this.#queue.then(work);
    this.#queue = done.catch(() => {});
    return done;
  }

  layout(bytes) {
    return this.#next(() => this.#channel.send_rrd(bytes));
  }

  // Where the viewer stands: {store, time in ns or null, playing}; null when nothing is shown.
  async where() {
    const state = await this.#viewer.get_state();
    const recording = state.recordings.find(({ store_id }) => store_id === state.active_store_id);
    if (!recording) return null;
    const time = recording.current_time?.timeline === TIMELINE ? recording.current_time.time : undefined;
    const value = typeof time === "object" ? time?.value : time;
    return {
      store: recording.store_id,
      time: value === undefined ? null : BigInt(value),
      play: recording.play_state,
      speed: recording.playback_speed,
      state,
    };
  }

  async playhead_us() {
    try {
      const where = this.#viewer && (await this.where());
      if (where?.time !== null && where?.time !== undefined) this.#playhead = Number(where.time) / 1000;
    } catch {
      // Busy painting: the last known place is near enough.
    }
    return this.#playhead;
  }

  // Show a recording in place of the present one; at `time_us` when there is none.
  show(bytes, recordingId, time_us) {
    return this.#next(async () => {
      const before = await this.where();
      this.#channel.send_rrd(bytes);
      const store = await this.#loaded(recordingId);
      const time = before?.time ?? BigInt(Math.round(time_us * 1000));
      const play_state = before?.play ?? "paused";
      await this.#viewer.set_time({ recording: store, timeline: TIMELINE, duration_nanos: time, play_state });
      const state = await this.#viewer.get_state();
      const old = state.recordings.map(({ store_id }) => store_id).filter((id) => id !== store);
      if (old.length) await this.#viewer.close({ store_ids: old });
      this.dispatchEvent(new CustomEvent("shown", { detail: recordingId }));
    });
  }

  seek(time_us, play_state = "paused") {
    return this.#next(async () => {
      const where = await this.where();
      if (!where) return;
      const duration_nanos = BigInt(Math.round(time_us * 1000));
      await this.#viewer.set_time({ recording: where.store, timeline: TIMELINE, duration_nanos, play_state });
    });
  }

  play(play_state) {
    return this.#next(() => this.#viewer.set_time({ play_state }));
  }

  async #loaded(recordingId) {
    const until = performance.now() + PATIENCE_MS;
    while (performance.now() < until) {
      const state = await this.#viewer.get_state();
      const found = state.recordings.find(({ store_id }) => store_id.endsWith(`:${recordingId}`));
      if (found?.timelines.some(({ name }) => name === TIMELINE)) return found.store_id;
      await pause(POLL_MS);
    }
    throw new Error("the viewer did not take the recording");
  }

  async state() {
    return this.#viewer.get_state();
  }

  get api() {
    return this.#viewer;
  }
}
