// Every word on the page. To translate it, translate this file; `{...}` is filled in.
export const TEXTS = {
  language: "en",
  title: "onboard",
  map: "Cars around",

  regular: "No group",
  leader: "Leader",
  member: "Member {number}",
  group: "group {group}",
  noteRegular: "Nobody ahead warns you",
  noteLeader: "You warn the cars behind",
  noteMemberOne: "The car ahead warns you",
  noteMember: "{count} cars ahead warn you",
  follows: "follows you",

  gap: "Gap",
  noLead: "Nobody ahead",
  gapUnknown: "Not known without the camera",
  noSpeed: "No speed: safe gap not known",
  safeFrom: "{headway} s · safe from {safe} m",
  safeLine: "safe {safe} m",
  speed: "Speed",
  plateUnknown: "plate not read",
  objectByBsm: "own radio",
  objectBySensor: "seen",
  objectByShared: "told of",

  camera: "Camera",
  speedSensor: "Speed",
  position: "Position",
  radio: "Radio",
  detector: "Detector",
  lost: "{sensor} lost",
  notRecording: "Not recording",
  why: {
    silent: "silent", frozen: "picture frozen", dark: "picture dark", end_of_recording: "recording ended",
  },

  brakeNow: "Brake!",
  stopNow: "Stop!",
  keepDistance: "Keep distance",
  watchOut: "Watch out",
  groupOne: "The car ahead brakes hard",
  groupSecond: "Hard braking, {count} cars ahead",
  closingGap: "You close in on the car ahead",
  hardBraking: "A car ahead brakes hard",
  crossing: { left: "Car from the left", right: "Car from the right", ahead: "Car crossing" },

  soundOff: "Sound is off: tap",
  soundOn: "Sound on",
  voice: "Say alarms aloud",
  colours: { auto: "Colours: as the device", day: "Colours: day", night: "Colours: night" },
  brakeButton: "Brake (test)",

  connecting: "Connecting",
  stale: "No data",
  staleFor: "Nothing heard for {seconds} s. Warnings would not reach you.",
};

export function fill(text, values) {
  return text.replace(/\{(\w+)\}/g, (_, name) => String(values[name]));
}
