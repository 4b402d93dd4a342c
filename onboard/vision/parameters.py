"""Periods and timeouts of perception that are not settings."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PerceptionParameters:
    """Periods that were measured on rendered drives and photographs."""

    search_period_s: float = 0.5
    """Between two searches of the whole frame."""
    search_period_without_lead_s: float = 0.2
    """The same without a lead; where vehicles are found as such, between two searches around a lead
    without a plate, and around what is new."""
    seldom_period_s: float = 1.0
    """Where vehicles are found as such, between two searches of the whole frame for plates, and
    while the lead has one also for vehicles."""
    read_period_s: float = 0.5
    """Between two readings of a plate; the lead's is read in every frame until it is identified."""
    read_period_identified_s: float = 1.0
    """The same of an identified plate whose last reading agreed."""
    frozen_after_s: float = 0.6
    """Repeats of one image for longer than this are a lost camera."""


DEFAULT_PARAMETERS = PerceptionParameters()
