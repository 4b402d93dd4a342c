"""Vulnerable road users by VAMs and PSMs: the same values that BSMs give of vehicles.

So all that is known of a BSM's sender is checked of theirs, and FCW sees them where it sees
vehicles. Their sizes, which few state, are ours: those of an adult, and of a bicycle.
"""

from collections.abc import Mapping

from onboard.errors import DecodeError
from onboard.its_g5.awareness import ELLIPSE_SIGMAS, PERIOD_MS
from onboard.its_g5.its_timestamp import nearest_utc_s
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import AccelerationSet, CoreData, PositionalAccuracy, VehicleSize
from onboard.messages.psm import PersonalDeviceUser, PersonalSafetyMessage
from onboard.messages.vam import Vam

PERSON = VehicleSize(width_m=0.6, length_m=0.6)
BICYCLE = VehicleSize(width_m=0.7, length_m=1.8)
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


def bsm_of_psm(message: PersonalSafetyMessage) -> BasicSafetyMessage:
    """Return the BSM that says what a PSM says."""
    is_cyclist = message.basic_type is PersonalDeviceUser.PEDAL_CYCLIST
    return BasicSafetyMessage(
        CoreData(
            msg_cnt=message.msg_cnt,
            temporary_id=message.temporary_id,
            sec_mark_s=message.sec_mark_s,
            latitude_deg=message.position.latitude_deg,
            longitude_deg=message.position.longitude_deg,
            elevation_m=message.position.elevation_m,
            accuracy=message.accuracy,
            speed_m_s=message.speed_m_s,
            heading_rad=message.heading_rad,
            size=BICYCLE if is_cyclist else PERSON,
        )
    )
