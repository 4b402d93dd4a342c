// One card per car: camera image with the plates read, state, alarms, lost sensors.
import { html, svg } from "./make.js";

const WIDTH_PX = 640, HEIGHT_PX = 360;
const PLATE_SHOWN_S = 0.15;

export class Card {
  constructor(car, store) {
    this.car = car.name;
    this.store = store;
    this.picture = html("canvas", { width: WIDTH_PX, height: HEIGHT_PX });
    this.boxes = svg("svg", { viewBox: `0 0 ${WIDTH_PX} ${HEIGHT_PX}` });
    this.state = html("strong");
    this.place = html("span", { class: "soft" });
    this.numbers = html("p", { class: "numbers" });
    this.notes = html("p", { class: "notes" });
    this.element = html("article", { class: "card", "data-car": car.name, "data-colour": car.colour },
      html("h2", {}, html("i", { class: "swatch" }), car.name, html("span", { class: "soft" }, car.identity),
        ...(car.page ? [html("a", { href: car.page, target: "_blank", rel: "noopener" }, "driver's page ↗")] : [])),
      html("div", { class: "picture" }, this.picture, this.boxes),
      html("p", { class: "state" }, this.state, " ", this.place),
      this.numbers, this.notes);
  }

  draw(at_s) {
    this.#drawTexts(at_s);
    this.wanted_s = at_s;
    if (!this.busy) this.#drawPictures();
  }

  // One request at a time, until the image of the last requested time is drawn.
  async #drawPictures() {
    this.busy = true;
    let drawn_s;
    while (drawn_s !== this.wanted_s) {
      drawn_s = this.wanted_s;
      try { await this.#drawPicture(drawn_s); } catch { /* The run has ended; the last image stays. */ }
    }
    this.busy = false;
  }

  async #drawPicture(at_s) {
    const response = await fetch(`pictures/${this.car}?at_s=${at_s}`);
    const stamp = response.headers.get("X-Stamp");
    if (!response.ok || stamp === this.stamp) return;
    const picture = await createImageBitmap(await response.blob());
    this.picture.getContext("2d").drawImage(picture, 0, 0, WIDTH_PX, HEIGHT_PX);
    this.stamp = stamp;
  }

  #drawTexts(at_s) {
    const { store, car } = this;
    const place = store.last(car, "transition", at_s);
    const state = place?.state ?? "regular";
    this.element.dataset.state = state;
    this.state.textContent = state === "member" ? `MEMBER ${place.group_number}` : state.toUpperCase();
    this.place.textContent = state === "member" ? `behind ${place.leader_id}` : "";
    const speed = store.last(car, "speed", at_s), lead = store.last(car, "lead", at_s);
    const gap = lead?.gap_m == null ? "no lead" : `${lead.text ?? "unread"} in ${lead.gap_m.toFixed(1)} m`;
    const parts = [`${speed ? (speed.speed_m_s * 3.6).toFixed(0) : "–"} km/h`, gap, ...this.#identity(lead, at_s)];
    this.numbers.textContent = parts.join(" · ");
    const plates = store.between(car, "plate", at_s - PLATE_SHOWN_S, at_s);
    const newest = plates.at(-1)?.stamp_s;
    this.boxes.replaceChildren(...plates.filter((plate) => plate.stamp_s === newest).flatMap(plateBox));
    this.notes.replaceChildren(...this.#alarms(at_s), ...this.#lost(at_s));
    this.element.dataset.alarm = this.notes.querySelector(".warning") ? "warning" : "";
  }

  // What was asked about the lead's track, and who it is.
  #identity(lead, at_s) {
    const newest = (kinds) => kinds.flatMap((kind) => this.store.between(this.car, kind, -Infinity, at_s))
      .filter(({ track_id }) => track_id === lead?.track_id)
      .sort((one, other) => one.order - other.order).at(-1);
    const asked = newest(["inquired"]), known = newest(["identified", "identity_lost"]);
    if (lead?.gap_m == null || !asked) return [];
    const texts = `asked: ${asked.names} ${asked.names === 1 ? "text" : "texts"}`;
    if (known?.kind !== "identified") return [texts];
    return [`${texts}, answered by ${known.text ?? known.car_id}`];
  }

  #alarms(at_s) {
    const current = new Map();
    for (const alarm of this.store.between(this.car, "alarm", -Infinity, at_s)) current.set(`${alarm.cause} ${alarm.vehicle}`, alarm);
    return [...current.values()].filter((alarm) => alarm.level !== "none")
      .map((alarm) => html("span", { class: alarm.level }, alarm.cause.replace("_", " ")));
  }

  #lost(at_s) {
    const changes = [
      ...this.store.between(this.car, "sensor_lost", -Infinity, at_s),
      ...this.store.between(this.car, "sensor_recovered", -Infinity, at_s),
    ].filter((change) => (change.traced_s ?? 0) <= at_s).sort((one, other) => one.order - other.order);
    const last = new Map(changes.map((change) => [change.sensor, change]));
    return [...last.values()].filter((change) => change.kind === "sensor_lost")
      .map((change) => html("span", { class: "lost" }, `${change.sensor} lost: ${change.reason}`));
  }
}

function plateBox({ box, text, is_lead }) {
  const kind = is_lead ? "lead" : "other";
  const label = svg("text", { x: box.x_px, y: box.y_px - 7, class: kind });
  label.textContent = text ?? "";
  return [svg("rect", { x: box.x_px, y: box.y_px, width: box.w_px, height: box.h_px, class: kind }), label];
}
