// Talking to the server: requests, the stream of messages, and what happens when it goes away.

export class Refused extends Error {
  constructor(status, text) {
    super(text);
    this.status = status;
  }
}

async function answered(response) {
  if (response.ok) return response;
  let text = `${response.status} ${response.statusText}`;
  try {
    text = (await response.json()).error ?? text;
  } catch {
    // Not ours: the status has to do.
  }
  throw new Refused(response.status, text);
}

export async function post(path, content = {}) {
  const body = JSON.stringify(content);
  const headers = { "content-type": "application/json" };
  const response = await answered(await fetch(path, { method: "POST", headers, body }));
  return response.json();
}

export async function get(path) {
  return (await answered(await fetch(path))).json();
}

export async function bytes(path) {
  return new Uint8Array(await (await answered(await fetch(path))).arrayBuffer());
}

// The page's connection: opens a page on the server, listens to its messages, opens it anew when the server comes back.
export class Connection extends EventTarget {
  page = null;
  #stream = null;
  #retry = null;

  async open(recording) {
    const opening = await post("/api/pages", { recording });
    this.page = opening.page;
    this.recording = opening.recording.name;
    this.#listen();
    return opening;
  }

  path(rest) {
    return `/api/pages/${this.page}/${rest}`;
  }

  close() {
    this.#stream?.close();
    clearTimeout(this.#retry);
  }

  #listen() {
    this.#stream?.close();
    const stream = (this.#stream = new EventsInMemory(this.path("messages")));
    stream.onmessage = (event) => {
      const message = JSON.parse(event.data);
      this.dispatchEvent(new CustomEvent(message.kind, { detail: message }));
    };
    stream.onerror = () => {
      stream.close();
      if (stream !== this.#stream) return;
      this.dispatchEvent(new CustomEvent("lost"));
      this.#reopen();
    };
  }

  #reopen() {
    clearTimeout(this.#retry);
    this.#retry = setTimeout(async () => {
      try {
        const opening = await this.open(this.recording);
        this.dispatchEvent(new CustomEvent("back", { detail: opening }));
      } catch {
        this.#reopen();
      }
    }, 700);
  }
}
