"""How many warned drivers still hit a standing vehicle, by speed: what FCW's thresholds cost.

Drivers react and brake as in the studies. The warning is given where FCW first gives it, with exact
data. A warning is late for a driver who hits the vehicle in spite of it; one cost of lateness
against a nuisance would warn at the same share of late warnings at all speeds. So the time to
collision of such a warning stands beside the present one.
"""

from collections.abc import Iterator

import numpy as np

from bench import Figure
from onboard.risk.alarm import Level
from onboard.risk.fcw import fcw_level
from onboard.risk.settings import FcwSettings
from sim_rig.roads.driver import ReactionSettings

DRIVERS = 100_000
SPEEDS_M_S = (5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0)
LATE = 0.05
"""Share of late warnings that is compared at all speeds."""
FARTHEST_M, STEP_M = 300.0, 0.1


def measure() -> Iterator[Figure]:
    """Yield for each speed the share of late warnings, and the TTC at which it would be `LATE`."""
    reactions, rng = ReactionSettings(), np.random.default_rng(1)
    median_s, sigma = reactions.warned_median_s, reactions.warned_sigma
    reacts_s = median_s * np.exp(rng.normal(0.0, sigma, DRIVERS))
    braking_m_s2 = rng.uniform(*reactions.braking_m_s2, DRIVERS)
    for speed_m_s in SPEEDS_M_S:
        stops_m = speed_m_s * reacts_s + speed_m_s**2 / (2.0 * braking_m_s2)
        caution_m, warning_m = (
            _gap_m(level, speed_m_s) for level in (Level.CAUTION, Level.WARNING)
        )
        after_caution, after_warning = (
            float(np.mean(stops_m > gap_m)) for gap_m in (caution_m, warning_m)
        )
        name, limit = f"late_warnings.{speed_m_s:g}m_s", "at the caution"
        yield Figure(f"{name}.late", after_warning, "share", DRIVERS, limit, after_caution)
        even_s = float(np.quantile(stops_m, 1.0 - LATE)) / speed_m_s
        limit = "the present TTC at the warning"
        yield Figure(f"{name}.ttc_even", even_s, "s", DRIVERS, limit, warning_m / speed_m_s)


def _gap_m(level: Level, speed_m_s: float) -> float:
    """The farthest gap to a standing vehicle at which this level is shown."""
    settings = FcwSettings()
    gaps_m = (step * STEP_M for step in range(round(FARTHEST_M / STEP_M), 0, -1))
    return next(
        gap_m
        for gap_m in gaps_m
        if fcw_level(gap_m, speed_m_s, speed_m_s, 0.0, None, settings=settings)[0].rank
        >= level.rank
    )
