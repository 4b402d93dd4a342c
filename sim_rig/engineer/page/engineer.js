// The engineer's page: all cars at one time of the run, either the latest or a selected one.
import { Card } from "./cards.js";
import { html } from "./make.js";
import { Sequence } from "./sequence.js";
import { Store, isWarning } from "./store.js";
import { drawDiscarded, drawFused, drawLedger, drawEvents } from "./tables.js";
import { Timeline } from "./timeline.js";

const POLL_MS = 250;
const BEHIND_S = 0.6; // delay, so that all entries of the shown time have arrived
const WINDOWS_S = [0.05, 0.5, 3, 10];
const $ = (id) => document.getElementById(id);

const store = new Store();
const run = await (await fetch("run")).json();
let next = 0, start_s = null, now_s = 0, received_ms = performance.now();
let paused_s = null;   // the selected time; null follows the run
let window_s = 3;
let isOver = false;

$("title").textContent = run.title;
const cards = run.cars.map((car) => new Card(car, store));
$("cards").append(...cards.map((card) => card.element));
const timeline = new Timeline($("timeline"), run.cars, store, (part) => seek(base() + part * run.duration_s));
const sequence = new Sequence($("sequence"), run.cars, store);
for (const seconds of WINDOWS_S) {
  const button = html("button", { type: "button", "aria-pressed": String(seconds === window_s) }, `${seconds} s`);
  button.onclick = () => {
    window_s = seconds;
    for (const other of $("windows").children) other.setAttribute("aria-pressed", String(other === button));
    draw();
  };
  $("windows").append(button);
}

const steps = {
  "earlier": [-1], "later": [1], "earlier-warning": [-1, isWarning], "later-warning": [1, isWarning],
};
for (const [id, [direction, stopsAt]] of Object.entries(steps)) $(id).onclick = () => step(direction, stopsAt);
$("pause").onclick = () => seek(paused_s === null ? shownTime() : null);
document.onkeydown = (event) => {
  const action = {
    " ": () => $("pause").onclick(), ArrowLeft: () => step(-1), ArrowRight: () => step(1),
    w: () => step(1, isWarning), W: () => step(-1, isWarning),
  }[event.key];
  if (action && !document.body.inert) { event.preventDefault(); action(); }
};
new ResizeObserver(() => draw()).observe($("sequence"));
setInterval(poll, POLL_MS);
setInterval(async () => {
  try { drawLedger($("ledger"), await (await fetch("ledger")).json()); } catch { /* The last ledger stays. */ }
}, 1500);
poll();

function base() { return start_s ?? store.first_s ?? now_s; }

function shownTime() {
  if (paused_s !== null) return paused_s;
  const live_s = now_s + (isOver ? 0 : (performance.now() - received_ms) / 1e3) - BEHIND_S;
  return Math.min(live_s, base() + run.duration_s + 1);
}

function seek(at_s) {
  paused_s = at_s;
  $("pause").textContent = at_s === null ? "Pause" : "Resume";
  document.body.classList.toggle("paused", at_s !== null);
  draw();
}

function step(direction, stopsAt) {
  const entry = store.next(shownTime(), direction, stopsAt);
  if (entry) seek(entry.stamp_s);
}

async function poll() {
  if (poll.busy) return;
  poll.busy = true;
  try {
    let answer;
    do { // A page that is opened late receives the run in parts, and shows it once it has them all.
      answer = await (await fetch(`entries?from=${next}`)).json();
      answer.entries.forEach((entry) => store.add(entry));
      next = answer.next;
    } while (answer.more);
    ({ start_s, now_s } = answer);
    received_ms = performance.now();
    isOver = false;
    document.body.inert = false; // No time can be selected before the run is known.
  } catch { isOver = true; } finally { poll.busy = false; }
  document.body.classList.toggle("over", isOver);
  if (paused_s === null) draw();
}

function draw() {
  const at_s = shownTime();
  $("clock").textContent = start_s === null ? "starting" : `${(at_s - start_s).toFixed(3)} s`;
  timeline.draw(base(), run.duration_s, Math.min(now_s, base() + run.duration_s), at_s);
  sequence.draw(at_s, window_s, base(), paused_s !== null);
  for (const card of cards) card.draw(at_s);
  drawEvents($("events"), store, at_s, base());
  drawDiscarded($("discarded"), run.cars, store, at_s);
  drawFused($("fused"), $("no-fused"), run.cars, store, at_s);
}
