"""LCCA of one vehicle: its group, the identification of the lead, and what both are given.

Both know vehicles by their communication IDs and rely on what they are given. Here plates become
IDs, IDs of adjacent epochs are masked on the air, and what is not credible is refused.
"""

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from onboard.core import Core
from onboard.lcca.asking import ReplyLimit
from onboard.lcca.epoch_ids import CarIds, EpochIds
from onboard.lcca.events import (
    BrakingStatement,
    MeasuredLead,
    TrackedLead,
    WarningLevel,
    WarningRaised,
)
from onboard.lcca.group import WarningGroup
from onboard.lcca.identification import Identification
from onboard.lcca.parameters import GroupParameters
from onboard.messages import lcca
from onboard.misbehaviour.alarm_claims import NOBODY, AlarmClaims
from onboard.misbehaviour.misbehaviour_detection import MisbehaviourDetector
from onboard.misbehaviour.pending_warnings import PendingWarnings
from onboard.misbehaviour.sender_check import sender_violation
from onboard.observations import Discarded, HardBrake, Lead, LeadIdentity, Speed
from onboard.security.plate_digest import PlateDigest
from onboard.security.pseudonyms import Pseudonym
from onboard.security.security_services import CLOCK_TOLERANCE_S
from onboard.trace.trace_line import Event

LEAD_VALID_S = 1.0
"""Of a lead that the camera has shown: without frames, the group leaves it as soon."""


class LccaApplication:
    """Sends and receives LCCA messages, in values; the timers of its cores are handled by others.

    Its events are taken after each of these.
    """

    def __init__(
        self,
        parameters: GroupParameters,
        plate: str,
        pseudonym: Pseudonym,
        rng: np.random.Generator,
        *,
        digest: PlateDigest,
        utc_offset_s: float,
        misbehaviour: MisbehaviourDetector,
        claims: AlarmClaims | None = None,
    ) -> None:
        """Start without a lead and a group.

        Args:
            parameters: of the group's protocol.
            plate: the own one.
            pseudonym: the present identifiers.
            rng: for start values of sequence numbers and random delays.
            digest: derives communication IDs from plates.
            utc_offset_s: UTC in seconds since 1970 less `now`.
            misbehaviour: knows who uses which ID, and the BSMs of all signers.
            claims: knows which signers are credible; `None`: all are.
        """
        self._digest = digest
        self._epoch_ids = EpochIds(digest, plate)
        self.utc_offset_s = utc_offset_s
        self._misbehaviour = misbehaviour
        self._claims = claims
        self.group = WarningGroup(
            parameters, pseudonym.car_id, rng, proves_ids=bool(pseudonym.proof)
        )
        self.identification = Identification(pseudonym.car_id, pseudonym.temporary_id, rng)
        self._pending_warnings = PendingWarnings(misbehaviour)
        self._replies = ReplyLimit()
        self.cores: tuple[Core, ...] = (self._pending_warnings, self.identification, self.group)
        """In the order of their timers."""
        self._lead: Lead | None = None
        self._events: deque[Event] = deque()

    def receive_speed(self, speed: Speed, now: float) -> None:
        """Take the own speed."""
        self.identification.receive_speed(speed.speed_m_s, speed.stamp_s)
        self.group.receive_speed(speed.speed_m_s, now)

    def receive_hard_brake(self, brake: HardBrake, now: float) -> None:
        """Take a change of the own hard braking."""
        self.group.receive_hard_brake(brake, now)

    def receive_lead(self, lead: Lead, now: float) -> None:
        """Find out which car is the lead, and let the group follow it."""
        self._lead = lead
        utc_s = self._utc_s(now)
        tracked = TrackedLead.of(lead, lambda text: self._digest.car_id(text, utc_s))
        self.identification.receive_lead(tracked, now)
        self._follow(lead, now)
        if self._claims is not None:
            self._claims.receive_identified(self._identified_signers())

    def follow_lead(self, now: float) -> None:
        """Hand the lead of the last frame to the warning group anew: its ID has changed."""
        lead = self._lead
        if lead is not None and now - lead.stamp_s <= LEAD_VALID_S:
            self._follow(lead, now)

    def _follow(self, lead: Lead, now: float) -> None:
        """Hand a lead to the warning group, under its ID if it is identified."""
        vehicle = None
        if lead.gap_m is not None:
            identity = self.identification.identity
            ids = CarIds(None if identity is None else identity.car_id)
            if identity is not None and identity.text is not None:
                ids = self._epoch_ids.of(identity.text, self._utc_s(now))
            vehicle = MeasuredLead(
                ids.present, lead.gap_m, lead.closing_speed_m_s, ids.previous, ids.following
            )
        is_unknown = lead.identity is LeadIdentity.UNKNOWN
        self.group.receive_lead(vehicle, now, is_unknown=is_unknown)

    def change_pseudonym(self, pseudonym: Pseudonym, now: float) -> None:
        """Take the own IDs of a new epoch; `follow_lead` then tells the group the lead's."""
        self.group.set_own_id(pseudonym.car_id, now)
        self.identification.set_own_id(pseudonym.car_id, pseudonym.temporary_id, now)

    def prepare_next_epoch(self, now: float) -> None:
        """Tell the group the own ID of the next epoch when that is near."""
        next_id = self._epoch_ids.own_next(self._utc_s(now))
        if next_id is not None:
            self.group.receive_next_own_id(next_id)

    def receive_message(
        self,
        message: lcca.LccaMessage,
        signer: bytes | None,
        made_at_s: float,
        now: float,
        stated: BrakingStatement | None = None,
        *,
        heading_rad: float | None = None,
    ) -> None:
        """Take an LCCA message from the air, to whichever vehicle it is addressed.

        Args:
            message: as decoded.
            signer: its signer; `None` if it is not signed.
            made_at_s: when it was generated by its sender's clock, as a time of the cores.
            now: time of reception.
            stated: of a signed copy of a warning, what the braking vehicle stated.
            heading_rad: of the host vehicle, clockwise from north; `None` if it is not known.
        """
        if signer is not None and not isinstance(message, lcca.Inquiry):  # which needs no proof
            self._misbehaviour.receive_car_id(signer, message.sender_id)
        match message:
            case lcca.Inquiry() | lcca.Answer():
                self._receive_identification(message, signer, now)
            case _ if signer is not None and self._refuses(message, signer, heading_rad, now):
                pass
            case lcca.Warn():
                message = _aged(message, now)
                claimant = self._claimant(signer, stated, now)
                if self._is_ignored(message, claimant, now):
                    sender = message.sender_id.hex()
                    self._discard("ignored_signer", f"a warning from {sender}", now)
                else:
                    self._pending_warnings.receive_warning(message, claimant, made_at_s, now)
            case _:
                self._receive_group_message(message, signer, now)

    def receive_bsm(self, signer: bytes, speed_m_s: float | None, now: float) -> None:
        """Take a credible BSM of this signer, which shows that its vehicle is still there."""
        car_id = self._misbehaviour.car_id_of(signer)
        if car_id is not None:
            self.group.receive_bsm(car_id, now, speed_m_s)

    @property
    def awaits_speeds(self) -> bool:
        """Whether a warning waits for a BSM that confirms it."""
        return self._pending_warnings.get_timer() != math.inf

    def check_pending_warnings(self, now: float) -> None:
        """Check the warnings that wait against the BSMs of their vehicles, after a BSM."""
        self._pending_warnings.handle_timer(now)

    def take_events(self, now: float) -> Iterator[Event]:
        """Yield what has happened; the group gets a warning after the events of the one before."""
        yield from self._taken()
        while (passed := self._pending_warnings.next_warning()) is not None:
            warning, signer = passed
            if self._claims is not None:
                self._claims.receive_identified(self._identified_signers())
                self._claims.receive_warn(warning, signer, now)
            self.group.receive_message(warning, now)
            yield from self._taken()

    def messages_to_send(self, now: float) -> list[lcca.LccaMessage]:
        """Return the messages to send, the group's first, with masked IDs; clear the outbox."""
        messages: list[lcca.LccaMessage] = [
            self._epoch_ids.to_send(message, self._utc_s(now))
            for message in self.group.messages_to_send(now)
        ]
        return messages + self.identification.messages_to_send()

    def _taken(self) -> Iterator[Event]:
        while self._events:
            yield self._events.popleft()
        while (event := self.group.next_event()) is not None:
            if self._claims is not None and isinstance(event, WarningRaised | WarningLevel):
                self._claims.receive_warning(event)
            yield event

    def _receive_identification(
        self, message: lcca.Inquiry | lcca.Answer, signer: bytes | None, now: float
    ) -> None:
        before = self.identification.identity
        self.identification.receive_message(message, signer, now)
        if self.identification.identity is not before:
            self.follow_lead(now)

    def _receive_group_message(
        self, message: lcca.GroupMessage, signer: bytes | None, now: float
    ) -> None:
        if isinstance(message, lcca.Join):
            if signer is not None and not self._replies.take(signer, now):
                self._discard("too_often", f"a join from {message.sender_id.hex()}", now)
                return
            if not self._misbehaviour.is_id_unique(message.sender_id):
                message = message.without_acknowledgement()
        clear = self._epoch_ids.received(message, self._lead_text, self._utc_s(now))
        self.group.receive_message(clear, now)

    def _refuses(
        self, message: lcca.GroupMessage, signer: bytes, heading_rad: float | None, now: float
    ) -> bool:
        """Whether a signed message is discarded for what is known of its sender."""
        violation = sender_violation(
            message,
            signer,
            self._misbehaviour,
            predecessor_id=self.group.predecessor_id,
            predecessor_signer=self.identification.sender,
            heading_rad=heading_rad,
        )
        if violation is not None:
            self._discard(violation, f"{message.kind} from {message.sender_id.hex()}", now)
            return True
        return False

    def _identified_signers(self) -> frozenset[bytes]:
        """Return who signs for the lead, and for the leader that it names to its group."""
        lead = self.identification.sender
        is_member = self.group.predecessor_id is not None
        leader = self._misbehaviour.owner_of(self.group.leader_id) if is_member else None
        return frozenset(signer for signer in (lead, leader) if signer is not None)

    def _claimant(
        self, signer: bytes | None, stated: BrakingStatement | None, now: float
    ) -> bytes | None:
        """Return who claims a braking ahead in this group; see `AlarmClaims.claimant`.

        Who brakes in another lane has not stated that it is ahead: who passes it on here claims so.
        """
        if stated is None or signer is None or self._claims is None:
            return signer
        is_ahead = self.group.has_ahead(stated.warn, now)
        return self._claims.claimant(signer, stated.signer_id if is_ahead else None, now)

    def _is_ignored(self, warn: lcca.Warn, claimant: bytes | None, now: float) -> bool:
        """Whether a braking is claimed, and who claims it is not credible."""
        if self._claims is None or warn.cause in (lcca.WarnCause.OVER, lcca.WarnCause.TEST):
            return False
        return self._claims.is_refused(warn.event_origin_id.hex(), claimant or NOBODY, now)

    @property
    def _lead_text(self) -> str | None:
        """Plate of the lead, if it is identified by it."""
        identity = self.identification.identity
        return None if identity is None else identity.text

    def _utc_s(self, now: float) -> float:
        return now + self.utc_offset_s

    def _discard(self, reason: str, detail: str, now: float) -> None:
        self._events.append(Discarded(now, "lcca", reason, detail))


def _aged(warn: lcca.Warn, now: float) -> lcca.Warn:
    """Return a warning at least as old as its vehicle has signed it, by clocks that may differ."""
    if warn.is_direct or warn.stated_at_s is None:
        return warn
    return replace(warn, age_s=max(warn.age_s, now - warn.stated_at_s - CLOCK_TOLERANCE_S))
