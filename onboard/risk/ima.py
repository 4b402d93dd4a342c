"""IMA: intersection movement assist, by the collision probability P_C of crossing paths."""

from collections.abc import Sequence

from onboard.mvs.perceived_object import PerceivedObject
from onboard.risk.alarm import NOTHING, Assessment, Level, object_reason
from onboard.risk.bsm_data import BsmDataStore
from onboard.risk.mean_collision_probability import DrivenVehicle, mean_collision_probabilities
from onboard.risk.path_crossing import CovarianceError, PathCrossing, path_crossing
from onboard.risk.settings import ImaSettings
from onboard.risk.vehicle_motion import VehicleMotion

MAX_AGE_S = 1.0
"""Older data raise no alarm."""
TREND_WINDOW_S = 0.8
"""Window over which the acceleration of a vehicle is estimated that does not report it."""


class IntersectionMovementAssist:
    """Assesses all perceived objects whose path crosses the host vehicle's."""

    def __init__(self, settings: ImaSettings, length_m: float, width_m: float) -> None:
        """Start without motions.

        Args:
            settings: the thresholds.
            length_m: of the host vehicle.
            width_m: of the host vehicle.
        """
        self._settings = settings
        self._own_size_m = length_m, width_m
        self._motions: dict[str, VehicleMotion] = {}

    def follow(self, objects: Sequence[PerceivedObject], now: float) -> None:
        """Take the velocities of all objects, the host vehicle included."""
        self._motions = {
            each.name: self._motions.get(each.name) or VehicleMotion(TREND_WINDOW_S)
            for each in objects
        }
        for each in objects:
            _, _, east_m_s, north_m_s = each.state
            self._motions[each.name].receive(now, east_m_s, north_m_s)

    def assess(
        self, own: PerceivedObject, others: Sequence[PerceivedObject], data: BsmDataStore
    ) -> tuple[Assessment, list[tuple[str, CovarianceError]]]:
        """Assess objects that were given to `follow`; the one with the highest P_C counts.

        Args:
            own: the host vehicle.
            others: the perceived objects.
            data: of their BSMs.

        Returns:
            the assessment, and names of objects whose covariance is invalid, with the error.
        """
        found: list[tuple[PerceivedObject, PathCrossing]] = []
        invalid: list[tuple[str, CovarianceError]] = []
        for each in others:
            if each.age_s > MAX_AGE_S:
                continue
            try:
                crossing = path_crossing(own, each)
            except CovarianceError as error:
                invalid.append((each.name, error))
                continue
            if crossing is not None and not _is_bridge(each, crossing, data):
                found.append((each, crossing))
        p_c = mean_collision_probabilities(
            [crossing for _, crossing in found],
            [self._driven(each, data.size_m(each.name)) for each, _ in found],
            self._driven(own, self._own_size_m),
        )
        assessed = [
            self._assessment(each, float(p), own) for (each, _), p in zip(found, p_c, strict=True)
        ]
        worst = max(assessed, key=lambda each: (each.level.rank, each.value), default=NOTHING)
        return worst, invalid

    def _assessment(self, other: PerceivedObject, p_c: float, own: PerceivedObject) -> Assessment:
        if p_c >= self._settings.warning_p_c:
            return Assessment(Level.WARNING, p_c, (object_reason(other, own),))
        if p_c >= self._settings.caution_p_c:
            return Assessment(Level.CAUTION, p_c, (object_reason(other, own),))
        return Assessment(Level.NONE, p_c, ())

    def _driven(self, each: PerceivedObject, size_m: tuple[float, float]) -> DrivenVehicle:
        """Return size and accelerations; the reported acceleration comes before the estimate."""
        motion = self._motions[each.name]
        reported_m_s2 = each.acceleration_m_s2
        return DrivenVehicle(
            *size_m,
            motion.acceleration_m_s2 if reported_m_s2 is None else reported_m_s2,
            motion.lateral_m_s2,
        )


def _is_bridge(other: PerceivedObject, crossing: PathCrossing, data: BsmDataStore) -> bool:
    distance_m = abs(float(crossing.mean[0])) + abs(float(crossing.mean[2]))
    return data.is_on_another_level(other.name, distance_m)
