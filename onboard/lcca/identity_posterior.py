"""Probability that each vehicle on the air is the one ahead.

One of these holds: the vehicle ahead bears one of the texts asked for and is on the air; it is on
the air and bears another text; it is not on the air. All vehicles that answered and are not ahead
did so by coincidence. With n answers, p the probability of a text, m the likelihood ratio of a
vehicle's motion (`motion_match`), r the share of vehicles on the air, N their number in range,
K(n) the probability of n answers by coincidence, and q = 1 - (sum of p of those that answered), the
weights are

    a vehicle that answered           p r m K(n - 1)
    a vehicle that did not answer     q (r / N) m K(n)
    no vehicle on the air             q (1 - r) K(n)

A coincidence is rare, but rarely comes alone: texts asked for differ in a character or two, as the
plates of a fleet do. With f the probability that the vehicle ahead is of such a fleet,

    K(n) = (1 - f) (c N)^n + f F^n
"""

import math
from collections.abc import Mapping

ON_AIR = 0.5
"""r: share of vehicles with a radio, where nothing is known of it."""
COINCIDENCE = 1e-6
"""c: probability that a given vehicle bears one given text. There are 10^7 plates and more in a
series, which are not used evenly."""
FLEET, FLEET_ANSWERS = 1e-3, 0.5
"""f: probability that the vehicle ahead is of a fleet with consecutive plates that is in range,
taken high, so that few are mistaken where it is (`sim-rig study false-identity`); F: share of the
texts near its own that are then borne by others."""


def vehicle_probabilities(
    answered: Mapping[bytes, float], motion: Mapping[bytes, float]
) -> dict[bytes, float]:
    """Return the probability of each vehicle; what their sum lacks to 1 is for none of them.

    Args:
        answered: probability of the text for which a vehicle answered, by the vehicle's name.
        motion: logarithm of the likelihood ratio of the motion of all vehicles on the air.
    """
    on_air = max(len(motion.keys() | answered.keys()), 1)
    others = max(0.0, 1.0 - sum(answered.values()))
    by_coincidence = _log(_coincidences(len(answered), on_air))
    logs = {
        name: _log(text * ON_AIR)
        + motion.get(name, 0.0)
        + _log(_coincidences(len(answered) - 1, on_air))
        for name, text in answered.items()
    }
    logs |= {
        name: _log(others * ON_AIR / on_air) + ratio + by_coincidence
        for name, ratio in motion.items()
        if name not in answered
    }
    nobody = _log(others * (1.0 - ON_AIR)) + by_coincidence
    highest = max(nobody, *logs.values()) if logs else nobody
    weights = {name: math.exp(each - highest) for name, each in logs.items()}
    total = sum(weights.values()) + math.exp(nobody - highest)
    return {name: weight / total for name, weight in weights.items()}


def _coincidences(answers: int, on_air: int) -> float:
    """K: probability of so many answers of vehicles that are not ahead."""
    at_random = min(COINCIDENCE * on_air, 1.0)
    return float((1.0 - FLEET) * at_random**answers + FLEET * FLEET_ANSWERS**answers)


def _log(probability: float) -> float:
    return math.log(max(probability, 1e-300))
