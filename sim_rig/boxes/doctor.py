"""What `sim-rig doctor` drives with a box, and what it finds: a lead at a steady distance."""

from collections import Counter
from collections.abc import Iterator

from onboard.settings import parse_settings
from onboard.tools.doctor.finding import Finding, FindingLevel
from sim_rig.boxes.settings import BoxSettings
from sim_rig.run_log.run_log import RunLog
from sim_rig.scenario.field_types import PlateText
from sim_rig.scenario.schema import Scenario

SPEED_M_S, GAP_M, LENGTH_M = 15.0, 12.0, 4.5
"""The headway of 0.8 s is far below that of a warning group, so the box joins its lead."""
DURATION_S = 12.0
LASTING_S = 3.0
"""A sensor that is silent for less is not called missing: images may be late."""
CERTIFICATE_KNOWN_S = 2.0
"""By then each knows the other's certificate, which comes with a BSM every
`CERTIFICATE_INTERVAL_S`."""

_KEYS = "keys of the box come from `keys` of its file (docs/hardware-in-the-loop.md)"
_CALIBRATION = "`camera` of the box has the calibration of the scenario's lens"
_DIGEST = "`security.plate_digest` of the box is that of the rig"
_RECORDING = "`recording`, filled by `fetch`, is the `recorder.folder` of the box after this drive"
_LOAD = "end other programs on this computer"


def doctor_scenario(car: str, box: BoxSettings) -> Scenario:
    """Return a scenario in which the box follows one other car, with every wire that it has.

    Raises:
        SettingsError: `car` cannot be the name of a car.
    """
    lead = lead_of(car)
    motion = {"lane": 1.0, "speed_m_s": SPEED_M_S, "length_m": LENGTH_M}
    tree = {
        "title": "One car drives ahead of a box.",
        "seed": 1,
        "duration_s": DURATION_S,
        "radio": {"reach_m": 300.0},
        "cars": {
            lead: motion | _other_identity(box.plate) | {"start_m": GAP_M + LENGTH_M},
            car: motion | _identity(box.plate) | {"start_m": 0.0},
        },
        "expect": [],
    }
    if box.satellites is not None:
        tree["gnss"] = {}
    if box.detector is not None:
        tree["detector"] = "plate-camera"
    return parse_settings(tree, Scenario, "doctor")


def lead_of(car: str) -> str:
    """Name of the lead of this car."""
    return "ahead" if car != "ahead" else "first"


def findings_of_drive(car: str, log: RunLog) -> Iterator[Finding]:
    """Yield what the drive shows of the box, from its recording and from its lead."""
    yield from _clock(car, log)
    yield from _differences(car, log)
    yield from _refused(log, lead_of(car), "the lead refuses of the box")
    yield from _refused(log, car, "the box refuses of the lead")
    yield from _lost(log, car)
    if car not in log.unjudged and car not in log.by_messages:
        yield _group(log, car)
    for line in log.lateness:
        if line.is_too_late:
            detail = f"late with {line.what}: p99 {line.p99_s * 1e3:.0f} ms"
            yield Finding("rig", FindingLevel.DOUBTFUL, detail, _LOAD)


def _clock(car: str, log: RunLog) -> Iterator[Finding]:
    for clock in log.clocks.get(car, ()):
        detail = (
            f"rig - box {clock.offset_s:.4f} s +- {clock.uncertainty_s * 1e3:.1f} ms,"
            f" {clock.frames_from_box} frames from the box, {clock.frames_to_box} to it"
        )
        yield Finding("clock", FindingLevel.GOOD, detail)
    if car in log.unjudged:
        yield Finding("recording", FindingLevel.MISSING, log.unjudged[car], _RECORDING)
    elif car in log.by_messages:
        detail = "none: only the messages of the box are judged"
        yield Finding("recording", FindingLevel.NOT_CONFIGURED, detail)
    else:
        by = f", by onboard {log.builds[car]}" if car in log.builds else ""
        detail = f"{len(log.traces[car])} records of this drive{by}"
        yield Finding("recording", FindingLevel.GOOD, detail)


def _differences(car: str, log: RunLog) -> Iterator[Finding]:
    for note in log.notes.get(car, ()):
        yield Finding("configuration", FindingLevel.DOUBTFUL, note)


def _refused(log: RunLog, receiver: str, what: str) -> Iterator[Finding]:
    """Yield what one of the two refuses for its signature."""
    refused = log.of(receiver, "discarded", CERTIFICATE_KNOWN_S, component="security")
    for reason, n in sorted(Counter(record["reason"] for record in refused).items()):
        yield Finding("signatures", FindingLevel.MISSING, f"{what} {n} x {reason}", _KEYS)


def _lost(log: RunLog, car: str) -> Iterator[Finding]:
    """Yield the sensors that the box reports as lost from some time to the end of the drive."""
    state = {
        record["sensor"]: record
        for record in log.traces[car]
        if record["kind"] in {"sensor_lost", "sensor_recovered"} and log.at_s(record) < DURATION_S
    }
    for sensor, record in sorted(state.items()):
        is_lasting = log.at_s(record) < DURATION_S - LASTING_S
        if record["kind"] == "sensor_lost" and is_lasting:
            yield Finding(
                sensor, FindingLevel.MISSING, f"the box reports it lost: {record['reason']}"
            )


def _group(log: RunLog, car: str) -> Finding:
    joined = next(log.of(car, "transition", state="member"), None)
    if joined is not None:
        detail = f"it is a member behind {log.name(joined['leader_id'])}"
        return Finding("group", FindingLevel.GOOD, detail)
    read = {record["text"] for record in log.of(car, "lead") if record["text"]}
    if not read:
        detail = "the box reads no plate or tag of the lead"
        return Finding("group", FindingLevel.MISSING, detail, _CALIBRATION)
    detail = f"the box has read {', '.join(sorted(read))}, and joined nobody"
    return Finding("group", FindingLevel.MISSING, detail, _DIGEST)


def _identity(text: PlateText) -> dict[str, object]:
    return {"tag_id": int(text[3:])} if _is_tag(text) else {"plate": text}


def _other_identity(text: PlateText) -> dict[str, object]:
    """Identity of the lead: of the kind that the box has, and not its own."""
    others = ("TAG1", "TAG2") if _is_tag(text) else ("GN417KB", "YW903MS")
    return _identity(next(each for each in others if each != text))


def _is_tag(text: PlateText) -> bool:
    return text.startswith("TAG") and text[3:].isdecimal()
