// The alarm sounds. Each level is a sequence of rising notes, repeated while the alarm lasts; a
// warning has more and higher notes than a caution.

export const PATTERNS = {
  caution: { notes_hz: [784, 988], note_s: 0.14, gain: 0.5, repeat_s: 3.0 },
  warning: { notes_hz: [988, 1245, 1568, 1976], note_s: 0.11, gain: 0.9, repeat_s: 0.8 },
  stale: { notes_hz: [494, 370], note_s: 0.18, gain: 0.35, repeat_s: null },
};

// Schedule one sequence of notes on the audio clock; a square wave is audible over road noise.
export function schedule(context, pattern, at_s) {
  pattern.notes_hz.forEach((note_hz, index) => {
    const start_s = at_s + index * pattern.note_s;
    const end_s = start_s + pattern.note_s;
    const oscillator = new OscillatorNode(context, { type: "square", frequency: note_hz });
    const envelope = new GainNode(context, { gain: 0 });
    envelope.gain.setValueAtTime(0, start_s);
    envelope.gain.linearRampToValueAtTime(pattern.gain, start_s + 0.008);
    envelope.gain.setValueAtTime(pattern.gain, end_s - 0.02);
    envelope.gain.linearRampToValueAtTime(0, end_s);
    oscillator.connect(envelope).connect(context.destination);
    oscillator.start(start_s);
    oscillator.stop(end_s);
  });
}

export class Sounds {
  #context = null;
  #level = "none";
  #next = null;

  // Browsers allow sound only after the page has been touched; onState(isOn) is called with each
  // change.
  constructor(onState) {
    this.onState = onState;
    this.#context = new AudioContext();
    this.#context.onstatechange = () => this.onState(this.isOn);
  }

  get isOn() { return this.#context.state === "running"; }

  async toggle() {
    if (this.isOn) await this.#context.suspend();
    else await this.#context.resume();
    this.onState(this.isOn);
  }

  // Repeat the sound of this level, "none" for silence; `isNew` starts it again at once.
  hold(level, isNew) {
    if (!isNew && level === this.#level) return;
    this.#level = level;
    clearTimeout(this.#next);
    if (level !== "none") this.#play();
  }

  once(name) {
    if (this.isOn) schedule(this.#context, PATTERNS[name], this.#context.currentTime);
  }

  #play() {
    const pattern = PATTERNS[this.#level];
    if (this.isOn) schedule(this.#context, pattern, this.#context.currentTime);
    this.#next = setTimeout(() => this.#play(), pattern.repeat_s * 1000);
  }
}

export function speak(text, language) {
  if (!("speechSynthesis" in window)) return;
  speechSynthesis.cancel();
  const utterance = new SpeechSynthesisUtterance(text);
  utterance.lang = language;
  utterance.rate = 1.15;
  speechSynthesis.speak(utterance);
}
