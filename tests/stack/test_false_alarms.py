"""One insider raises three false alarms at most, and those of others still come."""

import math
from collections.abc import Callable, Iterator

import pytest

from onboard.observations import VehicleDetection
from onboard.security.signer_credibility import CLAIM_S, MOST_ALARMS
from tests.security.trial import CAROL, DAVE
from tests.stack.insider import SPEED_M_S, Insider, Sent, Victim

ATTACK_S = 45.0
PASS_S = 6.0
"""Time in which an invented vehicle comes to the crossing."""
FACE_TO_CENTRE_M = 2.2

Attack = Callable[[Victim, Insider, float], Iterator[Sent]]


def crossing(victim: Victim, now: float) -> tuple[int, tuple[float, float], float]:
    """Number, place and remaining time of a vehicle from the right that would hit the victim."""
    left_s = PASS_S - now % PASS_S
    ahead_m = SPEED_M_S * left_s
    return int(now // PASS_S), (ahead_m, victim.north_m + ahead_m), left_s


def invented_bsm(victim: Victim, insider: Insider, now: float) -> Iterator[Sent]:
    number, place_m, _ = crossing(victim, now)
    name = number.to_bytes(4, "big")
    yield insider.bsm_at(place_m, (-SPEED_M_S, 0.0), now, name=name)


def invented_measurements(victim: Victim, insider: Insider, now: float) -> Iterator[Sent]:
    number, place_m, _ = crossing(victim, now)
    data = insider.footer(number % 200, place_m, now)
    place_m = (4.0, victim.north_m + 60.0)
    yield insider.bsm_at(place_m, (0.0, SPEED_M_S), now, footer=data)


def eternal(victim: Victim, insider: Insider, now: float) -> Iterator[Sent]:
    """Always on collision course, and always two seconds away."""
    ahead_m = 2.0 * SPEED_M_S
    yield insider.bsm_at((ahead_m, victim.north_m + ahead_m), (-SPEED_M_S, 0.0), now)


def flickering(victim: Victim, insider: Insider, now: float) -> Iterator[Sent]:
    """In the way, and two seconds later out of it."""
    aside_m = 0.0 if now % 4.0 < 2.0 else 40.0
    place_m = (2.0 * SPEED_M_S + aside_m, victim.north_m + 2.0 * SPEED_M_S)
    yield insider.bsm_at(place_m, (-SPEED_M_S, 0.0), now, name=(int(now // 2)).to_bytes(4, "big"))


def four_at_once(victim: Victim, insider: Insider, now: float) -> Iterator[Sent]:
    number, (east_m, north_m), _ = crossing(victim, now)
    for i in range(4):
        name = bytes([i]) + number.to_bytes(3, "big")
        yield insider.bsm_at((east_m + 0.2 * i, north_m), (-SPEED_M_S, 0.0), now, name=name)


def braking_ahead(victim: Victim, insider: Insider, now: float) -> Iterator[Sent]:
    phase_s = now % PASS_S
    name = int(now // PASS_S).to_bytes(4, "big")
    slower_m_s = 6.0 * max(phase_s - 3.0, 0.0)
    ahead_m = 30.0 - 3.0 * max(phase_s - 3.0, 0.0) ** 2
    speed_m_s = max(SPEED_M_S - slower_m_s, 0.0)
    place_m = (0.0, victim.north_m + ahead_m)
    yield insider.bsm_at(place_m, (0.0, speed_m_s), now, name=name, braking=phase_s > 3.0)


ATTACKS: tuple[Attack, ...] = (
    invented_bsm, invented_measurements, eternal, flickering, four_at_once, braking_ahead,
)  # fmt: skip


def attacked(attack: Attack, **host: bool) -> Victim:
    victim, insider = Victim(**host), Insider(CAROL)
    victim.drive(ATTACK_S, lambda now: attack(victim, insider, now))
    return victim


@pytest.mark.parametrize("attack", ATTACKS)
def test_one_insider_raises_three_false_alarms_at_most(attack: Attack) -> None:
    victim = attacked(attack)
    assert 1 <= len(victim.raised()) <= MOST_ALARMS
    assert victim.alarmed_s() <= MOST_ALARMS * (CLAIM_S + 1.5)
    assert len(victim.ignored()) == 1


@pytest.mark.parametrize("attack", ATTACKS)
def test_without_checks_these_attacks_raise_more(attack: Attack) -> None:
    victim = attacked(attack, checks=False)
    assert len(victim.raised()) > MOST_ALARMS or victim.alarmed_s() > 0.9 * ATTACK_S


def test_a_host_without_a_sensor_that_looks_ahead_has_the_same_bound() -> None:
    assert len(attacked(invented_bsm, detector=False).raised()) == MOST_ALARMS


def test_a_true_vehicle_alarms_while_an_insider_is_ignored() -> None:
    victim, insider, honest = Victim(), Insider(CAROL), Insider(DAVE, b"true")
    victim.drive(ATTACK_S, lambda now: invented_bsm(victim, insider, now))
    assert victim.ignored()
    began_at = victim.now
    crossing_m = victim.north_m + PASS_S * SPEED_M_S

    def approach(now: float) -> Iterator[Sent]:
        east_m = SPEED_M_S * (PASS_S - (now - began_at))
        yield honest.bsm_at((east_m, crossing_m), (-SPEED_M_S, 0.0), now)
        yield from invented_bsm(victim, insider, now)

    victim.drive(PASS_S, approach)
    (alarm,) = victim.raised(began_at)
    assert alarm.vehicle == b"true".hex()


def test_a_vehicle_that_the_detector_sees_alarms_every_time() -> None:
    """The same certificate each time: what own sensors confirm is not charged."""
    victim, honest = Victim(), Insider(DAVE)
    victim.drive(1.0)
    for encounter in range(1, 11):
        began_at = victim.now

        def approach(now: float, number: int = encounter) -> Iterator[Sent]:
            _, place_m, left_s = crossing(victim, now)
            if left_s < 0.3:
                return
            range_m = math.hypot(place_m[0], place_m[1] - victim.north_m) - FACE_TO_CENTRE_M
            is_near = range_m < 60.0
            seen = VehicleDetection(now, number, range_m, 0.3, math.pi / 4, 0.005)
            victim.seen = (seen,) if is_near else ()
            yield honest.bsm_at(place_m, (-SPEED_M_S, 0.0), now, name=number.to_bytes(4))

        victim.drive(PASS_S, approach)
        assert victim.raised(began_at), f"encounter {encounter}"
    assert not victim.ignored()
