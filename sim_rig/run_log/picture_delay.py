"""How late a car's pictures are: the gap that it measured, compared with the true one over time.

With the true gap g(t), the measured one is m(t) = s g(t - d): d is the delay between the exposure
and the stamp of a picture, and s the error of the lens's scale. Both are fitted by least squares.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sim_rig.run_log.run_log import RunLog

LEAST_LEADS = 20
MOST_UNCERTAIN_S = 0.1
"""A delay that is known less well is not told: the gap has hardly changed."""
_DELAYS_S = np.arange(-0.3, 1.5, 0.01)
_CORRELATED_S = 1.0
"""Errors of a gap repeat from picture to picture: one in this time counts."""

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class PictureDelay:
    """Delay of the pictures of one car."""

    delay_s: float
    uncertainty_s: float
    """Twice the standard error."""
    pictures: int


def picture_delay(log: RunLog, car: str, plates: Mapping[str, str]) -> PictureDelay | None:
    """Fit the delay of a car's pictures; `None` if the gap says too little of it.

    Args:
        log: the run log.
        car: name of the car.
        plates: name of each car by its plate.
    """
    leads = [
        lead
        for lead in log.of(car, "lead", from_s=0.0)
        if lead["gap_m"] is not None and lead["text"] in plates
    ]
    if len(leads) < LEAST_LEADS:
        return None
    of_car = _states(log)
    stamps_s = np.array([lead["stamp_s"] for lead in leads])
    measured_m = np.array([lead["gap_m"] for lead in leads])
    ahead = [plates[lead["text"]] for lead in leads]
    by_delay_m = np.array([_true_gaps_m(of_car, car, ahead, stamps_s - d) for d in _DELAYS_S])
    scales = (by_delay_m @ measured_m) / (by_delay_m**2).sum(axis=1)
    squares = ((measured_m - scales[:, None] * by_delay_m) ** 2).sum(axis=1)
    best = int(squares[1:-1].argmin()) + 1
    # Near its least, the sum of squares is a parabola; its curvature bounds the delay.
    step_s = float(_DELAYS_S[1] - _DELAYS_S[0])
    before, least, after = squares[best - 1 : best + 2]
    curvature = (before - 2.0 * least + after) / step_s**2
    if curvature <= 0.0:
        return None
    delay_s = float(_DELAYS_S[best]) + (before - after) / (2.0 * step_s * curvature)
    independent = max(float(stamps_s[-1] - stamps_s[0]) / _CORRELATED_S, 1.0)
    uncertainty_s = 2.0 * math.sqrt(2.0 * float(least) / (curvature * independent))
    if uncertainty_s > MOST_UNCERTAIN_S:
        return None
    return PictureDelay(delay_s, uncertainty_s, len(leads))


def _states(log: RunLog) -> dict[str, Array]:
    """Of each car, rows of time, x, y and length."""
    rows: dict[str, list[list[float]]] = {}
    for record in log.rig:
        if record["kind"] == "car_state":
            state = [record[key] for key in ("stamp_s", "x_m", "y_m", "length_m")]
            rows.setdefault(record["car"], []).append(state)
    return {car: np.array(states) for car, states in rows.items()}


def _true_gaps_m(of_car: Mapping[str, Array], own: str, ahead: list[str], at_s: Array) -> Array:
    """Distance from the own front to the rear of the lead, on a straight road."""
    gaps_m = np.empty(len(at_s))
    for name in set(ahead):
        rows = np.array([each == name for each in ahead])
        one, other = of_car[own], of_car[name]
        apart_m = [
            np.interp(at_s[rows], other[:, 0], other[:, axis])
            - np.interp(at_s[rows], one[:, 0], one[:, axis])
            for axis in (1, 2)
        ]
        gaps_m[rows] = np.hypot(*apart_m) - (one[0, 3] + other[0, 3]) / 2.0
    return gaps_m
