// Video of the view in slow motion: picture after picture at its own time, put together by the server. Where the viewer
// cannot run, of the previews.

/** @import { Connection } from "./server.js" */
/** @import { Viewer } from "./viewer.js" */

import { element } from "./elements.js";
import { videoOf } from "./server.js";

const STEP_US = 400; // of a recording from picture to picture: at 25 a second a hundred times slower than it was
const MOST_PICTURES = 300; // twelve seconds of video; of a longer clip each stands for more
// Every 32nd picture first, then those between them, until all are there or so much time has passed: without a graphics
// card one takes seconds. Those that are missing are shown as the one before them.
const STRIDES = [32, 16, 8, 4, 2, 1];
const MOST_MS = 60_000;

/**
 * Films the followed shot, or the whole clip where there is none; null where it is stopped.
 * @param {{connection: Connection, viewer: Viewer, settings: any, runner: any, overview: any}} app
 * @returns {Promise<Blob | null>}
 */
export async function filmed({ connection, viewer, settings, runner, overview }) {
  const [from_us, to_us] = settings.clip;
  const shots = overview.shots.filter((/** @type {number[]} */ [start, end]) => from_us <= start && end <= to_us);
  const [start_us, end_us] = shots[(runner.followed ?? 1) - 1] ?? settings.clip;
  const picture = async (/** @type {number} */ t_us) => {
    if (runner.isBlind) return preview(connection, t_us);
    await viewer.seek(t_us);
    return viewer.picture("image/jpeg");
  };
  const before_us = viewer.playhead_us;
  const count = Math.ceil(Math.min((end_us - start_us) / STEP_US, MOST_PICTURES));
  const bar = element("progress", { value: 0, "aria-label": "Progress of the video" });
  const stop = element("form", { method: "dialog" }, element("button", {}, "Stop"));
  const dialog = element("dialog.ask", { "aria-label": "Video" }, element("p", {}, "Filming the view ..."), bar, stop);
  document.body.append(dialog);
  dialog.showModal();
  try {
    /** @type {Blob[]} */
    const pictures = [];
    const began = performance.now();
    let taken = 0;
    for (const stride of STRIDES) {
      for (let i = 0; i < count; i += stride) {
        const share = (performance.now() - began) / MOST_MS;
        if (!dialog.open || (share > 1 && stride !== STRIDES[0])) break;
        if (pictures[i]) continue;
        pictures[i] = await picture(start_us + i / count * (end_us - start_us));
        bar.value = Math.max(++taken / count, Math.min(share, 1));
      }
    }
    if (!dialog.open) return null;
    for (let i = 1; i < count; i++) pictures[i] ??= pictures[i - 1];
    return await videoOf(pictures);
  } finally {
    dialog.remove();
    if (before_us !== null) viewer.seek(before_us);
  }
}

// The preview at a time, as JPEG.
async function preview(/** @type {Connection} */ connection, /** @type {number} */ t_us) {
  const found = await connection.get(/** @type {"preview"} */ (`preview?t_us=${t_us}`));
  const image = /** @type {HTMLImageElement} */ (element("img", { src: found.picture }));
  await image.decode();
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [image.naturalWidth, image.naturalHeight];
  canvas.getContext("2d")?.drawImage(image, 0, 0);
  return /** @type {Promise<Blob>} */ (new Promise((resolve) =>
    canvas.toBlob((blob) => blob && resolve(blob), "image/jpeg")
  ));
}
