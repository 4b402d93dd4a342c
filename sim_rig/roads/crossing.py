"""Two synthetic roads: a dense crossing with traffic lights, and a highway."""

import math

import numpy as np
from pydantic import Field

from onboard.settings import Settings
from sim_rig.roads.lanes import DriverSettings, Lane, LaneTraffic

LANE_M, MEDIAN_M = 4.0, 1.0
CYCLE_S, GREEN_S, CLEARANCE_S = 60.0, 25.0, 5.0


class IntersectionSettings(Settings):
    """Crossing of two roads at a right angle; all cars go straight on."""

    lanes: int = Field(3, ge=1, le=6)
    """In each direction."""
    arm_m: float = Field(160.0, ge=50.0, le=1000.0)
    arrivals_per_s: float = Field(0.19, ge=0.0, le=1.0)
    """Rate in each lane; by default some 100 cars are present at a time."""
    drivers: DriverSettings = DriverSettings()


class HighwaySettings(Settings):
    """Highway with lanes in one direction."""

    lanes: int = Field(3, ge=1, le=8)
    length_m: float = Field(1000.0, ge=100.0, le=20_000.0)
    arrivals_per_s: float = Field(0.4, ge=0.0, le=1.0)
    drivers: DriverSettings = DriverSettings(top_speed_m_s=32.0, top_speed_sigma_m_s=4.0)


def crossing(settings: IntersectionSettings, rng: np.random.Generator) -> LaneTraffic:
    """Return traffic on the lanes of four directions; east and west have green first."""
    lanes = []
    box_m = MEDIAN_M / 2.0 + settings.lanes * LANE_M
    for direction in range(4):
        heading = direction * math.pi / 2.0
        ahead = np.array([math.cos(heading), math.sin(heading)])
        right = np.array([ahead[1], -ahead[0]])
        green_at_s = (direction % 2) * CYCLE_S / 2.0
        for lane in range(settings.lanes):
            aside = MEDIAN_M / 2.0 + LANE_M * (lane + 0.5)
            begin = -settings.arm_m * ahead + aside * right
            lanes.append(
                Lane(
                    (float(begin[0]), float(begin[1])),
                    heading,
                    2.0 * settings.arm_m,
                    settings.arrivals_per_s,
                    direction,
                    settings.arm_m - box_m - 3.0,
                    (green_at_s, green_at_s + GREEN_S),
                )
            )
    return LaneTraffic(lanes, settings.drivers, rng, CYCLE_S)


def highway(settings: HighwaySettings, rng: np.random.Generator) -> LaneTraffic:
    """Return traffic on parallel lanes eastwards."""
    lanes = [
        Lane((0.0, lane * LANE_M), 0.0, settings.length_m, settings.arrivals_per_s, 0)
        for lane in range(settings.lanes)
    ]
    return LaneTraffic(lanes, settings.drivers, rng)
