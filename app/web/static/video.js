// Video of the view in slow motion: picture after picture at its own time, put together by the server.

/** @import { Viewer } from "./viewer.js" */

import { element } from "./elements.js";
import { videoOf } from "./server.js";

const STEP_US = 400; // of a recording from picture to picture: at 25 a second a hundred times slower than it was
const MOST_PICTURES = 300; // twelve seconds of video; of a longer clip each stands for more

/**
 * Films the followed shot, or the whole clip where there is none; null where it is stopped.
 * @param {{viewer: Viewer, settings: any, runner: any, overview: any}} app
 * @returns {Promise<Blob | null>}
 */
export async function filmed({ viewer, settings, runner, overview }) {
  const [from_us, to_us] = settings.clip;
  const shots = overview.shots.filter((/** @type {number[]} */ [start, end]) => from_us <= start && end <= to_us);
  const [start_us, end_us] = shots[(runner.followed ?? 1) - 1] ?? settings.clip;
  const step_us = Math.max(STEP_US, (end_us - start_us) / MOST_PICTURES);
  const before_us = viewer.playhead_us;
  const bar = element("progress", { max: end_us - start_us, value: 0, "aria-label": "Progress of the video" });
  const stop = element("form", { method: "dialog" }, element("button", {}, "Stop"));
  const dialog = element("dialog.ask", { "aria-label": "Video" }, element("p", {}, "Filming the view ..."), bar, stop);
  document.body.append(dialog);
  dialog.showModal();
  try {
    const pictures = [];
    for (let t_us = start_us; t_us < end_us && dialog.open; t_us += step_us) {
      await viewer.seek(t_us);
      pictures.push(await viewer.picture("image/jpeg"));
      bar.value = t_us - start_us;
    }
    return dialog.open ? await videoOf(pictures) : null;
  } finally {
    dialog.remove();
    if (before_us !== null) viewer.seek(before_us);
  }
}
