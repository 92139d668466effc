// The page's address: recording, what differs from how it was opened, biases, clip, playhead and tab.

export async function linkOf({ connection, settings, viewer, opening, biases }, withTab = false) {
  const words = new URLSearchParams();
  words.set("recording", connection.recording);
  for (const text of assignments(settings.parameters, opening.presets.opened)) words.append("set", text);
  if (settings.pinned) {
    words.set("pinned", "1");
    for (const text of assignments(settings.pinned, opening.presets.opened)) words.append("a", text);
  }
  if (String(settings.clip) !== String(opening.recording.clip_us)) words.set("clip", settings.clip.join("-"));
  const time = viewer.playhead_us;
  if (time !== null) words.set("t", Math.round(time));
  const changed = Object.entries(biases.values).filter(([name, value]) => value !== opening.biases.values[name]);
  for (const [name, value] of changed) words.append("bias", `${name}:${value}`);
  if (withTab) words.set("tab", await viewer.tab());
  return `#${words}`;
}

export function wantedByLink() {
  const words = new URLSearchParams(location.hash.slice(1));
  const clip = (words.get("clip") ?? "").match(/^(-?\d+)-(-?\d+)$/);
  return {
    recording: words.get("recording"),
    clip: clip && [Number(clip[1]), Number(clip[2])],
    time: Number(words.get("t")) || null,
    tab: words.get("tab"),
    biases: Object.fromEntries(words.getAll("bias").map((text) => text.split(":")).map(([name, value]) => [name, Number(value)])),
    parameters: (opened) => applied(opened, words.getAll("set")),
    pinnedBy: (opened) => (words.get("pinned") ? applied(opened, words.getAll("a")) : null),
  };
}

function assignments(values, others) {
  const found = [];
  for (const [group, fields] of Object.entries(values)) {
    for (const [name, value] of Object.entries(fields)) {
      if (JSON.stringify(value) !== JSON.stringify(others[group][name])) found.push(`${group}.${name}=${JSON.stringify(value)}`);
    }
  }
  return found;
}

function applied(opened, texts) {
  const values = structuredClone(opened);
  for (const text of texts) {
    const [, group, name, value] = text.match(/^(\w+)\.(\w+)=(.*)$/) ?? [];
    if (!(name in (values[group] ?? {}))) continue;
    try {
      values[group][name] = JSON.parse(value);
    } catch {
      // A mangled link: the value stays as it was.
    }
  }
  return values;
}
