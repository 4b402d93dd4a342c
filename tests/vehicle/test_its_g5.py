"""Whole vehicles with ITS-G5: what they send by tshark, and what they make of what they receive."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from onboard.its_g5 import packet, ports
from onboard.its_g5.awareness import cam_of
from onboard.its_g5.headers import Area, LongPositionVector
from onboard.its_g5.its_timestamp import timestamp_ms
from onboard.its_g5.notification import EventReports
from onboard.its_g5.permissions import denm_ssp
from onboard.messages import bsm as bsm_codec
from onboard.messages import cam, cpm, denm, vam
from onboard.messages.bsm_core import VehicleSize
from onboard.messages.cpm import (
    CollectivePerceptionMessage,
    ManagementContainer,
    Orientation,
    PerceivedObjectContainer,
)
from onboard.messages.cpm_object import Coordinate, CpmObject, ObjectPosition
from onboard.messages.its_common import ReferencePosition
from onboard.mvs.settings import MvsSettings
from onboard.observations import HardBrake, Position, Sensor, Speed
from onboard.security import ieee1609dot2, p256
from onboard.security.credentials import Credentials
from onboard.security.plate_digest import PlateDigest
from onboard.security.pseudonyms import Pseudonyms
from onboard.security.security_services import SecurityServices
from onboard.security.settings import PlateDigestSettings
from onboard.sensors.host_state import HostState
from onboard.settings import SettingsError, parse_settings
from onboard.step import ProgramMessage, ReceivedWsm, SentWsm
from onboard.tools.test_ca.authority import SSPS_OF_CARS, make_trial
from onboard.trace.trace_line import as_trace_record
from onboard.vehicle.config import CarConfig
from onboard.vehicle.its_g5_framing import ItsG5Framing
from onboard.vehicle.shared_sensing import SharedSensing
from onboard.vehicle.stack import Stack
from onboard.wave_udp import psid, wsmp
from onboard.wave_udp.capture import PcapWriter
from onboard.wave_udp.radio_queue import airtime_s
from onboard.wave_udp.settings import RadioProfile
from onboard.wave_udp.wsmp import WaveShortMessage
from sim_rig.reporting.verdict import Outcome, verdict
from sim_rig.road_side.person_messages import a_vam
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.schema import load_scenario
from tests.its_g5.test_awareness import SENT
from tests.its_g5.test_notification import bsm
from tests.messages.test_cpm import SENT as PERCEIVED
from tests.vehicle.platoon import SPEED_M_S, Platoon
from tests.wave_udp.test_capture import needs_tshark, tshark

UTC_S = 1_790_000_000.0
RNG = np.random.default_rng(3)
TRIAL = make_trial(
    ["AAA1", "BBB2"], psid.OF_ITS_VEHICLES, UTC_S, p256.key_from(np.random.default_rng(5))
)
SOURCE = LongPositionVector(
    is_manual=True, station_type=5, reserved=0, mac=b"\2\0abcd", timestamp_ms=0,
    latitude_deg=48.0, longitude_deg=11.0, is_accurate=True, speed_m_s=0.0, heading_rad=0.0,
)  # fmt: skip


def its_car(plate: str, credentials: Credentials | None = None, **radio: str) -> Stack:
    tree = {
        "car": {"plate": plate},
        "security": {"plate_digest": {"scrypt_log2_n": 1}},
        "radio": {"endpoint": "raw", "interface": "air", "profile": "its-g5"} | radio,
    }
    return Stack(
        parse_settings(tree, CarConfig, plate),
        (Sensor.SPEED, Sensor.CAMERA, Sensor.POSITION),
        np.random.default_rng(int.from_bytes(plate.encode())),
        now=0.0,
        utc_s=UTC_S,
        credentials=credentials,
    )


def drive(platoon: Platoon, duration_s: float) -> None:
    """Drive to the north, 20 m apart, with fixes."""
    for _ in range(round(duration_s / 0.1)):
        for place, plate in enumerate(platoon.cars):
            way_m = SPEED_M_S * platoon.now - 20.0 * place
            fix = Position(
                platoon.now, 48.0 + way_m / 111_195, 11.0, 500.0, 0.5, platoon.speed_m_s[plate], 0.0
            )
            platoon.receive(plate, fix)
        platoon.drive(0.1)


@pytest.fixture(params=[True, False], ids=["signed", "unsigned"])
def platoon(request: pytest.FixtureRequest) -> Platoon:
    """AAA1 leads BBB2, and both have driven for 3 s."""
    keys = {plate: TRIAL[plate] if request.param else None for plate in ("AAA1", "BBB2")}
    driven = Platoon({plate: its_car(plate, own) for plate, own in keys.items()})
    drive(driven, 3.0)
    return driven


def brake(platoon: Platoon) -> None:
    """AAA1 brakes hard for half a second."""
    platoon.receive("AAA1", HardBrake(platoon.now, 7.0, source="obd"))
    for _ in range(5):
        platoon.speed_m_s["AAA1"] -= 0.7
        drive(platoon, 0.1)


@needs_tshark
def test_tshark_reads_all_frames_and_finds_nothing_malformed(
    platoon: Platoon, tmp_path: Path
) -> None:
    brake(platoon)
    path = tmp_path / "its.pcap"
    with path.open("wb") as file:
        writer = PcapWriter(file)
        for frame in platoon.on_air:
            writer.write(frame, UTC_S, bytes(6))
    packets = tshark(path)
    assert len(packets) == len(platoon.on_air) > 20
    for fields in packets:
        assert "_ws.malformed" not in fields
        assert fields["geonw.bh.version"] == ["1"]
    its = [fields for fields in packets if "its.stationID" in fields]
    assert {each["its.protocolVersion"][0] for each in its} == {"2"}
    assert {each["btpb.dstport"][0] for each in its} == {"2001", "2002"}
    denms = [each for each in its if each["btpb.dstport"] == ["2002"]]
    assert {each["its.causeCode"][0] for each in denms} == {"99"}
    assert {each["geonw.ch.htype"][0] for each in denms} == {"0x40"}
    others = [fields for fields in packets if fields not in its]
    assert others
    for fields in others:  # in signed data of a private service tshark looks no further
        assert fields.get("btpb.dstport", [str(ports.LCCA)]) == [str(ports.LCCA)]


def test_a_follower_joins_and_is_warned_and_perceives_its_leader_once(platoon: Platoon) -> None:
    brake(platoon)

    alarms = [as_trace_record(event) for event in platoon.events_of("BBB2", "alarm")]
    assert "eebl" in {each["cause"] for each in alarms}
    assert len(list(platoon.events_of("BBB2", "warning"))) == 1
    _, others = platoon.cars["BBB2"].surroundings
    (leader,) = others
    assert leader.source.value == "bsm"
    reasons = [event.reason for event in discarded(platoon.events)]
    assert reasons == []


def discarded(events: Sequence[tuple[str, Any]]) -> list[Any]:
    return [event for _, event in events if event.kind == "discarded"]


def test_certificates_are_attached_once_a_second_and_to_group_messages() -> None:
    driven = Platoon({"AAA1": its_car("AAA1", TRIAL["AAA1"])})
    drive(driven, 5.0)
    cams = [frame for frame in driven.on_air if _port(frame) == 2001]
    with_certificate = [each for each in cams if ieee1609dot2.certificate_in(each[4:])]
    assert len(with_certificate) in {5, 6}
    assert len(cams) >= 15
    assert [each for each in driven.on_air if _port(each) != 2001] == []


def test_cpms_carry_no_certificate_and_leave_it_to_the_cams() -> None:
    security = SecurityServices(UTC_S, TRIAL["AAA1"], certificate_interval_s=1.0, distributes=False)
    sent = [
        security.secure(b"", service, now)
        for service, now in (
            (psid.CPM, 0.1),
            (psid.CAM, 0.2),
            (psid.CPM, 1.1),
            (psid.CAM, 1.25),
            (psid.CAM, 1.3),
        )
    ]
    has_certificate = [ieee1609dot2.certificate_in(each) is not None for each in sent]
    assert has_certificate == [False, True, False, True, False]


def _port(frame: bytes) -> int | None:
    header, content = packet.read_basic_header(frame)
    del header
    return packet.port_in(ieee1609dot2.payload_in(content) or content)


def test_two_cams_a_second_have_the_path_and_the_lights() -> None:
    driven = Platoon({"AAA1": its_car("AAA1")})
    drive(driven, 4.0)
    messages = [cam.decode(packet.decode(frame[4:]).payload) for frame in driven.on_air]
    low = [each.parameters.low_frequency for each in messages]
    assert low[0] is not None
    assert 6 <= sum(each is not None for each in low) <= 9 < len(low)
    last = [each for each in low if each is not None][-1]
    assert len(last.value.path) >= 1


def receives(frame: bytes, fix_age_s: float = 0.0) -> list[tuple[str, str]]:
    """Component and reason of what a vehicle with a fix discards of a frame."""
    car, now = its_car("AAA1"), 0.1 + fix_age_s
    car.step((Position(0.1, 25.0331, 121.5654, None, 0.5, 10.0, 0.0),), 0.1)
    events = car.step((ReceivedWsm(now, frame),), now).events
    records = map(as_trace_record, events)
    return [(each["component"], each["reason"]) for each in records if each["kind"] == "discarded"]


def framed(payload: bytes, port: int = 2001, maximum_hops: int = 1, hops: int = 1) -> bytes:
    content = packet.encode(packet.GeoPacket(port, payload, SOURCE, maximum_hops=maximum_hops))
    return packet.with_basic_header(content, is_secured=False, hops=hops)


def test_bad_frames_are_counted_each_with_its_reason() -> None:
    good = cam.encode(cam_of(SENT, UTC_S, low_frequency=True))
    assert receives(framed(good)) == []
    assert receives(framed(good, hops=255)) == [("geonetworking", "bad_hop_limit")]
    assert receives(framed(good, maximum_hops=255, hops=255)) == [
        ("geonetworking", "bad_hop_limit")
    ]
    assert receives(framed(good, port=2999)) == [("geonetworking", "unknown_port")]
    assert receives(framed(b"\1" + good[1:])) == [("cam", "unknown_version")]
    assert receives(framed(good[:20])) == [("cam", "too_short")]
    assert receives(b"") == [("geonetworking", "too_short")]


def test_an_event_is_for_who_is_in_its_area_and_brakes_once() -> None:
    (report,) = EventReports().messages(bsm(brakes=True), 0.1, UTC_S + 0.1)
    data = denm.encode(report)

    def to(area: Area) -> bytes:
        content = packet.encode(packet.GeoPacket(2002, data, SOURCE, 0, 10, area))
        return packet.with_basic_header(content, is_secured=False, hops=9)

    assert receives(to(Area(25.0330, 121.5654, 500))) == []
    assert receives(to(Area(25.1330, 121.5654, 500))) == [("geonetworking", "outside_area")]
    assert receives(framed(data[:9], port=2002)) == [("denm", "too_short")]


def test_at_the_end_of_a_tunnel_an_event_there_is_not_judged_by_the_fix_before_it() -> None:
    (report,) = EventReports().messages(bsm(brakes=True), 0.1, UTC_S + 0.1)
    area = Area(25.0630, 121.5654, 500)
    content = packet.encode(packet.GeoPacket(2002, denm.encode(report), SOURCE, 0, 10, area))
    frame = packet.with_basic_header(content, is_secured=False, hops=9)
    assert ("geonetworking", "outside_area") in receives(frame, 5.0)
    assert ("geonetworking", "outside_area") not in receives(frame, 60.0)


def test_a_denm_is_generated_where_the_vehicle_is_and_not_where_its_last_fix_was() -> None:
    fix = Position(0.0, 48.0, 11.0, 500.0, 0.5, 30.0, 0.0)
    framing = ItsG5Framing(psid.LCCA, lambda: fix)
    place = framing.location(psid.DENM, 1.0)
    assert place is not None
    assert (place.latitude_deg - 48.0) * 111_200 == pytest.approx(30.0, abs=0.2)
    area = packet.decode(framing.signed_part(b"", psid.DENM, 7, 1.0, UTC_S)).area
    assert area is not None
    assert area.latitude_deg == pytest.approx(place.latitude_deg, abs=1e-7)
    assert framing.location(psid.CAM, 1.0) is None


def test_who_sends_bsms_too_is_counted_once() -> None:
    vehicle = its_car("AAA1")
    wave = ieee1609dot2.encode_unsecured(bsm_codec.encode(SENT))
    bsm_frame = wsmp.encode(WaveShortMessage(psid.BSM, wave))
    for tenth in range(1, 20):
        now = 0.1 * tenth
        core = replace(SENT.core, sec_mark_s=round((UTC_S + now) * 1e3) % 60_000 / 1e3)
        message = cam.encode(cam_of(replace(SENT, core=core), UTC_S + now, low_frequency=True))
        fix = Position(now, 25.0331, 121.5654, None, 0.5, 10.0, 0.0)
        frames = [ReceivedWsm(now, each) for each in (framed(message), bsm_frame)]
        vehicle.step((fix, *frames), now)
    _, others = vehicle.surroundings
    assert [each.name for each in others] == [SENT.core.temporary_id.hex()]


def test_a_cpm_about_who_sends_cams_adds_nobody_and_one_about_others_does() -> None:
    vehicle = its_car("AAA1")
    for tenth in range(1, 20):
        now = 0.1 * tenth
        utc_s = UTC_S + now
        core = replace(SENT.core, sec_mark_s=round(utc_s * 1e3) % 60_000 / 1e3)
        message = cam.encode(cam_of(replace(SENT, core=core), utc_s, low_frequency=True))
        place = ReferencePosition(SENT.core.latitude_deg, SENT.core.longitude_deg)
        seen = [
            CpmObject(number, 0, ObjectPosition(*[Coordinate(at_m, 0.5)] * 2))
            for number, at_m in enumerate((0.0, 30.0))
        ]
        perceived = CollectivePerceptionMessage(
            SENT.core.temporary_id,
            ManagementContainer(timestamp_ms(utc_s), place),
            Orientation(),
            is_road_side_unit=False,
            perceived=PerceivedObjectContainer(2, tuple(seen)),
        )
        fix = Position(now, 25.0331, 121.5654, None, 0.5, 10.0, 0.0)
        frames = framed(message), framed(cpm.encode(perceived), ports.OF_SERVICES[psid.CPM])
        vehicle.step((fix, *[ReceivedWsm(now, each) for each in frames]), now)
    _, others = vehicle.surroundings
    assert sorted(each.source.value for each in others) == ["bsm", "shared"]


def test_bad_cpms_are_counted_each_with_its_reason() -> None:
    good = cpm.encode(PERCEIVED)
    assert receives(framed(good[:30], 2009)) == [("cpm", "too_short")]
    assert receives(framed(good[:1] + b"\2" + good[2:], 2009)) == [("cpm", "not_a_cpm")]
    assert receives(framed(good, 2009)) == [("mvs", "unplaced_sender")]


def test_what_is_shared_in_sdsms_is_not_with_its_g5() -> None:
    tree = {
        "car": {"plate": "AAA1"},
        "radio": {"endpoint": "raw", "interface": "air", "profile": "its-g5"},
        "mvs": {"shared_in": "sdsm"},
    }
    with pytest.raises(SettingsError, match="shared_in: sdsm is of SAE J3224"):
        parse_settings(tree, CarConfig, "AAA1")


def test_a_unit_that_needs_a_psid_has_no_its_g5() -> None:
    with pytest.raises(SettingsError, match="profile"):
        its_car("AAA1", endpoint="rsu41")


@pytest.mark.long
@pytest.mark.parametrize(
    "name",
    [
        "shared-detection",
        "fig4",
        "pedestrian",
        "red-light",
        "platoon",
        "signal-passed-at-red",
        "stop-at-line",
    ],
)
def test_scenarios_meet_their_expectations_with_its_g5(name: str) -> None:
    scenario = load_scenario(name, RadioProfile.ITS_G5).model_copy(update={"signed": True})
    judged = verdict(scenario, run_virtual(scenario))
    assert judged.outcome is Outcome.PASSED, judged


def loaded(vehicle: Stack, until_s: float, share: float, speed_m_s: float = 30.0) -> list[SentWsm]:
    """What a vehicle sends on a channel of which others take a share of the time."""
    noise, sent = bytes(1000), list[SentWsm]()
    count, now = share * 0.02 / airtime_s(len(noise)), 0.0
    owed = 0.0
    while now < until_s:
        owed += count
        frames = [ReceivedWsm(now, noise)] * int(owed)
        owed -= int(owed)
        north_deg = 48.0 + speed_m_s * now / 111_195
        fix = Position(now, north_deg, 11.0, 500.0, 0.5, speed_m_s, 0.0)
        sent += vehicle.step((fix, *frames), now).wsms
        now = round(now + 0.02, 6)
    return sent


@pytest.mark.parametrize(("share", "interval_s"), [(0.55, 0.3), (0.75, 1.0)])
def test_cams_are_made_when_the_gate_opens_and_are_new_when_sent(
    share: float, interval_s: float
) -> None:
    """Every 0.2 s by the motion; the reactive gate opens after 0.25 and 1 s."""
    vehicle = its_car("AAA1", congestion_control="reactive")
    sent = [wsm for wsm in loaded(vehicle, 9.0, share) if wsm.stamp_s > 4.0]
    assert np.diff([wsm.stamp_s for wsm in sent]) == pytest.approx(interval_s, abs=0.06)
    for wsm in sent:
        made_s = cam.decode(packet.decode(wsm.data[4:]).payload).generation_delta_time_s
        assert (timestamp_ms(UTC_S + wsm.stamp_s) - round(made_s * 1e3)) % 65_536 < 60


def test_a_hard_braking_passes_a_closed_gate_at_once() -> None:
    vehicle = its_car("AAA1", congestion_control="reactive")
    sent = loaded(vehicle, 6.0, 0.75)
    assert vehicle.step((), 6.0).wsms == []
    outputs = vehicle.step((HardBrake(6.0, 7.0, source="obd"),), 6.01)
    assert [_port(wsm.data) for wsm in outputs.wsms] == [2002]
    assert len(sent) > 0


def test_cams_and_cpms_take_turns_at_a_gate_that_opens_seldom(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    host = HostState()
    sharing = SharedSensing(
        MvsSettings(),
        VehicleSize(),
        Pseudonyms("AAA1", PlateDigest(PlateDigestSettings()), None, RNG).at(UTC_S),
        RNG,
        host,
        now=0.0,
        utc_offset_s=UTC_S,
        etsi=True,
    )
    monkeypatch.setattr(sharing.mvs, "cpm_to_send", lambda _: PERCEIVED)
    sharing.transmitter.receive_max_interval(0.1, 0.0)
    sent: list[str] = []
    opens_at = [0.0]
    for now in np.arange(0.0, 4.0, 0.05):
        for message in sharing.messages_to_send(now, lambda now: max(opens_at[-1], now)):
            assert now >= opens_at[-1]
            opens_at.append(now + 0.5)
            sent.append(message.kind)
    assert sent in (["bsm", "cpm"] * 4, ["cpm", "bsm"] * 4)


def test_access_never_sends_more_often_than_the_gate_opens() -> None:
    """An unsafe vehicle at rest, which would send every 0.1 s."""
    vehicle = its_car("AAA1", congestion_control="reactive")
    vehicle._vehicle._sharing.transmitter.receive_max_interval(0.1, 0.0)
    sent = [wsm for wsm in loaded(vehicle, 7.0, 0.75, 0.0) if wsm.stamp_s >= 4.0]
    assert 3 <= len(sent) <= 4


def test_a_signer_says_only_what_its_certificate_permits() -> None:
    """A DENM of a braking from who may report none; and an own DENM, which passes."""
    rng = p256.key_from(np.random.default_rng(6))
    for causes, reasons in ((None, []), ((), [("denm", "not_permitted")])):
        ssps = SSPS_OF_CARS if causes is None else {**SSPS_OF_CARS, psid.DENM: denm_ssp(causes)}
        trial = make_trial(["AAA1", "BBB2"], psid.OF_ITS_VEHICLES, UTC_S, rng, ssps=ssps)
        driven = Platoon({plate: its_car(plate, trial[plate]) for plate in ("AAA1", "BBB2")})
        drive(driven, 3.0)
        driven.events.clear()
        brake(driven)
        refused = {(each.component, each.reason) for each in discarded(driven.events)}
        assert refused == set(reasons)


def test_a_person_on_the_road_is_perceived_and_warned_of() -> None:
    """By VAMs: 60 m ahead, at 15 m/s."""
    vehicle = its_car("AAA1")
    levels = []
    for tenth in range(1, 35):
        now = 0.1 * tenth
        north_deg = 48.0 + 15.0 * now / 111_195
        fix = Position(now, north_deg, 11.0, 500.0, 0.5, 15.0, 0.0)
        speed = Speed(now, 15.0, 0.1, "dbc")
        person = vam.encode(a_vam(b"walk", (48.0 + 60.0 / 111_195, 11.0), UTC_S + now))
        frame = ReceivedWsm(now, framed(person, ports.OF_SERVICES[psid.VAM]))
        events = vehicle.step((speed, fix, frame), now).events
        levels += [as_trace_record(event) for event in events if event.kind == "alarm"]
        if tenth == 10:
            _, others = vehicle.surroundings
            assert [each.name for each in others] == [b"walk".hex()]
    assert {each["cause"] for each in levels} == {"fcw"}
    assert "warning" in {each["level"] for each in levels}


def test_a_message_of_a_program_goes_to_its_port_after_the_vehicles_own() -> None:
    tree = {
        "car": {"plate": "AAA1"},
        "radio": {"endpoint": "raw", "interface": "air", "profile": "its-g5"},
        "interface": {"sends": [{"psid": 0x8B, "btp_port": 2006}]},
    }
    vehicle = Stack(
        parse_settings(tree, CarConfig, "AAA1"), (Sensor.POSITION,), RNG, now=0.0, utc_s=UTC_S
    )
    sent = []
    for now in np.arange(0.05, 4.0, 0.05):
        fix = Position(now, 48.0 + 30.0 * now / 111_195, 11.0, 500.0, 0.5, 30.0, 0.0)
        flood = [ProgramMessage(now, 0x8B, 2, b"ivi")] * 20
        sent += vehicle.step((fix, *flood), now).wsms
    cams = [each.stamp_s for each in sent if _port(each.data) == 2001]
    assert np.diff(cams) == pytest.approx(0.2, abs=0.06)  # as without the program
    programs = [each.data for each in sent if _port(each.data) == 2006]
    assert len(programs) > 10
    assert packet.decode(programs[0][4:]).payload == b"ivi"
