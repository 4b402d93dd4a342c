"""What insiders claim to one host vehicle, and what it makes of that beside true vehicles."""

import math
from collections.abc import Callable, Iterator
from enum import StrEnum
from functools import partial

import numpy as np

from onboard.its_g5.permissions import denm_ssp
from onboard.observations import VehicleDetection
from onboard.risk.adjacent_lane import LANE_M
from onboard.risk.alarm import Alarm, Level
from onboard.security.p256 import key_from
from onboard.tools.test_ca.authority import SSPS_OF_CARS, make_trial
from onboard.wave_udp import psid
from sim_rig.studies.attacks import brakings_ahead
from sim_rig.studies.attacks.attack_counts import AttackCounts
from sim_rig.studies.attacks.attack_world import (
    PSEUDONYMS,
    SPEED_M_S,
    STEP_S,
    AttackedHost,
    Counted,
    Place,
    Signer,
    claimed_id,
    pseudonyms_of,
    refused,
)
from sim_rig.studies.attacks.brake_claims import (
    FACE_TO_CENTRE_M,
    ClaimedBraking,
    OwnSensors,
    by_bsm,
    by_footer,
)
from sim_rig.studies.attacks.forged_messages import (
    BadlyRead,
    ForgedAnswers,
    ForgedJoins,
    ForgedReplies,
    ForgedTests,
    Mimicry,
    MimicryUnread,
    NextLeader,
    OtherEpochs,
    SilentMimicry,
    StatementFlood,
    Unread,
)
from sim_rig.studies.attacks.forged_signals import early_red_for, red_for
from sim_rig.studies.attacks.group_attacks import (
    group_brakings,
    group_ends,
    group_levels,
)
from sim_rig.studies.attacks.impostures import Framing, Hijack, Imposture, Oracle
from sim_rig.studies.attacks.kept_memberships import ForgedLeaves

START_UTC_S = 1_790_000_000.0
PASS_S = 6.0
"""Time in which an invented vehicle comes to the place where it would hit the host."""
TRUE_EVERY_S = 20.0
"""Between true vehicles."""
STOPPING_M_S2, STANDS_M = 2.5, 8.5
"""How a vehicle stops that yields to the host, and how far from its path."""
SEEN_S = 1.2
"""Before the conflict, the host's detector sees a true vehicle: houses stand 12 m from the road."""


class AttackKind(StrEnum):
    """What an insider claims."""

    BSM = "crossing vehicle, by BSM"
    FOOTER = "crossing vehicle, by footer"
    SDSM = "crossing vehicle, by SDSM"
    ETERNAL = "vehicle on collision course for ever"
    FLICKERING = "vehicle in and out of the way"
    FOUR = "four crossing vehicles at once"
    BRAKING = "vehicle ahead that brakes hard"
    BLIND_SPOT = "vehicle in the blind spot of a driver who signals"
    FAR_BRAKING = "vehicle far ahead that brakes hard"
    UNPLACED_BRAKING = "vehicle that brakes hard, without a place"
    REPLAYED_BRAKING = "vehicle far ahead that braked hard a minute ago"
    OTHER_CARRIAGEWAY = "none, brakings on the other carriageway"
    BRIDGE = "none, brakings on a bridge ahead"
    TOWED = "none, brakings of a towed vehicle ahead"
    TURNS = "crossing vehicles, under 20 pseudonyms by turns"
    PSEUDONYMS = "crossing vehicles, three under each of 20 pseudonyms"
    SAME_ID = "IDs of true vehicles"
    SIGNALS = "red lights for true vehicles, by MAP and SPAT"
    EARLY_SIGNALS = "red lights long before where vehicles stop, by MAP and SPAT"
    GROUP_ENDS = "ends of the leader's brakings"
    GROUP_EARLY = "brakings of the leader before it brakes"
    GROUP_BRAKINGS = "brakings of invented vehicles in the group"
    HIJACK = "answers and warnings in the leader's name"
    FRAMING = "true brakings elsewhere, and old ones, passed on"
    JOINS = "acknowledgements of what others have yet to receive"
    REPLIES = "replies to the joins of others"
    ANSWERS = "BSMs from there under the leader's temporary ID, plates badly read"
    NEXT_LEADER = "a leader whose next ID is that of a member"
    OTHER_EPOCHS = "brakings under IDs of other epochs"
    STATEMENTS = "256 statements of brakings at each of the leader's"
    NONE_IN_GROUP = "none"
    NONE_BADLY_READ = "none, plates badly read"
    NONE_UNREAD = "none, plates not read"
    TESTS = "tests of the brake button"
    MIMICRY_BADLY_READ = "BSMs from the leader's place, plates badly read"
    SILENT_MIMICRY = "BSMs from there and no answer, plates badly read"
    MIMICRY_UNREAD = "BSMs from the leader's place, plates not read"
    ORACLE = "inquiries under changing IDs"
    BRAKE_CAMERA = "brake requests by BSMs from the place of the camera's lead"
    BRAKE_BOTH = "brake requests by BSMs from there, with a detector too"
    BRAKE_DETECTOR = "brake requests by BSMs from the place of what a detector sees"
    BRAKE_FOOTER = "brake requests by footers about what a detector sees"
    CERTIFICATES = "certificates that are made up, by outsiders"
    CAM = "crossing vehicle, by CAM"
    CPM = "crossing vehicle, by CPM"
    DENM = "vehicle ahead that brakes hard, by DENM"
    UNPERMITTED_DENM = "vehicle ahead that brakes hard, by DENM that is not permitted"
    VAM = "person ahead, by VAM"
    PSM = "person ahead, by PSM"
    SPATEM = "red lights for true vehicles, by MAPEM and SPATEM"
    LEAVES = "leaves in the followers' names"


Claims = Callable[[AttackedHost, Signer, int, float], Iterator[bytes]]
"""Messages of one attack: of a host, a signer, the insider's number, and the time."""


def run_host(
    attack: AttackKind, seed: tuple[int, ...], seconds: float, insiders: int, *, checks: bool
) -> AttackCounts:
    """Let the host drive among insiders and true vehicles.

    Args:
        attack: what the insiders claim.
        seed: of keys and draws.
        seconds: duration of the attack.
        insiders: their number.
        checks: whether the host checks claims; without, insiders may send as road-side units.
    """
    encounters = int(seconds // TRUE_EVERY_S)
    names = [f"insider{n}" for n in range(insiders)] + [f"true{n}" for n in range(encounters)]
    new_key = key_from(np.random.default_rng(seed))
    several = PSEUDONYMS if attack in VEHICLES_UNDER_EACH else 1
    services = psid.OF_VEHICLES if checks else psid.OF_VEHICLES | psid.OF_ROAD_SIDE_UNITS
    by_its_g5 = attack in BY_ITS_G5
    if by_its_g5:
        services = psid.OF_ITS_VEHICLES if checks else psid.OF_ITS_VEHICLES | psid.SIGNALS
    if attack in (AttackKind.VAM, AttackKind.PSM):
        services |= {psid.VAM if by_its_g5 else psid.PSM}
    unpermitted = checks and attack is AttackKind.UNPERMITTED_DENM
    trial = make_trial(
        ["host", *names],
        services,
        START_UTC_S,
        new_key,
        pseudonyms=several,
        ssps={**SSPS_OF_CARS, **({psid.DENM: denm_ssp(causes=())} if unpermitted else {})},
    )
    radio = ITS_G5 if by_its_g5 else None
    host = AttackedHost(trial["host"], START_UTC_S, checks=checks, radio=radio)
    host.signals = "left" if attack is AttackKind.BLIND_SPOT else None
    pseudonyms = partial(pseudonyms_of, utc_s=START_UTC_S, its_g5=by_its_g5)
    senders = [
        Counted(partial(_by_turns, attack, host, pseudonyms(trial[name], n), n))
        for n, name in enumerate(names[:insiders])
    ]
    true = [
        Signer(trial[name], START_UTC_S, _true_id(n), its_g5=by_its_g5)
        for n, name in enumerate(names[insiders:])
    ]
    host.drive(seconds, *senders, partial(_true_vehicles, host, true))
    true_ids = {each.temporary_id.hex() for each in true}
    warned = _notices_s(host)
    sent = sum(each.sent for each in senders)
    return AttackCounts(
        false_alarms=sum(claimed_id(alarm) not in true_ids for alarm in host.raised()),
        false_alarm_s=round(host.alarmed_s(true_ids), 1),
        ignored=len(host.ignored()),
        true_alarms=encounters,
        true_missed=len(true_ids - warned.keys()),
        least_notice_s=min(
            (round(warned[each], 1) for each in true_ids & warned.keys()), default=None
        ),
        sent=sent,
        received=sent - refused(host.events),
    )


def _notices_s(host: AttackedHost) -> dict[str, float]:
    """Return how long before the end of its period each vehicle was first warned of.

    The period ends at the conflict: an alarm of it, or after it, is none.
    """
    notices_s: dict[str, float] = {}
    for event in host.events:
        left_s = TRUE_EVERY_S - event.stamp_s % TRUE_EVERY_S
        if isinstance(event, Alarm) and event.level is Level.WARNING and left_s <= PASS_S:
            notices_s.setdefault(claimed_id(event), left_s)
    return notices_s


def _by_turns(
    attack: AttackKind, host: AttackedHost, signers: list[Signer], insider: int, now: float
) -> Iterator[bytes]:
    """Send what an attack says, under the pseudonym whose turn it is."""
    passes = int((now + 1.1 * insider) // PASS_S)
    number = passes // VEHICLES_UNDER_EACH.get(attack, 1)
    yield from CLAIMS.get(attack, crossing_bsm)(host, signers[number % len(signers)], insider, now)


def _true_vehicles(host: AttackedHost, true: list[Signer], now: float) -> Iterator[bytes]:
    """Vehicles from the left, each in the last `PASS_S` of its period; the host sees it late."""
    number, into_s = divmod(now, TRUE_EVERY_S)
    left_s = TRUE_EVERY_S - into_s
    host.seen = _seen(now + STEP_S, left_s - STEP_S) if number < len(true) else ()
    if left_s <= PASS_S and number < len(true):
        ahead_m = SPEED_M_S * left_s
        yield true[int(number)].bsm_at((-ahead_m, host.north_m + ahead_m), (SPEED_M_S, 0.0), now)


def _seen(now: float, left_s: float) -> tuple[VehicleDetection, ...]:
    """Return what the detector measures of a true vehicle `left_s` before the conflict."""
    if not 0.0 < left_s <= SEEN_S:
        return ()
    range_m = math.sqrt(2.0) * SPEED_M_S * left_s - FACE_TO_CENTRE_M
    return (VehicleDetection(now, 1, max(range_m, 0.1), 0.2, -math.pi / 4.0, 0.01),)


def _crossing(host: AttackedHost, insider: int, now: float) -> tuple[int, Place]:
    """Return number and place of a vehicle from the right that would hit the host."""
    passes, into_s = divmod(now + 1.1 * insider, PASS_S)
    ahead_m = SPEED_M_S * (PASS_S - into_s)
    return int(passes), (ahead_m, host.north_m + ahead_m)


def _true_id(number: int) -> bytes:
    return b"T" + number.to_bytes(3)


def _id(insider: int, number: int) -> bytes:
    return bytes((0xE0 + insider,)) + number.to_bytes(3, "big")


def _beside(host: AttackedHost, signer: Signer, footer: bytes, now: float) -> bytes:
    """The insider's own BSM, from a place where it is in nobody's way."""
    place_m = 40.0, host.north_m - 60.0
    return signer.bsm_at(place_m, (0.0, SPEED_M_S), now, footer=footer)


def crossing_bsm(host: AttackedHost, signer: Signer, insider: int, now: float) -> Iterator[bytes]:
    """Send the BSMs of one invented vehicle after the other."""
    number, place_m = _crossing(host, insider, now)
    yield signer.bsm_at(place_m, (-SPEED_M_S, 0.0), now, temporary_id=_id(insider, number))


def crossing_footer(
    host: AttackedHost, signer: Signer, insider: int, now: float
) -> Iterator[bytes]:
    """Report one invented vehicle after the other."""
    number, place_m = _crossing(host, insider, now)
    yield _beside(host, signer, signer.footer(number % 200, place_m, now), now)


def crossing_sdsm(host: AttackedHost, signer: Signer, insider: int, now: float) -> Iterator[bytes]:
    """Report one invented vehicle after the other in messages of their own."""
    number, place_m = _crossing(host, insider, now)
    yield signer.bsm_at((40.0, host.north_m - 60.0), (0.0, SPEED_M_S), now)
    yield signer.sdsm_at(number % 200, place_m, now)


def crossing_cpm(host: AttackedHost, signer: Signer, insider: int, now: float) -> Iterator[bytes]:
    """The same in CPMs, every other vehicle with what MVS adds."""
    number, place_m = _crossing(host, insider, now)
    yield signer.bsm_at((40.0, host.north_m - 60.0), (0.0, SPEED_M_S), now)
    yield signer.cpm_at(number % 200, place_m, now, evidence=number % 2 == 0)


def red_lights(host: AttackedHost, signer: Signer, _insider: int, now: float) -> Iterator[bytes]:
    """Each true vehicle has red where it crosses the host's path."""
    left_s = TRUE_EVERY_S - now % TRUE_EVERY_S
    yield from red_for((0.0, host.north_m + SPEED_M_S * left_s), host, signer, now)


def early_red_lights(
    host: AttackedHost, signer: Signer, insider: int, now: float
) -> Iterator[bytes]:
    """A vehicle from the left stops for the host; red lights long before say that it will not."""
    number, into_s = divmod(now + 1.1 * insider, PASS_S)
    left_m = SPEED_M_S * (PASS_S - into_s)
    stopping_m = SPEED_M_S**2 / (2.0 * STOPPING_M_S2)
    begins_m = stopping_m + STANDS_M
    braked_s = max(begins_m - left_m, 0.0) / SPEED_M_S
    braked_s = min(braked_s, SPEED_M_S / STOPPING_M_S2)
    way_m = SPEED_M_S * braked_s - STOPPING_M_S2 * braked_s**2 / 2.0
    place_m = (-(max(left_m, begins_m) - way_m), host.north_m + left_m)
    yield signer.bsm_at(
        place_m,
        (SPEED_M_S - STOPPING_M_S2 * braked_s, 0.0),
        now,
        temporary_id=_id(insider, int(number)),
        acceleration_m_s2=-STOPPING_M_S2 if braked_s > 0.0 else 0.0,
    )
    yield from early_red_for((0.0, host.north_m + left_m), host, signer, now)


def eternal(host: AttackedHost, signer: Signer, insider: int, now: float) -> Iterator[bytes]:
    """Always on collision course, and always two seconds away."""
    ahead_m = 2.0 * SPEED_M_S + 3.0 * insider
    yield signer.bsm_at((ahead_m, host.north_m + ahead_m), (-SPEED_M_S, 0.0), now)


def flickering(host: AttackedHost, signer: Signer, insider: int, now: float) -> Iterator[bytes]:
    """In the way, and two seconds later out of it, each time under another ID."""
    phase, into_s = divmod(now + insider, 4.0)
    aside_m = 0.0 if into_s < 2.0 else 40.0
    number = 2 * int(phase) + (into_s >= 2.0)
    place_m = (2.0 * SPEED_M_S + aside_m, host.north_m + 2.0 * SPEED_M_S)
    yield signer.bsm_at(place_m, (-SPEED_M_S, 0.0), now, temporary_id=_id(insider, number))


def four_at_once(host: AttackedHost, signer: Signer, insider: int, now: float) -> Iterator[bytes]:
    """Four invented vehicles side by side."""
    number, (east_m, north_m) = _crossing(host, insider, now)
    for lane in range(4):
        name = _id(insider, 4 * number + lane)
        place_m = (east_m + 0.2 * lane, north_m)
        yield signer.bsm_at(place_m, (-SPEED_M_S, 0.0), now, temporary_id=name)


def braking_ahead(host: AttackedHost, signer: Signer, insider: int, now: float) -> Iterator[bytes]:
    """One vehicle after the other, 30 m ahead, brakes at 6 m/s^2, as its speeds and places show."""
    number, into_s = divmod(now + 1.1 * insider, PASS_S)
    brakes_s = max(into_s - PASS_S / 2.0, 0.0)
    place_m = (0.0, host.north_m + 30.0 - 3.0 * brakes_s**2)
    velocity_m_s = (0.0, max(SPEED_M_S - 6.0 * brakes_s, 0.0))
    name = _id(insider, int(number))
    yield signer.bsm_at(place_m, velocity_m_s, now, temporary_id=name, brakes=brakes_s > 0.0)


def in_the_blind_spot(
    host: AttackedHost, signer: Signer, insider: int, now: float
) -> Iterator[bytes]:
    """One vehicle after the other in the lane to the left, as fast as the host, and just behind."""
    number, _ = divmod(now + 1.1 * insider, PASS_S)
    place_m = (-LANE_M, host.north_m - 3.0)
    name = _id(insider, int(number))
    yield signer.bsm_at(place_m, (0.0, SPEED_M_S), now, temporary_id=name)


def braking_by_denm(
    host: AttackedHost, signer: Signer, insider: int, now: float
) -> Iterator[bytes]:
    """The same by CAM and DENM."""
    yield from braking_ahead(host, signer, insider, now)
    yield from signer.events


def braking_by_denm_alone(
    host: AttackedHost, signer: Signer, insider: int, now: float
) -> Iterator[bytes]:
    """The same by DENM, without CAMs, which would show falling speeds."""
    for _ in braking_ahead(host, signer, insider, now):
        yield from signer.events


def person_ahead(host: AttackedHost, signer: Signer, insider: int, now: float) -> Iterator[bytes]:
    """One person after the other stands where the host drives."""
    number, into_s = divmod(now + 1.1 * insider, PASS_S)
    place_m = 0.0, host.north_m + SPEED_M_S * (PASS_S - into_s)
    yield signer.person_at(place_m, now, _id(insider, int(number)))


def same_id(host: AttackedHost, signer: Signer, insider: int, now: float) -> Iterator[bytes]:
    """A vehicle that stands aside, under the ID of the next true one, before that is heard."""
    number = insider + int(now // TRUE_EVERY_S)
    place_m = 40.0, host.north_m + 40.0 + 3.0 * insider
    yield signer.bsm_at(place_m, (0.0, 0.0), now, temporary_id=_true_id(number))


CLAIMS: dict[AttackKind, Claims] = {
    AttackKind.BSM: crossing_bsm,
    AttackKind.FOOTER: crossing_footer,
    AttackKind.ETERNAL: eternal,
    AttackKind.FLICKERING: flickering,
    AttackKind.FOUR: four_at_once,
    AttackKind.BRAKING: braking_ahead,
    AttackKind.FAR_BRAKING: brakings_ahead.far_ahead,
    AttackKind.UNPLACED_BRAKING: brakings_ahead.without_a_place,
    AttackKind.REPLAYED_BRAKING: brakings_ahead.replayed,
    AttackKind.OTHER_CARRIAGEWAY: brakings_ahead.other_carriageway,
    AttackKind.BRIDGE: brakings_ahead.on_a_bridge,
    AttackKind.TOWED: brakings_ahead.towed,
    AttackKind.SAME_ID: same_id,
    AttackKind.BLIND_SPOT: in_the_blind_spot,
    AttackKind.SDSM: crossing_sdsm,
    AttackKind.SIGNALS: red_lights,
    AttackKind.CAM: crossing_bsm,
    AttackKind.CPM: crossing_cpm,
    AttackKind.DENM: braking_by_denm,
    AttackKind.UNPERMITTED_DENM: braking_by_denm_alone,
    AttackKind.VAM: person_ahead,
    AttackKind.PSM: person_ahead,
    AttackKind.EARLY_SIGNALS: early_red_lights,
    AttackKind.SPATEM: red_lights,
}
"""The messages of each attack by BSMs."""
BY_ITS_G5 = frozenset({
    AttackKind.CAM, AttackKind.CPM, AttackKind.DENM, AttackKind.UNPERMITTED_DENM, AttackKind.VAM,
    AttackKind.SPATEM,
})  # fmt: skip
"""Attacks in which all radios have ITS-G5."""
ITS_G5 = {"endpoint": "raw", "interface": "air", "profile": "its-g5"}
"""Radio settings of the host then."""
VEHICLES_UNDER_EACH = {AttackKind.TURNS: 1, AttackKind.PSEUDONYMS: 3}
"""How many crossing vehicles each pseudonym claims, one after the other."""
FORGERIES = {
    AttackKind.GROUP_ENDS: group_ends,
    AttackKind.GROUP_EARLY: group_levels,
    AttackKind.GROUP_BRAKINGS: group_brakings,
}
"""What is forged in a warning group."""
IMPOSTURES: dict[AttackKind, type[Imposture]] = {
    AttackKind.HIJACK: Hijack,
    AttackKind.FRAMING: Framing,
    AttackKind.JOINS: ForgedJoins,
    AttackKind.REPLIES: ForgedReplies,
    AttackKind.ANSWERS: ForgedAnswers,
    AttackKind.NEXT_LEADER: NextLeader,
    AttackKind.LEAVES: ForgedLeaves,
    AttackKind.OTHER_EPOCHS: OtherEpochs,
    AttackKind.STATEMENTS: StatementFlood,
    AttackKind.TESTS: ForgedTests,
    AttackKind.NONE_IN_GROUP: Imposture,
    AttackKind.NONE_BADLY_READ: BadlyRead,
    AttackKind.NONE_UNREAD: Unread,
    AttackKind.MIMICRY_BADLY_READ: Mimicry,
    AttackKind.SILENT_MIMICRY: SilentMimicry,
    AttackKind.MIMICRY_UNREAD: MimicryUnread,
    AttackKind.ORACLE: Oracle,
}
"""Who speaks for others in a warning group, or asks who is near."""
BRAKE_CLAIMS = {
    AttackKind.BRAKE_CAMERA: ClaimedBraking(OwnSensors.CAMERA, by_bsm),
    AttackKind.BRAKE_BOTH: ClaimedBraking(OwnSensors.BOTH, by_bsm),
    AttackKind.BRAKE_DETECTOR: ClaimedBraking(OwnSensors.DETECTOR, by_bsm),
    AttackKind.BRAKE_FOOTER: ClaimedBraking(OwnSensors.DETECTOR, by_footer),
}
"""What measures the lead vehicle, and what is claimed about it."""
