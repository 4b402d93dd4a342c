"""Random plate numbers in the formats of registries.

A pattern is written with `L` for a letter, `#` for a digit; a space marks where groups part.
The patterns are facts about public series; the numbers drawn from them are random.
"""

import numpy as np

US_PATTERNS = (
    *("LL# L#L",) * 4,
    *("LLL ###", "LLL ####", "### LLL", "LLL L##", "#LLL###") * 3,
    "LL# L###",
    "#####L#",
    "L## ####",
    "LL #####",
    "##L ###",
    "L##LLL",
    "### ####",
    "LL ####",
    "#LL ###",
    "L### ###",
    "LLL## ##",
    "#####LL",
    "L#####L",
    "#### LL",
    "L## ##L",
    "L## #LL",
    "L## LLL",
    "#LL L##",
    "#LL####",
    "### L##",
    "##LL###",
    "#L# ####",
    "#L #####",
    "##L####",
    "L ######",
    "LL### L",
)
EU_PATTERNS = (
    *("LL ###LL",) * 3,
    *("#L# ####",) * 2,
    "LLL ## ##",
    "LL #####",
    "LLL ####",
    "LL ####L",
    "L LL ####",
    "LL LL ###",
    "LLL LL ##",
    "LL L ####",
    "LL ### LL",
    "LL##LLL",
    "#### LLL",
    "## LLL #",
    "L ### LL",
    "LLL ###",
    "L #####",
    "LL LLLLL",
)
BR_PATTERNS = (*("LLL ####",) * 4, "LLL#L##")

_LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
_RARE = "IOQ"
"""Many registries leave these out of their series, since they look like digits."""
_DIGITS = "0123456789"


def text_of(pattern: str, rng: np.random.Generator, *, rare: float = 0.5) -> str:
    """Draw a number after a pattern.

    Args:
        pattern: L is a letter, # a digit; other characters are kept.
        rng: source of all random numbers.
        rare: share of texts that may have I, O and Q.
    """
    letters = _LETTERS if rng.random() < rare else "".join(c for c in _LETTERS if c not in _RARE)
    alphabet = {"L": letters, "#": _DIGITS}
    return "".join(
        alphabet[sign][rng.integers(len(alphabet[sign]))] if sign in alphabet else sign
        for sign in pattern
    )


def any_text(rng: np.random.Generator, longest: int = 8) -> str:
    """A wish plate or an unknown series: letters and digits at random, perhaps parted once."""
    length = int(rng.integers(3, longest + 1))
    share_of_digits = rng.choice([0.0, 0.3, 0.5, 0.8])
    pattern = "".join("#" if rng.random() < share_of_digits else "L" for _ in range(length))
    if rng.random() < 0.6:
        cut = int(rng.integers(1, length))
        pattern = f"{pattern[:cut]} {pattern[cut:]}"
    return text_of(pattern, rng, rare=0.2 if "#" in pattern else 0.8)


def word(rng: np.random.Generator, longest: int = 16) -> str:
    """A made-up word or two, for dealers and places."""
    length = int(rng.integers(3, longest + 1))
    vowels, others = "AEIOU", "BCDFGHKLMNPRSTVW"
    sounds = [vowels, others] if rng.random() < 0.5 else [others, vowels]
    letters = "".join(
        sounds[place % 2][rng.integers(len(sounds[place % 2]))] for place in range(length)
    )
    if length > 8:
        letters = f"{letters[:6]} {letters[6:]}"
    return letters if rng.random() < 0.6 else letters.lower()
