// The map; the host vehicle's lane points upwards. Distances along the road are to scale. Lateral
// ones are compressed, so that a vehicle on a crossing road fits beside one in the next lane.
import { TEXTS, fill } from "./texts.js";

const SVG = "http://www.w3.org/2000/svg";
const RANGES_M = [25, 35, 50, 70, 100, 140];
const LANE_M = 3.5;
const SIDE_M = 1.5 * LANE_M; // lateral distances are to scale up to here
const BEND_M = 8.0;          // and logarithmic beyond, with this scale
const FARTHEST_M = 90.0;     // at the edge of the map, and beyond

export class Road {
  #svg;
  #range_m = RANGES_M[2];
  #size = { width: 0, height: 0 };
  #view = null;

  constructor(svg) {
    this.#svg = svg;
    svg.setAttribute("aria-label", TEXTS.map);
    new ResizeObserver(([entry]) => {
      const { width, height } = entry.contentRect;
      this.#size = { width, height };
      svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
      if (this.#view) this.draw(this.#view);
    }).observe(svg);
  }

  draw(view) {
    this.#view = view;
    const { width, height } = this.#size;
    if (width < 40 || height < 40) return;
    this.#chooseRange(view);
    const lane = Math.min(Math.max(Math.min(width * 0.17, height * 0.24), 44), 96);
    const size = { width: lane * 0.5, length: lane * 0.95 };
    const behind = size.length * (view.group.follower_count > 0 ? 2.35 : 1.4);
    const host = { x: width / 2, y: height - behind };  // the front bumper
    const scale = (host.y - 20) / this.#range_m;
    const edge = width / 2 - size.length * 0.55;
    const at = (ahead_m, right_m) => ({
      x: host.x + Math.sign(right_m) * lateral(Math.abs(right_m), lane, edge),
      y: host.y + size.length / 2 - ahead_m * scale,
    });
    const parts = [...this.#lanes(host, lane, height)];
    const labels = [];
    const lead = view.lead;
    if (lead === null || (lead.gap_m === null && lead.identity !== "no_lead")) {
      parts.push(make("rect", { x: host.x - lane / 2, y: 0, width: lane, height: host.y, class: "unknown" }));
    } else if (lead.safe_gap_m !== null) {
      parts.push(...this.#safeZone(host, lane, scale, lead));
      labels.push(text(host.x + lane / 2 + 12, host.y - lead.safe_gap_m * scale + 5,
        fill(TEXTS.safeLine, { safe: Math.round(lead.safe_gap_m) }), "start"));
    }
    for (const each of [...view.vehicles].reverse()) {
      const place = at(each.ahead_m, each.right_m);
      if (place.y > -size.length && place.y < height + size.length) {
        parts.push(this.#vehicle(place, size, each.in_alarm ? `${each.source} in-alarm` : each.source, each.relative_heading_rad));
      }
    }
    if (lead?.gap_m != null) {
      const rear = Math.max(host.y - lead.gap_m * scale, size.length + 34);
      parts.push(...this.#gap(host, rear));
      const place = { x: host.x, y: rear - size.length / 2 };
      parts.push(this.#vehicle(place, size, "lead", null));
      labels.push(...this.#plate(place, size, lead));
    }
    if (view.group.follower_count > 0) {
      const y = height - size.length * 0.6; // its distance is unknown
      parts.push(this.#vehicle({ x: host.x, y }, size, "follower", null));
      labels.push(text(host.x + lane / 2 + 12, y + 5, TEXTS.follows, "start"));
    }
    parts.push(this.#vehicle({ x: host.x, y: host.y + size.length / 2 }, size, "host", null));
    this.#svg.replaceChildren(...hatch(), ...parts, ...labels);
  }

  #chooseRange(view) {
    const needed = Math.max(20, (view.lead?.safe_gap_m ?? 0) * 1.12, (view.lead?.gap_m ?? 0) + 8);
    if (needed > this.#range_m || needed < this.#range_m * 0.5) {
      this.#range_m = RANGES_M.find((range) => range >= needed) ?? RANGES_M.at(-1);
    }
  }

  #lanes(host, lane, height) {
    const line = (x, kind) => make("line", { x1: x, x2: x, y1: 0, y2: height, class: kind });
    return [
      make("rect", { x: host.x - lane * 1.5, y: 0, width: lane * 3, height, class: "asphalt" }),
      make("rect", { x: host.x - lane / 2, y: 0, width: lane, height, class: "host-lane" }),
      line(host.x - lane / 2, "dashes"), line(host.x + lane / 2, "dashes"),
      line(host.x - lane * 1.5, "edge"), line(host.x + lane * 1.5, "edge"),
    ];
  }

  #safeZone(host, lane, scale, lead) {
    const top = host.y - lead.safe_gap_m * scale;
    const x = host.x - lane / 2;
    return [
      make("rect", { x, y: top, width: lane, height: host.y - top, class: "safe-zone" }),
      make("line", { x1: x - 6, x2: x + lane + 6, y1: top, y2: top, class: "safe-line" }),
    ];
  }

  #gap(host, rear) {
    const bottom = host.y - 6, top = rear + 6;
    if (bottom - top < 8) return [];
    const tick = (y) => make("line", { x1: host.x - 9, x2: host.x + 9, y1: y, y2: y, class: "gap-line" });
    return [make("line", { x1: host.x, x2: host.x, y1: top, y2: bottom, class: "gap-line" }), tick(top), tick(bottom)];
  }

  #plate(place, size, lead) {
    const known = lead.identity === "known" && lead.plate;
    const words = known ? lead.plate : withoutPlate(lead);
    const width = Math.max(words.length * (known ? 11.5 : 7.4) + 16, 60);
    const x = place.x - width / 2, y = place.y - size.length / 2 - 32;
    const label = text(place.x, y + 19, words, known ? "plate-text" : "");
    return known ? [make("rect", { x, y, width, height: 26, rx: 5, class: "plate" }), label] : [label];
  }

  #vehicle(place, size, kind, relative_heading_rad) {
    const w = size.width, l = size.length, turned = ((relative_heading_rad ?? 0) * 180) / Math.PI;
    const group = make("g", {
      class: `vehicle ${kind}`, transform: `translate(${place.x} ${place.y}) rotate(${turned})`,
    });
    group.append(
      make("path", { class: "body", d: body(w, l) }),
      make("path", { class: "glass", d: glass(w, -l * 0.24, 0.8, 0.94, l * 0.15) }),
      make("path", { class: "glass", d: glass(w, l * 0.27, 0.9, 0.78, l * 0.11) }),
    );
    if (kind === "lead" || kind === "host") {
      for (const side of [-1, 1]) {
        group.append(make("rect", {
          class: "lamp", x: side * w * 0.33 - w * 0.09, y: l * 0.46, width: w * 0.18, height: l * 0.035, rx: 1,
        }));
      }
    }
    return group;
  }
}

function withoutPlate({ is_answered, names_asked }) {
  if (is_answered) return TEXTS.knownByMotion;
  return names_asked === null ? TEXTS.plateUnknown : fill(TEXTS.asked, { count: names_asked });
}

function body(w, l) {
  const x = w / 2, y = l / 2;
  return `M${-x * 0.62} ${-y}Q0 ${-y * 1.06} ${x * 0.62} ${-y}Q${x} ${-y * 0.97} ${x} ${-y * 0.68}`
    + `V${y * 0.8}Q${x} ${y} ${x * 0.7} ${y}H${-x * 0.7}Q${-x} ${y} ${-x} ${y * 0.8}`
    + `V${-y * 0.68}Q${-x} ${-y * 0.97} ${-x * 0.62} ${-y}Z`;
}

function glass(w, y, top, bottom, height) {
  const a = (w / 2) * top * 0.86, b = (w / 2) * bottom * 0.86;
  return `M${-a} ${y}Q0 ${y - height * 0.3} ${a} ${y}L${b} ${y + height}H${-b}Z`;
}

// Lateral position on the map of a vehicle, in pixels from the centre of the host vehicle's lane.
function lateral(right_m, lane, edge) {
  if (right_m <= SIDE_M) return (right_m / LANE_M) * lane;
  const beside = 1.5 * lane;
  const far = Math.log1p((right_m - SIDE_M) / BEND_M) / Math.log1p((FARTHEST_M - SIDE_M) / BEND_M);
  return beside + Math.max(edge - beside, 0) * Math.min(far, 1);
}

// The pattern of a lane that no sensor covers.
function hatch() {
  const pattern = make("pattern", {
    id: "hatch", width: 12, height: 12, patternUnits: "userSpaceOnUse", patternTransform: "rotate(-45)",
  });
  pattern.append(make("rect", { width: 5, height: 12, class: "hatch" }));
  return [pattern];
}

function make(name, attributes) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  return element;
}

function text(x, y, words, kind) {
  const element = make("text", { x, y, class: kind });
  element.textContent = words;
  return element;
}
