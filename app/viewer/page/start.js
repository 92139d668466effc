// Starts Rerun's viewer on this page, hands it the recording, and puts the playhead where the track starts.
"use strict";

const CHANNEL = "recording";
const message = document.getElementById("message");

async function bytesOf(path) {
  const response = await fetch(path);
  if (!response.ok) throw new Error(`${path}: ${response.status} ${response.statusText}`);
  return new Uint8Array(await response.arrayBuffer());
}

function wait(milliseconds) {
  return new Promise((done) => setTimeout(done, milliseconds));
}

// The viewer takes the request only once it has read the recording; until then it says that there is none.
async function placePlayhead(viewer, request) {
  for (let attempt = 0; attempt < 300; attempt += 1) {
    try {
      await viewer.viewer_control(request);
      return;
    } catch {
      await wait(100);
    }
  }
}

async function start() {
  const recording = bytesOf("recording.rrd");
  const request = bytesOf("playhead");
  await wasm_bindgen({ module_or_path: document.getElementById("rerun").src.replace(".js", "_bg.wasm") });
  const viewer = new wasm_bindgen.WebHandle({
    hide_welcome_screen: true,
    enable_history: false,
    notebook: false,
    persist: false,
    theme: "dark",
  });
  await viewer.start(document.getElementById("viewer"));
  viewer.open_channel(CHANNEL, document.title);
  viewer.send_rrd_to_channel(CHANNEL, await recording);
  viewer.close_channel(CHANNEL);
  message.remove();
  await placePlayhead(viewer, await request);
  document.body.dataset.state = "ready";
}

start().catch((error) => {
  console.error(error);
  document.getElementById("viewer").hidden = true;
  message.textContent = `The viewer cannot run in this browser: ${error}. \
It needs WebAssembly and WebGL; \`spinscope view --native\` or \`--save FILE.rrd\` work without.`;
});
