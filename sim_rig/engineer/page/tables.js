// Events, discarded messages, and perceived objects with their measurements.
import { html, row } from "./make.js";

const HIDDEN = new Set(["car", "kind", "stamp_s", "traced_s", "content", "reasons", "signer_id", "message", "order"]);
const OBJECT_SHOWN_S = 1.5;

export function drawEvents(element, store, at_s, start_s) {
  const entries = store.eventsBefore(at_s, 40).reverse();
  element.replaceChildren(...entries.map((entry) => html("li", { class: entry.kind, "data-car": entry.car },
    html("time", {}, (entry.stamp_s - start_s).toFixed(3)), html("b", {}, entry.car),
    html("i", {}, entry.kind.replace("_", " ")), html("span", {}, sentence(entry)))));
}

export function drawDiscarded(table, cars, store, at_s) {
  const counts = new Map();
  cars.forEach(({ name }, index) => {
    for (const { component, reason } of store.between(name, "discarded", -Infinity, at_s)) {
      const key = `${component}: ${reason}`;
      if (!counts.has(key)) counts.set(key, cars.map(() => 0));
      counts.get(key)[index] += 1;
    }
  });
  table.tHead.replaceChildren(html("tr", {}, html("th", {}, "reason"), ...cars.map(({ name }) => html("th", {}, name))));
  table.tBodies[0].replaceChildren(...[...counts].sort().map(([key, each]) => row(key, ...each.map((n) => n || "·"))));
}

export function drawFused(table, none, cars, store, at_s, start_s) {
  const rows = [];
  for (const { name } of cars) {
    const objects = store.between(name, "perceived_object", at_s - OBJECT_SHOWN_S, at_s);
    const newest = objects.at(-1)?.stamp_s;
    for (const car of objects.filter((each) => each.stamp_s === newest)) {
      rows.push(row(name, car.name, car.source, `${car.state[0].toFixed(1)}, ${car.state[1].toFixed(1)}`,
        car.sigma_m.toFixed(2), measurements(car.provenance)));
    }
  }
  table.hidden = rows.length === 0;
  none.hidden = rows.length > 0;
  table.tBodies[0].replaceChildren(...rows);
}

export function drawLedger(table, lines) {
  table.tBodies[0].replaceChildren(...lines.map(({ hop, n, p50_s, p99_s }) =>
    row(hop, n, (p50_s * 1e3).toFixed(1), (p99_s * 1e3).toFixed(1))));
}

// Measurements by observer, each as seconds of the minute, as in BSMs.
function measurements(provenance) {
  const byObserver = new Map();
  for (const [observer, stamp_ms] of provenance) {
    byObserver.set(observer, [...(byObserver.get(observer) ?? []), stamp_ms]);
  }
  return [...byObserver].map(([observer, stamps]) =>
    `${observer}: ${stamps.sort().map((ms) => ((ms % 60000) / 1000).toFixed(2)).join(" ")}`).join("; ") || "own BSM";
}

function sentence(entry) {
  const { message, content } = entry;
  if (message && content) {
    return `${message} from ${content.sender_id}${content.to_id ? ` to ${content.to_id}` : ""}`;
  }
  return Object.entries(entry).filter(([key, value]) => !HIDDEN.has(key) && value !== null && typeof value !== "object")
    .map(([key, value]) => `${key} ${typeof value === "number" && !Number.isInteger(value) ? value.toFixed(3) : value}`).join(" · ");
}
