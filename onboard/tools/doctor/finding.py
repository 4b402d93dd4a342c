"""Result of one test."""

from dataclasses import dataclass
from enum import StrEnum


class FindingLevel(StrEnum):
    """Result of a test, from best to worst."""

    GOOD = "good"
    NOT_CONFIGURED = "not configured"
    """The configuration has no such connection."""
    DOUBTFUL = "doubtful"
    """It works, with reduced quality."""
    MISSING = "missing"
    """It is configured and does not work."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the report."""

    subject: str
    level: FindingLevel
    detail: str
    advice: str = ""
    """What the user can do; empty if there is nothing to do."""
