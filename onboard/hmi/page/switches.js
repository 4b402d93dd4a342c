// Colours of day and night, and the voice: what the driver chose stays with the browser.
import { TEXTS } from "./texts.js";

const CHOICES = ["auto", "day", "night"];
const night = matchMedia("(prefers-color-scheme: dark)");

export function switchColours(button, icon) {
  let choice = CHOICES.includes(remembered("colours")) ? remembered("colours") : "auto";
  const apply = () => {
    const isNight = choice === "night" || (choice === "auto" && night.matches);
    document.documentElement.dataset.colours = isNight ? "night" : "day";
    icon.setAttribute("href", `#icon-${choice}`);
    button.setAttribute("aria-label", TEXTS.colours[choice]);
    button.title = TEXTS.colours[choice];
  };
  button.onclick = () => {
    choice = CHOICES[(CHOICES.indexOf(choice) + 1) % CHOICES.length];
    remember("colours", choice);
    apply();
  };
  night.addEventListener("change", apply);
  apply();
}

export function switchVoice(button) {
  let isOn = remembered("voice") === "on";
  const apply = () => button.setAttribute("aria-pressed", String(isOn));
  button.setAttribute("aria-label", TEXTS.voice);
  button.title = TEXTS.voice;
  button.onclick = () => {
    isOn = !isOn;
    remember("voice", isOn ? "on" : "off");
    apply();
  };
  apply();
  return () => isOn;
}

// A screen that goes dark warns nobody. Only pages of this machine or over TLS may ask for this.
export async function keepAwake() {
  if (!("wakeLock" in navigator) || document.hidden) return;
  try {
    await navigator.wakeLock.request("screen");
  } catch { /* The device decides, a battery that is low for instance. */ }
}

function remembered(name) {
  try { return localStorage.getItem(name); } catch { return null; }
}

function remember(name, value) {
  try { localStorage.setItem(name, value); } catch { /* A private window forgets. */ }
}
