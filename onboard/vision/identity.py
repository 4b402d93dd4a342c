"""The car's text by vote over frames: what is sent is never a guess.

Every frame's read is one ballot. It names a character for each place, and weighs as much as the
reader was sure of the whole text, so a blurred frame says little. Reads of unequal length are
different claims about the plate: the length is voted first, then each place by itself, since single
characters are misread independently. A text is known when

- its weakest place and its length each have at least `confidence` of the votes,
- the votes weigh as much as two perfect reads, and
- two frames read exactly this text with at least `confidence`. A mixture of two plates is the plate
  of no car; and a plate too small to be read is misread in the same way in every frame, so that
  many doubtful votes are no more certain than one.

Many plate fonts draw 0 and O, or 1 and I, alike, and no identity tells them apart: they count as
one, and the text is spelt as it was read most often.

Old ballots fade, so that a new plate is believed after a few seconds of evidence, and not before.
"""

import math
from collections import defaultdict
from typing import TypeVar

FADE_S = 4.0
"""A ballot weighs 1/e of itself after this long."""
LEAST_WEIGHT = 2.0
"""In perfect reads."""
LEAST_CERTAIN = 1.5
"""Certain reads of the whole text, faded: two of them, one not long ago."""
LEAST_READ_CONFIDENCE = 0.3
"""Below it a read is noise and no ballot."""
LEAST_LENGTH = 4
"""Of a plate; shorter texts are pieces of one, or of the bodywork's lettering."""
_Choice = TypeVar("_Choice")
_FOLD = str.maketrans("OI", "01")


class PlateVote:
    """The votes on one car's text."""

    def __init__(self, confidence: float) -> None:
        """`confidence`: share of the votes that a text needs."""
        self._confidence = confidence
        self._lengths: defaultdict[int, float] = defaultdict(float)
        self._places: defaultdict[tuple[int, int], defaultdict[str, float]] = defaultdict(
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
        """Count one read of a whole text."""
        if confidence < LEAST_READ_CONFIDENCE or len(text) < LEAST_LENGTH:
            return
        self._fade(stamp_s)
        self._spellings[folded := text.translate(_FOLD)][text] += confidence
        self._lengths[len(text)] += confidence
        if confidence >= self._confidence:
            self._certain[folded] += 1.0
        weights = character_confidences or (1.0,) * len(text)
        for index, (character, weight) in enumerate(zip(folded, weights, strict=True)):
            self._places[len(text), index][character] += confidence * weight

    @property
    def text(self) -> str | None:
        """The voted text; `None` while it would be a guess."""
        total = sum(self._lengths.values())
        if total < LEAST_WEIGHT:
            return None
        length, weight = max(self._lengths.items(), key=lambda item: item[1])
        places = (self._places[length, index] for index in range(length))
        text = "".join(max(votes, key=lambda character: votes[character]) for votes in places)
        is_certain = (
            self.share(text) >= self._confidence
            and weight >= LEAST_WEIGHT
            and self._certain.get(text, 0.0) >= LEAST_CERTAIN
        )
        if not is_certain:
            return None
        spellings = self._spellings[text]
        return max(spellings, key=lambda spelling: spellings[spelling])

    def share(self, text: str) -> float:
        """Of the votes, those for `text`: for its length, and for its weakest place; 1 of none."""
        total = sum(self._lengths.values())
        if not total:
            return 1.0
        shares = [self._lengths.get(len(text), 0.0) / total]
        for index, character in enumerate(text.translate(_FOLD)):
            votes: dict[str, float] = self._places.get((len(text), index), defaultdict(float))
            shares.append(votes.get(character, 0.0) / max(sum(votes.values()), 1e-9))
        return min(shares)

    def _fade(self, stamp_s: float) -> None:
        keep = math.exp((self._stamp_s - stamp_s) / FADE_S)
        self._stamp_s = stamp_s
        _scale(self._lengths, keep)
        for votes in (self._certain, *self._places.values(), *self._spellings.values()):
            _scale(votes, keep)


def _scale(votes: defaultdict[_Choice, float], factor: float) -> None:
    for choice in votes:
        votes[choice] *= factor
