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

  drivingTab: "Road",
  groupTab: "Group",
  members: "Members of the group",
  neighbours: "Messages of cars nearby",
  states: { regular: "no group yet", leader: "Leader", member: "Member" },
  thisCar: "This car",
  thisCarAsObject: "this car",
  relations: { predecessor: "warns you", follower: "follows you", other: "" },
  brakesHard: "brakes hard",
  ago: "{seconds} s ago",
  noMessages: "None received",
  messages: {
    join: "{from} follows {to}",
    reply: "{from} accepts {to}",
    leave: "{from} leaves {to}",
    update: "{from} renumbers the cars behind",
    warn: "{from} warns of hard braking",
    inquiry: "{from} asks which car is ahead",
    answer: "{from} tells {to} that it is ahead",
  },
  otherMessage: "{from}: {kind}",
  ofGroup: "group {leader}, number {number}",
  fields: {
    speed_m_s: "{value} km/h",
    deceleration_m_s2: "{value} m/s²",
    age_s: "{value} s old",
    hops: "hop {value}",
    origin_number: "number {value} brakes",
    shift: "number lower by {value}",
    names: "{value} texts",
    reason: "{value}",
    cause: "{value}",
  },
  values: {
    gap: "gap is safe", not_ahead: "no longer ahead", follows_another: "follows another car",
    no_answer: "no answer", leader_silent: "leader silent", speed_unknown: "speed unknown",
  },

  gap: "Gap",
  noLead: "No car ahead",
  gapUnknown: "Unknown without the camera",
  leadUnknown: "Car ahead? The camera cannot tell",
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
  notWritten: { trace: "No trace", capture: "No capture", driver: "Driver not remembered" },
  reasons: {
    silent: "silent", frozen: "image frozen", dark: "image dark", end_of_recording: "recording ended",
    clock_wrong: "this computer's clock is wrong",
  },

  impairments: {
    turned: "turned: calibrate it", dirty: "view dirty, or fog", blurred: "image blurred", over_exposed: "too much light",
  },

  headlines: { brake: "Brake!", stop: "Stop!", keep_distance: "Keep distance", watch_out: "Watch out", stay_in_lane: "Stay in lane" },
  // Sentences of alarms come in English from onboard/risk/alarm_table.py: { "Car crossing": "..." }.
  sentences: {},
  brakesAhead: "Hard braking, {count} cars ahead",
  several: "{sentence} ({count})",
  test: "Test",
  testOfWarning: "A driver ahead tests the warning",

  brakeRequest: "Braking requested: {value} m/s² ({percent} % certain)",

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
