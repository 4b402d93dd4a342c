"""Vulnerable road users by VAMs: the same values that BSMs give of vehicles.

So all that is known of a BSM's sender is checked of theirs, and FCW sees them where it sees
vehicles.
"""

from collections.abc import Mapping

from onboard.errors import DecodeError
from onboard.its_g5.awareness import ELLIPSE_SIGMAS, PERIOD_MS
from onboard.its_g5.its_timestamp import nearest_utc_s
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import AccelerationSet, CoreData, PositionalAccuracy, VehicleSize
from onboard.messages.psm_as_bsm import BICYCLE, PERSON
from onboard.messages.vam import Vam

PEDESTRIAN, CYCLIST, MOPED, MOTORCYCLE = 1, 2, 3, 4
"""Station types (TS 102 894-2) of which VAMs are."""
_SIZES: Mapping[int, VehicleSize] = {
    0: PERSON,
    PEDESTRIAN: PERSON,
    CYCLIST: BICYCLE,
    MOPED: BICYCLE,
    MOTORCYCLE: VehicleSize(width_m=0.8, length_m=2.2),
}


def bsm_of_vam(message: Vam, utc_s: float) -> BasicSafetyMessage:
    """Return the BSM that says what a VAM says, received at `utc_s`, seconds since 1970.

    Raises:
        DecodeError: `not_a_road_user` from a vehicle.
    """
    parameters = message.parameters
    basic, motion = parameters.basic, parameters.motion
    size = _SIZES.get(basic.station_type)
    if size is None:
        raise DecodeError("not_a_road_user", f"station type {basic.station_type}")
    position, ellipse = basic.position, basic.position.ellipse
    generated_s = nearest_utc_s(round(message.generation_delta_time_s * 1e3), PERIOD_MS, utc_s)
    return BasicSafetyMessage(
        CoreData(
            msg_cnt=0,
            temporary_id=message.station_id,
            sec_mark_s=round(generated_s * 1e3) % 60_000 / 1e3,
            latitude_deg=position.latitude_deg,
            longitude_deg=position.longitude_deg,
            elevation_m=position.altitude.altitude_m,
            accuracy=PositionalAccuracy(
                _sigma(ellipse.semi_major_m), _sigma(ellipse.semi_minor_m), ellipse.orientation_rad
            ),
            speed_m_s=motion.speed.speed_m_s,
            heading_rad=motion.heading.heading_rad,
            acceleration=AccelerationSet(longitudinal_m_s2=motion.acceleration.acceleration_m_s2),
            size=size,
        )
    )


def _sigma(axis_m: float | None) -> float | None:
    return None if axis_m is None else axis_m / ELLIPSE_SIGMAS
