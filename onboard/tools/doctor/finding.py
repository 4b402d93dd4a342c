"""One thing that was looked at, and what was found."""

from dataclasses import dataclass
from enum import StrEnum


class FindingLevel(StrEnum):
    """From best to worst."""

    GOOD = "good"
    NOT_CONFIGURED = "not configured"
    """The configuration has no such wire; the car does without."""
    DOUBTFUL = "doubtful"
    """The car drives, but not as well as it could."""
    MISSING = "missing"
    """The car does not do what it was configured for."""


@dataclass(frozen=True, slots=True)
class Finding:
    """What a line of the report says."""

    subject: str
    verdict: FindingLevel
    detail: str
    advice: str = ""
    """What to do; empty where there is nothing to do."""
