"""The probability of each text that a plate may bear, by all readings of one track.

Each reading gives texts x a probability p_t(x); what they lack to 1 is for all other texts. If
readings were independent, Bayes' rule with equally likely texts would be the product of the p_t.
But they show the same plate, and a plate that is too small is misread alike in every frame. With
the correlation rho between any two of n readings, they are worth

    m = n / (1 + (n - 1) rho)

independent ones (design effect; Kish 1965, Survey Sampling, section 5.4). So

    log P(x) = m / n  sum_t w_t log max(p_t(x), f_t) + constant,    n = sum_t w_t

where the weight w_t of a reading falls to 1/e in `FADE_S`, and the floor f_t, for a text that the
reading does not name, bounds what one wrong reading can do. "None of these texts" takes part as if
it were one text with the remaining probability.
"""

import math
from collections.abc import Sequence

from onboard.observations import PlateCandidate
from onboard.vision.look_alikes import folded

CORRELATION = 0.5
"""Correlation of two readings of one plate, each of the mean of the views so far: of 0.1 to 1 that
with the highest mean log probability of the true text, on 240 rendered drives with plates of 20 to
52 px. Of the texts with 0.11, 0.32, 0.65, 0.86 and 0.99, shares of 0.11, 0.25, 0.48, 0.83 and 1.00
are right there."""
FADE_S = 4.0
"""Time in which the weight of a reading falls to 1/e."""
FLOOR = 1e-3
"""Least probability of a text that a reading does not name, as a share of what it leaves."""
MIN_REMAINDER = 0.01
"""Least probability that a reading leaves to other texts."""
MIN_LENGTH = 4
"""Characters of a plate; shorter texts are fragments of one, or lettering on the bodywork."""
POOL = 96
"""Texts that are kept; the least likely ones give way."""
CERTAIN_TEXT, CERTAIN_READING, CERTAIN_READINGS = 0.9, 0.98, 1.5
"""Posterior from which a text is certain; probability of it in one reading, and how many such
readings, faded, there must be: two, one not long ago. A plate too small to be read is misread alike
in every frame: on rendered drives at 25 m, `SE652S0` for `SE652SD` with up to 0.97."""
WIDE_PX, CERTAIN_WIDE_READING, LONGEST = 60.0, 0.88, 8
"""Width of a plate that is not small, the probability that suffices in a reading of it, and the
characters that it has at most: a longer text may have what is beside the plate, as `M5VCF20377` for
`5VCF203`. Of photographs with plates of 65 px, in grey, the half that chose this bound is certain
in 64 of 89, and wrong in none (with 0.85 in 65), the other half in 57 of 76, and wrong in one, by
its label; with 0.92 in 57 and 53. With 0.85, the other half has `AUP2403` for `AVP2403`."""
MAX_CANDIDATES = 16
"""Texts that a lead carries (`Lead.candidates`)."""


class PlatePosterior:
    """The posterior of one track's plate.

    Texts that differ only in O and 0, or I and 1, are one: many fonts draw them alike. It is spelt
    as the likeliest reading spelt it.
    """

    def __init__(self) -> None:
        """Start without readings."""
        self._evidence: dict[str, float] = {}
        """Weighted sum of log(p_t / f_t) of each text, O and I folded."""
        self._others = 0.0
        """Weighted sum of the logarithm of the number of all other texts."""
        self._readings = 0.0
        """Number of readings, faded."""
        self._spellings: dict[str, tuple[float, str]] = {}
        """Highest probability in one reading, and the spelling there."""
        self._certain_readings: dict[str, float] = {}
        """Number of readings that alone were certain of a text, faded."""
        self._stamp_s = -math.inf
        self._texts: tuple[PlateCandidate, ...] = ()
        """All texts with their posterior, the likeliest first."""
        self.certain_text: str | None = None
        """The text that the plate certainly bears; `None` while there is none."""

    def update(
        self, candidates: Sequence[PlateCandidate], stamp_s: float, width_px: float = 0.0
    ) -> None:
        """Add one reading of the plate.

        A reading whose likeliest text is shorter than a plate, or which has none, is of a fragment,
        and changes nothing.

        Args:
            candidates: texts with their probabilities by this reading alone, in any order.
            stamp_s: of the frame.
            width_px: of the plate; a small one must be read with more certainty.
        """
        likeliest = max(candidates, key=lambda candidate: candidate.probability, default=None)
        if likeliest is None or len(likeliest.text) < MIN_LENGTH or likeliest.probability <= 0.0:
            return
        self._fade(stamp_s)
        probabilities: dict[str, float] = {}
        for candidate in candidates:
            if len(candidate.text) >= MIN_LENGTH and candidate.probability > 0.0:
                text = folded(candidate.text)
                probabilities[text] = probabilities.get(text, 0.0) + candidate.probability
                spelling = (candidate.probability, candidate.text)
                self._spellings[text] = max(spelling, self._spellings.get(text, spelling))
        remainder = max(MIN_REMAINDER, 1.0 - sum(probabilities.values()))
        floor = FLOOR * remainder
        is_wide = width_px >= WIDE_PX
        self._readings += 1.0
        self._others += math.log(remainder / floor)
        for text, probability in probabilities.items():
            likelihood_ratio = max(probability / floor, 1.0)
            self._evidence[text] = self._evidence.get(text, 0.0) + math.log(likelihood_ratio)
            is_whole = is_wide and len(text) <= LONGEST
            if probability >= (CERTAIN_WIDE_READING if is_whole else CERTAIN_READING):
                self._certain_readings[text] = self._certain_readings.get(text, 0.0) + 1.0
        if len(self._evidence) > POOL:
            self._keep(sorted(self._evidence, key=lambda text: -self._evidence[text])[:POOL])
        self._texts = self._by_posterior()
        self.certain_text = self._certainly_borne()

    def candidates(self, limit: int = MAX_CANDIDATES) -> tuple[PlateCandidate, ...]:
        """The likeliest texts with their posterior, the likeliest first, at most `limit`."""
        return self._texts[:limit]

    def probability(self, text: str) -> float:
        """Posterior of one text; 1 without readings."""
        same = (each.probability for each in self._texts if folded(each.text) == folded(text))
        return next(same, 0.0) if self._texts else 1.0

    def _by_posterior(self) -> tuple[PlateCandidate, ...]:
        share = 1.0 / (1.0 + max(self._readings - 1.0, 0.0) * CORRELATION)
        others = self._others / self._readings
        most = max(others, share * max(self._evidence.values()))
        weights = {
            text: math.exp(share * evidence - most) for text, evidence in self._evidence.items()
        }
        total = sum(weights.values()) + math.exp(others - most)
        return tuple(
            PlateCandidate(self._spellings[text][1], weights[text] / total)
            for text in sorted(weights, key=lambda text: -weights[text])
        )

    def _certainly_borne(self) -> str | None:
        likeliest = self._texts[0]
        if likeliest.probability < CERTAIN_TEXT:
            return None
        certain = self._certain_readings.get(folded(likeliest.text), 0.0)
        return likeliest.text if certain >= CERTAIN_READINGS else None

    def _fade(self, stamp_s: float) -> None:
        keep = math.exp(min(0.0, self._stamp_s - stamp_s) / FADE_S)
        self._stamp_s = max(stamp_s, self._stamp_s)
        self._readings *= keep
        self._others *= keep
        for faded in (self._evidence, self._certain_readings):
            for text in faded:
                faded[text] *= keep

    def _keep(self, texts: list[str]) -> None:
        self._evidence = {text: self._evidence[text] for text in texts}
        self._certain_readings = {t: n for t, n in self._certain_readings.items() if t in texts}
        self._spellings = {text: self._spellings[text] for text in texts}
