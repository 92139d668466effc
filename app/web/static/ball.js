// Fixed ball (ball spinner): its circle, typed, picked by centre and edge in an image, or found automatically.

/** @import { Opening } from "./messages.d.ts" */
/** @import { Connection } from "./server.js" */
/** @import { Settings } from "./settings.js" */

import { attempt, element, notice } from "./elements.js";

export class Ball {
  /**
   * @param {any} parent
   * @param {{connection: Connection, settings: Settings, opening: Opening}} app
   */
  constructor(parent, { connection, settings, opening }) {
    this.connection = connection;
    this.settings = settings;
    this.opening = opening;
    this.boxes = ["x", "y", "radius"].map((name) =>
      element("input.number", { type: "text", placeholder: "–", "aria-label": `fixed ball ${name} in px` })
    );
    this.state = element("p.note");
    parent.append(
      this.state,
      element("div.row", {}, "x", this.boxes[0], "y", this.boxes[1], "radius", this.boxes[2], "px"),
      element(
        "div.row",
        {},
        element("button", { onclick: () => this.#typed() }, "Use this circle"),
        element("button", { onclick: () => this.#pick() }, "Pick in the image"),
        element("button", { onclick: () => attempt(() => this.#find()) }, "Find automatically"),
      ),
      this.fly = element("button", { onclick: () => settings.set("track.ball", "flying") }, "Ball in flight"),
    );
    settings.addEventListener("change", () => this.#refresh());
    this.#refresh();
  }

  #refresh() {
    const track = this.settings.parameters.track;
    const fixed = track.ball === "fixed";
    this.fly.hidden = !fixed;
    this.state.textContent = fixed
      ? "The ball stays in place (ball spinner)."
      : "The ball is in flight. For a ball spinner, give the circle of the ball.";
    ["x", "y", "radius"].forEach((name, i) => {
      if (document.activeElement !== this.boxes[i]) this.boxes[i].value = track[`fixed_${name}_px`] ?? "";
    });
  }

  #typed() {
    const [x, y, radius] = this.boxes.map(({ value }) => Number(value.replace(",", ".")));
    if (this.boxes.some(({ value }) => !value.trim()) || ![x, y, radius].every(Number.isFinite)) {
      notice("The fixed ball needs three numbers: x, y and radius in px.");
      return;
    }
    this.#fix({ fixed_x_px: x, fixed_y_px: y, fixed_radius_px: radius });
  }

  #fix(/** @type {Record<string, number>} */ values) {
    /** @type {HTMLElement | null} */ (document.activeElement)?.blur();
    this.settings.setAll({ track: { ball: "fixed", ...values } });
  }

  async #find() {
    this.#fix(await this.connection.post("find_ball", this.settings.request));
  }

  // An image of all events: the first click is the centre, the second one on the edge.
  #pick() {
    const [start_us, end_us] = this.settings.clip;
    const { width_px, height_px } = this.opening.recording;
    const image = element("img", {
      src: this.connection.path(`events.png?start_us=${start_us}&end_us=${end_us}`),
      alt: "events of the clip",
    });
    const words = element("p", {}, "Click the centre of the ball, then its edge. The wheel zooms, Esc closes.");
    const frame = element("div.frame", {}, image);
    const dialog = element("dialog.pick", { "aria-label": "Circle of the ball" }, words, frame);
    document.body.append(dialog);
    dialog.addEventListener("close", () => dialog.remove());
    let zoom = 1;
    frame.addEventListener("wheel", (/** @type {WheelEvent} */ event) => {
      event.preventDefault();
      const at = place(event);
      zoom = Math.min(Math.max(zoom * (event.deltaY < 0 ? 1.3 : 1 / 1.3), 1), 12);
      image.style.width = `${100 * zoom}%`;
      const box = frame.getBoundingClientRect();
      frame.scrollLeft = (at.x / width_px) * image.clientWidth - (event.clientX - box.left);
      frame.scrollTop = (at.y / height_px) * image.clientHeight - (event.clientY - box.top);
    }, { passive: false });
    const place = (/** @type {MouseEvent} */ event) => {
      const box = image.getBoundingClientRect();
      return {
        x: ((event.clientX - box.left) / box.width) * width_px - 0.5,
        y: ((event.clientY - box.top) / box.height) * height_px - 0.5,
      };
    };
    /** @type {{x: number, y: number} | null} */
    let centre = null;
    image.addEventListener("click", (/** @type {MouseEvent} */ event) => {
      const at = place(event);
      if (!centre) {
        centre = at;
        words.textContent = `Centre ${at.x.toFixed(1)}, ${at.y.toFixed(1)} px. Now click the edge.`;
        return;
      }
      const radius = Math.hypot(at.x - centre.x, at.y - centre.y);
      dialog.close();
      const round = (/** @type {number} */ value) => Number(value.toFixed(1));
      this.#fix({
        fixed_x_px: round(centre.x),
        fixed_y_px: round(centre.y),
        fixed_radius_px: Math.max(round(radius), 1),
      });
    });
    dialog.showModal();
  }
}
