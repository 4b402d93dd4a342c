"""BSMs of the MVS studies' cars: acceleration and hard braking as a car can know them."""

import numpy as np
import pytest

from onboard.kinematics.units import KM_H
from onboard.messages.bsm_safety import VehicleEventFlags
from sim_rig.studies.mvs.bsms import TICK_S, BsmSource

SPEED_M_S, BRAKING_M_S2 = 20.0, 6.0


def source(resolution_m_s: float) -> BsmSource:
    return BsmSource(bytes(4), (4.5, 1.8), resolution_m_s, np.random.default_rng(0), 0.0)


@pytest.mark.parametrize(("resolution_m_s", "flag_within_s"), [(KM_H, 0.8), (0.02, 0.4)])
def test_hard_braking_is_flagged_once_the_bus_shows_it(
    resolution_m_s: float, flag_within_s: float
) -> None:
    car = source(resolution_m_s)
    car.receive_earlier_speeds(SPEED_M_S, 0.0, 0.0)
    accelerations_m_s2, flagged = [], []
    for tick in range(20):
        now = tick * TICK_S
        car.receive_speed(SPEED_M_S - BRAKING_M_S2 * now, now)
        message = car.bsm(None, now)
        accelerations_m_s2.append(message.core.acceleration.longitudinal_m_s2)
        events = message.safety.events if message.safety else None
        flagged.append(events is not None and VehicleEventFlags.HARD_BRAKING in events)

    assert not flagged[0]
    assert all(flagged[round(flag_within_s / TICK_S) :])
    # The slope over 0.8 s lags behind, and converges.
    assert accelerations_m_s2[3] > -0.75 * BRAKING_M_S2
    assert accelerations_m_s2[-1] == pytest.approx(-BRAKING_M_S2, abs=0.5)


def test_who_brakes_as_its_radio_is_switched_on_has_braked_before() -> None:
    car = source(KM_H)
    car.receive_earlier_speeds(SPEED_M_S, -BRAKING_M_S2, 0.0)
    car.receive_speed(SPEED_M_S, 0.0)

    assert car.bsm(None, 0.0).core.acceleration.longitudinal_m_s2 == pytest.approx(
        -BRAKING_M_S2, abs=0.5
    )
