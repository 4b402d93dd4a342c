// The driver's page: draws each view that the server sends.
import { make } from "./elements.js";
import { showMembers, showMessages } from "./group.js";
import { Link } from "./link.js";
import { Road } from "./road.js";
import { Sounds, speak } from "./sounds.js";
import { keepAwake, switchColours, switchVoice } from "./switches.js";
import { Tabs } from "./tabs.js";
import { TEXTS, fill } from "./texts.js";

const KM_H = 3.6;
const MOST_IN_CHAIN = 7; // vehicles drawn on each side of the host vehicle
const $ = (id) => document.getElementById(id);

document.documentElement.lang = TEXTS.language;
document.title = TEXTS.title;
for (const element of document.querySelectorAll("[data-text]")) {
  element.textContent = TEXTS[element.dataset.text];
}

const road = new Road($("road"));
const voiceIsOn = switchVoice($("voice"));
switchColours($("colours"), $("colours-icon"));
const sounds = new Sounds((isOn) => {
  $("sound").setAttribute("aria-pressed", String(isOn));
  $("sound").setAttribute("aria-label", isOn ? TEXTS.soundOn : TEXTS.soundOff);
  $("sound-icon").setAttribute("href", isOn ? "#icon-sound" : "#icon-mute");
  $("sound-word").hidden = isOn;
});
$("sound").onclick = () => sounds.toggle();
document.addEventListener("visibilitychange", keepAwake);
keepAwake();

let raised = ""; // cause, level and time of the present alarms
let last = null; // the last view
new Tabs($("tabs"), () => { if (last !== null) showMiddle(last); });
const link = new Link("views", show, showAge);
$("brake").onclick = () => link.send("brake");
fetch("build").then((answer) => answer.text()).then((build) => { $("build").textContent = `onboard ${build}`; });

function show(view) {
  last = view;
  showAlarms(view.alarms);
  showRequest(view.brake_request);
  showGroup(view.group);
  showSensors(view.sensors, view.recorder_failure, view.failed_files);
  $("brake").hidden = !view.brake_button;
  showMiddle(view);
}

// Only the tab that is seen.
function showMiddle(view) {
  if (!$("group-view").hidden) {
    showMembers($("members"), view);
    showMessages($("messages"), view);
    return;
  }
  showLead(view);
  for (const item of $("legend").children) {
    item.hidden = !view.vehicles.some((vehicle) => vehicle.source === item.className);
  }
  road.draw(view);
}

function showGroup({ state, group_number, leader_id, follower_count }) {
  $("group").dataset.state = state;
  $("state").textContent = fill(TEXTS[state], { number: group_number });
  const ahead = group_number - 1;
  const note = { regular: TEXTS.noteRegular, leader: TEXTS.noteLeader }[state]
    ?? (ahead === 1 ? TEXTS.noteMemberOne : fill(TEXTS.noteMember, { count: ahead }));
  $("state-note").textContent = state === "regular" ? note : `${note} · ${fill(TEXTS.group, { leader: leader_id })}`;
  const kinds = [
    ...Array(Math.min(ahead, MOST_IN_CHAIN)).fill("ahead"),
    "host",
    ...Array(Math.min(follower_count, MOST_IN_CHAIN)).fill("behind"),
  ];
  $("chain").replaceChildren(...kinds.map((kind) => make("li", kind, "")));
}

function showLead({ lead, speed_m_s }) {
  $("speed").textContent = speed_m_s === null ? "–" : Math.round(speed_m_s * KM_H);
  const figures = $("figures");
  $("gap-label").textContent = TEXTS.gap;
  if (lead === null || lead.gap_m === null) {
    const isFree = lead?.identity === "no_lead";
    figures.dataset.gap = isFree ? "none" : "lost";
    $("gap").textContent = "–";
    $("gap-unit").hidden = true;
    $("gap-bar").style.width = "0";
    $("gap-note").textContent = isFree ? TEXTS.noLead : lead === null ? TEXTS.gapUnknown : TEXTS.leadUnknown;
    return;
  }
  const { gap_m, safe_gap_m } = lead;
  $("gap").textContent = gap_m < 10 ? gap_m.toFixed(1) : Math.round(gap_m);
  $("gap-unit").hidden = false;
  if (safe_gap_m === null) {
    figures.dataset.gap = "none";
    $("gap-bar").style.width = "0";
    $("gap-note").textContent = TEXTS.noSpeed;
    return;
  }
  const share = safe_gap_m > 0 ? gap_m / safe_gap_m : 1;
  figures.dataset.gap = share >= 1 ? "safe" : share >= 0.5 ? "close" : "tight";
  $("gap-bar").style.width = `${Math.min(share, 1) * 100}%`;
  const headway = speed_m_s > 0.5 ? (gap_m / speed_m_s).toFixed(1) : "–";
  $("gap-note").textContent = fill(TEXTS.safeFrom, { headway, safe: Math.round(safe_gap_m) });
}

function showSensors(sensors, recorder_failure, failed_files) {
  const names = { camera: TEXTS.camera, speed: TEXTS.speedSensor, position: TEXTS.position, radio: TEXTS.radio, detector: TEXTS.detector };
  $("sensors").replaceChildren(...sensors.map(({ sensor, is_lost, reason, impairments }) => {
    const why = [...(is_lost ? [TEXTS.reasons[reason] ?? reason] : []), ...impairments.map((each) => TEXTS.impairments[each])];
    const item = make("li", why.length > 0 ? "lost" : "", "");
    item.dataset.sensor = sensor;
    const words = make("span", "", is_lost ? fill(TEXTS.lost, { sensor: names[sensor] }) : names[sensor]);
    if (why.length > 0) words.append(make("small", "", why.join("; ")));
    item.append(icon(sensor), words);
    return item;
  }));
  if (recorder_failure !== null) showFailure(TEXTS.notRecording, recorder_failure);
  for (const { use, reason } of failed_files) showFailure(TEXTS.notWritten[use], reason);
}

function showFailure(text, reason) {
  const words = make("span", "", text);
  words.append(make("small", "", reason));
  const item = make("li", "lost", "");
  item.append(icon("recorder"), words);
  $("sensors").append(item);
}

function showAlarms(alarms) {
  const first = alarms[0];
  const names = alarms.map((alarm) => `${alarm.cause} ${alarm.level} ${alarm.raised_at_s}`);
  const isNew = names.some((name) => !raised.includes(name));
  raised = names.join(", ");
  document.body.dataset.alarm = first?.level ?? "none";
  $("alarm").hidden = first === undefined;
  if (first !== undefined) {
    const words = alarmTexts(first);
    $("alarm-sign").setAttribute("href", `#sign-${words.sign}`);
    $("alarm-headline").textContent = words.headline;
    $("alarm-sentence").textContent = words.sentence;
    $("alarm-also").textContent = counted(alarms.slice(1).map((alarm) => alarmTexts(alarm).sentence)).join(" · ");
    if (isNew && voiceIsOn()) speak(`${words.headline} ${words.sentence}`, TEXTS.language);
  }
  sounds.hold(first?.level ?? "none", isNew);
}

function showRequest(request) {
  $("brake-request").hidden = request === null;
  if (request === null) return;
  const percent = Math.round(request.certainty * 100);
  $("brake-request").textContent = fill(TEXTS.brakeRequest, { value: request.deceleration_m_s2.toFixed(1), percent });
}

// Each sentence once, with its number where it comes more often.
function counted(sentences) {
  return [...new Set(sentences)].map((sentence) => {
    const count = sentences.filter((each) => each === sentence).length;
    return count === 1 ? sentence : fill(TEXTS.several, { sentence, count });
  });
}

function alarmTexts({ headline, sign, sentence, vehicles_ahead, is_test }) {
  if (is_test) return { sign, headline: TEXTS.test, sentence: TEXTS.testOfWarning };
  const words = vehicles_ahead > 1 ? fill(TEXTS.brakesAhead, { count: vehicles_ahead }) : TEXTS.sentences[sentence] ?? sentence;
  return { sign, headline: TEXTS.headlines[headline], sentence: words };
}

function showAge(age_ms, isStale) {
  const before = document.body.dataset.link;
  const now = !isStale ? "live" : age_ms === null ? "waiting" : "lost";
  document.body.dataset.link = now;
  $("stale").hidden = now === "live";
  if (now === "live") return;
  $("stale-headline").textContent = now === "waiting" ? TEXTS.connecting : TEXTS.stale;
  $("stale-sentence").textContent = now === "waiting" ? "" : fill(TEXTS.staleFor, { seconds: Math.round(age_ms / 1000) });
  if (before === "live") { // An alarm from before the loss may be over: stop it.
    showAlarms([]);
    showRequest(null);
    sounds.once("stale");
  }
}

function icon(name) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  const use = document.createElementNS("http://www.w3.org/2000/svg", "use");
  use.setAttribute("href", `#icon-${name}`);
  svg.append(use);
  return svg;
}
