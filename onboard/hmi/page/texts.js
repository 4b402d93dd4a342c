// All texts of the page. To translate the page, translate this file; `{...}` is replaced.
export const TEXTS = {
  language: "en",
  title: "onboard",
  map: "Vehicles nearby",

  regular: "No group",
  leader: "Leader",
  member: "Member {number}",
  group: "group {leader}",
  noteRegular: "No car ahead warns you",
  noteLeader: "You warn the cars behind",
  noteMemberOne: "The car ahead warns you",
  noteMember: "{count} cars ahead warn you",
  follows: "follows you",

  gap: "Gap",
  noLead: "No car ahead",
  gapUnknown: "Unknown without the camera",
  noSpeed: "No speed: safe gap unknown",
  safeFrom: "{headway} s · safe from {safe} m",
  safeLine: "safe {safe} m",
  speed: "Speed",
  plateUnknown: "plate not read",
  asked: "plates asked: {count}",
  knownByMotion: "known by its motion",
  objectByBsm: "by radio (BSM)",
  objectBySensor: "by own sensors",
  objectByShared: "shared by others",

  camera: "Camera",
  speedSensor: "Speed",
  position: "Position",
  radio: "Radio",
  detector: "Detector",
  lost: "{sensor} lost",
  notRecording: "Not recording",
  reasons: {
    silent: "silent", frozen: "image frozen", dark: "image dark", end_of_recording: "recording ended",
  },

  brakeNow: "Brake!",
  stopNow: "Stop!",
  keepDistance: "Keep distance",
  watchOut: "Watch out",
  lccaFirst: "The car ahead brakes hard",
  lccaSecond: "Hard braking, {count} cars ahead",
  fcw: "You are closing in on the car ahead",
  eebl: "A car ahead brakes hard",
  ima: { left: "Car from the left", right: "Car from the right", ahead: "Car crossing" },

  soundOff: "Sound is off: tap",
  soundOn: "Sound on",
  voice: "Speak alarms",
  colours: { auto: "Colours: as the device", day: "Colours: day", night: "Colours: night" },
  brakeButton: "Brake (test)",

  connecting: "Connecting",
  stale: "No data",
  staleFor: "Nothing received for {seconds} s. Warnings would not reach you.",
};

export function fill(text, values) {
  return text.replace(/\{(\w+)\}/g, (_, name) => String(values[name]));
}
