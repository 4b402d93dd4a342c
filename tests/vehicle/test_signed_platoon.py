"""Whole vehicles that sign: which messages are accepted, and what an observer can read."""

import json
import math
import shutil
import subprocess
from pathlib import Path

import pytest

from onboard.kinematics.units import KM_H
from onboard.lcca.events import WarningRaised
from onboard.messages import bsm, lcca
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData, PositionalAccuracy
from onboard.observations import BrakeCause, HardBrake, Position
from onboard.security.credentials import Credentials
from onboard.security.security_services import SecurityServices
from onboard.step import BrakeButton, ReceivedWsm
from onboard.trace.trace_line import as_record
from onboard.wave_udp import psid, wsmp
from onboard.wave_udp.capture import PcapWriter
from onboard.wave_udp.wsmp import WaveShortMessage
from tests.security.trial import ALICE, BOB, CAROL, DAVE, UTC_S
from tests.typed import every
from tests.vehicle.platoon import SPEED_M_S, Platoon, car


@pytest.fixture
def platoon() -> Platoon:
    """AAA1 leads BBB2, and both have driven for 3 s."""
    cars = {"AAA1": ALICE, "BBB2": BOB}
    driven = Platoon(
        {plate: car(plate, credentials=keys, utc_s=UTC_S) for plate, keys in cars.items()}
    )
    driven.drive(3.0)
    return driven


def reasons(platoon: Platoon, plate: str) -> list[str]:
    return [as_record(event)["reason"] for event in platoon.events_of(plate, "discarded")]


def test_a_braking_vehicle_warns_its_follower_once_its_speeds_show_the_brake(
    platoon: Platoon,
) -> None:
    brake_and_slow_down(platoon, "AAA1")

    assert len(list(platoon.events_of("BBB2", "warning"))) == 1


def test_a_warning_is_rejected_when_its_sender_keeps_its_speed(platoon: Platoon) -> None:
    platoon.receive("AAA1", HardBrake(platoon.now, 7.0, source="obd"))
    platoon.drive(1.0)

    assert list(platoon.events_of("BBB2", "warning")) == []
    assert "implausible_brake" in reasons(platoon, "BBB2")


def test_the_button_warns_of_a_test_between_vehicles_that_keep_their_speed(
    platoon: Platoon,
) -> None:
    platoon.receive("AAA1", BrakeButton(platoon.now))
    platoon.drive(2.0)

    (warning,) = every(WarningRaised, platoon.events_of("BBB2", "warning"))
    assert warning.cause is BrakeCause.TEST
    assert len(list(platoon.events_of("BBB2", "warning_over"))) == 1


def test_a_warning_under_the_leaders_id_by_another_signer_is_refused() -> None:
    """The plates AO01 and A001 have one ID: look-alike characters are one."""
    cars = {"AO01": ALICE, "BBB2": BOB, "CCC3": DAVE}
    platoon = Platoon(
        {plate: car(plate, credentials=keys, utc_s=UTC_S) for plate, keys in cars.items()}
    )
    platoon.drive(3.0)
    leader = platoon.cars["AO01"].digest.car_id("A001", UTC_S + platoon.now)
    assert platoon.cars["CCC3"].group.leader_id == leader
    oncoming = lcca.encode(
        lcca.Warn(leader, leader, 1, leader, 9, 2, 1, 9, lcca.WarnCause.DECELERATION, 6.0, 0.0, 1)
    )
    for plate in ("BBB2", "CCC3"):
        carol_sends(platoon, plate, oncoming, psid.LCCA, delay_s=0.0)
        assert list(platoon.events_of(plate, "warning")) == []
    assert "another_signer" in reasons(platoon, "BBB2")
    assert "claimed_by_two" in reasons(platoon, "CCC3")

    brake_and_slow_down(platoon, "AO01")
    platoon.drive(0.5)

    assert len(list(platoon.events_of("CCC3", "warning"))) == 1


def test_a_warning_of_a_vehicle_in_the_opposite_direction_is_refused(platoon: Platoon) -> None:
    for tenth in range(20):
        north_deg = 48.0 + 0.1 * tenth * SPEED_M_S / 111_195
        fix = Position(platoon.now, north_deg, 11.0, None, 1.0, SPEED_M_S, 0.0)
        platoon.receive("BBB2", fix)
        platoon.drive(0.1)
    oncoming = CoreData(0, b"come", speed_m_s=SPEED_M_S, heading_rad=math.pi)
    carol_sends(platoon, "BBB2", bsm.encode(BasicSafetyMessage(oncoming)), psid.BSM, delay_s=0.0)
    leader = car_id(platoon, "AAA1")
    warning = lcca.Warn(
        b"somebody", leader, 1, b"somebody", 9, 1, 1, 9, lcca.WarnCause.DECELERATION, 6.0, 0.0, 1
    )

    carol_sends(platoon, "BBB2", lcca.encode(warning), psid.LCCA, delay_s=0.0)

    assert "opposite_direction" in reasons(platoon, "BBB2")
    assert list(platoon.events_of("BBB2", "warning")) == []


@pytest.mark.parametrize("claimed", ["before", "meanwhile", "never"])
def test_who_claims_the_temporary_id_of_a_crossing_vehicle_does_not_hide_it(claimed: str) -> None:
    """The insider's BSM under that ID is 200 m away; the two touch 4.5 s after the start."""
    platoon = Platoon({"BBB2": car("BBB2", credentials=BOB, utc_s=UTC_S)})
    for tenth in range(45):
        now = platoon.now
        to_go_m = 4.5 * SPEED_M_S - now * SPEED_M_S
        north_deg, east_deg = to_go_m / 111_195, to_go_m / 111_195 / math.cos(math.radians(48.0))
        fix = Position(now, 48.0 - north_deg, 11.0, None, 0.5, SPEED_M_S, 0.0)
        platoon.receive("BBB2", fix)
        claim = on_the_road(now, 48.0 + 0.002, 11.0, 0.0)
        if tenth == 0 and claimed == "before":
            carol_sends(platoon, "BBB2", bsm.encode(claim), psid.BSM, delay_s=0.0)
        if tenth >= 2:
            true = on_the_road(now, 48.0, 11.0 + east_deg, 1.5 * math.pi)
            carol_sends(platoon, "BBB2", bsm.encode(true), psid.BSM, delay_s=0.0, keys=DAVE)
        if claimed == "meanwhile" and tenth > 5:
            carol_sends(platoon, "BBB2", bsm.encode(claim), psid.BSM, delay_s=0.0)
        platoon.drive(0.1)

    alarms = [as_record(event) for event in platoon.events_of("BBB2", "alarm")]
    assert any(each["cause"] == "ima" and each["level"] == "warning" for each in alarms)


def on_the_road(
    now: float, north_deg: float, east_deg: float, heading_rad: float
) -> BasicSafetyMessage:
    return BasicSafetyMessage(
        CoreData(
            0,
            b"abcd",
            sec_mark_s=(UTC_S + now) % 60.0,
            latitude_deg=north_deg,
            longitude_deg=east_deg,
            accuracy=PositionalAccuracy(0.5, 0.5, 0.0),
            speed_m_s=SPEED_M_S,
            heading_rad=heading_rad,
        )
    )


def carol_sends(
    platoon: Platoon,
    plate: str,
    payload: bytes,
    psid: int,
    *,
    delay_s: float,
    keys: Credentials = CAROL,
) -> None:
    """A trusted third vehicle sends to one vehicle, where it arrives `delay_s` later."""
    made_at = platoon.now - delay_s
    wsm = WaveShortMessage(psid, SecurityServices(UTC_S, keys).secure(payload, psid, made_at))
    platoon.receive(plate, ReceivedWsm(platoon.now, wsmp.encode(wsm)))
    platoon.settle()


def brake_and_slow_down(platoon: Platoon, plate: str) -> None:
    platoon.speed_m_s[plate] = SPEED_M_S - 3 * KM_H
    platoon.drive(0.1)
    platoon.receive(plate, HardBrake(platoon.now, 7.0, source="obd"))
    platoon.settle()


@pytest.mark.long
@pytest.mark.parametrize("speed_m_s", [15.0, 30.0])
@pytest.mark.parametrize("latest_fix_s", [0.0, 0.3, 0.6, 0.9])
def test_a_warning_is_accepted_at_once_from_a_vehicle_with_one_fix_per_second(
    speed_m_s: float, latest_fix_s: float
) -> None:
    """Its position is up to 1.3 s old, its speed is not; its steps pass the position check."""
    cars = {"AAA1": ALICE, "BBB2": BOB}
    platoon = Platoon(
        {plate: car(plate, credentials=keys, utc_s=UTC_S) for plate, keys in cars.items()}
    )
    way_m, decelerated_m_s, braked_at = 0.0, 0.0, math.inf
    for tenth in range(70):
        braking = tenth >= 50
        decelerated_m_s += 0.6 * braking
        platoon.speed_m_s = dict.fromkeys(cars, speed_m_s - decelerated_m_s)
        way_m += 0.1 * platoon.speed_m_s["AAA1"]
        if (tenth - round(10 * latest_fix_s)) % 10 == 0:
            north_deg = 48.0 + (way_m - 0.3 * speed_m_s) / 111_195
            stamp_s = platoon.now - 0.3
            fix = Position(
                stamp_s,
                north_deg,
                11.0,
                None,
                1.0,
                speed_m_s - max(0.0, decelerated_m_s - 1.8),
                0.0,
            )
            platoon.receive("AAA1", fix)
        if tenth == 53:
            braked_at = platoon.now
            platoon.receive("AAA1", HardBrake(braked_at, 6.0, source="obd:7E8"))
        platoon.drive(0.1)

    (warning,) = every(WarningRaised, platoon.events_of("BBB2", "warning"))
    assert braked_at <= warning.stamp_s < braked_at + 0.05
    assert not {reason for reason in reasons(platoon, "BBB2") if reason.startswith("implausible")}


def car_id(platoon: Platoon, plate: str) -> bytes:
    return platoon.cars[plate].digest.car_id(plate, UTC_S + platoon.now)


def test_a_forged_leave_does_not_remove_a_follower(
    platoon: Platoon,
) -> None:
    leader, follower = car_id(platoon, "AAA1"), car_id(platoon, "BBB2")
    leave = lcca.Leave(follower, leader, 2, leader, lcca.LeaveReason.GAP)
    carol_sends(platoon, "AAA1", lcca.encode(leave), psid.LCCA, delay_s=0.0)

    brake_and_slow_down(platoon, "AAA1")

    assert "claimed_by_two" in reasons(platoon, "AAA1")
    assert len(list(platoon.events_of("BBB2", "warning"))) == 1


def test_a_restarted_vehicle_keeps_its_identity(platoon: Platoon) -> None:
    platoon.cars["BBB2"] = car("BBB2", credentials=BOB, utc_s=UTC_S, seed=2)
    platoon.drive(2.0)
    assert platoon.cars["AAA1"].group.followers == (car_id(platoon, "BBB2"),)

    platoon.drive(5.0, gap_m=100.0)

    assert "claimed_by_two" not in reasons(platoon, "AAA1")
    assert not platoon.cars["AAA1"].group.followers


def test_a_warning_delayed_for_seconds_is_discarded_as_stale(platoon: Platoon) -> None:
    leader = car_id(platoon, "AAA1")
    warning = lcca.Warn(
        b"somebody", leader, 1, b"somebody", 1, 0, 1, 1, lcca.WarnCause.DECELERATION, 6.0, 0.01, 1
    )

    carol_sends(platoon, "BBB2", lcca.encode(warning), psid.LCCA, delay_s=4.0)

    assert "stale" in reasons(platoon, "BBB2")
    assert list(platoon.events_of("BBB2", "warning")) == []


def test_many_temporary_ids_of_one_signer_do_not_lengthen_the_interval(platoon: Platoon) -> None:
    """The interval depends on the number of vehicles near, counted by signer."""
    for i in range(300):
        name = bsm.encode(BasicSafetyMessage(CoreData(0, i.to_bytes(4))))
        carol_sends(platoon, "BBB2", name, psid.BSM, delay_s=0.0)
    before = len(platoon.on_air)

    platoon.drive(2.0)

    assert len(platoon.on_air) - before >= 2 * 19


def test_a_frame_of_an_unknown_service_is_discarded_unopened(platoon: Platoon) -> None:
    wsm = wsmp.encode(WaveShortMessage(0x8007, b"?"))
    platoon.receive("BBB2", ReceivedWsm(platoon.now, wsm))
    platoon.settle()

    assert reasons(platoon, "BBB2")[-1:] == ["unknown_psid"]


def test_expired_certificates_are_reported() -> None:
    expired_utc_s = UTC_S + 2 * 86_400.0
    late = car("AAA1", credentials=ALICE, utc_s=expired_utc_s)

    (event, *_) = late.step((), 0.0).events

    assert event.kind == "certificate_expired"


@pytest.mark.parametrize("shown_s", [0.0, 946_684_800.0], ids=["1970", "2000"])
def test_messages_are_accepted_once_the_sender_s_clock_is_set(
    shown_s: float,
) -> None:
    """A unit without a battery for its clock; time in IEEE 1609.2 begins in 2004."""
    unset = car("AAA1", credentials=ALICE, utc_s=shown_s)
    platoon = Platoon({"AAA1": unset, "BBB2": car("BBB2", credentials=BOB, utc_s=UTC_S)})
    platoon.drive(2.0)
    assert set(reasons(platoon, "BBB2")) == {"stale"}
    assert list(platoon.events_of("BBB2", "transition")) == []

    unset.step((), platoon.now, UTC_S + platoon.now)
    platoon.drive(2.0)
    brake_and_slow_down(platoon, "AAA1")

    assert len(list(platoon.events_of("BBB2", "warning"))) == 1


def test_wireshark_finds_nothing_malformed_in_a_drive(platoon: Platoon, tmp_path: Path) -> None:
    if shutil.which("tshark") is None:
        pytest.skip("tshark is not installed")
    platoon.receive("AAA1", BrakeButton(platoon.now))
    platoon.drive(0.5)
    capture = tmp_path / "drive.pcap"
    with capture.open("wb") as file:
        writer = PcapWriter(file)
        for wsm in platoon.on_air:
            writer.write(wsm, UTC_S, b"\x02CAR01")

    shown = subprocess.run(
        ["tshark", "-n", "-r", str(capture), "-T", "json", "--no-duplicate-keys"],
        capture_output=True,
        check=True,
        timeout=60,
    ).stdout
    packets = [json.dumps(packet["_source"]["layers"]) for packet in json.loads(shown)]

    assert len(packets) == len(platoon.on_air) > 60
    for packet in packets:
        assert '"wsmp.psid"' in packet
        assert "_ws.malformed" not in packet
        assert "_ws.expert" not in packet
    # Wireshark looks for 1609.2 data under the PSIDs that it knows; the group's is our own.
    bsms = [packet for packet in packets if f'"wsmp.psid": "0x{psid.BSM:08x}"' in packet]
    assert len(bsms) > 60
    assert all("ieee1609dot2.ecdsaNistP256Signature" in packet for packet in bsms)
