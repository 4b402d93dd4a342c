"""One insider raises three false alarms at most, and those of others still come."""

import math
from collections.abc import Iterator
from functools import partial

import pytest

from onboard.misbehaviour.signer_credibility import CLAIM_S, MOST_ALARMS
from onboard.observations import VehicleDetection
from sim_rig.studies.attacks.attack_world import SPEED_M_S, AttackedHost, Signer
from sim_rig.studies.attacks.attacks import CLAIMS, PASS_S, AttackKind
from tests.security.trial import ALICE, CAROL, DAVE, UTC_S

ATTACK_S = 45.0
FACE_TO_CENTRE_M = 2.2
NOWHERE = {
    AttackKind.UNPLACED_BRAKING,
    AttackKind.REPLAYED_BRAKING,
    AttackKind.OTHER_CARRIAGEWAY,
    AttackKind.BRIDGE,
    AttackKind.TOWED,
}
"""Brakings that are not ahead in the lane: they raise no alarm, whatever is checked of claims."""
_OTHERS = {
    AttackKind.SAME_ID, AttackKind.SDSM, AttackKind.SIGNALS, AttackKind.EARLY_SIGNALS,
    AttackKind.SPATEM, AttackKind.CPM, AttackKind.VAM, AttackKind.PSM, AttackKind.UNPERMITTED_DENM,
}  # fmt: skip
INVENTIONS = sorted(set(CLAIMS) - NOWHERE - _OTHERS)
"""What a certificate for BSMs permits."""


def attacked(attack: AttackKind, *, checks: bool = True, detector: bool = True) -> AttackedHost:
    host = AttackedHost(ALICE, UTC_S, checks=checks, detector=detector)
    host.signals = "left" if attack is AttackKind.BLIND_SPOT else None
    host.drive(ATTACK_S, partial(CLAIMS[attack], host, Signer(CAROL, UTC_S), 0))
    return host


@pytest.mark.long
@pytest.mark.parametrize("attack", INVENTIONS)
def test_one_insider_raises_three_false_alarms_at_most(attack: AttackKind) -> None:
    host = attacked(attack)
    assert 1 <= len(host.raised()) <= MOST_ALARMS
    assert host.alarmed_s() <= MOST_ALARMS * (CLAIM_S + 1.5)
    assert len(host.ignored()) == 1


@pytest.mark.long
@pytest.mark.parametrize("attack", INVENTIONS)
def test_without_checks_these_attacks_raise_more(attack: AttackKind) -> None:
    host = attacked(attack, checks=False)
    assert len(host.raised()) > MOST_ALARMS or host.alarmed_s() > 0.9 * ATTACK_S


@pytest.mark.long
def test_a_host_without_a_sensor_that_looks_ahead_has_the_same_bound() -> None:
    assert len(attacked(AttackKind.BSM, detector=False).raised()) == MOST_ALARMS


@pytest.mark.long
def test_a_true_vehicle_alarms_while_an_insider_is_ignored() -> None:
    host = attacked(AttackKind.BSM)
    assert host.ignored()
    honest, began_at = Signer(DAVE, UTC_S, b"true"), host.now
    crossing_m = host.north_m + PASS_S * SPEED_M_S

    def approach(now: float) -> Iterator[bytes]:
        east_m = SPEED_M_S * (PASS_S - (now - began_at))
        yield honest.bsm_at((east_m, crossing_m), (-SPEED_M_S, 0.0), now)

    host.drive(PASS_S, approach, partial(CLAIMS[AttackKind.BSM], host, Signer(CAROL, UTC_S), 0))
    (alarm,) = host.raised(began_at)
    assert alarm.vehicle == b"true".hex()


@pytest.mark.long
def test_a_vehicle_that_the_detector_sees_alarms_every_time() -> None:
    """The same certificate each time: what own sensors confirm is not charged."""
    host, honest = AttackedHost(ALICE, UTC_S), Signer(DAVE, UTC_S)
    host.drive(1.0)
    for encounter in range(1, 11):
        began_at = host.now

        def approach(
            now: float, began_at: float = began_at, number: int = encounter
        ) -> list[bytes]:
            left_m = SPEED_M_S * (PASS_S - (now - began_at))
            range_m = math.sqrt(2.0) * left_m - FACE_TO_CENTRE_M
            seen = VehicleDetection(now, number, max(range_m, 0.5), 0.3, math.pi / 4, 0.005)
            host.seen = (seen,) if range_m < 60.0 else ()
            place_m = (left_m, host.north_m + left_m)
            name = number.to_bytes(4)
            return [honest.bsm_at(place_m, (-SPEED_M_S, 0.0), now, temporary_id=name)]

        host.drive(PASS_S, approach)
        host.seen = ()
        host.drive(2.0)
        assert host.raised(began_at), f"encounter {encounter}"
    assert not host.ignored()


def test_the_checks_leave_what_is_perceived_of_honest_vehicles_equal_to_the_bit() -> None:
    perceived = []
    for checks in (True, False):
        host, honest = AttackedHost(ALICE, UTC_S, checks=checks), Signer(DAVE, UTC_S, b"true")

        def drive_beside(now: float, honest: Signer = honest) -> list[bytes]:
            return [honest.bsm_at((4.0, SPEED_M_S * now + 20.0), (0.0, SPEED_M_S), now)]

        host.drive(5.0, drive_beside)
        perceived.append(host.stack.surroundings)
    assert perceived[0][1]
    assert perceived[0] == perceived[1]
