// Switches for day and night colours and for speech; the browser stores the choice.
import { TEXTS } from "./texts.js";

const CHOICES = ["auto", "day", "night"];
const night = matchMedia("(prefers-color-scheme: dark)");

export function switchColours(button, icon) {
  let choice = CHOICES.includes(stored("colours")) ? stored("colours") : "auto";
  const apply = () => {
    const isNight = choice === "night" || (choice === "auto" && night.matches);
    document.documentElement.dataset.colours = isNight ? "night" : "day";
    icon.setAttribute("href", `#icon-${choice}`);
    button.setAttribute("aria-label", TEXTS.colours[choice]);
    button.title = TEXTS.colours[choice];
  };
  button.onclick = () => {
    choice = CHOICES[(CHOICES.indexOf(choice) + 1) % CHOICES.length];
    store("colours", choice);
    apply();
  };
  night.addEventListener("change", apply);
  apply();
}

export function switchVoice(button) {
  let isOn = stored("voice") === "on";
  const apply = () => button.setAttribute("aria-pressed", String(isOn));
  button.setAttribute("aria-label", TEXTS.voice);
  button.title = TEXTS.voice;
  button.onclick = () => {
    isOn = !isOn;
    store("voice", isOn ? "on" : "off");
    apply();
  };
  apply();
  return () => isOn;
}

// Keep the screen on. Browsers allow it only to pages of this computer or over TLS.
export async function keepAwake() {
  if (!("wakeLock" in navigator) || document.hidden) return;
  try {
    await navigator.wakeLock.request("screen");
  } catch { /* The device may refuse, for instance with a low battery. */ }
}

function stored(name) {
  try { return localStorage.getItem(name); } catch { return null; }
}

function store(name, value) {
  try { localStorage.setItem(name, value); } catch { /* A private window stores nothing. */ }
}
