"""Model of one plate's readings by one camera, without images: texts with probabilities.

At each place of the text, each character has a score: normal noise of variance d, and d more for
the character that is there. The ratio of the likelihoods of a score x with and without the
character is exp(x - d/2), so the softmax of the scores is each character's exact probability, and
a reading by itself is calibrated, as the shipped reader's is. The discriminability d grows with the
plate's width in the image, and differs between plates.

The noise has a part that lasts as long as the camera knows the plate, and a part that changes
within `CORRELATION_S`. A misreading therefore lasts for seconds, and now and then it is confident.
"""

import math

import numpy as np

from onboard.observations import PlateCandidate
from onboard.vision.look_alikes import folded
from onboard.vision.plate_reader import ALPHABET
from sim_rig.cars.camera_view import FPS
from sim_rig.cars.gauss_markov import wandered
from sim_rig.roads.cars import Array

CHARACTERS = "".join(character for character in ALPHABET if character not in "OI")
"""O is read as 0 and I as 1: candidates do not distinguish them."""
LENGTH = 10
"""Characters of the longest plate."""
TEXTS = 30
"""Texts of a reading."""
WIDTHS_PX = (16.0, 25.0, 30.0, 36.0, 45.0, 80.0)
DISCRIMINABILITY = (0.0, 7.0, 11.0, 15.0, 20.0, 24.0)
"""At the widths above; linear in between, constant above. Fitted to photographs of three regions,
made smaller until the plate has that width: the share of plates whose text is among the K likeliest
(`tests/sim_rig/cars/test_plate_readings.py` compares them)."""
SPREAD = 0.28
"""Standard deviation of the logarithm of d between plates, from the same fit."""
LASTING = 0.6
"""Share of the noise's variance that lasts: the correlation of two distant readings of a plate. On
rendered drives at 30 to 38 px, a wrong text is read again 2 s later in 1 to 10 % of the frames; in
the model, in 3 to 6 %."""
CORRELATION_S = 0.5
"""Correlation time of the rest, which depends on the plate's position on the pixel grid."""


class PlateReadings:
    """The readings of one plate by one camera, frame by frame."""

    def __init__(self, rng: np.random.Generator, rate_hz: float = FPS) -> None:
        """Draw how legible the plate is, and what it is taken for.

        Args:
            rng: source of all.
            rate_hz: frames a second.
        """
        self._rng = rng
        self._times = 1 / rate_hz / CORRELATION_S
        self._legibility = math.exp(SPREAD * rng.standard_normal())
        self._lasting = rng.standard_normal((LENGTH, len(CHARACTERS)))
        self._passing = rng.standard_normal((LENGTH, len(CHARACTERS)))

    def advance(self) -> None:
        """Go on to the next frame, with the same number of draws whether it is read or not."""
        fresh = self._rng.standard_normal(self._passing.shape)
        self._passing = wandered(self._passing, 1.0, self._times, fresh)

    def read(self, text: str, width_px: float) -> tuple[PlateCandidate, ...]:
        """Read a plate in the present frame.

        Args:
            text: what it bears.
            width_px: its width in the image.

        Returns:
            The likeliest texts with their probabilities, the likeliest first.
        """
        true = [CHARACTERS.index(character) for character in folded(text)]
        d = self._legibility * float(np.interp(width_px, WIDTHS_PX, DISCRIMINABILITY))
        noise = math.sqrt(LASTING) * self._lasting + math.sqrt(1 - LASTING) * self._passing
        scores = math.sqrt(d) * noise[: len(true)]
        scores[np.arange(len(true)), true] += d
        scores -= np.log(np.exp(scores).sum(axis=1, keepdims=True))
        return _likeliest(scores, TEXTS)


def _likeliest(log_probabilities: Array, limit: int) -> tuple[PlateCandidate, ...]:
    """The likeliest texts of independent characters, (places, characters) in."""
    texts, sums = [""], np.zeros(1)
    for row in log_probabilities:
        longer = sums[:, None] + row
        best = np.argpartition(longer, -limit, axis=None)[-limit:]
        texts = [texts[at // len(row)] + CHARACTERS[at % len(row)] for at in best.tolist()]
        sums = longer.ravel()[best]
    order = np.argsort(-sums)
    return tuple(PlateCandidate(texts[at], math.exp(sums[at])) for at in order.tolist())
