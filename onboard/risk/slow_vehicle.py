"""Course of a vehicle that pulls out: its velocity has no direction yet, but its heading does."""

import math
from dataclasses import replace

import numpy as np

from onboard.kinematics.heading import Heading
from onboard.tracking.perceived_object import PerceivedObject

BELOW_M_S = 4.0
"""A faster vehicle's velocity tells its course."""


def with_heading(vehicle: PerceivedObject, heading: Heading | None) -> PerceivedObject:
    """Return a slow vehicle with its speed along its heading; others, and without one, unchanged.

    Args:
        vehicle: as perceived.
        heading: clockwise from north, where the vehicle keeps one at rest.
    """
    x_m, y_m, east_m_s, north_m_s = vehicle.state
    if heading is None or not math.hypot(east_m_s, north_m_s) < BELOW_M_S:
        return vehicle
    along = np.array([math.sin(heading.heading_rad), math.cos(heading.heading_rad)])
    across = np.array([along[1], -along[0]])
    speed_m_s = max(east_m_s * along[0] + north_m_s * along[1], 0.0)
    covariance = np.array(vehicle.covariance)
    variance = along @ covariance[2:, 2:] @ along
    turned = variance * np.outer(along, along)
    turned += (speed_m_s * heading.sigma_rad) ** 2 * np.outer(across, across)
    both = np.zeros((4, 4))
    both[:2, :2], both[2:, 2:] = covariance[:2, :2], turned
    return replace(
        vehicle,
        state=(x_m, y_m, *(speed_m_s * along).tolist()),
        covariance=tuple(map(tuple, both.tolist())),
    )
