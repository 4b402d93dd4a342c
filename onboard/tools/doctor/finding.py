"""Result of one test, and what is tested."""

from collections.abc import Collection, Mapping
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


SUBJECTS: Mapping[str, tuple[str, ...]] = {
    "can": ("bus", "ECU"),
    "camera": ("camera", "light", "calibration"),
    "detector": ("detector",),
    "gnss": ("gpsd",),
    "radio": ("radio",),
}
"""Subjects by the section of the configuration; without the section, the first is reported."""
COMPUTER_SUBJECTS = ("program", "clock", "disk", "keys")
"""Subjects of every configuration."""


def best_levels(sections: Collection[str]) -> dict[str, FindingLevel]:
    """Return the level of each subject if all works that a configuration with `sections` names."""
    levels = dict.fromkeys(COMPUTER_SUBJECTS, FindingLevel.GOOD)
    for section, subjects in SUBJECTS.items():
        if section in sections:
            levels |= dict.fromkeys(subjects, FindingLevel.GOOD)
        else:
            levels[subjects[0]] = FindingLevel.NOT_CONFIGURED
    return levels


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the report."""

    subject: str
    level: FindingLevel
    detail: str
    advice: str = ""
    """What the user can do; empty if there is nothing to do."""
