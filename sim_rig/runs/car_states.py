"""True states of the cars of a run, as records of the rig's trace."""

import numpy as np

from sim_rig.roads.road import Road
from sim_rig.run_log.run_log import Record

EVERY_S = 0.1
"""Interval between two records of one car."""


def car_state_records(road: Road, start_s: float, duration_s: float) -> list[Record]:
    """Ground truth for the rig's trace: the state of every car, each `EVERY_S`.

    Args:
        road: source of the states.
        start_s: stamp at which the scenario began.
        duration_s: duration of the scenario.
    """
    return [
        {
            "stamp_s": start_s + at_s,
            "kind": "car_state",
            "car": car,
            "x_m": state.x_m,
            "y_m": state.y_m,
            "heading_rad": state.heading_rad,
            "elevation_m": state.elevation_m,
            "speed_m_s": state.speed_m_s,
            "length_m": state.length_m,
            "width_m": state.width_m,
        }
        for at_s in np.arange(0.0, duration_s, EVERY_S).tolist()
        for car, state in road.cars_at(at_s).items()
    ]
