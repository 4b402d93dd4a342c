// State of each car over time, with brakings, warnings and lost sensors; a click selects a time.
import { svg } from "./make.js";
import { isWarning } from "./store.js";

const MARKS = {
  hard_brake: "M-5-4H5L0 5Z",
  alarm: "M-5 4H5L0-5Z",
  sensor_lost: "M-4-4 4 4M-4 4 4-4",
};
const LABEL_PX = 76, ROW_PX = 20;

export class Timeline {
  constructor(element, cars, store, onSeek) {
    Object.assign(this, { element, cars, store });
    element.setAttribute("height", cars.length * ROW_PX + 22);
    element.onclick = (event) => {
      const box = element.getBoundingClientRect();
      onSeek((event.clientX - box.left - LABEL_PX) / (box.width - LABEL_PX - 12));
    };
  }

  draw(start_s, duration_s, end_s, at_s) {
    const width = this.element.clientWidth, wide = width - LABEL_PX - 12;
    const x = (stamp_s) => LABEL_PX + Math.min(Math.max((stamp_s - start_s) / duration_s, 0), 1) * wide;
    this.element.setAttribute("viewBox", `0 0 ${width} ${this.cars.length * ROW_PX + 22}`);
    const parts = [];
    this.cars.forEach(({ name }, index) => {
      const y = index * ROW_PX;
      parts.push(words(4, y + 15, name, "name"));
      const states = [{ stamp_s: start_s, state: "regular" },
        ...this.store.between(name, "transition", -Infinity, end_s), { stamp_s: end_s }];
      for (let n = 0; n + 1 < states.length; n += 1) {
        const from = x(states[n].stamp_s), to = x(states[n + 1].stamp_s);
        if (to > from) {
          parts.push(svg("rect", { class: states[n].state, x: from, y: y + 3, width: to - from, height: ROW_PX - 6 }));
        }
      }
      for (const [kind, path] of Object.entries(MARKS)) {
        for (const entry of this.store.between(name, kind, start_s, end_s)) {
          if (kind === "alarm" && !isWarning(entry)) continue;
          parts.push(svg("path", { class: kind, d: path, transform: `translate(${x(entry.stamp_s)} ${y + ROW_PX / 2})` }));
        }
      }
    });
    const bottom = this.cars.length * ROW_PX;
    for (let s = 0; s <= duration_s; s += duration_s > 90 ? 30 : 5) {
      parts.push(words(x(start_s + s), bottom + 16, `${s}`, "tick"));
    }
    parts.push(svg("line", { class: "playhead", x1: x(at_s), x2: x(at_s), y1: 0, y2: bottom + 4 }));
    this.element.replaceChildren(...parts);
  }
}

function words(x, y, text, kind) {
  const element = svg("text", { x, y, class: kind });
  element.textContent = text;
  return element;
}
