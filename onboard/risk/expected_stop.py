"""Who may be expected to stop at a red signal."""

import math
from collections.abc import Callable

from onboard.tracking.perceived_object import PerceivedObject

COMFORTABLE_M_S2 = 3.4
"""Deceleration that is comfortable for most drivers (AASHTO Green Book, stopping sight
distance)."""

RedLight = Callable[[PerceivedObject], float | None]
"""Distance in m from a vehicle's position to the stop line of the signal that is red for it and
stays so until it is there; `None` without one."""


def no_red_light(_vehicle: PerceivedObject) -> None:
    """Say that no signal is known."""


def is_expected_to_stop(
    vehicle: PerceivedObject, length_m: float, red_light_m: RedLight, reaction_s: float = 0.0
) -> bool:
    """Return whether a vehicle has red and can still stop comfortably.

    Args:
        vehicle: its state.
        length_m: its length, half of which is ahead of its position.
        red_light_m: finds its signal.
        reaction_s: time until its driver brakes.
    """
    distance_m = red_light_m(vehicle)
    if distance_m is None:
        return False
    speed_m_s = math.hypot(*vehicle.state[2:])
    braking_m = distance_m - length_m / 2.0 - speed_m_s * reaction_s
    return braking_m > 0.0 and speed_m_s**2 <= 2.0 * COMFORTABLE_M_S2 * braking_m
