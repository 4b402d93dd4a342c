"""Probability that each vehicle on the air is the lead.

By the camera, the lead's plate bears the text T with probability p(T). The vehicle that bears it is
on the air with probability r; it then answers, unless it or its answer is lost in each of the n(T)
inquiries for T. Vehicles that answer and are not the lead do so by coincidence. With m' the
likelihood ratio of a vehicle's motion (`motion_match`) and N the number of vehicles on the air, the
weights are, by Bayes' rule,

    a vehicle that answered for T     r m p(T) K(T)
    a vehicle that did not answer     (r / N) m  sum of p(T) L^n(T) K(T)
    one asked by its temporary ID     (r / N) min(m, 1/i) L^q  the same sum
    no vehicle on the air             (1 - r)    sum of p(T) K(T)

with the sums over all texts that nobody answered for. So the likeliest text that stays silent
while a less likely one answers keeps its weight, as that of a vehicle without a radio. An insider
can move just as the lead does, with probability i, but proves no other ID than its own: where the
camera reads a plate, that decides, not the motion. And the lead would answer whoever asks it by
its temporary ID: q counts the inquiries that are left unanswered, none if it answered under the ID
of a text that the camera does not list.

Others of the lead's row move almost as it does, and the lead may be one without radio and plate.
With e the likelihood ratio of another place in the row, and w the number of its vehicles,

    m = m' / (1 - w / N + e w / N)

where motion alone speaks for a vehicle. Where it has answered for a text, m = m': an insider that
moves as the row does cannot keep it from being the lead.

K(T) is the probability of the answers for other texts than T. A given plate is rare. But vehicles
of one fleet have consecutive plates, and the lead may be of a fleet that is in range. With a
answers for plates near T and b for others,

    K(T) = (c N)^b ((1 - f) (c N)^a + f F^a)
"""

import math
from collections.abc import Collection, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from onboard.lcca.plate_series import letters_and_number

ON_AIR = 0.5
"""r: share of vehicles with a radio, where nothing is known of it."""
LOST = 0.3
"""L: probability that an inquiry or its answer is lost, taken high."""
COINCIDENCE = 1e-6
"""c: probability that a given vehicle bears one given text. There are 10^7 plates and more in a
series, which are not used evenly."""
IMITATION = 1e-2
"""i: probability that a vehicle imitates the motion of the lead, taken high: it could keep the lead
from being identified, or be taken for it and warn the host."""
IN_ROW = 4.0
"""w: vehicles of the lead's row on the air, without the lead; at most half of all."""
READ = 0.5
"""Least probability of all texts that the camera lists at which it has read the plate; a plate that
is not read leaves the decision to motion."""
FLEET, FLEET_ANSWERS = 0.2, 0.5
"""f: probability that the lead is of a fleet with consecutive plates that is in range,
taken high, so that few are mistaken where it is (`sim-rig study false-identity`); F: share of the
plates near its own that are then borne by others on the air."""
FLEET_SPAN = 50
"""Difference of the numbers of two plates from which they are not near each other."""
CALIBRATION = 0.8
"""Exponent of the camera's probabilities, since readings of consecutive images are alike. Chosen on
91 photographs of plates 28 and 36 px wide, and judged on 87 others, as are the following constants
(`python -m bench.text_calibration`)."""
MIN_UNLISTED = 0.02
"""Least probability that the camera does not list the text: where less than 0.05 is left to other
texts, 3 of 258 plates bear one of those, and 12 of 280 of the photographs that judge."""
UNLISTED, UNLISTED_NEAR = 0.01, 0.1
"""If the camera does not list the text: probability that it is a given one that was asked for, and
that it is near a given other one, as a share of the latter's own. Of 26 such plates, one is near
the likeliest text, and 4 bear one of the 255 that were listed before."""


class AskedText(NamedTuple):
    """A text that the lead's plate may bear."""

    text: str
    probability: float
    """By the camera."""
    inquiries: int
    """That named it, and that could have been answered by now."""


def vehicle_probabilities(
    texts: Collection[AskedText],
    answered: Mapping[bytes, str],
    motion: Mapping[bytes, float],
    asked_by_motion: Mapping[bytes, int] = MappingProxyType({}),
    in_row: Mapping[bytes, float] = MappingProxyType({}),
) -> dict[bytes, float]:
    """Return the probability of each vehicle; what their sum lacks to 1 is for none of them.

    Args:
        texts: all that the camera lists, each once; what their probabilities lack to 1 is for all
            other texts.
        answered: the text for which a vehicle answered, by the vehicle's name.
        motion: logarithm of the likelihood ratio of the motion of all vehicles on the air.
        asked_by_motion: of vehicles that were asked by the temporary ID of their BSMs, the number
            of inquiries that they could have answered, and did not.
        in_row: as `motion`, for another place in the lead's row.
    """
    on_air = max(len(motion.keys() | answered.keys()), 1)
    rare = min(COINCIDENCE * on_air, 1.0)
    borne = list(answered.values())
    near = {text: _near(text, borne) for text in borne}  # itself too
    silent, of_borne = _silent_and_answered(texts, near.keys())
    weights = {
        name: ON_AIR
        * math.exp(motion.get(name, 0.0))
        * of_borne[text]
        * _coincidence(near[text] - 1, len(borne) - near[text], rare)
        for name, text in answered.items()
    }
    nobody = lost = 0.0
    for each in silent:
        beside = _near(each.text, borne)
        weight = each.probability * _coincidence(beside, len(borne) - beside, rare)
        nobody += weight
        lost += weight * LOST**each.inquiries
    is_read = sum(each.probability for each in texts) >= READ
    row = min(IN_ROW / on_air, 0.5)
    most = math.log(1.0 / IMITATION) if is_read else math.inf
    for name, ratio in motion.items():
        if name in answered:
            continue
        weight = math.exp(ratio)
        if name in asked_by_motion:
            weight = math.exp(min(ratio, most)) * LOST ** asked_by_motion[name]
        if name in in_row:
            weight /= 1.0 - row + row * math.exp(in_row[name])
        weights[name] = ON_AIR / on_air * weight * lost
    total = sum(weights.values()) + (1.0 - ON_AIR) * nobody
    return {name: weight / total if total else 0.0 for name, weight in weights.items()}


def calibrated(
    probabilities: Sequence[float], exponent: float = CALIBRATION, least: float = MIN_UNLISTED
) -> tuple[list[float], float]:
    """Return the probabilities of texts as the shares of plates that bear them, and of all others.

    Args:
        probabilities: by the camera, of the texts that it lists.
        exponent: below 1 for one that is too sure of them.
        least: probability that the plate bears none of them.
    """
    listed = sum(probabilities)
    powers = [each**exponent for each in probabilities]
    scale = listed / (sum(powers) or 1.0)
    return [scale * each for each in powers], max(least, 1.0 - listed)


def _silent_and_answered(
    texts: Collection[AskedText], borne: Collection[str]
) -> tuple[list[AskedText], dict[str, float]]:
    """All texts that nobody answered for, and the probabilities of those that are borne.

    Of the texts that the camera does not list, those near one that is borne are lumped under its
    name, and all others under none.
    """
    probabilities, unlisted = calibrated([each.probability for each in texts])
    of_borne = dict.fromkeys(borne, UNLISTED * unlisted)
    silent = []
    for each, probability in zip(texts, probabilities, strict=True):
        if each.text in of_borne:
            of_borne[each.text] = probability
        else:
            silent.append(each._replace(probability=probability))
    beside = {
        text: UNLISTED_NEAR * max(each, UNLISTED) * unlisted for text, each in of_borne.items()
    }
    silent += [AskedText(text, probability, 0) for text, probability in beside.items()]
    return [*silent, AskedText("", unlisted - sum(beside.values()), 0)], of_borne


def _coincidence(near: int, far: int, rare: float) -> float:
    """K: probability of answers for so many texts near that of the lead, and others."""
    fleet = FLEET * FLEET_ANSWERS**near
    return float(rare**far * ((1.0 - FLEET) * rare**near + fleet))


def _near(text: str, others: Collection[str]) -> int:
    """How many of the texts are near a text: the same letters, and almost the same number."""
    letters, number = letters_and_number(text)
    return sum(
        each == letters and abs(other - number) < FLEET_SPAN
        for each, other in map(letters_and_number, others)
    )
