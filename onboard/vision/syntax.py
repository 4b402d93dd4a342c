"""The valid texts of plates, if the user gave their patterns."""

import re


class PlateSyntax:
    """Patterns of valid plates; without any, all texts are valid."""

    def __init__(self, patterns: tuple[str, ...]) -> None:
        self._patterns = [re.compile(pattern) for pattern in patterns]

    def __bool__(self) -> bool:
        """Whether there are patterns."""
        return bool(self._patterns)

    def fits(self, text: str) -> bool:
        """Whether `text` is valid."""
        return not self._patterns or any(pattern.fullmatch(text) for pattern in self._patterns)


ALL_VALID = PlateSyntax(())
"""Without patterns."""
