"""The text of a plate by a vote of its readings over frames.

A reading votes for one character at each position, with the reader's confidence in the whole text
as its weight. The length is voted first, then each position by itself, because single characters
are misread independently. A text is identified when

- its length and its weakest position each have at least `confidence` of the votes,
- the votes weigh as much as two perfect readings, and
- two readings gave exactly this text with at least `confidence`. That excludes mixtures of the
  readings of two plates, and plates too small to be read, which are misread alike in every frame.

Many plate fonts draw 0 and O, or 1 and I, alike: they count as one character, and the text is spelt
as it was read most often. Old votes fade, so that another plate is identified after a few seconds.
"""

import math
from collections import defaultdict
from typing import TypeVar

from onboard.vision.look_alikes import folded

FADE_S = 4.0
"""Time in which a vote's weight falls to 1/e."""
MIN_WEIGHT = 2.0
"""Weight of all votes, in perfect readings."""
MIN_CERTAIN_READINGS = 1.5
"""Certain readings of the whole text, faded: two of them, one not long ago."""
MIN_READ_CONFIDENCE = 0.3
"""Confidence below which a reading is no vote."""
MIN_LENGTH = 4
"""Characters of a plate; shorter texts are fragments of one, or lettering on the bodywork."""
IDENTITY_CONFIDENCE = 0.9
"""Share of the votes that identifies a text."""
_Choice = TypeVar("_Choice")


class PlateVote:
    """The votes on the text of one plate or tag."""

    def __init__(self, confidence: float = IDENTITY_CONFIDENCE) -> None:
        """Start without votes; `confidence`: share of the votes that identifies a text."""
        self._confidence = confidence
        self._lengths: defaultdict[int, float] = defaultdict(float)
        self._positions: defaultdict[tuple[int, int], defaultdict[str, float]] = defaultdict(
            lambda: defaultdict(float)
        )
        self._certain: defaultdict[str, float] = defaultdict(float)
        self._spellings: defaultdict[str, defaultdict[str, float]] = defaultdict(
            lambda: defaultdict(float)
        )
        self._stamp_s = -math.inf

    def vote(
        self, text: str, confidence: float, character_confidences: tuple[float, ...], stamp_s: float
    ) -> None:
        """Count one reading of a whole text.

        Args:
            text: as read.
            confidence: that all of it is right.
            character_confidences: one for each character; empty for all certain.
            stamp_s: of the frame.
        """
        if confidence < MIN_READ_CONFIDENCE or len(text) < MIN_LENGTH:
            return
        self._fade(stamp_s)
        self._spellings[alike := folded(text)][text] += confidence
        self._lengths[len(text)] += confidence
        if confidence >= self._confidence:
            self._certain[alike] += 1.0
        weights = character_confidences or (1.0,) * len(text)
        for index, (character, weight) in enumerate(zip(alike, weights, strict=True)):
            self._positions[len(text), index][character] += confidence * weight

    @property
    def text(self) -> str | None:
        """The identified text; `None` while the votes do not suffice."""
        total = sum(self._lengths.values())
        if total < MIN_WEIGHT:
            return None
        length, weight = max(self._lengths.items(), key=lambda item: item[1])
        positions = (self._positions[length, index] for index in range(length))
        text = "".join(max(votes, key=lambda character: votes[character]) for votes in positions)
        is_certain = (
            self.share(text) >= self._confidence
            and weight >= MIN_WEIGHT
            and self._certain.get(text, 0.0) >= MIN_CERTAIN_READINGS
        )
        if not is_certain:
            return None
        spellings = self._spellings[text]
        return max(spellings, key=lambda spelling: spellings[spelling])

    def share(self, text: str) -> float:
        """Share of the votes for `text`: the least of its length and positions; 1 without votes."""
        total = sum(self._lengths.values())
        if not total:
            return 1.0
        shares = [self._lengths.get(len(text), 0.0) / total]
        for index, character in enumerate(folded(text)):
            votes: dict[str, float] = self._positions.get((len(text), index), defaultdict(float))
            shares.append(votes.get(character, 0.0) / max(sum(votes.values()), 1e-9))
        return min(shares)

    def _fade(self, stamp_s: float) -> None:
        keep = math.exp((self._stamp_s - stamp_s) / FADE_S)
        self._stamp_s = stamp_s
        _scale(self._lengths, keep)
        for votes in (self._certain, *self._positions.values(), *self._spellings.values()):
            _scale(votes, keep)


def _scale(votes: defaultdict[_Choice, float], factor: float) -> None:
    for choice in votes:
        votes[choice] *= factor
