"""How the numbers of a country are made, where the user says so."""

import re


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
