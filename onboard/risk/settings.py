"""Thresholds of the alarms that a user can set; the other constants stand in the alarms' files."""

from pydantic import Field

from onboard.settings import Settings


class FcwSettings(Settings):
    """Forward collision warning; EEBL uses the reaction time and the warning's deceleration too."""

    reaction_s: float = Field(1.0, ge=0.0, le=3.0)
    """Driver's reaction time, before which the required deceleration does not begin."""
    caution_m_s2: float = Field(3.5, gt=0.0, le=12.0)
    """Caution from this required deceleration on."""
    warning_m_s2: float = Field(5.0, gt=0.0, le=12.0)
    """Warning from this required deceleration on: about half of what a dry road allows."""
    caution_ttc_s: float = Field(3.2, gt=0.0, le=10.0)
    """Caution at this time to collision or less."""
    warning_ttc_s: float = Field(2.6, gt=0.0, le=10.0)
    """Warning at this time to collision or less; NHTSA's confirmation test asks for 2.0 s, 2.1 s or
    2.4 s, by its case."""


class ImaSettings(Settings):
    """Intersection movement assist, by the collision probability P_C."""

    caution_p_c: float = Field(0.30, gt=0.0, le=1.0)
    """Of 100 approaches without a crash 99 stay below it (docs/design/risk.md)."""
    warning_p_c: float = Field(0.45, gt=0.0, le=1.0)
    """Above what any approach without a crash has reached (docs/design/risk.md)."""


class RiskSettings(Settings):
    """All alarms."""

    fcw: FcwSettings = FcwSettings()
    """Forward collision warning, and what EEBL has in common with it."""
    ima: ImaSettings = ImaSettings()
    """Intersection movement assist."""
    least_speed_m_s: float = Field(2.0, ge=0.0, le=20.0)
    """Below this host speed there are no FCW and no EEBL."""
