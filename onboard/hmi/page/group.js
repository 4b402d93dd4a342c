// The second view: the members of the own group, and the messages of the vehicles nearby.
import { make } from "./elements.js";
import { TEXTS, fill } from "./texts.js";

const KM_H = 3.6;
const UNITS = [["_m_s2", "m/s²"], ["_m_s", "m/s"], ["_s", "s"], ["_m", "m"]];

export function showMembers(list, { members, stamp_s }) {
  list.replaceChildren(...members.map((member) => {
    const row = make("li", member.relation, "");
    row.classList.toggle("brakes", member.brakes);
    const name = make("span", "name", member.relation === "host" ? TEXTS.thisCar : member.car);
    const note = member.relation === "host" ? member.car : TEXTS.relations[member.relation];
    if (note) name.append(make("small", "", note));
    const state = make("span", "member-state", TEXTS.states[member.state]);
    if (member.brakes) state.append(make("strong", "", TEXTS.brakesHard));
    const age = member.relation === "host" ? "" : ago(stamp_s - member.received_at_s);
    row.append(make("span", "number", member.number), name, state, make("span", "age", age));
    return row;
  }));
}

export function showMessages(list, { messages, stamp_s }) {
  if (messages.length === 0) {
    list.replaceChildren(make("li", "none", TEXTS.noMessages));
    return;
  }
  list.replaceChildren(...messages.map((each) => {
    const row = make("li", each.message, "");
    const words = make("span", "name", fill(TEXTS.messages[each.message] ?? TEXTS.otherMessage, {
      kind: each.message,
      from: each.sender,
      to: each.is_to_host ? TEXTS.thisCarAsObject : each.receiver,
    }));
    const position = each.leader === null ? [] : [fill(TEXTS.ofGroup, each)];
    words.append(make("small", "", [...position, ...contents(each.content)].join(" · ")));
    row.append(words, make("span", "age", ago(stamp_s - each.received_at_s)));
    return row;
  }));
}

function contents(content) {
  return Object.entries(content).filter(([, value]) => value !== null)
    .map(([name, value]) => described(name, value));
}

// A field without a text of its own is shown under its name, whose end is its unit.
function described(name, value) {
  if (name === "speed_m_s") return fill(TEXTS.fields.speed_m_s, { value: Math.round(value * KM_H) });
  const shown = typeof value === "number" ? Number(value.toFixed(2)) : Array.isArray(value) ? value.length : value;
  const words = TEXTS.values[shown] ?? String(shown).replaceAll("_", " ");
  if (TEXTS.fields[name]) return fill(TEXTS.fields[name], { value: words });
  const [ending, unit] = UNITS.find(([each]) => name.endsWith(each)) ?? ["", ""];
  return `${name.slice(0, name.length - ending.length).replaceAll("_", " ")} ${words} ${unit}`.trim();
}

function ago(age_s) {
  return fill(TEXTS.ago, { seconds: Math.max(age_s, 0).toFixed(1) });
}
