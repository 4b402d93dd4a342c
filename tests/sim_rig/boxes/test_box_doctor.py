"""The doctor of a box: what each wire lacks is named, with what to do."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import pytest

from onboard.messages import bsm
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData
from onboard.security import ieee1609dot2
from onboard.settings import SettingsError
from onboard.tools.doctor.finding import Finding, FindingLevel
from onboard.wave_udp import psid, wsmp
from onboard.wave_udp.wsmp import WaveShortMessage
from sim_rig.boxes.contact import Contact
from sim_rig.boxes.doctor import CERTIFICATE_KNOWN_S, doctor_scenario, findings_of_drive
from sim_rig.boxes.settings import BoxSettings
from sim_rig.run_log.clock_offset import ClockOffset
from sim_rig.run_log.run_log import RunLog
from tests.sim_rig.boxes.box_file import box


def frame(core: CoreData) -> bytes:
    data = ieee1609dot2.encode_unsecured(bsm.encode(BasicSafetyMessage(core)))
    return wsmp.encode(WaveShortMessage(psid=psid.BSM, payload=data))


def at_work(**core: float) -> Contact:
    contact = Contact(answers=7, pictures=3)
    contact.receive_wsm(frame(CoreData(0, b"abcd", 10.0, **core)))  # type: ignore[arg-type]
    return contact


def missing(findings: Sequence[Finding]) -> Mapping[str, Finding]:
    return {each.subject: each for each in findings if each.level is FindingLevel.MISSING}


def on_wires(contact: Contact, settings: BoxSettings) -> Mapping[str, Finding]:
    return missing(list(contact.findings("red", settings, doctor_scenario("red", settings))))


def test_a_box_that_is_off_lacks_every_wire_of_its_file() -> None:
    wired = box(satellites={"port": 5000})
    found = on_wires(Contact(), wired)
    assert found.keys() == {"bus", "camera", "radio", "satellites"}
    assert found["bus"].advice == "`can` of the box is socketcand (127.0.0.1:29536, can0)"
    assert "http://127.0.0.1:8090/red" in found["camera"].advice
    assert "the iwcu of the box is 127.0.0.1, UDP port 5398" in found["radio"].advice


def test_a_box_at_work_lacks_nothing() -> None:
    settings = box()
    contact = at_work(speed_m_s=15.0)
    found = list(contact.findings("red", settings, doctor_scenario("red", settings)))
    assert missing(found) == {}
    assert [each.detail for each in found] == ["7 speeds sent", "3 images taken", "1 BSM"]


def test_a_wire_on_which_the_box_hears_nothing_is_named_by_its_bsms() -> None:
    found = on_wires(at_work(), box(satellites={"port": 5000}))
    assert {name: each.detail for name, each in found.items()} == {
        "bus": "its BSMs have no speed",
        "satellites": "no BSM has a position",
    }


def test_frames_of_another_kind_are_counted() -> None:
    contact = Contact()
    contact.receive_wsm(b"")
    contact.receive_wsm(wsmp.encode(WaveShortMessage(psid=0x87, payload=b"")))
    assert on_wires(contact, box())["radio"].detail == (
        "no BSM of it has arrived: 1 no WSM, 1 0x87"
    )


def test_the_scenario_has_the_wires_of_the_box_and_a_car_of_its_kind() -> None:
    bare, full = box(), box(satellites={"port": 5000}, detector={"port": 5300})
    assert (doctor_scenario("red", bare).gnss, doctor_scenario("red", bare).detector) == (None,) * 2
    assert doctor_scenario("red", full).gnss is not None
    assert doctor_scenario("red", full).detector is not None
    same_plate = doctor_scenario("ahead", box(plate="GN417KB")).cars
    assert {name: car.identity for name, car in same_plate.items()} == {
        "first": "YW903MS",
        "ahead": "GN417KB",
    }
    tagged = doctor_scenario("red", box(plate="TAG1")).cars
    assert [car.tag_id for car in tagged.values()] == [2, 1]


def test_a_file_whose_name_is_no_car_s_is_an_error() -> None:
    with pytest.raises(SettingsError, match="Red-1"):
        doctor_scenario("Red-1", box())


def drive(red: Sequence[dict[str, Any]], ahead: Sequence[dict[str, Any]] = ()) -> RunLog:
    return RunLog(
        100.0,
        {"ahead": list(ahead), "red": list(red)},
        [],
        {"ab": "ahead"},
        builds={"red": "0.2.0+20261124.4f463bb4b"},
        clocks={"red": [ClockOffset(5.0, 0.001, 90, 80)]},
    )


LEAD = {"stamp_s": 101.0, "kind": "lead", "text": "GN417KB"}
JOINED = {"stamp_s": 101.2, "kind": "transition", "state": "member", "leader_id": "ab"}


def test_a_member_behind_its_lead_hears_and_is_heard() -> None:
    found = list(findings_of_drive("red", drive([LEAD, JOINED])))
    assert missing(found) == {}
    assert [each.subject for each in found] == ["clock", "recording", "group"]
    assert found[0].detail == "rig - box 5.0000 s +- 1.0 ms, 90 frames from the box, 80 to it"
    assert found[1].detail == "2 records of this drive, by onboard 0.2.0+20261124.4f463bb4b"
    assert found[-1].detail == "it is a member behind ahead"


def test_why_a_box_joins_nobody_is_named_from_what_it_reads() -> None:
    blind = missing(list(findings_of_drive("red", drive([LEAD | {"text": None}]))))
    assert "reads no plate" in blind["group"].detail
    other = missing(list(findings_of_drive("red", drive([LEAD]))))
    assert other["group"].detail == "the box has read GN417KB, and joined nobody"
    assert "plate_digest" in other["group"].advice


def test_keys_of_another_trial_are_named_on_both_sides() -> None:
    refusal = {"kind": "discarded", "component": "security", "reason": "unknown_issuer"}
    late = [refusal | {"stamp_s": 100.0 + CERTIFICATE_KNOWN_S + n} for n in range(3)]
    early = refusal | {"stamp_s": 100.1, "reason": "unknown_certificate"}
    found = list(findings_of_drive("red", drive([*late, JOINED], [early, *late[:1]])))
    refused = [each.detail for each in found if each.subject == "signatures"]
    assert refused == [
        "the lead refuses of the box 1 x unknown_issuer",
        "the box refuses of the lead 3 x unknown_issuer",
    ]


def test_a_sensor_that_is_lost_at_the_end_is_named() -> None:
    lost = {"stamp_s": 103.0, "kind": "sensor_lost", "sensor": "detector", "reason": "silent"}
    back = {"stamp_s": 104.0, "kind": "sensor_recovered", "sensor": "detector"}
    just_before_the_end = lost | {"stamp_s": 111.0, "sensor": "camera"}
    found = missing(list(findings_of_drive("red", drive([JOINED, lost, just_before_the_end]))))
    assert found["detector"].detail == "the box reports it lost: silent"
    assert "camera" not in found
    assert not missing(list(findings_of_drive("red", drive([JOINED, lost, back]))))


def test_a_box_without_a_recording_needs_its_radio_only() -> None:
    vendor = box(recording=None)
    scenario = doctor_scenario("red", vendor)
    assert [each.subject for each in Contact().missing("red", vendor, scenario)] == ["radio"]
    assert at_work(speed_m_s=15.0).missing("red", vendor, scenario) == []
    log = RunLog(100.0, {"ahead": [], "red": []}, [], {}, by_messages=frozenset({"red"}))
    found = list(findings_of_drive("red", log))
    assert [(each.subject, each.level) for each in found] == [
        ("recording", FindingLevel.NOT_CONFIGURED)
    ]


def test_what_differs_in_version_or_configuration_is_named() -> None:
    log = replace(drive([LEAD, JOINED]), notes={"red": ["its onboard has version 0"]})
    found = [each for each in findings_of_drive("red", log) if each.subject == "configuration"]
    assert [each.detail for each in found] == ["its onboard has version 0"]


def test_a_recording_that_is_not_judged_is_named() -> None:
    log = RunLog(100.0, {"ahead": [], "red": []}, [], {}, unjudged={"red": "no recording"})
    found = missing(list(findings_of_drive("red", log)))
    assert found.keys() == {"recording"}
    assert found["recording"].detail == "no recording"
