"""Insiders who speak for other vehicles, lay charges on them, or ask who is near.

All IDs change during the attack: an insider knows all plates, and so everybody's next ID before it
is used. Without checks, the certificates commit to no IDs.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np
from typing_extensions import override

from onboard.messages.lcca import (
    MAX_NAMES,
    NAME_BYTES,
    NO_ID,
    Answer,
    CarId,
    Inquiry,
    Join,
    LccaMessage,
    Leave,
    LeaveReason,
    Reply,
    Update,
    Warn,
    WarnCause,
)
from onboard.security.p256 import key_from
from onboard.security.plate_digest import PlateDigest
from onboard.security.settings import PlateDigestSettings
from onboard.tools.test_ca.authority import KnownPlate, make_trial
from onboard.wave_udp import psid, wsmp
from sim_rig.studies.attacks.attack_counts import AttackCounts
from sim_rig.studies.attacks.attack_world import SPEED_M_S, STEP_S
from sim_rig.studies.attacks.attacked_group import (
    DIGEST,
    LEADER,
    PLATES,
    READ,
    AttackedGroup,
)
from sim_rig.studies.attacks.group_attacks import (
    BRAKING_MESSAGES,
    PERIOD_MESSAGES,
    GroupInsider,
    brake_under_attack,
)

SEQUENCES = 1 << 16
"""Of each sequence number."""
CHANGE_S = 46.0
"""From the start until all IDs change."""
ELSEWHERE = "DDD4"
"""Plate of an honest vehicle in another lane, in radio range."""


class Imposture:
    """One insider in radio range of the group."""

    reach: ClassVar[int] = len(PLATES)
    """Vehicles ahead and behind that a vehicle of the group receives; insiders reach all."""
    plate: ClassVar[float] = READ
    """Probability of the text that cameras read on the plate ahead."""
    leads: ClassVar[bool] = False
    """Whether the first insider drives ahead of the group."""

    def __init__(self, insider: GroupInsider, group: AttackedGroup, plates: "Plates") -> None:
        """Begin with the attack."""
        self.insider, self.group, self.plates = insider, group, plates
        self.own_ids: set[CarId] = set()
        """IDs under which it asks."""

    def sends(self, _now: float) -> Iterator[bytes]:
        """Yield what it sends ten times a second."""
        yield from ()

    def answers(self, _message: LccaMessage, _secured: bytes, _now: float) -> Iterator[bytes]:
        """Yield what it sends at once when it receives a message."""
        yield from ()


class Plates:
    """Everybody's communication IDs, and an honest vehicle in another lane."""

    def __init__(self, utc_s: float, digest: PlateDigest, elsewhere: GroupInsider) -> None:
        """Know all plates; time 0 is `utc_s`."""
        self._utc_s, self._digest, self.elsewhere = utc_s, digest, elsewhere

    def car_id(self, plate: str, now: float) -> CarId:
        """Return the ID of a vehicle of the group."""
        return self._digest.car_id(plate, self._utc_s + now)


class Hijack(Imposture):
    """Answers for the leader, and sends all else in its name and its follower's.

    Its numbers are the next ones of these vehicles, as anybody in radio range knows them.
    """

    def __init__(self, insider: GroupInsider, group: AttackedGroup, plates: Plates) -> None:
        super().__init__(insider, group, plates)
        self._join_sequence = self._leader_sequence = 0
        """Newest ones of the follower's joins, and of the leader's replies."""

    @override
    def answers(self, message: LccaMessage, _secured: bytes, now: float) -> Iterator[bytes]:
        """Answer inquiries and joins before the leader does."""
        lead, follower = self._named(now)
        asks = message.sender_id
        match message:
            case Inquiry():
                evil = self.insider.temporary_id
                answer = Answer(lead, asks, message.sequence, evil, SPEED_M_S)
                yield self.insider.signed(answer, now)
            case Reply(sender_id=sender) if sender == lead:
                self._leader_sequence = message.leader_sequence
            case Join(to_id=asked) if asked == lead:
                if asks == follower:
                    self._join_sequence = message.sequence
                number = (self._leader_sequence + 1) % SEQUENCES
                reply = Reply(lead, lead, 9, asks, message.sequence, number, SPEED_M_S, NO_ID)
                yield self.insider.signed(reply, now)

    @override
    def sends(self, now: float) -> Iterator[bytes]:
        """Warn, end warnings, renumber, leave and join for others."""
        lead, follower = self._named(now)
        newest = self.group.newest
        own = braking(lead, lead, newest + 1)
        yield self.insider.signed(own, now)
        for sequence in (newest, newest + 1):
            end = replace(braking(lead, lead, sequence), cause=WarnCause.OVER)
            yield self.insider.signed(replace(end, first_sequence=newest), now)
        yield self.insider.signed(replace(own, sender_id=self.insider.own_id(now)), now)
        number = (self._leader_sequence + 1) % SEQUENCES
        yield self.insider.signed(Update(lead, lead, 9, number), now)
        yield self.insider.signed(Leave(follower, lead, 2, lead, LeaveReason.GAP), now)
        sequence = (self._join_sequence + 1) % SEQUENCES
        yield self.insider.signed(Join(follower, lead, 2, lead, sequence, lead, newest), now)

    def _named(self, now: float) -> tuple[CarId, CarId]:
        """Return the IDs of the leader and of its follower."""
        lead, follower = (self.plates.car_id(plate, now) for plate in PLATES[:2])
        return lead, follower


class Framing(Imposture):
    """Passes on what honest vehicles have signed, where or when it is not true."""

    def __init__(self, insider: GroupInsider, group: AttackedGroup, plates: Plates) -> None:
        super().__init__(insider, group, plates)
        self._old: tuple[Warn, bytes] | None = None

    @override
    def answers(self, message: LccaMessage, secured: bytes, _now: float) -> Iterator[bytes]:
        """Keep the leader's last warning."""
        if isinstance(message, Warn) and message.is_direct:
            self._old = message, secured
        yield from ()

    @override
    def sends(self, now: float) -> Iterator[bytes]:
        """Pass on a true braking in another lane as one ahead in this, and an old one again."""
        own, lead = self.insider.own_id(now), self.plates.car_id(LEADER, now)
        origin = self.plates.elsewhere.own_id(now)
        number, into = divmod(round(now / STEP_S), PERIOD_MESSAGES)
        if into < BRAKING_MESSAGES:
            true = braking(origin, origin, number)
            signed = wsmp.decode(self.plates.elsewhere.signed(true, now)).payload
            yield self._copy(replace(true, sender_id=own, leader_id=lead), signed, now)
        if self._old is not None:
            warn, secured = self._old
            yield self._copy(replace(warn, sender_id=own, leader_id=lead), secured, now)

    def _copy(self, warn: Warn, secured: bytes, now: float) -> bytes:
        return self.insider.signed(replace(warn, hops=2, age_s=0.01), now, secured)


class Oracle(Imposture):
    """Asks ten times a second, each time under another ID, for the plates of the group."""

    @override
    def sends(self, now: float) -> Iterator[bytes]:
        """Ask for all plates at once."""
        number = round(now / STEP_S)
        own = self.insider.own_id(now)[:4] + number.to_bytes(4)
        self.own_ids.add(own)
        names = [self.plates.car_id(plate, now)[:NAME_BYTES] for plate in PLATES]
        names += [number.to_bytes(2) + bytes((0xEE, at)) for at in range(MAX_NAMES - len(names))]
        yield self.insider.signed(Inquiry(own, number % SEQUENCES, tuple(sorted(names))), now)


def run_imposture(
    kind: type[Imposture],
    seed: tuple[int, ...],
    utc_s: float,
    seconds: float,
    insiders: int,
    *,
    checks: bool,
) -> AttackCounts:
    """Let a group form and its leader brake every `BRAKES_EVERY_S`, under attack from the start.

    Args:
        kind: what the insiders do.
        seed: of keys, times of the brakings and draws of the vehicles.
        utc_s: near the start, seconds since 1970.
        seconds: duration of the attack, of which `QUIET_S` are without a braking.
        insiders: their number.
        checks: whether certificates commit to IDs, and the vehicles check brakings and claims.

    Returns:
        What is counted in the run.
    """
    rng, *rngs = np.random.default_rng(seed).spawn(1 + len(PLATES))
    names = [f"EVIL{number}" for number in range(insiders)]
    digest = PlateDigest(PlateDigestSettings.model_validate(DIGEST))
    utc_s = digest.epoch_ends_at(utc_s) - CHANGE_S
    plates = {plate: KnownPlate(plate, digest) for plate in (*PLATES, ELSEWHERE, *names)}
    keys = make_trial(
        plates,
        {psid.BSM, psid.LCCA},
        utc_s,
        key_from(rng),
        pseudonyms=1,
        plates=plates if checks else {},
    )
    group = AttackedGroup(
        keys,
        utc_s,
        rngs,
        checks=checks,
        reach=kind.reach,
        plate=kind.plate,
        ahead=names[0] if kind.leads else None,
    )
    known = Plates(utc_s, digest, GroupInsider(ELSEWHERE, digest, keys[ELSEWHERE], utc_s))
    attackers = [
        kind(GroupInsider(name, digest, keys[name], utc_s), group, known) for name in names
    ]
    answered = _AnswersCounted(attackers)
    group.listeners = [*(each.answers for each in attackers), answered.receive]
    senders = [each.sends for each in attackers]
    counts = brake_under_attack(group, senders, seconds, rng)
    honest = {
        own.certificate.hashed_id8 for name in (*PLATES, ELSEWHERE) for own in keys[name].pseudonyms
    }
    return replace(
        counts,
        honest_ignored=len(group.ignored() & honest),
        answers_per_s=round(answered.count / group.now, 2),
    )


class _AnswersCounted:
    """Counts the answers that insiders get."""

    def __init__(self, attackers: Sequence[Imposture]) -> None:
        self._attackers = attackers
        self.count = 0

    def receive(self, message: LccaMessage, _secured: bytes, _now: float) -> Iterator[bytes]:
        if isinstance(message, Answer):
            self.count += any(message.to_id in each.own_ids for each in self._attackers)
        yield from ()


def braking(origin: CarId, leader: CarId, sequence: int) -> Warn:
    """Return a warning of a braking as its own vehicle sends it."""
    sequence %= SEQUENCES
    return Warn(
        origin, leader, 1, origin, sequence, 5, 1, sequence, WarnCause.DECELERATION, 8.0, 0.01, 1
    )
