"""Warnings that others repeat: they carry what the braking vehicle signed, and it is charged."""

from dataclasses import replace

import pytest

from onboard.messages import lcca
from onboard.messages.lcca import CarId, LccaPdu, Warn, WarnCause
from onboard.misbehaviour.signer_credibility import MOST_ALARMS, SignerIgnored
from onboard.observations import HardBrake
from onboard.wave_udp import wsmp
from tests.security.trial import UTC_S
from tests.vehicle.platoon import Platoon
from tests.vehicle.proved import (
    PLATES,
    Insider,
    brakes,
    car_id,
    driven,
    pdu_in,
    reasons,
    secured_in,
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
    "origin", ["none", "garbage", "altered", "of another braking", "a join", "in another's name"]
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
            insider.wsm(
                lcca.Join(own, leader, 1, leader, 1, lcca.NO_ID, 0, lcca.NO_ID), platoon.now
            )
        ),
        "in another's name": secured_in(insider.wsm(braking(leader, leader, 900), platoon.now)),
    }[origin]
    before = len(list(platoon.events_of("CCC3", "warning")))
    for plate in ("BBB2", "CCC3"):
        platoon.receive(plate, insider.wsm(invented, platoon.now, origin=stated))
    platoon.settle()

    assert "unproved_origin" in reasons(platoon, "BBB2")
    assert "unproved_origin" in reasons(platoon, "CCC3")
    assert len(list(platoon.events_of("CCC3", "warning"))) == before


def true_statement(platoon: Platoon) -> bytes:
    """What the leader signs when it brakes."""
    brakes(platoon, "AAA1")
    for wsm in platoon.on_air:
        pdu = pdu_in(wsm)
        if pdu is not None and isinstance(pdu.message, Warn) and pdu.message.is_direct:
            return wsmp.decode(wsm).payload
    raise AssertionError("no warning")


def ignored(platoon: Platoon, plate: str) -> set[bytes]:
    events = (each for name, each in platoon.events if name == plate)
    return {each.signer_id for each in events if isinstance(each, SignerIgnored)}


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


def test_a_true_braking_elsewhere_that_is_passed_on_is_charged_to_nobody_by_name() -> None:
    """An insider passes on each braking of an honest vehicle in another group."""
    platoon, insider = driven(beacons=False), Insider()
    honest = Insider(plate="DDD4")
    for sequence in range(900, 900 + 2 * MOST_ALARMS):
        own, other = insider.pseudonym(platoon.now), honest.pseudonym(platoon.now)
        true = braking(other.car_id, other.car_id, sequence)
        copy = replace(true, sender_id=own.car_id, leader_id=car_id(platoon, "AAA1"), hops=2)
        signed = secured_in(honest.wsm(true, platoon.now))
        platoon.receive("CCC3", insider.wsm(copy, platoon.now, origin=signed))
        platoon.drive(12.0)

    assert len(list(platoon.events_of("CCC3", "warning"))) == MOST_ALARMS
    assert ignored(platoon, "CCC3") == {b""}
    platoon.drive(1.0)
    brakes(platoon, "AAA1")
    platoon.drive(0.3)
    assert len(list(platoon.events_of("CCC3", "warning"))) == MOST_ALARMS + 1


def test_a_braking_that_lasts_is_named_by_the_new_id_after_a_change() -> None:
    """By an ID that its vehicle proves; where the next ID is known, the warning goes on."""
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
    for plate in ("BBB2", "CCC3"):
        assert len(list(platoon.events_of(plate, "warning"))) == 1
        assert not list(platoon.events_of(plate, "warning_over"))
    platoon.receive("AAA1", HardBrake(platoon.now, 0.0, source="obd", is_over=True))
    platoon.drive(0.3)
    for plate in ("BBB2", "CCC3"):
        assert len(list(platoon.events_of(plate, "warning_over"))) == 1
