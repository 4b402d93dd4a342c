"""Sensors of the cars in the MVS studies, by name: the rig's detectors, and invented ones."""

from collections.abc import Mapping
from typing import Annotated

from sim_rig.scenario.sensor_settings import (
    SENSOR_PROFILES,
    LensSettings,
    VehicleCameraSettings,
)
from sim_rig.scenario.setting_types import by_name
from sim_rig.studies.mvs.world_settings import WorldSettings


def _of_detector(detector: VehicleCameraSettings) -> WorldSettings:
    return WorldSettings(
        sensing_range_m=detector.sight_m,
        view_deg=detector.view_deg,
        rear_only=detector.rear_only,
        detection=1.0 - detector.misses,
        range_sigma_m=detector.range_sigma_m,
        range_sigma_per_m=detector.range_sigma,
        bearing_sigma_rad=detector.bearing_sigma_rad,
        range_rate_sigma_m_s=detector.range_rate_sigma_m_s,
    )


_DETECTORS = {name: _of_detector(detector) for name, detector in SENSOR_PROFILES.items()}
_READS_PLATES = {"plate_lens": LensSettings()}


WORLD_PROFILES: Mapping[str, WorldSettings] = {
    "paper": WorldSettings(sensing_range_m=150.0, detection=1.0),
    "all-round-60": WorldSettings(),
    "all-round-120": WorldSettings(sensing_range_m=120.0),
    **_DETECTORS,
    "plate-camera": _DETECTORS["plate-camera"].model_copy(update=_READS_PLATES),
}
"""`paper` and `all-round-...` are invented: the paper states neither range nor field of view. The
others are the rig's detectors, at ten detections a second; `plate-camera` is the one that ships:
only with its lens, which reads plates, do cars run LCCA."""

WorldProfile = Annotated[WorldSettings, by_name("profile of sensors", WORLD_PROFILES)]
"""Settings of a world, or the name of a profile."""
