"""Whole vehicles whose certificates commit to their IDs: nobody speaks under that of another."""

from collections.abc import Iterator, Mapping

import pytest
from typing_extensions import override

from onboard.lcca.asking import REPLIES_AT_ONCE, REPLIES_PER_S
from onboard.lcca.transitions import GroupState
from onboard.messages import lcca
from onboard.messages.lcca import CarId, LccaMessage
from onboard.security.credentials import Credentials
from onboard.step import Input
from onboard.trace.trace_line import as_record
from onboard.wave_udp import psid
from tests.security.trial import ALICE, BOB, CAROL, UTC_S, credentials_of
from tests.vehicle.platoon import SPEED_M_S, Platoon, car
from tests.vehicle.proved import (
    PLATES,
    Insider,
    brakes,
    car_id,
    driven,
    message_in,
    pdu_in,
    reasons,
    stack_of,
    warned,
)


def test_an_honest_group_forms_and_is_warned() -> None:
    platoon = driven()

    assert [stack_of(platoon, plate).group.state for plate in PLATES] == [
        GroupState.LEADER, GroupState.MEMBER, GroupState.MEMBER,
    ]  # fmt: skip
    brakes(platoon, "AAA1")
    platoon.drive(0.3)
    assert warned(platoon) == ["BBB2", "CCC3"]
    assert not any("unproved_id" in reasons(platoon, plate) for plate in PLATES)


@pytest.mark.long
def test_an_honest_group_lasts_over_a_change_of_ids_though_clocks_differ() -> None:
    keys = {plate: credentials_of(plate, 30.0) for plate in PLATES}
    late_s = dict(zip(PLATES, (0.0, 0.9, -0.9), strict=True))
    platoon = Platoon(
        {
            plate: car(plate, 30.0, own, UTC_S + late_s[plate], seed)
            for seed, (plate, own) in enumerate(keys.items())
        }
    )
    platoon.drive(65.0)

    assert [stack_of(platoon, plate).group.group_number for plate in PLATES] == [1, 2, 3]
    assert not any("unproved_id" in reasons(platoon, plate) for plate in PLATES)
    lost = [each for plate in PLATES for each in platoon.events_of(plate, "transition")]
    assert not [as_record(each) for each in lost if as_record(each)["event"].startswith("left")]


def forgeries(lead: CarId, follower: CarId) -> Iterator[LccaMessage]:
    """What an insider sends under the IDs of a leader and its follower."""
    yield lcca.Join(follower, lead, 2, lead, 900, lcca.NO_ID, 0)
    yield lcca.Reply(lead, lead, 1, follower, 900, 900, SPEED_M_S, lcca.NO_ID)
    yield lcca.Leave(follower, lead, 2, lead, lcca.LeaveReason.GAP)
    yield lcca.Update(lead, lead, 6, 900)
    yield lcca.Warn(lead, lead, 1, lead, 900, 1, 1, 900, lcca.WarnCause.DECELERATION, 7.0, 0.0, 1)
    yield lcca.Answer(lead, follower, 0, b"EVIL", SPEED_M_S)


@pytest.mark.parametrize("number", range(6))
def test_a_message_under_the_id_of_another_is_discarded(number: int) -> None:
    platoon, insider = driven(), Insider()
    forged = list(forgeries(car_id(platoon, "AAA1"), car_id(platoon, "BBB2")))[number]
    for plate in ("AAA1", "BBB2"):
        platoon.receive(plate, insider.wsm(forged, platoon.now))
    platoon.settle()

    assert reasons(platoon, "AAA1")[-1:] == reasons(platoon, "BBB2")[-1:] == ["unproved_id"]
    assert warned(platoon) == []
    brakes(platoon, "AAA1")
    platoon.drive(0.3)
    assert warned(platoon) == ["BBB2", "CCC3"]
    assert "claimed_by_two" not in reasons(platoon, "BBB2")


@pytest.mark.parametrize("proof", ["own", "truncated", "longer", "of another epoch", "none"])
def test_an_id_is_proved_by_its_own_siblings_only(proof: str) -> None:
    platoon, insider = driven(), Insider()
    own = insider.pseudonym(platoon.now)
    third = Insider().pseudonym(platoon.now + 3 * 300.0)  # the certificate is the same
    assert own.credential is not None
    assert third.credential is not None
    assert own.credential.certificate == third.credential.certificate
    siblings = {
        "own": own.proof,
        "truncated": own.proof[:-1],
        "longer": (*own.proof, bytes(12)),
        "of another epoch": third.proof,
        "none": (),
    }[proof]
    lead = car_id(platoon, "AAA1")
    join = lcca.Join(own.car_id, lead, 1, lead, 900, lcca.NO_ID, 0)
    platoon.receive("AAA1", insider.wsm(join, platoon.now, siblings))
    platoon.settle()

    followers = stack_of(platoon, "AAA1").group.followers
    assert (own.car_id in followers) is (proof == "own")
    assert ("unproved_id" in reasons(platoon, "AAA1")) is (proof != "own")


def test_certificates_that_commit_to_nothing_prove_nothing() -> None:
    platoon, insider = driven(), Insider(keys=CAROL)
    lead, own = car_id(platoon, "AAA1"), insider.pseudonym(platoon.now).car_id
    join = lcca.Join(own, lead, 1, lead, 900, lcca.NO_ID, 0)
    platoon.receive("AAA1", insider.wsm(join, platoon.now))
    platoon.settle()

    assert own not in stack_of(platoon, "AAA1").group.followers
    assert reasons(platoon, "AAA1")[-1:] == ["unproved_id"]


class Hijacked(Platoon):
    """An insider answers every inquiry for the lead, before the lead does."""

    insider: Insider | None = None

    @override
    def receive(self, plate: str, *inputs: Input) -> None:
        super().receive(plate, *inputs)
        if plate != "AAA1" or self.insider is None:
            return
        for each in inputs:
            message = message_in(each)
            if isinstance(message, lcca.Inquiry):
                lead = car_id(self, "AAA1")
                answer = lcca.Answer(lead, message.sender_id, message.sequence, b"EVIL", SPEED_M_S)
                super().receive("BBB2", self.insider.wsm(answer, self.now))


def hijacked(keys: Mapping[str, Credentials], insider: Insider) -> Platoon:
    """The insider is first to answer in a new epoch, and the lead brakes in it."""
    platoon = Hijacked(
        {
            plate: car(plate, 30.0, own, UTC_S, seed)
            for seed, (plate, own) in enumerate(keys.items())
        }
    )
    platoon.drive(3.0)
    digest = stack_of(platoon, "BBB2").digest
    platoon.drive(digest.epoch_ends_at(UTC_S + platoon.now) - UTC_S - platoon.now - 0.5)
    platoon.insider = insider
    platoon.drive(3.0)
    brakes(platoon, "AAA1")
    platoon.drive(0.3)
    return platoon


@pytest.mark.long
def test_an_insider_who_answers_first_in_a_new_epoch_is_not_taken_for_the_lead() -> None:
    platoon = hijacked({plate: credentials_of(plate, 30.0) for plate in PLATES}, Insider(30.0))

    assert "unproved_id" in reasons(platoon, "BBB2")
    assert "another_signer" not in reasons(platoon, "BBB2")
    assert warned(platoon) == ["BBB2", "CCC3"]


def test_without_an_authority_that_knows_plates_both_who_answer_for_the_lead_are_accepted() -> None:
    platoon = hijacked({"AAA1": ALICE, "BBB2": BOB}, Insider(30.0, keys=CAROL))

    assert "another_signer" in reasons(platoon, "BBB2")
    assert warned(platoon) == ["BBB2"]


def test_nothing_that_is_sent_links_two_pseudonyms() -> None:
    """Certificates and proofs of two epochs have no octets of a node in common."""
    pseudonyms = [Insider().pseudonym(300.0 * number) for number in range(3)]
    roots = set()
    siblings: set[bytes] = set()
    for each in pseudonyms:
        assert each.credential is not None
        roots.add(each.credential.certificate.ssp(psid.LCCA))
        assert siblings.isdisjoint(each.proof)
        siblings.update(each.proof)
    assert len(roots) == len(pseudonyms)


def test_an_id_of_another_epoch_is_not_proved() -> None:
    """Else one certificate would be some hundred vehicles at a time."""
    platoon, insider = driven(), Insider()
    own, third = insider.pseudonym(platoon.now), Insider().pseudonym(platoon.now + 3 * 300.0)
    assert own.credential == third.credential
    lead = car_id(platoon, "AAA1")
    join = lcca.Join(third.car_id, lead, 1, lead, 900, lcca.NO_ID, 0)
    platoon.receive("AAA1", insider.wsm(join, platoon.now, third.proof))
    platoon.settle()

    assert third.car_id not in stack_of(platoon, "AAA1").group.followers
    assert reasons(platoon, "AAA1")[-1:] == ["unproved_id"]


@pytest.mark.parametrize("step_s", [0.0, pytest.param(0.0003, marks=pytest.mark.long)])
def test_what_is_received_when_the_ids_change_is_answered_under_the_new_one(
    step_s: float,
) -> None:
    """Not under the old ID, signed with the certificate of the new one."""
    platoon, insider = driven(30.0), Insider(30.0)
    changes_at = stack_of(platoon, "AAA1").digest.epoch_ends_at(UTC_S + platoon.now) - UTC_S
    platoon.drive(changes_at - platoon.now - 0.15)
    platoon.now = changes_at + step_s
    before = len(platoon.on_air)
    lead = car_id(platoon, "AAA1", changes_at - 1.0)
    own = insider.pseudonym(platoon.now).car_id
    join = lcca.Join(own, lead, 1, lead, 900, lcca.NO_ID, 0)
    platoon.receive("AAA1", insider.wsm(join, platoon.now))
    platoon.drive(0.1)

    sent = [pdu for wsm in platoon.on_air[before:] if (pdu := pdu_in(wsm)) is not None]
    replies = [pdu.message for pdu in sent if isinstance(pdu.message, lcca.Reply)]
    assert [each.sender_id for each in replies if each.to_id == own] == [car_id(platoon, "AAA1")]
    assert not any("unproved_id" in reasons(platoon, plate) for plate in PLATES)


@pytest.mark.long
def test_one_signer_is_replied_to_as_often_as_a_follower_asks_and_the_followers_still_are() -> None:
    """A join is small, and a reply takes a signature."""
    platoon, insider = driven(beacons=False), Insider()
    own, lead = insider.pseudonym(platoon.now).car_id, car_id(platoon, "AAA1")
    before, sequence = len(platoon.on_air), 0
    for _ in range(30):
        for _ in range(20):
            sequence += 1
            join = lcca.Join(own, lead, 1, lead, sequence, lcca.NO_ID, 0)
            platoon.receive("AAA1", insider.wsm(join, platoon.now))
        platoon.drive(0.1)

    sent = [pdu.message for wsm in platoon.on_air[before:] if (pdu := pdu_in(wsm)) is not None]
    replies = [each.to_id for each in sent if isinstance(each, lcca.Reply)]
    allowed = REPLIES_AT_ONCE + 2.9 * REPLIES_PER_S
    assert allowed - 1.0 <= replies.count(own) <= allowed
    follower = car_id(platoon, "BBB2")
    joins = [each for each in sent if isinstance(each, lcca.Join) and each.sender_id == follower]
    assert replies.count(follower) == len(joins) >= 5  # it refreshes twice a second
