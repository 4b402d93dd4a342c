"""What the signal ahead of a vehicle says of its driver's intent: to stop, or to drive on."""

import math
from enum import Enum
from typing import Protocol

from onboard.risk.mean_collision_probability import ANSWERING_M_S2, SETTING_OFF_M_S
from onboard.tracking.perceived_object import PerceivedObject

COMFORTABLE_M_S2 = 3.4
"""Deceleration that is comfortable for most drivers (AASHTO Green Book, stopping sight
distance)."""


class Signals(Protocol):
    """The signals of intersections, as far as they are known.

    Both return the distance in m from a vehicle's position to the stop line of its signal, if that
    shows the colour and stays so until the vehicle is there; else `None`.
    """

    def red_light_m(self, vehicle: PerceivedObject, /) -> float | None:
        """Return the distance to a red signal."""

    def green_light_m(self, vehicle: PerceivedObject, /) -> float | None:
        """Return the distance to a green signal."""


class NoSignals:
    """No signal is known."""

    def red_light_m(self, _vehicle: PerceivedObject, /) -> None:
        """See `Signals`."""

    green_light_m = red_light_m


NO_SIGNALS = NoSignals()


class Intent(Enum):
    """What a driver is expected to do at the signal."""

    STOPS = "stops"
    """Has red, and can still stop comfortably."""
    PASSES_RED = "passes red"
    """Has red, can no longer stop so, and does not brake."""
    PASSES_GREEN = "passes green"
    """Has green, and does not brake."""


def signal_intent(
    vehicle: PerceivedObject,
    length_m: float,
    signals: Signals,
    acceleration_m_s2: float | None,
    *,
    braking_m_s2: float = ANSWERING_M_S2,
) -> Intent | None:
    """Return a driver's intent; `None` if no signal tells it.

    Args:
        vehicle: its state.
        length_m: its length, half of which is ahead of its position.
        signals: those that are known.
        acceleration_m_s2: along its course; `None`: not known.
        braking_m_s2: a driver who brakes by more is not expected to pass.
    """
    speed_m_s = math.hypot(*vehicle.state[2:])
    keeps_on = acceleration_m_s2 is not None and acceleration_m_s2 > -braking_m_s2
    red_m = signals.red_light_m(vehicle)
    if red_m is None:
        has_green = keeps_on and signals.green_light_m(vehicle) is not None
        return Intent.PASSES_GREEN if has_green else None
    braking_m = red_m - length_m / 2.0
    if braking_m > 0.0 and speed_m_s**2 <= 2.0 * COMFORTABLE_M_S2 * braking_m:
        return Intent.STOPS
    return Intent.PASSES_RED if keeps_on and speed_m_s >= SETTING_OFF_M_S else None
