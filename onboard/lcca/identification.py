"""Which car is the lead: asked over the radio, and confirmed by its motion.

The camera gives texts that the lead's plate may bear. An inquiry names them, and the car that bears
one answers. Which of the cars that answered is the lead, if any, follows from the texts'
probabilities, from the number of answers, and from the speeds and positions of the cars on the air
(`identity_posterior`, `motion_match`, `position_match`). From `BELIEF` on the car is identified. If
no plate can be read, a car whose motion alone is as convincing is asked by the temporary ID of its
BSMs.

An identity belongs to the vehicle that the camera tracks: readings after it change nothing, and it
ends with the track, or when the car on the air ceases to move as the lead does.
"""

import math
from collections import OrderedDict, deque
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from typing_extensions import override

from onboard.core import Core
from onboard.lcca.asking import AnswerLimit, is_behind, is_near
from onboard.lcca.events import Identified, IdentityLost, Inquired, TrackedLead
from onboard.lcca.identity_posterior import (
    LOST,
    MIN_UNLISTED,
    AskedText,
    vehicle_probabilities,
)
from onboard.lcca.motion_match import MAX_VEHICLES, MotionMatch, speed_at
from onboard.lcca.position_match import position_log_ratio, row_log_ratio
from onboard.messages.lcca import MAX_NAMES, NAME_BYTES, Answer, CarId, Inquiry
from onboard.observations import Discarded
from onboard.sensors.host_state import SPEED_VALID_S

BELIEF = 0.999
"""Probability from which a car is identified."""
MIN_ASKED = 0.004
"""Probability below which a text is not asked for, as a share of what the silence of the likelier
ones leaves to all texts: a plate that is misread for seconds bears one that seemed unlikely."""
MIN_ASKED_BY_MOTION = 0.5
"""Probability by motion alone from which a car is asked for its communication ID."""
KEEPS_BACK = (1.0 - BELIEF) / 10.0
"""The same where another one has answered for its plate, and is not identified yet: ten less
likely ones cannot keep it back."""
MAX_ASKED_BY_MOTION = MAX_NAMES // 2
"""Cars that one inquiry asks for that."""
REFUTED = -7.0
"""Evidence of its motion against a car (logarithm of a likelihood ratio), since it was last at its
highest, from which it is no longer the lead."""
ASK_HEADWAY_S = 3.0
"""Gap, divided by the own speed, from which on a car need not be known: more than the headway at
which it is joined, so that it is known by then."""
RETRY_S, RETRY_MAX_S = 0.1, 1.0
"""Until an inquiry is repeated: at first, and at most, doubling in between."""
RETRY_ON_AIR_S = 0.3
"""At most, if a car on the air moves as the lead does: inquiry or answer were then lost."""
ENOUGH_INQUIRIES, ANSWER_TIME_S = 2, 0.04
"""Inquiries, and time since the last one, after which a car is identified: the others that were
asked, the lead among them, have then had the chance to answer too."""
LIKELY, DERIVING_S = 0.9, 0.4
"""Probability of a text below which a car is not identified before so much time has passed since
the first inquiry: the IDs of the less likely texts are then derived and asked for. Of a fleet's
cars, the lead may be among them."""
NEW_TEXT, MAX_EARLY = 0.05, 8
"""Probability of a text not asked for yet from which an inquiry is repeated early, and how often
that happens on one track."""
RENEW_S = 2.0
"""Time between inquiries for the BSMs of an identified car that are not heard."""
MAX_TRACKS = 16
"""Tracks whose identity is remembered."""
MAX_ANSWERS, MAX_ASKED = 32, 256
"""Vehicles whose answers, and texts, are remembered of one track."""
_SPEEDS = 128
"""Samples of the own speed kept: those of more than a second at 100 Hz."""
_SEQUENCES = 1 << 16
_MAX_DOUBLINGS = 8
_VALID_SEQUENCES = 16
"""Inquiries whose answers are accepted."""


@dataclass(frozen=True, slots=True)
class CarIdentity:
    """The car that is the lead."""

    car_id: CarId
    """When it was identified; another one in the next epoch."""
    text: str | None
    """Its plate; `None` if it was identified by its motion."""


@dataclass(slots=True)
class _Track:
    """What is known of the vehicle of one track."""

    track_id: int
    answers: dict[bytes, CarId] = field(default_factory=dict)
    """Communication IDs of the cars that answered, by sender."""
    asked: dict[CarId, tuple[str, int]] = field(default_factory=dict)
    """Texts asked for in this epoch, and in how many inquiries."""
    asked_by_motion: dict[bytes, int] = field(default_factory=dict)
    """In how many inquiries of this epoch a sender was asked by its temporary ID."""
    inquiries: int = 0
    first_asked_at: float = math.inf
    identity: CarIdentity | None = None
    sender: bytes | None = None
    """The identified car, as its BSMs name it."""
    is_disputed: bool = False
    """Whether another signer has answered for it too."""

    def inquiries_for(self, car_id: CarId) -> int:
        """How many inquiries named a car in this epoch."""
        _, inquiries = self.asked.get(car_id, ("", 0))
        return inquiries


class Identification(Core):
    """Asks which car is the lead, answers the cars that ask, and decides."""

    def __init__(self, own_id: CarId, temporary_id: bytes, rng: np.random.Generator) -> None:
        """Start without a lead.

        Args:
            own_id: the own communication ID.
            temporary_id: of the own BSMs.
            rng: draws the first sequence number.
        """
        self._own_id, self._temporary_id = own_id, temporary_id
        self._speeds: deque[tuple[float, float]] = deque(maxlen=_SPEEDS)
        self._motion = MotionMatch()
        self._lead: TrackedLead | None = None
        self._last_track_id: int | None = None
        self._tracks: OrderedDict[int, _Track] = OrderedDict()
        self._temporary_ids: OrderedDict[bytes, bytes] = OrderedDict()
        self._offsets_m: Mapping[bytes, tuple[float, float, float]] = {}
        self._ask_at = self._asked_at = -math.inf
        self._sequence = int(rng.integers(_SEQUENCES))
        self._sequences: deque[int] = deque(maxlen=_VALID_SEQUENCES)
        self._answer_limit = AnswerLimit()
        self._outbox: list[Inquiry | Answer] = []
        self._events: deque[Inquired | Identified | IdentityLost | Discarded] = deque()

    @property
    def identity(self) -> CarIdentity | None:
        """The car that is the lead; `None` while it is not identified."""
        track = self._track
        return None if track is None else track.identity

    @property
    def sender(self) -> bytes | None:
        """The identified car, as its BSMs name it; `None` while that is not known, or disputed."""
        track = self._track
        return None if track is None or track.is_disputed else track.sender

    @property
    def _track(self) -> _Track | None:
        """What is known of the lead."""
        return None if self._lead is None else self._tracks.get(self._lead.track_id)

    def _speed_at(self, at_s: float) -> float | None:
        """Return the own speed at a time in m/s; `None` if it is not known."""
        return speed_at(self._speeds, at_s, SPEED_VALID_S)

    # In

    def set_own_id(self, own_id: CarId, temporary_id: bytes, now: float) -> None:
        """Take the own IDs of a new epoch; the others change theirs at about this time."""
        self._own_id, self._temporary_id = own_id, temporary_id
        for track in self._tracks.values():
            track.answers.clear()
            track.asked.clear()
            track.asked_by_motion.clear()
            track.sender, track.is_disputed = None, False
            if track.identity is not None and track.identity.text is None:
                self._lose(track, "epoch", now)
        self._plan_inquiry(now)

    def receive_speed(self, speed_m_s: float, stamp_s: float) -> None:
        """Take a sample of the own speed; one that is older than the last is ignored."""
        if not self._speeds or stamp_s > self._speeds[-1][0]:
            self._speeds.append((stamp_s, speed_m_s))

    def receive_speed_on_air(
        self, sender: bytes, temporary_id: bytes, speed_m_s: float, now: float
    ) -> None:
        """Take the speed in a BSM.

        Args:
            sender: its signer, or else its temporary ID.
            temporary_id: of the BSM.
            speed_m_s: of its sender.
            now: seconds on the cores' clock.
        """
        self._motion.receive_speed_on_air(sender, speed_m_s, now)
        self._temporary_ids[sender] = temporary_id
        self._temporary_ids.move_to_end(sender)
        if len(self._temporary_ids) > MAX_VEHICLES:
            self._temporary_ids.popitem(last=False)

    def receive_offsets(self, offsets_m: Mapping[bytes, tuple[float, float, float]]) -> None:
        """Take where other vehicles are by their and the own position.

        Args:
            offsets_m: by sender, as in `receive_speed_on_air`: ahead, right, and the sigma of
                either, in m. Replaces all that was received before.
        """
        self._offsets_m = offsets_m

    def receive_lead(self, lead: TrackedLead | None, now: float) -> None:
        """Take what one image shows of the lead; `None`: there is none."""
        self._lead = lead
        if lead is None:
            return
        track = self._tracks.setdefault(lead.track_id, _Track(lead.track_id))
        self._tracks.move_to_end(lead.track_id)
        if len(self._tracks) > MAX_TRACKS:
            self._tracks.popitem(last=False)
        if lead.track_id != self._last_track_id:
            self._last_track_id = lead.track_id
            self._motion.restart()
            self._plan_inquiry(now)
        own_m_s = self._speed_at(lead.stamp_s)
        if lead.closing_speed_m_s is not None and own_m_s is not None:
            self._motion.receive_lead_speed(
                own_m_s - lead.closing_speed_m_s,
                lead.closing_speed_sigma_m_s or 0.0,
                own_m_s,
                lead.stamp_s,
            )
        self._decide(track, lead, now)
        self._ask_if_due(track, lead, now)

    def receive_message(self, message: Inquiry | Answer, signer: bytes | None, now: float) -> None:
        """Take an inquiry or an answer, to whichever vehicle it is addressed.

        Args:
            message: the message.
            signer: `None` if it is not signed.
            now: seconds on the cores' clock.
        """
        if message.sender_id == self._own_id:
            self._discard("own_echo", message, now)
        elif isinstance(message, Inquiry):
            self._receive_inquiry(message, signer, now)
        elif message.to_id == self._own_id:
            self._receive_answer(message, signer or message.temporary_id, now)

    # Out

    def messages_to_send(self) -> list[Inquiry | Answer]:
        """Return the messages to send, and clear the outbox."""
        out, self._outbox = self._outbox, []
        return out

    @override
    def next_event(self) -> Inquired | Identified | IdentityLost | Discarded | None:
        return self._events.popleft() if self._events else None

    # Asking

    def _plan_inquiry(self, now: float) -> None:
        """Ask with the next image, and from then on ever more rarely."""
        if self._track is not None:
            self._track.inquiries = 0
            self._ask_at = max(now, self._asked_at + RETRY_S)

    def _ask_if_due(self, track: _Track, lead: TrackedLead, now: float) -> None:
        likely = {each.car_id for each in lead.candidates if each.probability >= NEW_TEXT}
        if not likely <= track.asked.keys() | {self._own_id} and track.inquiries < MAX_EARLY:
            self._ask_at = min(self._ask_at, self._asked_at + RETRY_S)
        if now < self._ask_at:
            return
        names = self._names(track, lead, now)
        if not names:
            return
        self._asked_at = now
        track.inquiries += 1
        track.first_asked_at = min(track.first_asked_at, now)
        if len(track.asked) > MAX_ASKED:
            track.asked.clear()
            track.asked_by_motion.clear()
        for each in lead.candidates:
            if each.car_id[:NAME_BYTES] in names:
                track.asked[each.car_id] = each.text, track.inquiries_for(each.car_id) + 1
        for sender, temporary_id in self._temporary_ids.items():
            if temporary_id in names:
                track.asked_by_motion[sender] = track.asked_by_motion.get(sender, 0) + 1
        silent = track.asked_by_motion.keys() - track.answers.keys()
        is_on_air = any(map(self._motion.is_on_air, silent))
        most_s = RETRY_ON_AIR_S if is_on_air else RETRY_MAX_S
        retry_s = min(RETRY_S * 2 ** min(track.inquiries - 1, _MAX_DOUBLINGS), most_s)
        self._ask_at = now + (retry_s if track.identity is None else RENEW_S)
        self._sequence = (self._sequence + 1) % _SEQUENCES
        self._sequences.append(self._sequence)
        self._outbox.append(Inquiry(self._own_id, self._sequence, tuple(names)))
        self._events.append(Inquired(now, track.track_id, len(names)))

    def _names(self, track: _Track, lead: TrackedLead, now: float) -> list[bytes]:
        """What to ask for; nothing if nothing is to be found out."""
        own_m_s = self._speed_at(now)
        if own_m_s is None or lead.gap_m >= ASK_HEADWAY_S * own_m_s:
            return []
        if track.identity is not None:
            is_on_air = track.sender is not None and self._motion.is_on_air(track.sender)
            if is_on_air or track.identity.text is None:
                return []
            return [
                each.car_id[:NAME_BYTES]
                for each in lead.candidates
                if each.text == track.identity.text
            ][:1]
        names = [self._temporary_ids[sender] for sender in self._alike(track, lead, now)]
        least = MIN_ASKED * self._left_by_silence(track, lead)
        names += [
            each.car_id[:NAME_BYTES]
            for each in lead.candidates
            if each.probability >= least and each.car_id != self._own_id
        ]
        return sorted(list(dict.fromkeys(names))[:MAX_NAMES])  # their order reveals nothing

    def _left_by_silence(self, track: _Track, lead: TrackedLead) -> float:
        """Probability of all texts if the lead has a radio, and none of those asked for so far."""
        asked = [each for each in lead.candidates if each.car_id in track.asked]
        lost = sum(each.probability * LOST ** track.inquiries_for(each.car_id) for each in asked)
        return lost + max(MIN_UNLISTED, 1.0 - sum(each.probability for each in asked))

    def _alike(self, track: _Track, lead: TrackedLead, now: float) -> list[bytes]:
        """Vehicles whose motion is a reason to ask them, the likeliest first."""
        has_answer = any(car_id in track.asked for car_id in track.answers.values())
        is_kept_back = has_answer and self._have_all_answered(track, lead, now)
        least = KEEPS_BACK if is_kept_back else MIN_ASKED_BY_MOTION
        probabilities = self._probabilities(track, lead, now)
        alike = [
            sender
            for sender, probability in probabilities.items()
            if probability >= least
            and sender not in track.answers
            and sender in self._temporary_ids
        ]
        alike.sort(key=probabilities.__getitem__, reverse=True)
        return alike[:MAX_ASKED_BY_MOTION]

    # Being asked

    def _receive_inquiry(self, inquiry: Inquiry, signer: bytes | None, now: float) -> None:
        is_read = self._own_id[:NAME_BYTES] in inquiry.names
        if not is_read and self._temporary_id not in inquiry.names:
            return
        if signer is not None and not self._may_ask(signer, is_read=is_read):
            self._discard("not_behind", inquiry, now)
            return
        if not self._answer_limit.take(signer or inquiry.sender_id, now):
            self._discard("too_often", inquiry, now)
            return
        self._outbox.append(
            Answer(
                self._own_id,
                inquiry.sender_id,
                inquiry.sequence,
                self._temporary_id,
                self._speed_at(now),
            )
        )

    def _may_ask(self, signer: bytes, *, is_read: bool) -> bool:
        """Whether an asker may be behind and near, by what is known of its place."""
        offset_m = self._offsets_m.get(signer)
        return offset_m is None or (is_near(offset_m) and (is_read or is_behind(offset_m)))

    # Deciding

    def _receive_answer(self, answer: Answer, sender: bytes, now: float) -> None:
        track, lead = self._track, self._lead
        if track is None or lead is None or answer.sequence not in self._sequences:
            self._discard("not_asked", answer, now)
            return
        is_asked_by_motion = self._temporary_ids.get(sender) == answer.temporary_id
        if answer.sender_id not in track.asked and not is_asked_by_motion:
            self._discard("not_asked", answer, now)
            return
        if answer.speed_m_s is not None:
            self.receive_speed_on_air(sender, answer.temporary_id, answer.speed_m_s, now)
        if track.identity is None:
            if sender not in track.answers and len(track.answers) >= MAX_ANSWERS:
                self._discard("too_many", answer, now)
                return
            track.answers[sender] = answer.sender_id
            self._decide(track, lead, now)
        elif _is_of(track.identity, answer.sender_id, lead):
            self._bind(track, answer, sender, now)

    def _bind(self, track: _Track, answer: Answer, sender: bytes, now: float) -> None:
        """Take who sends the identified vehicle's BSMs, unless that is known.

        No answer moves an identity: whoever has a certificate could else silence the vehicle ahead.
        Its certificate stays in an epoch, also over a restart; a temporary ID does not, so without
        signatures another one is taken once the former is off the air. Where no certificate commits
        to IDs, the first answer of an epoch may be an insider's: of two signers, neither is the
        only one.
        """
        is_signed = sender != answer.temporary_id
        if track.sender is not None and (is_signed or self._motion.is_on_air(track.sender)):
            if sender != track.sender:
                track.is_disputed |= is_signed
                self._discard("another_signer", answer, now)
            return
        track.sender = sender

    def _probabilities(self, track: _Track, lead: TrackedLead, now: float) -> dict[bytes, float]:
        pending = int(now < self._asked_at + ANSWER_TIME_S)
        texts = [
            AskedText(
                each.text, each.probability, max(0, track.inquiries_for(each.car_id) - pending)
            )
            for each in lead.candidates
        ]
        answered = {
            sender: track.asked[car_id][0]
            for sender, car_id in track.answers.items()
            if car_id in track.asked
        }
        motion, in_row = self._motion.log_ratios(), self._motion.in_row_log_ratios()
        for sender in motion:
            offset_m = self._offsets_m.get(sender)
            if offset_m is not None:
                motion[sender] += position_log_ratio(*offset_m, lead.gap_m)
                in_row[sender] += row_log_ratio(*offset_m)
        silent = {
            sender: max(0, inquiries - pending)
            for sender, inquiries in track.asked_by_motion.items()
        }
        listed = {each.car_id for each in lead.candidates} | track.asked.keys()
        silent |= {sender: 0 for sender, car_id in track.answers.items() if car_id not in listed}
        return vehicle_probabilities(texts, answered, motion, silent, in_row)

    def _decide(self, track: _Track, lead: TrackedLead, now: float) -> None:
        if track.identity is not None:
            if track.sender is not None and self._motion.decline(track.sender) <= REFUTED:
                self._motion.refute(track.sender)
                self._lose(track, "refuted", now)
                self._plan_inquiry(now)
            return
        if not track.answers:
            return
        probabilities = self._probabilities(track, lead, now)
        sender = max(track.answers, key=lambda each: probabilities.get(each, 0.0))
        probability = probabilities.get(sender, 0.0)
        car_id = track.answers[sender]
        is_by_text = car_id in track.asked
        if probability < BELIEF or (is_by_text and not self._have_all_answered(track, lead, now)):
            return
        text = _text_of(car_id, lead)
        track.identity, track.sender = CarIdentity(car_id, text), sender
        cause = "answer" if is_by_text else "motion"
        self._events.append(Identified(now, track.track_id, car_id, text, probability, cause))

    def _have_all_answered(self, track: _Track, lead: TrackedLead, now: float) -> bool:
        """Whether no other answer is to be expected, since all came or only one text is likely."""
        likeliest = max((each.probability for each in lead.candidates), default=0.0)
        is_asked = track.inquiries >= ENOUGH_INQUIRIES and now >= self._asked_at + ANSWER_TIME_S
        is_likely = likeliest >= LIKELY or now >= track.first_asked_at + DERIVING_S
        return likeliest >= BELIEF or (is_asked and is_likely)

    def _lose(self, track: _Track, cause: str, now: float) -> None:
        if track.identity is not None:
            self._events.append(IdentityLost(now, track.track_id, track.identity.car_id, cause))
        track.identity = track.sender = None
        track.is_disputed = False
        track.answers.clear()

    def _discard(self, reason: str, message: Inquiry | Answer, now: float) -> None:
        detail = f"{message.kind} from {message.sender_id.hex()}"
        self._events.append(Discarded(now, "lcca", reason, detail))


def _is_of(identity: CarIdentity, car_id: CarId, lead: TrackedLead) -> bool:
    """Whether this is a communication ID of the identified car."""
    if identity.text is None:
        return car_id == identity.car_id
    return _text_of(car_id, lead) == identity.text


def _text_of(car_id: CarId, lead: TrackedLead) -> str | None:
    return next((each.text for each in lead.candidates if each.car_id == car_id), None)
