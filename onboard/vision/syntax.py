"""How the numbers of a country are made, where the user says so."""

import itertools
import re

_ALIKE = ("0O", "0D", "0Q", "1I", "2Z", "5S", "6G", "8B")


class PlateSyntax:
    """The plates that there are, where the user named them."""

    def __init__(self, patterns: tuple[str, ...]) -> None:
        self._patterns = [re.compile(pattern) for pattern in patterns]

    def __bool__(self) -> bool:
        """Whether the user named any."""
        return bool(self._patterns)

    def fits(self, text: str) -> bool:
        """Whether `text` is one of them, or may be anything."""
        return not self._patterns or any(pattern.fullmatch(text) for pattern in self._patterns)

    def fit(self, text: str) -> str | None:
        """`text`, or the only text that fits and differs by characters that look alike."""
        if self.fits(text):
            return text
        spellings = (_alike(character) for character in text)
        fitting = {
            candidate
            for letters in itertools.islice(itertools.product(*spellings), 4096)
            if self.fits(candidate := "".join(letters))
        }
        return fitting.pop() if len(fitting) == 1 else None


def _alike(character: str) -> str:
    others = {other for pair in _ALIKE if character in pair for other in pair}
    return "".join(sorted(others | {character}))
