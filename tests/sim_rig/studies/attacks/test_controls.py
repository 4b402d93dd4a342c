"""What each attack does once the checks that stop it are away: it proves nothing unless it bites.

A control takes only these checks out of the vehicles, for one run.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import pytest

from onboard.brake_request.brake_requester import BrakeRequester
from onboard.errors import DecodeError
from onboard.lcca import acceptance, asking, group_warnings, identification, identity_posterior
from onboard.lcca.adjacent_ids import AdjacentIds, Renamed
from onboard.lcca.followers import Followers
from onboard.lcca.membership import Membership
from onboard.messages import lcca
from onboard.messages.lcca import LccaMessage, Warn
from onboard.misbehaviour.alarm_claims import AlarmClaims
from onboard.misbehaviour.misbehaviour_detection import MisbehaviourDetector
from onboard.risk import braking_ahead, ima
from onboard.risk.stream_motion import StreamMotion
from onboard.security.security_services import SecurityServices
from onboard.vehicle.lcca_link import LccaLink
from onboard.vehicle.risk_response import RiskResponse
from sim_rig.studies.attacks.attack_counts import AttackCounts
from sim_rig.studies.attacks.attacks import (
    BRAKE_CLAIMS,
    FORGERIES,
    IMPOSTURES,
    START_UTC_S,
    AttackKind,
    run_host,
)
from sim_rig.studies.attacks.brake_claims import LEAD_EVERY_S, run_brake_claims
from sim_rig.studies.attacks.group_attacks import BRAKES_EVERY_S, QUIET_S, run_group
from sim_rig.studies.attacks.impostures import run_imposture

Check = tuple[object, str, object]
"""A part, its attribute that checks, and what is there instead."""
_warn_refusal = acceptance.warn_refusal


class Control(NamedTuple):
    """What stops an attack, and what it does else."""

    checks: tuple[Check, ...]
    bites: Callable[[AttackCounts], bool]


def _always(_self: object, *_: object) -> bool:
    return True


def _never(_self: object, *_: object) -> bool:
    return False


def _as_received(_link: LccaLink, pdu: lcca.LccaPdu, *_: object) -> tuple[LccaMessage, None]:
    """Believe a copy without what the braking vehicle signed."""
    return pdu.message, None


def _end_of_anybody(warn: Warn, *arguments: object, **named: object) -> str | None:
    refusal = _warn_refusal(warn, *arguments, **named)  # type: ignore[arg-type]
    return None if refusal == "not_followed" else refusal


def _by_others(ids: AdjacentIds) -> None:
    """Translate whoever is named by what the predecessor says of its leader."""
    names: Mapping[bytes, bytes] = {
        later: present for present, later in (ids._next_leader | ids._next).items()
    }
    ids._by_next = Renamed(names, names)


def _if_kept(link: LccaLink, message: LccaMessage) -> bytes:
    """Send a copy without what the braking vehicle signed once that is displaced."""
    origin = b""
    if isinstance(message, Warn) and not message.is_direct:
        kept = [each.opened.secured for each in link._statements.values()]
        origin = message.origin if message.origin in kept else b""
    try:
        return lcca.encode(message, link._proof, origin)
    except DecodeError:
        return lcca.encode(message)


def _by_all(response: RiskResponse, now: float) -> None:
    """Request what any alarm asks for, whoever claims it."""
    if isinstance(response.brake_requester, BrakeRequester):
        alarms = response.monitor.assessments
        response.brake_requester.assess(alarms, alarms, now)


def _as_reply(membership: Membership, car_id: bytes, now: float) -> None:
    """Take each BSM of the predecessor for a reply."""
    if car_id == membership.predecessor:
        membership._join_at = now + membership._parameters.refresh_s
        membership._answered_at = membership._sequence_at = now


def _as_join(followers: Followers, car_id: bytes, now: float) -> bool:
    """Take each BSM of a follower for a join."""
    return car_id in followers and followers.receive_join(car_id, now)


def _late(counts: AttackCounts) -> bool:
    return counts.identified_s is None or counts.identified_s > 2.0


def _missed(counts: AttackCounts) -> bool:
    return counts.true_missed > 0


def _false(counts: AttackCounts) -> bool:
    return counts.false_alarms > 0


PROOF: Check = (LccaLink, "_is_proved", _always)
ORIGIN: Check = (LccaLink, "receive_pdu", _as_received)
UNIQUE: Check = (MisbehaviourDetector, "is_id_unique", _always)
BY_TEXT: Check = (identity_posterior, "READ", 2.0)
IN_ROW: Check = (identity_posterior, "IN_ROW", 0.0)
SILENCE: Check = (identification, "KEEPS_BACK", 2.0)
ANY_MOTION: Check = (StreamMotion, "log_ratio", lambda _self, _name: 5.0)
ANY_PLACE: Check = (braking_ahead, "place_odds", lambda _name, _situation: 10.0)
ANY_SPEED: Check = (MisbehaviourDetector, "receive_bsm", lambda _self, *_: None)
ANY_TIME: Check = (
    SecurityServices,
    "_check_time",
    lambda _self, message, *_: message.generation_time64,
)
AS_REPLY: Check = (Membership, "receive_bsm", _as_reply)
AS_JOIN: Check = (Followers, "receive_bsm", _as_join)
OWN_SENSORS: Check = (RiskResponse, "_request_braking", _by_all)

CONTROLS: dict[AttackKind, Control] = {
    AttackKind.GROUP_ENDS: Control(
        (ORIGIN, (group_warnings, "warn_refusal", _end_of_anybody)), _missed
    ),
    AttackKind.GROUP_EARLY: Control((ORIGIN,), _false),
    AttackKind.HIJACK: Control((PROOF, UNIQUE), _missed),
    AttackKind.JOINS: Control((PROOF, UNIQUE), _missed),
    AttackKind.REPLIES: Control(((Membership, "refusal", lambda *_: None),), _missed),
    AttackKind.LEAVES: Control((PROOF, UNIQUE, AS_REPLY, AS_JOIN), _missed),
    AttackKind.NEXT_LEADER: Control(((AdjacentIds, "_invert", _by_others),), _missed),
    AttackKind.STATEMENTS: Control(((LccaLink, "encode", _if_kept),), _missed),
    AttackKind.TESTS: Control(
        ((AlarmClaims, "_admit_test", _always),), lambda counts: counts.false_alarm_s > 30.0
    ),
    AttackKind.MIMICRY_BADLY_READ: Control((BY_TEXT, IN_ROW), _late),
    AttackKind.ANSWERS: Control((BY_TEXT, IN_ROW), _late),
    AttackKind.SILENT_MIMICRY: Control((SILENCE, IN_ROW), _late),
    AttackKind.ORACLE: Control(
        ((asking.AnswerLimit, "take", _always),), lambda counts: counts.answers_per_s > 20.0
    ),
    AttackKind.SAME_ID: Control(
        ((MisbehaviourDetector, "remote_id", lambda _self, _sender, name: name),), _missed
    ),
    AttackKind.UNPLACED_BRAKING: Control((ANY_MOTION,), _false),
    AttackKind.REPLAYED_BRAKING: Control((ANY_TIME,), _false),
    AttackKind.OTHER_CARRIAGEWAY: Control((ANY_PLACE,), _false),
    AttackKind.BRIDGE: Control((ANY_PLACE,), _false),
    AttackKind.TOWED: Control((ANY_PLACE, ANY_SPEED), _false),
    AttackKind.BRAKE_CAMERA: Control((OWN_SENSORS,), _false),
    AttackKind.BRAKE_BOTH: Control((OWN_SENSORS,), _false),
    AttackKind.BRAKE_DETECTOR: Control((OWN_SENSORS,), _false),
    AttackKind.BRAKE_FOOTER: Control((OWN_SENSORS,), _false),
}
"""Of attacks that do the same with `check_braking` and without."""


def _run(attack: AttackKind, *, checks: bool = True) -> AttackCounts:
    if attack in FORGERIES:
        forgery, seconds = FORGERIES[attack], QUIET_S + BRAKES_EVERY_S
        return run_group(forgery, (1,), START_UTC_S, seconds, 1, checks=checks)
    if attack in IMPOSTURES:
        kind, seconds = IMPOSTURES[attack], QUIET_S + BRAKES_EVERY_S
        return run_imposture(kind, (1,), START_UTC_S, seconds, 1, checks=checks)
    if attack in BRAKE_CLAIMS:
        claims, seconds = BRAKE_CLAIMS[attack], 4.0 * LEAD_EVERY_S
        return run_brake_claims(claims, (1,), START_UTC_S, seconds, insiders=3, checks=checks)
    return run_host(attack, (1,), 20.0, 1, checks=checks)


@pytest.mark.long
@pytest.mark.parametrize("attack", CONTROLS)
def test_an_attack_bites_without_the_check_that_stops_it(
    monkeypatch: pytest.MonkeyPatch, attack: AttackKind
) -> None:
    checks, bites = CONTROLS[attack]
    for part, name, instead in checks:
        monkeypatch.setattr(part, name, instead)

    assert bites(_run(attack))


@pytest.mark.long
@pytest.mark.parametrize("attack", CONTROLS)
def test_the_same_attack_does_not_bite_with_it(attack: AttackKind) -> None:
    assert not CONTROLS[attack].bites(_run(attack))


@pytest.mark.long
def test_where_no_id_is_proved_leaves_dispute_the_followers_ids_and_nobody_misses_a_warning(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The followers' BSMs do not count then, but their joins do."""
    monkeypatch.setattr(*PROOF)

    assert _run(AttackKind.LEAVES).true_missed == 0


@pytest.mark.long
def test_where_no_id_is_proved_who_answers_for_the_leader_hides_it_and_no_warning(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Two answer for one ID; what either sends in its name ends no warning."""
    monkeypatch.setattr(*PROOF)

    counts = _run(AttackKind.HIJACK)

    assert _late(counts)
    assert counts.true_missed == 0


def test_a_red_light_of_an_insider_who_may_send_it_silences_a_true_alarm() -> None:
    counts = _run(AttackKind.SIGNALS, checks=False)

    assert (counts.true_alarms, counts.true_missed) == (1, 1)


@pytest.mark.long
def test_a_red_light_long_before_where_a_vehicle_stops_alarms_nobody(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert _run(AttackKind.EARLY_SIGNALS, checks=False).false_alarms == 0

    monkeypatch.setattr(ima, "LARGEST_CROSSING_M", 1e9)
    assert _run(AttackKind.EARLY_SIGNALS, checks=False).false_alarms > 0
