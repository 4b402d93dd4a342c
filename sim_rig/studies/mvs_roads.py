"""Where the cars drive that share what they see: a six-lane road made here, or a recorded trace."""

import math

import numpy as np

from sim_rig.studies.mvs_world import Array, Traffic

LANES_M = (-10.5, -6.5, -2.5, 2.5, 6.5, 10.5)
STEP_S = 0.01


def six_lane_road(
    cars_per_lane: int, spacing_m: float, duration_s: float, q: float, rng: np.random.Generator
) -> Traffic:
    """Three lanes each way at 12 m/s; every car strays about its place by white acceleration.

    A spring and a damper keep it there: its acceleration is -0.25 x - 0.7 v + noise of density q
    along the lane, with x the distance from its place and v the difference from 12 m/s.
    """
    directions = np.repeat([1.0 if lane < 0 else -1.0 for lane in LANES_M], cars_per_lane)
    offsets = np.repeat(rng.uniform(0.0, spacing_m, len(LANES_M)), cars_per_lane)
    places = np.tile((np.arange(cars_per_lane) - cars_per_lane / 2) * spacing_m, len(LANES_M))
    lanes = np.repeat(LANES_M, cars_per_lane)
    steps = math.ceil(duration_s / STEP_S) + 2
    strays, speeds = np.zeros((steps, len(lanes))), np.zeros((steps, len(lanes)))
    strays[0], speeds[0] = rng.normal(0, 1.5, len(lanes)), rng.normal(0, 0.9, len(lanes))
    for step in range(1, steps):
        pull = -0.25 * strays[step - 1] - 0.7 * speeds[step - 1]
        noise = rng.normal(0, math.sqrt(q * STEP_S), len(lanes))
        speeds[step] = speeds[step - 1] + pull * STEP_S + noise
        strays[step] = strays[step - 1] + speeds[step] * STEP_S

    def motion(at_s: float) -> Array:
        step = round(at_s / STEP_S)
        along = 12.0 * step * STEP_S + strays[step]
        states = np.zeros((len(lanes), 4))
        states[:, 0], states[:, 1] = directions * (places + offsets + along), lanes
        states[:, 2] = directions * (12.0 + speeds[step])
        return states

    return Traffic(motion, len(lanes))
