// Drawings of one shot in SVG: the three parts of its spin, the clock, the flight over the table, the proof.

/** @import { CoachShot, FlightPath, SpinProofPoints } from "../messages.d.ts" */

import { drawing, element } from "../elements.js";
import { decimal, spinWords, term, text } from "./texts.js";

// Laws of table tennis, metres: app/coach/flight_path.py.
export const TABLE = { long: 2.74, wide: 1.525, net: 0.1525 };
const PARTS = [
  { value: "topspin_rps", negative: "backspin", positive: "topspin" },
  { value: "sidespin_rps", negative: "right_sidespin", positive: "left_sidespin" },
  { value: "corkscrew_rps", negative: "left_corkscrew", positive: "right_corkscrew" },
];

/** @param {string} label @param {string} box @param {...any} children */
const svg = (label, box, ...children) =>
  drawing("svg", { viewBox: box, role: "img", "aria-label": label }, ...children);

/** Bars of the three parts, from the middle to the side of their direction. @param {CoachShot} shot */
export function componentBars(shot) {
  const most = Math.max(20, ...PARTS.map(({ value }) => Math.abs(/** @type {any} */ (shot)[value] ?? 0)));
  return element(
    "div.bars",
    {},
    PARTS.map(({ value, negative, positive }) => {
      const rps = /** @type {any} */ (shot)[value];
      const share = Math.round(50 * Math.abs(rps) / most);
      const isLeft = rps < 0;
      return element(
        "div.bar",
        {},
        element("span.end", {}, term(negative)),
        element(
          "span.track",
          {},
          element("span.fill", { style: `width:${share}%;${isLeft ? "right" : "left"}:50%` }),
          element("span.value", { style: isLeft ? "left:52%" : "right:52%" }, spinWords(Math.abs(rps))),
        ),
        element("span.end", {}, term(positive)),
      );
    }),
  );
}

/** Clock face: where the spin pushes the ball. @param {number} hours */
export function clock(hours) {
  const angle = hours * Math.PI / 6;
  const at = (/** @type {number} */ radius, a = angle) => [50 + radius * Math.sin(a), 50 - radius * Math.cos(a)];
  const whole = Math.round(hours * 60) % 720;
  const time = `${Math.floor(whole / 60) || 12}:${String(whole % 60).padStart(2, "0")}`;
  const [x, y] = at(24);
  const ticks = Array.from({ length: 12 }, (_, i) => {
    const [x1, y1] = at(44, i * Math.PI / 6), [x2, y2] = at(i % 3 ? 41 : 38, i * Math.PI / 6);
    return drawing("line", { x1, y1, x2, y2, class: "tick" });
  });
  const numbers = [12, 3, 6, 9].map((hour) => {
    const [nx, ny] = at(31, hour * Math.PI / 6);
    return drawing("text", { x: nx, y: ny + 3, class: "hour" }, String(hour));
  });
  return element(
    "figure.clock",
    {},
    svg(
      `${text("clock")}: ${time}`,
      "0 0 100 100",
      drawing("circle", { cx: 50, cy: 50, r: 46, class: "face" }),
      ...ticks,
      ...numbers,
      drawing("line", { x1: 50, y1: 50, x2: x, y2: y, class: "hand" }),
      drawing("circle", { cx: 50, cy: 50, r: 3.5, class: "hub" }),
    ),
    element("figcaption", {}, term("clock"), ` ${time}`),
  );
}

// The flight from above and from the side, with a ball that `show` moves.
export class FlightDrawing {
  /** @param {FlightPath | null} flight */
  constructor(flight) {
    this.flight = flight;
    this.root = element("div.flight");
    /** @type {{ball: any, place: (point: number[]) => number[]}[]} */
    this.balls = [];
    if (flight === null) {
      this.root.append(element("p.note", {}, text("no_flight")));
      return;
    }
    const hasTable = flight.frame === "table";
    const xs = flight.points_m.map(([x]) => x), highest = Math.max(...flight.points_m.map((point) => point[2]));
    const reach = hasTable
      ? [-TABLE.long / 2 - 0.1, TABLE.long / 2 + 0.1]
      : [Math.min(...xs) - 0.1, Math.max(...xs) + 0.1];
    const lowest = hasTable ? -0.06 : Math.min(...flight.points_m.map((point) => point[2])) - 0.1;
    const side = hasTable
      ? TABLE.wide / 2 + 0.08
      : Math.max(0.25, ...flight.points_m.map(([, y]) => Math.abs(y))) + 0.05;
    const wide = reach[1] - reach[0];
    const above = this.#view(flight, wide, 2 * side, ([x, y]) => [x - reach[0], side - y]);
    const top = hasTable ? Math.max(highest, 0.4) + 0.08 : highest + 0.15;
    const beside = this.#view(flight, wide, top - lowest, ([x, , z]) => [x - reach[0], top - z]);
    if (hasTable) {
      const [x, y] = [-TABLE.long / 2 - reach[0], side - TABLE.wide / 2], middle = -reach[0];
      above.prepend(
        drawing("rect", { x, y, width: TABLE.long, height: TABLE.wide, class: "table" }),
        drawing("line", { x1: x, y1: side, x2: x + TABLE.long, y2: side, class: "line" }),
        drawing("line", { x1: middle, y1: y - 0.05, x2: middle, y2: y + TABLE.wide + 0.05, class: "net" }),
      );
      beside.prepend(
        drawing("rect", { x, y: top, width: TABLE.long, height: 0.03, class: "table" }),
        drawing("line", { x1: middle, y1: top, x2: middle, y2: top - TABLE.net, class: "net" }),
      );
      if (flight.landing_m !== null) {
        const [lx, ly] = flight.landing_m;
        above.append(drawing("circle", { cx: lx - reach[0], cy: side - ly, r: 0.035, class: "landing" }));
      }
    }
    this.root.append(
      element("figure", {}, above, element("figcaption", {}, text("from_above"))),
      element("figure", {}, beside, element("figcaption", {}, text("from_side"))),
      element("p.note", {}, this.words(), " ", element("a", { href: "#table" }, text("mark_table"))),
    );
  }

  /** @param {FlightPath} flight @param {number} width @param {number} height @param {(point: number[]) => number[]} place */
  #view(flight, width, height, place) {
    const points = flight.points_m.map((point) => place(point).map((one) => one.toFixed(4)).join(",")).join(" ");
    const [cx, cy] = place(flight.points_m[0]);
    const ball = drawing("circle", { cx, cy, r: 0.028, class: "ball" });
    this.balls.push({ ball, place });
    return svg(text("flight"), `0 0 ${width} ${height}`, drawing("polyline", { points, class: "path" }), ball);
  }

  words() {
    const { flight } = this;
    if (flight === null) return text("no_flight");
    if (flight.frame !== "table") return text("no_table");
    const cm = (/** @type {number} */ m) => decimal(Math.abs(100 * m));
    const net = flight.net_clearance_m;
    const over = net === null
      ? text("not_over_net")
      : text("over_net", { value: decimal(100 * net), error: cm(flight.height_std_m ?? 0) });
    if (flight.landing_m === null) return `${over} ${text("no_landing")}`;
    const [x, y] = flight.landing_m;
    return `${over} ${text("landed", { long: cm(x), side: cm(y), where: text(y > 0 ? "left" : "right") })}`;
  }

  /** Moves the ball to a file time. @param {number} t_us */
  show(t_us) {
    if (this.flight === null) return;
    const { t_us: times, points_m } = this.flight;
    const share = (t_us - times[0]) / (times[times.length - 1] - times[0]) * (times.length - 1);
    const point = points_m[Math.max(0, Math.min(times.length - 1, Math.round(share)))];
    for (const { ball, place } of this.balls) {
      const [x, y] = place(point);
      ball.setAttribute("cx", x);
      ball.setAttribute("cy", y);
    }
  }
}

/** The logo at two instants, and the first turned over the second. @param {SpinProofPoints | null} proof */
export function proofDiscs(proof) {
  if (proof === null) return element("p.note", {}, text("no_proof"));
  const dots = (/** @type {number[][]} */ points, /** @type {string} */ kind) =>
    points.map(([cx, cy]) => drawing("circle", { cx, cy, r: 0.022, class: kind }));
  const disc = (/** @type {string} */ caption, /** @type {any[]} */ ...children) =>
    element(
      "figure",
      {},
      svg(caption, "-1.05 -1.05 2.1 2.1", drawing("circle", { cx: 0, cy: 0, r: 1, class: "disc" }), ...children.flat()),
      element("figcaption", {}, caption),
    );
  const later = decimal((proof.second_us - proof.first_us) / 1000, 1);
  return element(
    "div.proof",
    {},
    disc(text("proof_first"), dots(proof.first, "first")),
    disc(text("proof_second", { value: later }), dots(proof.second, "second")),
    disc(text("proof_turned"), dots(proof.second, "second"), dots(proof.turned, "first")),
    element("p.note", {}, text("proof_help")),
  );
}
