"""Characters that many plate fonts draw alike: 0 and O, 1 and I.

Texts that differ only in these are one, written with digits ("folded").
"""

import itertools

MAX_SPELLINGS = 16
"""Spellings of a text that are considered; each such character doubles them."""
_TO_DIGITS = str.maketrans("OI", "01")
_DRAWN_ALIKE = {"0": "0O", "1": "1I"}


def folded(text: str) -> str:
    """The text with O written as 0 and I as 1."""
    return text.translate(_TO_DIGITS)


def spellings(text: str) -> list[str]:
    """The texts that are folded to `text`, itself first; at most `MAX_SPELLINGS`."""
    choices = [_DRAWN_ALIKE.get(character, character) for character in text]
    chosen = itertools.islice(itertools.product(*choices), MAX_SPELLINGS)
    return ["".join(characters) for characters in chosen]
