"""The bus of the MVS studies' cars: acceleration and hard braking as a car can know them."""

import math
from collections.abc import Iterable

import numpy as np
import pytest

from onboard.bsm_transmission.transmitter import BsmTransmitter
from onboard.kinematics.units import KM_H
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import VehicleSize
from onboard.messages.bsm_safety import VehicleEventFlags
from onboard.observations import HardBrake, Speed
from onboard.security.pseudonyms import Pseudonym
from onboard.sensors.host_state import HostState
from sim_rig.studies.mvs.sampled_bus import TICK_S, SampledBus
from tests.typed import a

SPEED_M_S, BRAKING_M_S2 = 20.0, 6.0


class Car:
    """A bus, and the BSMs that follow from it."""

    def __init__(self, resolution_m_s: float) -> None:
        self.bus = SampledBus(resolution_m_s)
        pseudonym = Pseudonym(b"", bytes(4), 0, None, math.inf)
        rng = np.random.default_rng(0)
        self.host = HostState()
        self.transmitter = BsmTransmitter(VehicleSize(), pseudonym, rng, 0.0, self.host)

    def bsm(self, samples: Iterable[Speed | HardBrake], now: float) -> BasicSafetyMessage:
        for sample in samples:
            self.host.receive_observation(sample)
            if isinstance(sample, Speed):
                self.transmitter.receive_speed(sample)
            else:
                self.transmitter.receive_hard_brake(sample, now)
        return self.transmitter.bsm(None, now, now)


@pytest.mark.parametrize(("resolution_m_s", "flag_within_s"), [(KM_H, 0.8), (0.02, 0.4)])
def test_hard_braking_is_flagged_once_the_bus_shows_it(
    resolution_m_s: float, flag_within_s: float
) -> None:
    car = Car(resolution_m_s)
    car.bsm(car.bus.earlier_samples(SPEED_M_S, 0.0, 0.0), 0.0)
    accelerations_m_s2, flagged = [], []
    for tick in range(20):
        now = tick * TICK_S
        message = car.bsm(car.bus.sample(SPEED_M_S - BRAKING_M_S2 * now, now), now)
        accelerations_m_s2.append(a(float, message.core.acceleration.longitudinal_m_s2))
        events = message.safety.events if message.safety else None
        flagged.append(events is not None and VehicleEventFlags.HARD_BRAKING in events)

    assert not flagged[0]
    assert all(flagged[round(flag_within_s / TICK_S) :])
    # The slope over 0.8 s lags behind, and converges.
    assert accelerations_m_s2[3] > -0.75 * BRAKING_M_S2
    assert accelerations_m_s2[-1] == pytest.approx(-BRAKING_M_S2, abs=0.5)


def test_who_brakes_as_its_radio_is_switched_on_has_braked_before() -> None:
    car = Car(KM_H)
    car.bsm(car.bus.earlier_samples(SPEED_M_S, -BRAKING_M_S2, 0.0), 0.0)
    message = car.bsm(car.bus.sample(SPEED_M_S, 0.0), 0.0)

    assert message.core.acceleration.longitudinal_m_s2 == pytest.approx(-BRAKING_M_S2, abs=0.5)
