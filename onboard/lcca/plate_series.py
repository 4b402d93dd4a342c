"""Where a plate stands in its series: its letters at their places, and the number of its digits."""

_LOOK_ALIKES = str.maketrans("OI", "01")
"""Drawn alike by many plate fonts, and therefore one in communication IDs too."""


def letters_and_number(text: str) -> tuple[str, int]:
    """Return a plate's text with a 0 for each digit, and the number that the digits form."""
    folded = text.translate(_LOOK_ALIKES)
    letters = "".join("0" if each.isdecimal() else each for each in folded)
    return letters, int("".join(filter(str.isdecimal, folded)) or "0")
