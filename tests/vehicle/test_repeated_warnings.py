"""Warnings that others repeat: they carry what the braking vehicle signed, and it is charged."""

from dataclasses import replace

import pytest

from onboard.messages import lcca
from onboard.messages.lcca import CarId, LccaPdu, Warn, WarnCause
from onboard.misbehaviour.signer_credibility import MOST_ALARMS, SignerIgnored
from onboard.observations import HardBrake, Position
from onboard.security import ieee1609dot2
from onboard.security.ieee1609dot2 import SignedData
from onboard.security.region import CircularRegion, TwoDLocation
from onboard.tools.test_ca.authority import KnownPlate, make_issuing, make_pseudonyms
from onboard.trace.trace_line import as_record
from onboard.wave_udp import psid, wsmp
from tests.security.trial import ALICE, BOB, CAROL, ISSUING, ROOT, UTC_S, VALID, new_key
from tests.vehicle.platoon import Platoon, car
from tests.vehicle.proved import (
    PLATES,
    Insider,
    brakes,
    car_id,
    driven,
    pdu_in,
    reasons,
    secured_in,
    stack_of,
    warned,
)


def repeated(platoon: Platoon) -> list[LccaPdu]:
    """The warnings on the air that are copies."""
    pdus = (pdu_in(wsm) for wsm in platoon.on_air)
    return [
        pdu
        for pdu in pdus
        if pdu is not None and isinstance(pdu.message, Warn) and not pdu.message.is_direct
    ]


def signer_of(plate: str, now: float) -> bytes:
    """The certificate of a vehicle."""
    credential = Insider(plate=plate).pseudonym(now).credential
    assert credential is not None
    return credential.certificate.hashed_id8


def braking(own: CarId, leader: CarId, sequence: int, number: int = 1) -> Warn:
    return Warn(
        own, leader, number, own, sequence, 0, number, sequence, WarnCause.DECELERATION, 7.0, 0.0, 1
    )


def test_a_warning_that_is_repeated_carries_what_the_braking_vehicle_signed() -> None:
    platoon = driven(reach=1)
    brakes(platoon, "AAA1")
    platoon.drive(0.3)

    assert warned(platoon) == ["BBB2", "CCC3"]
    assert all(pdu.origin for pdu in repeated(platoon))
    assert not any("unproved_origin" in reasons(platoon, plate) for plate in PLATES)


@pytest.mark.parametrize(
    "origin",
    [
        "none",
        "garbage",
        "altered",
        "of another braking",
        "a join",
        "in another's name",
        "cut short",
    ],
)
def test_a_braking_that_its_vehicle_did_not_state_is_discarded(origin: str) -> None:
    platoon, insider = driven(), Insider()
    leader, own = car_id(platoon, "AAA1"), insider.pseudonym(platoon.now).car_id
    invented = replace(braking(leader, leader, 900), sender_id=own, hops=2)
    stated = {
        "none": b"",
        "garbage": b"\x03\x81\x00\x40",
        "altered": secured_in(insider.wsm(braking(own, leader, 900), platoon.now)),
        "of another braking": true_statement(platoon),
        "a join": secured_in(
            insider.wsm(lcca.Join(own, leader, 1, leader, 1, lcca.NO_ID, 0), platoon.now)
        ),
        "in another's name": secured_in(insider.wsm(braking(leader, leader, 900), platoon.now)),
        "cut short": secured_in(insider.wsm(braking(leader, leader, 900), platoon.now, cut=3)),
    }[origin]
    before = len(list(platoon.events_of("CCC3", "warning")))
    for plate in ("BBB2", "CCC3"):
        platoon.receive(plate, insider.wsm(invented, platoon.now, origin=stated))
    platoon.settle()

    assert "unproved_origin" in reasons(platoon, "BBB2")
    assert "unproved_origin" in reasons(platoon, "CCC3")
    assert len(list(platoon.events_of("CCC3", "warning"))) == before


@pytest.mark.parametrize("origin", ["none", "of the begin", "in another's name"])
def test_nobody_else_ends_a_braking(origin: str) -> None:
    platoon, insider = driven(), Insider()
    begin = true_statement(platoon)
    platoon.drive(0.2)
    assert warned(platoon) == ["BBB2", "CCC3"]
    stated = next(
        pdu.message
        for pdu in map(pdu_in, platoon.on_air)
        if pdu is not None and isinstance(pdu.message, Warn)
    )
    over = replace(stated, event_sequence=stated.event_sequence + 1, cause=lcca.WarnCause.OVER)
    secured = {
        "none": b"",
        "of the begin": begin,
        "in another's name": secured_in(insider.wsm(over, platoon.now)),
    }[origin]
    copy = replace(over, sender_id=insider.pseudonym(platoon.now).car_id, hops=2)
    for plate in ("BBB2", "CCC3"):
        platoon.receive(plate, insider.wsm(copy, platoon.now, origin=secured))
    platoon.settle()

    for plate in ("BBB2", "CCC3"):
        assert "unproved_origin" in reasons(platoon, plate)
        assert not list(platoon.events_of(plate, "warning_over"))


def true_statement(platoon: Platoon) -> bytes:
    """What the leader signs when it brakes."""
    brakes(platoon, "AAA1")
    for wsm in platoon.on_air:
        pdu = pdu_in(wsm)
        if pdu is not None and isinstance(pdu.message, Warn) and pdu.message.is_direct:
            return wsmp.decode(wsm).payload
    raise AssertionError("no warning")


def test_who_states_a_braking_does_not_pass_it_on_as_another() -> None:
    """Without an authority that knows plates, one certificate speaks under any IDs."""
    keys = {"AAA1": ALICE, "BBB2": BOB}
    platoon = Platoon({plate: car(plate, 300.0, keys[plate], UTC_S) for plate in keys})
    platoon.drive(3.0)
    insider, lead = Insider(keys=CAROL), car_id(platoon, "AAA1")
    warn = braking(b"unknown1", lead, 900)
    stated = secured_in(insider.wsm(warn, platoon.now))
    copy = insider.wsm(replace(warn, sender_id=b"unknown2", hops=2), platoon.now, origin=stated)
    platoon.receive("BBB2", copy)
    platoon.settle()

    assert reasons(platoon, "BBB2")[-1:] == ["unproved_origin"]
    assert warned(platoon) == []


def ignored(platoon: Platoon, plate: str) -> set[bytes]:
    events = (each for name, each in platoon.events if name == plate)
    return {each.signer_id for each in events if isinstance(each, SignerIgnored)}


@pytest.mark.long
def test_who_claims_a_braking_is_charged_though_another_repeats_it() -> None:
    """The leader invents brakings, of which the last vehicle hears by copies only."""
    platoon = driven(reach=1, beacons=False)
    leader = signer_of("AAA1", platoon.now)
    for _ in range(MOST_ALARMS + 1):
        platoon.receive("AAA1", HardBrake(platoon.now, 7.0, source="obd"))
        platoon.drive(1.0)
        platoon.receive("AAA1", HardBrake(platoon.now, 0.0, source="obd", is_over=True))
        platoon.drive(11.0)

    assert len(list(platoon.events_of("CCC3", "warning"))) == MOST_ALARMS
    assert ignored(platoon, "CCC3") == {leader}


def pass_on_from_elsewhere(platoon: Platoon, insider: Insider, times: int) -> None:
    """An insider passes on each braking of an honest vehicle in another group."""
    honest = Insider(plate="DDD4")
    for sequence in range(900, 900 + times):
        own, other = insider.pseudonym(platoon.now), honest.pseudonym(platoon.now)
        true = braking(other.car_id, other.car_id, sequence)
        copy = replace(true, sender_id=own.car_id, leader_id=car_id(platoon, "AAA1"), hops=2)
        signed = secured_in(honest.wsm(true, platoon.now))
        platoon.receive("CCC3", insider.wsm(copy, platoon.now, origin=signed))
        platoon.drive(12.0)


@pytest.mark.long
def test_a_true_braking_elsewhere_is_charged_to_whoever_passes_it_on() -> None:
    platoon, insider = driven(beacons=False), Insider()
    forwarder = insider.pseudonym(platoon.now).credential
    assert forwarder is not None

    pass_on_from_elsewhere(platoon, insider, 2 * MOST_ALARMS)

    assert len(list(platoon.events_of("CCC3", "warning"))) == MOST_ALARMS
    assert ignored(platoon, "CCC3") == {forwarder.certificate.hashed_id8}
    platoon.drive(1.0)
    brakes(platoon, "AAA1")
    platoon.drive(0.3)
    assert len(list(platoon.events_of("CCC3", "warning"))) == MOST_ALARMS + 1


@pytest.mark.long
def test_who_passes_on_what_is_elsewhere_silences_no_other_forwarder() -> None:
    """The leader changes, so that its braking is stated for another group than the follower's."""
    platoon = driven(beacons=False)
    pass_on_from_elsewhere(platoon, Insider(), MOST_ALARMS)
    lead = Insider(plate="BBB2")
    origin, own = Insider(plate="DDD4").pseudonym(platoon.now), lead.pseudonym(platoon.now)
    true = braking(origin.car_id, origin.car_id, 950)
    copy = replace(true, sender_id=own.car_id, leader_id=car_id(platoon, "AAA1"), hops=2)
    signed = secured_in(Insider(plate="DDD4").wsm(true, platoon.now))

    platoon.receive("CCC3", lead.wsm(copy, platoon.now, origin=signed))
    platoon.settle()

    assert len(list(platoon.events_of("CCC3", "warning"))) == MOST_ALARMS + 1


@pytest.mark.long
def test_a_braking_that_lasts_is_named_by_the_new_id_after_a_change() -> None:
    """By an ID that its vehicle proves; where its next ID is known by its plate, it goes on.

    Others raise it again, whatever their predecessor says of the leader's next ID.
    """
    platoon = driven(30.0, start_s=10.0)
    changes_at = 30.0 - (UTC_S + 10.0) % 30.0
    platoon.drive(changes_at - platoon.now - 0.5)
    brakes(platoon, "AAA1")
    platoon.drive(3.0)

    pdus = [pdu_in(wsm) for wsm in platoon.on_air]
    sent = [pdu.message for pdu in pdus if pdu is not None and isinstance(pdu.message, Warn)]
    direct = {warn.event_origin_id for warn in sent if warn.hops == 1}
    assert len(direct) == 2
    assert all(warn.is_direct for warn in sent if warn.hops == 1)
    assert len({warn.first_sequence for warn in sent if warn.is_direct}) == 2
    for plate, names in (("BBB2", 1), ("CCC3", 2)):
        raised = [as_record(each)["origin_id"] for each in platoon.events_of(plate, "warning")]
        assert len(raised) == len(set(raised)) == names
        over = [as_record(each)["origin_id"] for each in platoon.events_of(plate, "warning_over")]
        assert over == raised[:-1]  # the former name expires
    platoon.receive("AAA1", HardBrake(platoon.now, 0.0, source="obd", is_over=True))
    platoon.drive(1.0)
    for plate, names in (("BBB2", 1), ("CCC3", 2)):
        assert len(list(platoon.events_of(plate, "warning_over"))) == names


def copied(platoon: Platoon, insider: Insider, origin: Insider, made_at: float) -> Warn:
    """A braking of another vehicle as an insider passes it on, ahead in this group and fresh."""
    own = insider.pseudonym(platoon.now).car_id
    true = braking(origin.pseudonym(made_at).car_id, car_id(platoon, "AAA1"), 900)
    return replace(true, sender_id=own, hops=2, age_s=0.0)


@pytest.mark.parametrize(("later_s", "age_s"), [(1.0, 0.0), (4.0, 2.0), (4.9, 2.9), (5.01, None)])
def test_a_copy_is_as_old_as_its_vehicle_signed_it_but_for_the_error_of_clocks(
    later_s: float, age_s: float | None
) -> None:
    """Clocks may differ by 2 s; a warning of more than 3 s is refused."""
    platoon, insider, honest = driven(beacons=False), Insider(), Insider(plate="DDD4")
    made_at = platoon.now
    own = honest.pseudonym(made_at).car_id
    signed = secured_in(honest.wsm(braking(own, car_id(platoon, "AAA1"), 900), made_at))
    platoon.now = made_at + later_s
    copy = copied(platoon, insider, honest, made_at)
    platoon.receive("CCC3", insider.wsm(copy, platoon.now, origin=signed))
    platoon.settle()

    raised = [as_record(each)["age_s"] for each in platoon.events_of("CCC3", "warning")]
    assert raised == ([] if age_s is None else [pytest.approx(age_s, abs=0.01)])


def test_what_others_state_displaces_no_origin_of_a_copy_that_waits() -> None:
    """The leader brakes; before the next vehicle repeats it, an insider states hundreds."""
    platoon, insider = driven(reach=1), Insider()
    platoon.speed_m_s["AAA1"] -= 1.0
    platoon.drive(0.1)
    platoon.receive("AAA1", HardBrake(platoon.now, 7.0, source="obd"))
    own = insider.pseudonym(platoon.now).car_id
    platoon.step()
    for sequence in range(300):
        flood = insider.wsm(braking(own, own, sequence), platoon.now)
        platoon.receive("BBB2", flood)
    platoon.drive(0.3)

    assert warned(platoon) == ["BBB2", "CCC3"]
    assert all(pdu.origin for pdu in repeated(platoon))


def test_the_issuer_of_what_a_copy_carries_is_asked_for() -> None:
    """The braking vehicle is out of range, and of another authority."""
    platoon, insider = driven(), Insider()
    other = make_issuing(ROOT, "another", new_key=new_key, **VALID)
    known = KnownPlate("DDD4", stack_of(platoon, "AAA1").digest)
    keys = make_pseudonyms(other, 3, {psid.BSM, psid.LCCA}, new_key=new_key, plate=known, **VALID)
    far = Insider(keys=keys, plate="DDD4")
    signed = secured_in(
        far.wsm(braking(far.pseudonym(platoon.now).car_id, b"leader--", 900), platoon.now)
    )
    copy = copied(platoon, insider, far, platoon.now)
    platoon.receive("CCC3", insider.wsm(copy, platoon.now, origin=signed))
    before = len(platoon.on_air)
    platoon.drive(0.2)

    asked = [request_in(wsm) for wsm in platoon.on_air[before:]]
    assert other.credential.certificate.hashed_id8[-3:] in asked


def request_in(wsm: bytes) -> bytes | None:
    frame = wsmp.decode(wsm)
    signed = ieee1609dot2.decode(frame.payload) if frame.psid == psid.BSM else None
    return signed.p2pcd_request if isinstance(signed, SignedData) else None


def test_what_was_signed_where_its_certificate_is_not_valid_is_refused() -> None:
    platoon, insider = driven(), Insider()
    at = Position(platoon.now, 48.0, 11.0, None, 5.0, 15.0, 1.5)
    platoon.receive("CCC3", at)
    elsewhere = CircularRegion(TwoDLocation(10.0, 10.0), 1000)
    known = KnownPlate("DDD4", stack_of(platoon, "AAA1").digest)
    keys = make_pseudonyms(
        ISSUING, 3, {psid.BSM, psid.LCCA}, new_key=new_key, plate=known, region=elsewhere, **VALID
    )
    far = Insider(keys=keys, plate="DDD4")
    signed = secured_in(
        far.wsm(braking(far.pseudonym(platoon.now).car_id, b"leader--", 900), platoon.now)
    )
    copy = copied(platoon, insider, far, platoon.now)
    platoon.receive("CCC3", insider.wsm(copy, platoon.now, origin=signed))
    platoon.settle()

    assert reasons(platoon, "CCC3")[-1:] == ["outside_region"]
