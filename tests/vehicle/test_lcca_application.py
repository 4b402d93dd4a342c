"""LCCA of two vehicles whose messages the test carries, without the other cores."""

import math
from typing import TypeVar

import numpy as np
import pytest

from onboard.lcca.events import WarningRaised
from onboard.lcca.parameters import GroupParameters
from onboard.lcca.transitions import GroupState
from onboard.messages import bsm, lcca
from onboard.messages.bsm_core import CoreData
from onboard.misbehaviour.alarm_claims import AlarmClaims
from onboard.misbehaviour.misbehaviour_detection import MisbehaviourDetector
from onboard.misbehaviour.signer_credibility import CLAIM_S, MOST_ALARMS
from onboard.observations import BrakeCause, Discarded, HardBrake, Speed
from onboard.risk.alarm import AlarmReason, Assessment, Level
from onboard.risk.lcca_warning import LCCA
from onboard.security.plate_digest import PlateDigest
from onboard.security.pseudonyms import Pseudonym
from onboard.security.settings import PlateDigestSettings
from onboard.sensors.host_state import HostState
from onboard.trace.trace_line import Event
from onboard.vehicle.lcca_application import LccaApplication
from tests.leads import known_lead

UTC_S = 1_790_000_000.0
AHEAD, BEHIND = "AAA1", "BBB2"
SIGNERS = {AHEAD: b"signer 1", BEHIND: b"signer 2"}


class Car:
    """One vehicle's LCCA at 15 m/s."""

    def __init__(self, plate: str, epoch_s: float = 300.0) -> None:
        self.plate = plate
        self.digest = PlateDigest(PlateDigestSettings(scrypt_log2_n=1, epoch_s=epoch_s))
        self.misbehaviour = MisbehaviourDetector()
        self.claims = AlarmClaims(
            self.misbehaviour.signer_of, lambda _: False, HostState(), has_sight=True
        )
        self.lcca = LccaApplication(
            GroupParameters(),
            plate,
            self.pseudonym(0.0),
            np.random.default_rng(1),
            digest=self.digest,
            utc_offset_s=UTC_S,
            misbehaviour=self.misbehaviour,
            claims=self.claims,
        )
        self.events: list[Event] = []

    def pseudonym(self, now: float) -> Pseudonym:
        car_id = self.digest.car_id(self.plate, UTC_S + now)
        ends_at_utc_s = self.digest.epoch_ends_at(UTC_S + now)
        return Pseudonym(car_id, self.plate.encode(), 0, None, ends_at_utc_s)

    def step(self, lead: str | None, now: float) -> list[lcca.LccaMessage]:
        self.lcca.receive_speed(Speed(now, 15.0, 0.28, "test"), now)
        if lead is not None:
            self.lcca.receive_lead(known_lead(now, lead), now)
        self.lcca.prepare_next_epoch(now)
        for core in self.lcca.cores:
            core.handle_timer(now)
            self.events += self.lcca.take_events(now)
        return self.lcca.messages_to_send(now)

    def hears(
        self,
        message: lcca.LccaMessage,
        signer: bytes | None,
        now: float,
        heading_rad: float | None = None,
    ) -> list[Event]:
        self.lcca.receive_message(message, signer, now, now, heading_rad=heading_rad)
        new = list(self.lcca.take_events(now))
        self.events += new
        return new


class Pair:
    """Two vehicles in one lane; steps of 20 ms."""

    def __init__(self, epoch_s: float = 300.0) -> None:
        self.cars = {plate: Car(plate, epoch_s) for plate in (AHEAD, BEHIND)}
        self.now = 0.0
        self.on_air: list[lcca.LccaMessage] = []

    def drive(self, duration_s: float) -> None:
        end_s = self.now + duration_s
        while self.now < end_s:
            self.now += 0.02
            for plate, car in self.cars.items():
                for message in car.step(AHEAD if plate == BEHIND else None, self.now):
                    self.on_air.append(message)
                    for other in self.cars.values():
                        if other is not car:
                            other.hears(message, SIGNERS[plate], self.now)


E = TypeVar("E")


def of(events: list[Event], kind: type[E]) -> list[E]:
    return [event for event in events if isinstance(event, kind)]


def refusals(events: list[Event]) -> list[str]:
    return [event.reason for event in events if isinstance(event, Discarded)]


@pytest.fixture
def pair() -> Pair:
    two = Pair()
    two.drive(2.0)
    return two


def test_a_read_plate_is_identified_and_joined(pair: Pair) -> None:
    ahead, behind = pair.cars.values()

    assert behind.lcca.identification.identity is not None
    assert behind.lcca.identification.identity.text == AHEAD
    assert behind.lcca.group.state is GroupState.MEMBER
    assert ahead.lcca.group.followers == (behind.pseudonym(0.0).car_id,)


def test_a_braking_ahead_warns(pair: Pair) -> None:
    ahead, behind = pair.cars.values()
    behind.events.clear()

    brake = HardBrake(pair.now, 6.0, "test", BrakeCause.DECELERATION)
    ahead.lcca.receive_hard_brake(brake, pair.now)
    pair.drive(0.2)

    assert len(of(behind.events, WarningRaised)) == 1


def test_an_answer_of_another_signer_does_not_silence_the_lead(pair: Pair) -> None:
    """An insider answers for the identified lead, whose warnings would then be another's."""
    ahead, behind = pair.cars.values()
    inquiry = [each for each in pair.on_air if isinstance(each, lcca.Inquiry)][-1]
    forged = lcca.Answer(
        ahead.pseudonym(0.0).car_id, inquiry.sender_id, inquiry.sequence, b"EVIL", 15.0
    )

    behind.hears(forged, b"signer 9", pair.now)
    refused = refusals(list(iter(behind.lcca.identification.next_event, None)))
    assert refused[-1:] == ["another_signer"]
    brake = HardBrake(pair.now, 6.0, "test", BrakeCause.DECELERATION)
    ahead.lcca.receive_hard_brake(brake, pair.now)
    pair.drive(0.2)

    assert len(of(behind.events, WarningRaised)) == 1


def test_who_signs_a_warning_is_charged_not_whose_id_it_bears(pair: Pair) -> None:
    """In a new epoch, before the lead has answered, its signer is not known."""
    ahead, behind = pair.cars.values()
    lead_id, own = ahead.pseudonym(0.0).car_id, behind.pseudonym(0.0)
    behind.lcca.identification.set_own_id(own.car_id, own.temporary_id, pair.now)
    for sequence in range(100, 100 + MOST_ALARMS):
        invented = lcca.Warn(
            lead_id, lead_id, 1, lead_id, sequence, 0, 1, sequence,
            lcca.WarnCause.DECELERATION, 6.0, 0.0, 1,
        )  # fmt: skip
        (warning,) = of(behind.hears(invented, b"signer 9", pair.now), WarningRaised)
        reason = AlarmReason(warning.kind, warning.origin_id.hex(), 0.0)
        assessment = Assessment(Level.WARNING, 6.0, (reason,))
        for at in (0.0, 1.0):
            assert behind.claims.admit(LCCA, assessment, pair.now + at)
        pair.now += CLAIM_S + 1.0

    for signer, is_ignored in ((b"signer 9", True), (SIGNERS[AHEAD], False)):
        assert behind.claims.credibility.is_ignored(signer, pair.now) is is_ignored


@pytest.mark.parametrize(
    ("own_rad", "refused"), [(0.0, ["opposite_direction"]), (math.pi, []), (None, [])]
)
def test_who_drives_in_the_opposite_direction_is_refused(
    pair: Pair, own_rad: float | None, refused: list[str]
) -> None:
    behind = pair.cars[BEHIND]
    southbound = bsm.BasicSafetyMessage(CoreData(0, b"AAA1", heading_rad=math.pi))
    behind.misbehaviour.receive_bsm(SIGNERS[AHEAD], southbound, pair.now, pair.now)
    joined = next(each for each in pair.on_air if isinstance(each, lcca.Reply))

    events = behind.hears(joined, SIGNERS[AHEAD], pair.now, own_rad)

    assert [each for each in refusals(events) if each == "opposite_direction"] == refused


def test_another_signer_does_not_speak_for_the_lead(pair: Pair) -> None:
    joined = next(each for each in pair.on_air if isinstance(each, lcca.Reply))

    events = pair.cars[BEHIND].hears(joined, b"signer 3", pair.now)

    assert refusals(events) == ["another_signer"]


def test_the_next_id_is_sent_before_the_epoch_ends_and_masked_on_the_air() -> None:
    pair = Pair(epoch_s=70.0)
    ahead, behind = pair.cars.values()
    pair.drive(2.0)
    ends_at = ahead.pseudonym(0.0).ends_at_utc_s - UTC_S
    pair.now = ends_at - 50.0
    pair.drive(2.0)
    next_id = ahead.digest.car_id(AHEAD, UTC_S + ends_at)
    sent = [each.next_leader_id for each in pair.on_air if isinstance(each, lcca.Reply)]

    assert set(sent) - {lcca.NO_ID}
    assert next_id not in sent
    for car in (ahead, behind):
        car.lcca.change_pseudonym(car.pseudonym(ends_at), ends_at)
        car.lcca.follow_lead(ends_at)
    assert behind.lcca.group.leader_id == next_id


def test_a_lead_of_a_camera_that_is_lost_is_not_joined_at_the_next_epoch(pair: Pair) -> None:
    behind = pair.cars[BEHIND]
    for _ in range(250):
        pair.now += 0.02
        behind.step(None, pair.now)
    assert behind.lcca.group.state is GroupState.REGULAR
    behind.lcca.change_pseudonym(behind.pseudonym(pair.now + 300.0), pair.now)
    behind.lcca.follow_lead(pair.now)
    assert behind.lcca.messages_to_send(pair.now) == []
