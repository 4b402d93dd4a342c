// All trace entries, by car and kind, in order of their stamps.

export class Store {
  #lists = new Map();
  #sent = new Map(); // the stamps at which a message was sent
  #count = 0;
  first_s = null;
  events = [];       // the entries that the step buttons visit

  // `order` is the order of arrival: a sensor may recover with a sample older than its loss.
  add(entry) {
    entry.order = this.#count += 1;
    this.first_s = Math.min(this.first_s ?? entry.stamp_s, entry.stamp_s);
    insert(this.#list(entry.car, entry.kind), entry);
    if (!OFTEN.has(entry.kind)) insert(this.events, entry);
    if (entry.kind === "sent") {
      const key = messageKey(entry.car, entry);
      this.#sent.set(key, [...(this.#sent.get(key) ?? []), entry.stamp_s]);
    }
  }

  // The last entry of a kind at a time, or undefined.
  last(car, kind, at_s) {
    const list = this.#list(car, kind);
    return list[after(list, at_s) - 1];
  }

  // The entries of a kind in (from, until].
  between(car, kind, from_s, until_s) {
    const list = this.#list(car, kind);
    return list.slice(after(list, from_s), after(list, until_s));
  }

  // The stamp at which a received message was sent.
  sentAt(received) {
    const stamps = this.#sent.get(messageKey(received.content?.sender_id, received)) ?? [];
    return stamps.filter((at_s) => at_s <= received.stamp_s).at(-1);
  }

  eventsBefore(at_s, count) {
    const end = after(this.events, at_s);
    return this.events.slice(Math.max(0, end - count), end);
  }

  // The next entry to stop at, forwards (+1) or backwards (-1).
  next(at_s, direction, stopsAt) {
    const list = stopsAt ? this.events.filter(stopsAt) : this.events;
    if (direction > 0) return list[after(list, at_s + 1e-7)];
    return list[after(list, at_s - 1e-7) - 1];
  }

  #list(car, kind) {
    const key = `${car} ${kind}`;
    if (!this.#lists.has(key)) this.#lists.set(key, []);
    return this.#lists.get(key);
  }
}

// A warning of any cause.
export function isWarning({ kind, level }) {
  return kind === "alarm" && level === "warning";
}

const OFTEN = new Set(["speed", "lead", "plate", "perceived_object"]);

function messageKey(sender, { message, content }) {
  return `${sender} ${message} ${JSON.stringify(content)}`;
}

function after(list, at_s) {
  let low = 0, high = list.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (list[middle].stamp_s <= at_s) low = middle + 1; else high = middle;
  }
  return low;
}

function insert(list, entry) {
  const last = list.at(-1);
  if (last === undefined || last.stamp_s <= entry.stamp_s) list.push(entry);
  else list.splice(after(list, entry.stamp_s), 0, entry);
}
