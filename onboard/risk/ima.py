"""IMA and LTA: intersection movement and left turn assist, by P_C of crossing paths."""

from collections.abc import Sequence

import numpy as np

from onboard.bsm_transmission.turn_signals import TurnSignals
from onboard.kinematics.heading import Heading
from onboard.messages.bsm_safety import ExteriorLights
from onboard.observations import Speed, TurnSignal
from onboard.risk.alarm import Assessment, Cause, Level, object_reason
from onboard.risk.bsm_data import BsmDataStore
from onboard.risk.expected_stop import RedLight, is_expected_to_stop
from onboard.risk.host_braking import HostBraking
from onboard.risk.left_turn import has_known_turn, left_turn_crossing, left_turn_radius_m
from onboard.risk.mean_collision_probability import (
    MAX_ACCELERATION_M_S2,
    DrivenVehicle,
    mean_collision_probabilities,
)
from onboard.risk.path_crossing import CovarianceError, PathCrossing, path_crossing
from onboard.risk.settings import ImaSettings
from onboard.risk.slow_vehicle import with_heading
from onboard.risk.vehicle_motion import VehicleMotion
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject

CROSSING_CAUSES = (Cause.IMA, Cause.LTA)
MAX_AGE_S = 1.0
"""Older data raise no alarm."""
KNOWN_FOR_S = 0.6
"""Longest interval of BSMs (SAE J2945/1). By older data another driver may have begun to brake, and
is not taken to drive on."""
HORIZON_S = 4.0
"""A vehicle that cannot be at the crossing by then, even if it accelerates, raises none yet."""
TREND_WINDOW_S = 0.8
"""Window over which the acceleration of a vehicle is estimated that does not report it."""
HOST_WINDOW_S = 0.5
"""The same of the host vehicle, by its speed: steps of 1 km/h are 0.2 m/s^2 over it."""


class IntersectionMovementAssist:
    """Assesses all perceived objects whose path crosses the host vehicle's."""

    def __init__(
        self, settings: ImaSettings, length_m: float, width_m: float, reaction_s: float
    ) -> None:
        """Start without motions.

        Args:
            settings: the thresholds.
            length_m: of the host vehicle.
            width_m: of the host vehicle.
            reaction_s: of its driver.
        """
        self._settings = settings
        self.reaction_s = reaction_s
        self._own_size_m = length_m, width_m
        self._motions: dict[str, VehicleMotion] = {}
        self._host = HostBraking(HOST_WINDOW_S)
        self._turn_signals = TurnSignals()

    def receive_speed(self, speed: Speed) -> None:
        """Take the host vehicle's speed."""
        self._host.receive_speed(speed)

    def receive_turn_signal(self, turn_signal: TurnSignal) -> None:
        """Take a turn signal of the host vehicle."""
        self._turn_signals.receive_turn_signal(turn_signal)

    def follow(self, objects: Sequence[PerceivedObject], now: float) -> None:
        """Take the velocities of all objects, the host vehicle included."""
        self._motions = {
            each.name: self._motions.get(each.name) or VehicleMotion(TREND_WINDOW_S)
            for each in objects
        }
        for each in objects:
            _, _, east_m_s, north_m_s = each.state
            self._motions[each.name].receive(now, now - each.age_s, east_m_s, north_m_s)

    def assess(
        self,
        own: PerceivedObject,
        others: Sequence[PerceivedObject],
        data: BsmDataStore,
        now: float,
        red_light_m: RedLight,
        *,
        heading: Heading | None,
    ) -> tuple[dict[Cause, list[Assessment]], list[tuple[str, CovarianceError]]]:
        """Assess objects that were given to `follow`.

        Args:
            own: the host vehicle.
            others: the perceived objects.
            data: of their BSMs.
            now: the time.
            red_light_m: finds the red signal of a vehicle; who is expected to stop there, crosses
                nobody's path.
            heading: of the host vehicle, kept at rest.

        Returns:
            assessments of those that may be met, by cause, and names of objects whose covariance is
            invalid, with the error.
        """
        found: list[tuple[PerceivedObject, PathCrossing, DrivenVehicle]] = []
        invalid: list[tuple[str, CovarianceError]] = []
        if is_expected_to_stop(own, self._own_size_m[0], red_light_m, self.reaction_s):
            return {}, invalid
        own = with_heading(own, heading)
        signals = self._turn_signals.lights(now) is ExteriorLights.LEFT_TURN_SIGNAL
        own_radius_m = self._left_turn_radius_m(own, signals=signals)
        for other in others:
            if other.age_s > MAX_AGE_S:
                continue
            each = with_heading(other, data.heading(other.name))
            signals = data.signals_left(other.name)
            radius_m = self._left_turn_radius_m(each, signals=signals)
            try:
                crossing = _crossing(own, each, own_radius_m, radius_m)
            except CovarianceError as error:
                invalid.append((each.name, error))
                continue
            if crossing is None or not _is_soon(crossing) or _is_bridge(each, crossing, data):
                continue
            if not is_expected_to_stop(each, data.size_m(each.name)[0], red_light_m):
                known_m_s2, size_m = each.acceleration_m_s2, data.size_m(each.name)
                driven = self._driven(each, size_m, known_m_s2, turns=radius_m is not None)
                found.append((each, crossing, driven))
        if not found:
            return {}, invalid
        p_c = mean_collision_probabilities(
            [crossing for _, crossing, _ in found],
            [driven for *_, driven in found],
            self._driven(
                own,
                self._own_size_m,
                self._host.acceleration_m_s2(now),
                turns=own_radius_m is not None,
            ),
            reaction_s=self.reaction_s,
        )
        assessed = [
            self._assessment(each, float(p), own) for (each, *_), p in zip(found, p_c, strict=True)
        ]
        cause = Cause.IMA if own_radius_m is None else Cause.LTA
        return {cause: assessed}, invalid

    def _left_turn_radius_m(self, each: PerceivedObject, *, signals: bool) -> float | None:
        if not has_known_turn(each):  # most of many objects end here
            return None
        lateral_m_s2 = self._motions[each.name].lateral_m_s2
        return left_turn_radius_m(each, lateral_m_s2, signals=signals)

    def _assessment(self, other: PerceivedObject, p_c: float, own: PerceivedObject) -> Assessment:
        level = Level.NONE
        if p_c >= self._settings.caution_p_c:
            level = Level.WARNING if p_c >= self._settings.warning_p_c else Level.CAUTION
        return Assessment(level, p_c, (object_reason(other, own),), other.name)

    def _driven(
        self,
        each: PerceivedObject,
        size_m: tuple[float, float],
        known_m_s2: float | None,
        *,
        turns: bool,
    ) -> DrivenVehicle:
        """Return size and accelerations; a known acceleration comes before the estimate."""
        motion = self._motions[each.name]
        lateral_m_s2 = 0.0 if turns else motion.lateral_m_s2  # the distance is along the turn
        if each.age_s > KNOWN_FOR_S and each.source is not ObjectSource.HOST:
            lateral_m_s2 = None
        along_m_s2 = motion.acceleration_m_s2 if known_m_s2 is None else known_m_s2
        return DrivenVehicle(*size_m, along_m_s2, lateral_m_s2)


def _crossing(
    own: PerceivedObject,
    other: PerceivedObject,
    own_radius_m: float | None,
    radius_m: float | None,
) -> PathCrossing | None:
    """Return where the paths cross, of which one may turn left; raises `CovarianceError`."""
    if own_radius_m is None and radius_m is None:
        return path_crossing(own, other)
    if own_radius_m is not None:
        return None if radius_m is not None else left_turn_crossing(own, other, own_radius_m)
    assert radius_m is not None  # noqa: S101 (one of both turns)
    crossing = left_turn_crossing(other, own, radius_m)
    return None if crossing is None else crossing.of_other()


def _is_soon(crossing: PathCrossing) -> bool:
    distances_m, speeds_m_s = crossing.mean[[0, 2]], crossing.mean[[1, 3]]
    soon_m = HORIZON_S * (speeds_m_s + MAX_ACCELERATION_M_S2 * HORIZON_S / 2.0)
    return bool(np.all(distances_m <= soon_m))


def _is_bridge(other: PerceivedObject, crossing: PathCrossing, data: BsmDataStore) -> bool:
    distance_m = abs(float(crossing.mean[0])) + abs(float(crossing.mean[2]))
    return data.is_on_another_level(other, distance_m)
