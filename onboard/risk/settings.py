"""When to warn: every threshold, with where it comes from."""

from pydantic import Field

from onboard.settings import Settings


class FcwSettings(Settings):
    """The car ahead that the camera sees."""

    reaction_s: float = Field(1.0, ge=0.0, le=3.0)
    """Before which no driver brakes."""
    caution_m_s2: float = Field(3.5, gt=0.0, le=12.0)
    """Braking needed after the reaction."""
    warning_m_s2: float = Field(5.0, gt=0.0, le=12.0)
    """As above: about half of what a dry road gives."""
    caution_ttc_s: float = Field(3.2, gt=0.0, le=10.0)
    """Time to collision at present speeds."""
    warning_ttc_s: float = Field(2.6, gt=0.0, le=10.0)
    """As above; NHTSA's confirmation test asks for 2.0 s, 2.1 s or 2.4 s, by its case."""
    lead_window_s: float = Field(0.6, gt=0.0, le=3.0)
    """Over which the braking of the car ahead is estimated."""
    lead_deadband_m_s2: float = Field(1.5, ge=0.0, le=5.0)
    """Estimates below this may be noise, and count as none."""
    settled_sigma_m_s: float = Field(1.5, gt=0.0, le=10.0)
    """Of the closing speed of a car that has been in view for a while, at most."""
    confirm_s: float = Field(0.04, ge=0.0, le=1.0)
    """How long it must be so: one odd frame warns nobody."""
    lead_held_s: float = Field(0.5, gt=0.0, le=2.0)
    """How long a sight of the car ahead is good for."""


class EeblSettings(Settings):
    """A car ahead on our path whose BSM says that it brakes hard (EEBL)."""

    range_m: float = Field(150.0, gt=0.0, le=500.0)
    beside_m: float = Field(2.0, gt=0.0, le=10.0)
    """Farther to the side it is in another lane."""
    heading_rad: float = Field(0.5, gt=0.0, le=1.5)
    """Another heading is another road."""
    held_s: float = Field(1.0, gt=0.0, le=5.0)
    """How long a flag is good for."""
    assumed_m_s2: float = Field(4.0, gt=0.0, le=12.0)
    """What the flag stands for: more than 0.4 g (SAE J2735). A car that says more is believed."""


class ImaSettings(Settings):
    """Crossing paths, by the collision probability P_C."""

    caution_p_c: float = Field(0.30, gt=0.0, le=1.0)
    """99 in 100 approaches without a crash stay below it (docs/risk.md)."""
    warning_p_c: float = Field(0.45, gt=0.0, le=1.0)
    """Above what any approach without a crash has reached (docs/risk.md)."""
    oldest_s: float = Field(1.0, gt=0.0, le=5.0)
    """Older data raise nothing."""
    trend_s: float = Field(0.8, gt=0.0, le=3.0)
    """Over which the acceleration of a car is estimated that does not say it."""
    range_m: float = Field(120.0, gt=0.0, le=500.0)
    """Of either car from where the paths meet."""
    least_angle_rad: float = Field(0.35, gt=0.09, lt=1.57)
    """Between the courses; below it paths are taken for parallel."""
    least_speed_m_s: float = Field(1.0, gt=0.0, le=10.0)
    """A slower car has no course."""
    course_sigma_rad: float = Field(0.35, gt=0.0, le=1.0)
    """A car whose course is less certain is not judged: it was just seen, and its speed settles."""
    settled_sigma_m_s: float = Field(1.5, gt=0.0, le=10.0)
    """Of a settled velocity, on any axis. Above it, two cars may have been taken for a fast one."""
    settled_after_s: float = Field(1.0, gt=0.0, le=10.0)
    """After this time a velocity counts as settled all the same: what is left of its sigma is
    mostly the error of the own position, which all pictures share."""
    hardest_braking_m_s2: float = Field(9.55, gt=0.0, le=15.0)
    """Table I."""
    acceleration_m_s2: float = Field(2.1, gt=0.0, le=10.0)
    """Table I."""
    stopping_m_s2: float = Field(3.0, gt=0.0, le=9.0)
    """A driver who would need more than this to stop short of the other's way, and does not brake,
    is taken to drive on. Drivers who stop brake less (signals are timed for 10 ft/s^2)."""
    reaction_s: float = Field(1.0, ge=0.0, le=3.0)
    """Until the own driver, who is to be warned, would brake, or another who still accelerates."""
    gaining_m_s2: float = Field(1.0, ge=0.0, le=5.0)
    """A driver who accelerates by more does not mean to stop yet."""
    driving_on_m_s2: float = Field(1.0, gt=0.0, le=5.0)
    """A driver who drives on keeps the present acceleration, or none, give or take this."""
    straight_m_s2: float = Field(1.0, gt=0.0, le=10.0)
    """A car with more sideways is in a bend, and will not be where its present course leads."""
    top_speed_m_s: float = Field(70.0, gt=0.0, le=150.0)
    other_level_m: float = Field(3.5, gt=0.0, le=20.0)
    """A car so much higher or lower is on a bridge over our road, or under it."""
    slope: float = Field(0.02, ge=0.0, le=0.2)
    """Added to that for each metre that both have still to go."""


class RiskSettings(Settings):
    """All causes of an alarm."""

    fcw: FcwSettings = FcwSettings()
    eebl: EeblSettings = EeblSettings()
    ima: ImaSettings = ImaSettings()
    least_speed_m_s: float = Field(2.0, ge=0.0, le=20.0)
    """Below it, the own car gets no alarm but the group's warnings."""
    speed_held_s: float = Field(1.0, gt=0.0, le=5.0)
    """How long a sample of the own speed is good for."""
    release_s: float = Field(1.0, gt=0.0, le=10.0)
    """How long a lower level must last before an alarm goes down to it."""
    group_warning_s: float = Field(3.0, gt=0.0, le=10.0)
    """How long a warning from the group is shown."""
    other_length_m: float = Field(5.0, gt=0.0, le=30.0)
    """Of a car that does not say it."""
    other_width_m: float = Field(1.75, gt=0.0, le=5.0)
    """As above."""
