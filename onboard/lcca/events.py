"""Input and output values of the identification of the lead, and of the warning group."""

import math
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Self

from onboard.lcca.transitions import GroupEvent, GroupState
from onboard.messages.lcca import CarId, GroupMessage, Warn
from onboard.observations import BrakeCause, Discarded, Lead


@dataclass(frozen=True, slots=True)
class CandidateCar:
    """A car that may be the lead."""

    text: str
    """That its plate would bear."""
    car_id: CarId
    """The communication ID of that text in this epoch."""
    probability: float
    """That the lead's plate bears the text."""


@dataclass(frozen=True, slots=True)
class TrackedLead:
    """The lead, as one camera frame shows it, with the cars that it may be."""

    stamp_s: float
    """Time of the frame in s."""
    track_id: int
    gap_m: float
    closing_speed_m_s: float | None
    """Positive while the gap shrinks; `None` while not known."""
    closing_speed_sigma_m_s: float | None
    candidates: tuple[CandidateCar, ...]
    """The likeliest first; what their probabilities lack to 1 is for all other texts."""

    @classmethod
    def of(cls, lead: Lead, car_id_of: Callable[[str], CarId]) -> Self | None:
        """Return a lead with the communication IDs of its texts; `None` if there is none.

        Args:
            lead: as the camera reports it.
            car_id_of: derives the communication ID of a text in this epoch.
        """
        if lead.track_id is None or lead.gap_m is None:
            return None
        closing_m_s, closing_sigma_m_s = lead.closing_speed_m_s, lead.closing_speed_sigma_m_s
        if closing_m_s is not None and closing_sigma_m_s is not None:  # speeds of BSMs have a scale
            scale_sigma = (lead.gap_sigma_m or 0.0) / max(lead.gap_m, 1.0)
            closing_sigma_m_s = math.hypot(closing_sigma_m_s, scale_sigma * closing_m_s)
        texts: dict[CarId, str] = {}
        probabilities: defaultdict[CarId, float] = defaultdict(float)
        for each in lead.candidates:  # look-alike texts have one ID
            car_id = car_id_of(each.text)
            texts.setdefault(car_id, each.text)
            probabilities[car_id] += each.probability
        return cls(
            lead.stamp_s,
            lead.track_id,
            lead.gap_m,
            closing_m_s,
            closing_sigma_m_s,
            tuple(CandidateCar(texts[each], each, p) for each, p in probabilities.items()),
        )


@dataclass(frozen=True, slots=True)
class BrakingStatement:
    """A warning as the braking car itself sent it, of which another car sent a copy."""

    warn: Warn
    signer_id: bytes | None
    """HashedId8 of the braking car's certificate."""


@dataclass(frozen=True, slots=True)
class Inquired:
    """The cars in range were asked which of them is the lead."""

    kind: ClassVar[str] = "inquired"
    stamp_s: float
    track_id: int
    names: int
    """How many texts were asked for."""


@dataclass(frozen=True, slots=True)
class Identified:
    """The lead is known."""

    kind: ClassVar[str] = "identified"
    stamp_s: float
    track_id: int
    car_id: CarId
    text: str | None
    """Its plate; `None` if only its motion identified it."""
    probability: float
    cause: str
    """`answer` or `motion`."""


@dataclass(frozen=True, slots=True)
class IdentityLost:
    """The lead is no longer known, though it is still tracked."""

    kind: ClassVar[str] = "identity_lost"
    stamp_s: float
    track_id: int
    car_id: CarId
    cause: str
    """`refuted` by its motion, or `epoch`: its IDs have changed, and its plate is not known."""


@dataclass(frozen=True, slots=True)
class MeasuredLead:
    """The lead, as one camera frame shows it, with its ID if it is identified."""

    car_id: CarId | None
    """Communication ID; `None` while the lead is not identified."""
    gap_m: float
    closing_speed_m_s: float | None
    """Positive while the gap shrinks; `None` while not known."""
    previous_id: CarId | None = None
    """Of the epoch before, while others may still use it."""
    next_id: CarId | None = None
    """Of the epoch to come, when others may already use it."""


@dataclass(frozen=True, slots=True)
class Transition:
    """This vehicle's state, leader or number in its group has changed."""

    kind: ClassVar[str] = "transition"
    stamp_s: float
    event: GroupEvent
    state_before: GroupState
    state: GroupState
    """After the event."""
    leader_id: CarId
    """After the event."""
    group_number: int
    """After the event; 1 unless the state is MEMBER."""
    cause: str
    """A stable word: `answered`, `gap`, `not_ahead`, `no_answer`, `update`, ..."""


@dataclass(frozen=True, slots=True)
class WarningRaised:
    """A vehicle ahead in the group brakes hard: the driver is to be warned until it is over."""

    kind: ClassVar[str] = "warning"
    stamp_s: float
    origin_id: CarId
    """Of the braking vehicle."""
    sequence: int
    """Identifies the braking together with `origin_id`."""
    origin_number: int
    """The braking vehicle's number in the group, smaller than the own one."""
    group_number: int
    """The own number."""
    leader_id: CarId
    cause: BrakeCause
    """TEST: of the button; nothing brakes."""
    deceleration_m_s2: float
    age_s: float
    """From the sample that showed the braking to the reception of this copy, without clocks being
    compared: what each vehicle held it, and a bound for the time on the air."""
    hops: int
    """How many transmissions the warning took; 1: from the braking vehicle itself."""


@dataclass(frozen=True, slots=True)
class WarningLevel:
    """A braking that was warned of has another deceleration or cause."""

    kind: ClassVar[str] = "warning_level"
    stamp_s: float
    origin_id: CarId
    sequence: int
    """As in `WarningRaised`."""
    cause: BrakeCause
    deceleration_m_s2: float


@dataclass(frozen=True, slots=True)
class WarningOver:
    """A braking that was warned of is over."""

    kind: ClassVar[str] = "warning_over"
    stamp_s: float
    origin_id: CarId
    sequence: int
    """As in `WarningRaised`."""
    reason: str
    """`over`: its vehicle says so; `expired`: no warning of it has been accepted for some time."""


def discarded(reason: str, message: GroupMessage, now: float) -> Discarded:
    """Return that a message is discarded, for a counted reason."""
    return Discarded(now, "lcca", reason, f"{message.kind} from {message.sender_id.hex()}")
