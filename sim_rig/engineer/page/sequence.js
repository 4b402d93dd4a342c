// Sequence diagram: a lifeline per car, time downwards, an arrow per received message.
import { svg } from "./make.js";

const TOP_PX = 26, SIDE_PX = 58;
const AHEAD = 0.4;       // part of the window after the shown time, when that is in the past
const NAME_ALL_S = 0.5;  // longer windows label rare messages only
const OFTEN = new Set(["join", "reply", "inquiry", "answer"]);
const EVENT_LABELS = {
  hard_brake: (entry) =>
    entry.is_over ? "braking is over" : `brakes ${entry.deceleration_m_s2.toFixed(1)} m/s²`,
  warning: (entry) => `warned: ${entry.origin_id}`,
  identified: (entry) => `ahead: ${entry.car_id}`,
  identity_lost: (entry) => `${entry.cause}: ${entry.car_id}`,
  transition: (entry) => entry.event.replace("_", " "),
};

export class Sequence {
  constructor(element, cars, store) {
    Object.assign(this, { element, cars: cars.map(({ name }) => name), store });
  }

  draw(moment_s, window_s, start_s, isPast) {
    this.window_s = window_s;
    const at_s = moment_s + (isPast ? AHEAD * window_s : 0);
    const { clientWidth: width, clientHeight: height } = this.element;
    if (width < 50 || height < 50) return;
    const from_s = at_s - window_s;
    const x = (car) => SIDE_PX + (this.cars.indexOf(car) + 0.5) * ((width - SIDE_PX) / this.cars.length);
    const y = (stamp_s) => TOP_PX + ((stamp_s - from_s) / window_s) * (height - TOP_PX - 8);
    this.element.setAttribute("viewBox", `0 0 ${width} ${height}`);
    const parts = [], labels = [];
    for (const car of this.cars) {
      parts.push(svg("line", { class: "life", x1: x(car), x2: x(car), y1: TOP_PX, y2: height }));
      labels.push(textAt(x(car), 16, car, "car"));
    }
    const step_s = window_s / 5;
    for (let s = Math.ceil((from_s - start_s) / step_s) * step_s; s <= at_s - start_s; s += step_s) {
      labels.push(textAt(4, y(start_s + s) + 4, s.toFixed(window_s < 1 ? 2 : 1), "time"));
    }
    for (const car of this.cars) {
      for (const entry of this.store.between(car, "received", from_s, at_s)) this.#arrow(entry, x, y, parts, labels);
      for (const entry of this.store.between(car, "discarded", from_s, at_s)) {
        const mark = svg("path", { class: "discard", d: "M-4-4 4 4M-4 4 4-4", transform: `translate(${x(car)} ${y(entry.stamp_s)})` });
        mark.append(title(`${car} discards: ${entry.reason} (${entry.detail})`));
        parts.push(mark);
      }
      for (const [kind, describe] of Object.entries(EVENT_LABELS)) {
        for (const entry of this.store.between(car, kind, from_s, at_s)) {
          parts.push(svg("circle", { class: kind, cx: x(car), cy: y(entry.stamp_s), r: 4.5 }));
          labels.push(textAt(x(car) + 9, y(entry.stamp_s) + 4, describe(entry), `mark ${kind}`));
        }
      }
    }
    if (isPast) parts.push(svg("line", { class: "moment", x1: SIDE_PX, x2: width, y1: y(moment_s), y2: y(moment_s) }));
    this.element.replaceChildren(...parts, ...labels);
  }

  #arrow(entry, x, y, parts, labels) {
    const sender = entry.content?.sender_id;
    if (!this.cars.includes(sender)) return;
    const sent_s = this.store.sentAt(entry) ?? entry.stamp_s;
    const to = entry.content.to_id;
    const overheard = to !== undefined && to !== entry.car;
    const x1 = x(sender), x2 = x(entry.car), y1 = y(sent_s), y2 = y(entry.stamp_s);
    const kind = `${entry.message} ${overheard ? "overheard" : ""}`;
    const arrow = svg("g", { class: `message ${kind}` },
      svg("line", { x1, x2, y1, y2 }),
      svg("path", { d: "M0 0-7-3.5V3.5Z", transform: `translate(${x2} ${y2}) rotate(${(Math.atan2(y2 - y1, x2 - x1) * 180) / Math.PI})` }));
    arrow.append(title(`${entry.message} ${sender} to ${entry.car}, ${((entry.stamp_s - sent_s) * 1e3).toFixed(1)} ms`));
    parts.push(arrow);
    if (!overheard && (this.window_s <= NAME_ALL_S || !OFTEN.has(entry.message))) labels.push(textAt((x1 + 2 * x2) / 3, (y1 + 2 * y2) / 3 - 4, entry.message, `message ${entry.message}`));
  }
}

function textAt(x, y, text, kind) {
  const element = svg("text", { x, y, class: kind });
  element.textContent = text;
  return element;
}

function title(text) {
  const element = svg("title");
  element.textContent = text;
  return element;
}
