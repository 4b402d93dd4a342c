"""Warnings in a group by one insider, and by a vehicle that really brakes, many times."""

import pytest

from onboard.messages import lcca
from onboard.misbehaviour.signer_credibility import MOST_ALARMS
from onboard.observations import Discarded, HardBrake
from onboard.security.credentials import Credentials
from onboard.security.security_services import SecurityServices
from onboard.step import ReceivedWsm
from onboard.wave_udp import psid, wsmp
from onboard.wave_udp.wsmp import WaveShortMessage
from tests.security.trial import ALICE, BOB, CAROL, UTC_S
from tests.typed import a
from tests.vehicle.platoon import SPEED_M_S, Platoon, car


def platoon(follower: Credentials = BOB) -> Platoon:
    """AAA1 leads BBB2, and both have driven for 3 s; all epochs of the test are one."""
    cars = {"AAA1": ALICE, "BBB2": follower}
    driven = Platoon(
        {
            plate: car(plate, epoch_s=86_400.0, credentials=keys, utc_s=UTC_S)
            for plate, keys in cars.items()
        }
    )
    driven.drive(3.0)
    return driven


def warn(driven: Platoon, number: int) -> None:
    """An insider tells BBB2 of the braking of a vehicle ahead that does not exist."""
    leader = driven.cars["AAA1"].digest.car_id("AAA1", UTC_S + driven.now)
    origin = number.to_bytes(8)
    warning = lcca.Warn(
        origin, leader, 1, origin, 9, 1, 1, 9, lcca.WarnCause.DECELERATION, 6.0, 0.0, 1
    )
    secured = SecurityServices(UTC_S, CAROL).secure(lcca.encode(warning), psid.LCCA, driven.now)
    driven.receive(
        "BBB2", ReceivedWsm(driven.now, wsmp.encode(WaveShortMessage(psid.LCCA, secured)))
    )
    driven.settle()


def brake(driven: Platoon) -> None:
    """Both slow down by 6 m/s in a second, the first warns, and both drive on."""
    for step in range(10):
        driven.speed_m_s = dict.fromkeys(driven.cars, SPEED_M_S - 0.6 * step)
        if step == 4:
            driven.receive("AAA1", HardBrake(driven.now, 6.0, source="obd"))
        driven.drive(0.1)
    for step in range(20):
        driven.speed_m_s = dict.fromkeys(driven.cars, SPEED_M_S - 0.3 * (20 - step))
        driven.drive(0.1)
    driven.drive(4.0)


@pytest.mark.long
def test_one_insider_raises_three_warnings_at_most() -> None:
    driven = platoon()
    for number in range(6):
        warn(driven, number)
        driven.drive(4.0)
    assert len(list(driven.events_of("BBB2", "warning"))) == MOST_ALARMS
    refused = [a(Discarded, each).reason for each in driven.events_of("BBB2", "discarded")]
    assert refused.count("ignored_signer") == 6 - MOST_ALARMS
    assert len(list(driven.events_of("BBB2", "signer_ignored"))) == 1

    brake(driven)

    assert len(list(driven.events_of("BBB2", "warning"))) == MOST_ALARMS + 1


@pytest.mark.long
def test_every_true_braking_of_one_vehicle_is_warned_of() -> None:
    driven = platoon()
    for _ in range(5):
        brake(driven)
    assert len(list(driven.events_of("BBB2", "warning"))) == 5
    assert not list(driven.events_of("BBB2", "signer_ignored"))
