"""FCW and EEBL for the driver's own reaction time: who reacts late is warned early."""

from onboard.risk.settings import FcwSettings

SLOWEST_S = 1.5
"""Mean brake reaction of surprised drivers (M. Green, How long does it take to stop?,
Transportation Human Factors 2, 2000). For a longer one, alarms would be early for every lead."""


def for_driver(settings: FcwSettings, reaction_s: float | None) -> FcwSettings:
    """Return the thresholds for a driver, whose reaction time may be known.

    The required deceleration is that after this time, and the times to collision grow by what it
    exceeds `settings.reaction_s`. Nobody is warned later than by `settings`: with 0.7 s, NHTSA's
    confirmation test is failed.

    Args:
        settings: for drivers who are not known.
        reaction_s: median of the driver's reaction times; `None` while few are known.
    """
    if reaction_s is None:
        return settings
    longer_s = max(min(reaction_s, SLOWEST_S) - settings.reaction_s, 0.0)
    later = ("reaction_s", "caution_ttc_s", "warning_ttc_s")
    return settings.model_copy(update={name: getattr(settings, name) + longer_s for name in later})
