"""How often plates bear the texts that the camera lists, by its probabilities, on photographs.

`python -m bench text_calibration` prints the figures; `python -m bench.text_calibration` writes the
table in `docs/plates.md`. The photographs are followed as in `bench.plate_frames`. Those with an
even checksum chose what the identification of the lead makes of the camera's probabilities
(`onboard/lcca/identity_posterior.py`), the others judge it. The score is the mean logarithm of the
probability of what the plate bears, a listed text or another one.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from bench import Figure
from bench._tables import write_tables
from bench.plate_frames import PAGE, Condition, followed, judges
from onboard.lcca.identity_posterior import CALIBRATION, MIN_UNLISTED, calibrated
from onboard.vision.look_alikes import folded

WIDTHS_PX = (28, 36)
AFTER_FRAMES = (3, 6)
"""A lead is asked for from its third frame on."""
FEW = 0.05
"""Probability left to other texts below which these should hardly ever be the right ones."""
WAYS = ((1.0, 0.005), (0.6, 0.005), (CALIBRATION, MIN_UNLISTED))
"""Exponents and least probabilities of other texts: at the camera's word, as the readings of
`sim_rig/cars/plate_readings.py` suggest, and as shipped."""


@dataclass(frozen=True, slots=True)
class ListedTexts:
    """The texts of one plate after some frames."""

    judges: bool
    probabilities: list[float]
    """By the camera."""
    borne: int | None
    """Which of them the plate bears; `None` for another text."""

    def score(self, exponent: float, least: float) -> float:
        """Logarithm of the probability of what the plate bears."""
        texts, others = calibrated(self.probabilities, exponent, least)
        of_borne = others if self.borne is None else texts[self.borne]
        return math.log(max(of_borne, 1e-12) / (sum(texts) + others))


def listed_texts() -> Iterator[ListedTexts]:
    """The texts of all photographs in which any are read."""
    for width_px in WIDTHS_PX:
        for photograph, number, posterior in followed(Condition(width_px), max(AFTER_FRAMES)):
            candidates = posterior.candidates()
            if number in AFTER_FRAMES and candidates:
                texts = [folded(each.text) for each in candidates]
                truth = folded(photograph.text)
                yield ListedTexts(
                    judges(photograph),
                    [each.probability for each in candidates],
                    texts.index(truth) if truth in texts else None,
                )


def measure() -> Iterator[Figure]:
    """Scores of the photographs that judge; shares of texts that are not listed, by half."""
    chose, judging = _halves(listed_texts())
    for way in WAYS:
        value, by_word = (_mean_score(judging, each) for each in (way, WAYS[0]))
        name = "text_calibration.score.{}.{}".format(*way)
        yield Figure(name, value, "1", len(judging), "the camera at its word", by_word)
    (missing, of), (missing_else, of_else) = map(_missing, (chose, judging))
    name, unit = "text_calibration.not_listed", "share"
    yield Figure(name, missing_else / of_else, unit, of_else, "those that chose", missing / of)


def table(texts: Iterable[ListedTexts]) -> str:
    """One row a way, as Markdown."""
    halves = _halves(texts)
    lines = ["| power, least | where chosen | elsewhere |", "|---|---|---|"]
    for way in WAYS:
        chosen, elsewhere = (f"{_mean_score(half, way):.3f}" for half in halves)
        lines.append(f"| {way[0]:g}, {way[1]:g} | {chosen} | {elsewhere} |")
    return "\n".join(lines) + "\n"


def _halves(texts: Iterable[ListedTexts]) -> tuple[list[ListedTexts], ...]:
    every = list(texts)
    return [each for each in every if not each.judges], [each for each in every if each.judges]


def _mean_score(texts: Sequence[ListedTexts], way: tuple[float, float]) -> float:
    return float(np.mean([each.score(*way) for each in texts]))


def _missing(texts: Sequence[ListedTexts]) -> tuple[int, int]:
    """Of those that leave little to other texts, the plates that bear one, and all."""
    few = [each for each in texts if 1.0 - sum(each.probabilities) < FEW]
    return sum(each.borne is None for each in few), len(few)


def main() -> None:
    """Write the table into the page, between its marks."""
    write_tables(PAGE, {"calibration": table(listed_texts())})


if __name__ == "__main__":
    main()
