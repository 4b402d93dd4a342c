"""Insiders who disturb a warning group: what they forge, and how many true brakings are missed.

The forged messages are signed, name the group's leader, and use its next event sequence numbers.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from onboard.lcca.epoch_ids import EpochIds
from onboard.messages import lcca
from onboard.messages.lcca import CarId, GroupMessage, LccaMessage, Reply, Warn, WarnCause
from onboard.security.credentials import Credentials
from onboard.security.p256 import key_from
from onboard.security.plate_digest import PlateDigest
from onboard.security.pseudonyms import Pseudonyms
from onboard.security.settings import PlateDigestSettings
from onboard.tools.test_ca.authority import KnownPlate, make_trial
from onboard.wave_udp import psid
from sim_rig.studies.attacks.attack_counts import AttackCounts
from sim_rig.studies.attacks.attack_world import STEP_S, Place, Sender, Signer
from sim_rig.studies.attacks.attacked_group import (
    BRAKING_S,
    DIGEST,
    FOLLOWERS,
    PLATES,
    AttackedGroup,
    Warned,
)

NUMBERS = 2
"""Event sequence numbers ahead of the leader's that are forged at once."""
BRAKING_MESSAGES, PERIOD_MESSAGES = 20, 80
"""Of one invented braking, and until the next one: the alarm has ended by then."""
QUIET_S = 35.0
"""Of the attack, before the first braking: a slowing ahead would confirm what insiders invent."""
BRAKES_EVERY_S = 10.0
"""In the meantime, the vehicles regain the speed that they lost."""
LATEST_S = 1.0
"""After the start of a braking, while it lasts; it is missed if no warning of it is on then."""

GroupForgery = Callable[[CarId, CarId, int, int], Iterator[LccaMessage]]
"""Messages that are forged at once: by the insider's and the leader's ID, the leader's newest event
sequence number, and how often was forged before."""


def run_group(
    forgery: GroupForgery,
    seed: tuple[int, ...],
    utc_s: float,
    seconds: float,
    insiders: int,
    *,
    checks: bool,
) -> AttackCounts:
    """Let a group form and its leader brake every `BRAKES_EVERY_S`, under attack from the start.

    Args:
        forgery: what the insiders send.
        seed: of keys, times of the brakings and draws of the vehicles.
        utc_s: at the start, seconds since 1970.
        seconds: duration of the attack, of which `QUIET_S` are without a braking.
        insiders: their number.
        checks: whether the vehicles check brakings and claims.

    Returns:
        What is counted in the run.
    """
    rng, *rngs = np.random.default_rng(seed).spawn(1 + len(PLATES))
    names = [f"EVIL{number}" for number in range(insiders)]
    digest = PlateDigest(PlateDigestSettings.model_validate(DIGEST))
    plates = {plate: KnownPlate(plate, digest) for plate in (*PLATES, *names)}
    services = {psid.BSM, psid.LCCA}
    keys = make_trial(plates, services, utc_s, key_from(rng), pseudonyms=1, plates=plates)
    group = AttackedGroup(keys, utc_s, rngs, checks=checks)
    signers = [GroupInsider(name, digest, keys[name], utc_s) for name in names]
    return brake_under_attack(
        group, [partial(_forged, group, signer, forgery) for signer in signers], seconds, rng
    )


def brake_under_attack(
    group: AttackedGroup, senders: Sequence[Sender], seconds: float, rng: np.random.Generator
) -> AttackCounts:
    """Let a group form, and its leader brake every `BRAKES_EVERY_S`.

    Args:
        group: the vehicles.
        senders: the insiders.
        seconds: duration of the attack, of which `QUIET_S` are without a braking.
        rng: draws the times of the brakings.

    Returns:
        What the followers were warned of, whom they took for the vehicle ahead, and whom they
        ignore.
    """
    group.drive(QUIET_S, senders)
    brakings_at = []
    for _ in range(int((seconds - QUIET_S) // BRAKES_EVERY_S)):
        brakings_at.append(group.now + round(rng.uniform(0.0, BRAKES_EVERY_S / 2.0), 1))
        group.drive(BRAKES_EVERY_S, senders, brakings_at[-1])
    found = [_count_alarms(group, plate, brakings_at) for plate in FOLLOWERS]
    false_alarms, false_alarm_s, missed = zip(*found, strict=True)
    return AttackCounts(
        false_alarms=max(false_alarms),
        false_alarm_s=max(false_alarm_s),
        ignored=len(group.ignored()),
        true_alarms=len(brakings_at) * len(FOLLOWERS),
        true_missed=sum(missed),
        identified_s=_identified_s(group),
        wrong_leads=sum(not is_right for plate in FOLLOWERS for _, is_right in group.leads(plate)),
        sent=group.sent,
        received=group.received(),
    )


def _identified_s(group: AttackedGroup) -> float | None:
    """Return when the last follower had identified the vehicle ahead of it; `None`: never."""
    found_s = [
        min((at_s for at_s, is_right in group.leads(plate) if is_right), default=math.inf)
        for plate in FOLLOWERS
    ]
    return round(max(found_s), 2) if max(found_s) < math.inf else None


def _count_alarms(
    group: AttackedGroup, plate: str, brakings_at: Sequence[float]
) -> tuple[int, float, int]:
    """Return false alarms of a follower, for how long, and the brakings it had no alarm of."""
    alarms = group.alarms(plate)
    warned = [each for each in group.warned(plate) if each.origin_id in group.leader_ids]
    missed = sum(not (_is_on(warned, at) and _is_on(alarms, at)) for at in brakings_at)
    false = [each for each in alarms if not _is_true(each, group, brakings_at)]
    false_s = [min(each.ended_at, group.now) - each.began_at for each in false]
    return len(false_s), round(sum(false_s), 1), missed


def _is_on(warned: Sequence[Warned], braked_at: float) -> bool:
    """Whether one is on in time after the start of a braking, and has not been ended."""
    return any(each.began_at <= braked_at + LATEST_S < each.ended_at for each in warned)


def _is_true(alarm: Warned, group: AttackedGroup, brakings_at: Sequence[float]) -> bool:
    """Whether an alarm is of the leader, or of nobody by name, and began while it braked."""
    return (not alarm.origin_id or alarm.origin_id in group.leader_ids) and any(
        at <= alarm.began_at <= at + BRAKING_S + LATEST_S for at in brakings_at
    )


class GroupInsider:
    """A radio with a certificate of its own vehicle, whose ID it proves."""

    def __init__(self, plate: str, digest: PlateDigest, keys: Credentials, utc_s: float) -> None:
        """Start at time 0, which is `utc_s`.

        Args:
            plate: of its vehicle.
            digest: of the trial.
            keys: its certificate.
            utc_s: seconds since 1970.
        """
        self._utc_s = utc_s
        self._epoch_ids = EpochIds(digest, plate)
        self._signer = Signer(keys, utc_s, plate[-4:].encode())
        self._pseudonyms = Pseudonyms(plate, digest, keys, np.random.default_rng(1))

    @property
    def temporary_id(self) -> bytes:
        """Of its BSMs."""
        return self._signer.temporary_id

    def masked(self, reply: Reply, now: float) -> GroupMessage:
        """Return an own reply as it is sent: only who reads the plate knows the next ID in it."""
        return self._epoch_ids.to_send(reply, self._utc_s + now)

    def own_id(self, now: float) -> CarId:
        """Return the communication ID of its vehicle."""
        return self._pseudonyms.at(self._utc_s + now).car_id

    def bsm_at(
        self,
        place_m: Place,
        velocity_m_s: tuple[float, float],
        now: float,
        *,
        temporary_id: bytes | None = None,
    ) -> bytes:
        """Return a signed BSM; see `Signer.bsm_at`."""
        return self._signer.bsm_at(place_m, velocity_m_s, now, temporary_id=temporary_id)

    def signed(
        self,
        message: LccaMessage,
        now: float,
        origin: bytes = b"",
        *,
        proved_at: float | None = None,
    ) -> bytes:
        """Return a message signed, with the proof of its own ID, in a WSM.

        Args:
            message: the message.
            now: the time.
            origin: of a warning that it repeats, what the braking vehicle signed.
            proved_at: time at which the ID is the own one; now, if not given.
        """
        proof = self._pseudonyms.at(self._utc_s + (now if proved_at is None else proved_at)).proof
        return self._signer.signed(lcca.encode(message, proof, origin), psid.LCCA, now)


def _forged(
    group: AttackedGroup, insider: GroupInsider, forgery: GroupForgery, now: float
) -> Iterator[bytes]:
    """Yield what one insider sends at a time."""
    own, sent = insider.own_id(now), round(now / STEP_S)
    for leader in group.leader_ids[-1:]:
        for message in forgery(own, leader, group.newest, sent):
            yield insider.signed(message, now)


def _braking(own: CarId, leader: CarId, sequence: int, **changes: object) -> Warn:
    """A braking of the leader, as a member of its group would repeat it."""
    sequence %= 1 << 16
    warn = Warn(
        own, leader, 1, leader, sequence, 5, 1, sequence, WarnCause.DECELERATION, 8.0, 0.01, 1
    )
    return replace(warn, **changes)  # type: ignore[arg-type]


def group_ends(own: CarId, leader: CarId, newest: int, _sent: int) -> Iterator[LccaMessage]:
    """Ends of the leader's present and next brakings."""
    for sequence in range(newest, newest + NUMBERS):
        for first in (newest, newest + 1):
            first_sequence = first % (1 << 16)
            yield _braking(
                own, leader, sequence, first_sequence=first_sequence, cause=WarnCause.OVER
            )


def group_levels(own: CarId, leader: CarId, newest: int, _sent: int) -> Iterator[LccaMessage]:
    """The leader's next braking, before it brakes."""
    for sequence in range(newest + 1, newest + 1 + NUMBERS):
        yield _braking(own, leader, sequence, first_sequence=(newest + 1) % (1 << 16))


def group_brakings(own: CarId, leader: CarId, _newest: int, sent: int) -> Iterator[LccaMessage]:
    """One invented braking of the own vehicle ahead after the other."""
    number, into = divmod(sent, PERIOD_MESSAGES)
    if into < BRAKING_MESSAGES:
        yield _braking(own, leader, number, event_origin_id=own)
