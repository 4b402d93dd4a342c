"""Messages of pedestrians with a radio: VAMs and PSMs."""

from onboard.its_g5.awareness import ELLIPSE_SIGMAS, PERIOD_MS
from onboard.its_g5.its_timestamp import timestamp_ms
from onboard.its_g5.road_users import PEDESTRIAN
from onboard.messages.bsm_core import PositionalAccuracy
from onboard.messages.cam import Acceleration, BasicContainer
from onboard.messages.its_common import (
    ConfidenceEllipse,
    ReferencePosition,
    ReportedHeading,
    ReportedSpeed,
)
from onboard.messages.map_data import ReferencePoint
from onboard.messages.psm import PersonalDeviceUser, PersonalSafetyMessage
from onboard.messages.vam import MOTION_PRESENT, Vam, VruMotion, VruParameters

PERSON_SIGMA_M = 0.5
"""That they state of their position."""


def a_vam(
    station_id: bytes,
    place_deg: tuple[float, float],
    utc_s: float,
    *,
    speed_m_s: float = 0.0,
    heading_rad: float = 0.0,
) -> Vam:
    """Return the VAM of a pedestrian at a latitude and longitude, clockwise from north."""
    ellipse = ConfidenceEllipse(PERSON_SIGMA_M * ELLIPSE_SIGMAS, PERSON_SIGMA_M * ELLIPSE_SIGMAS)
    return Vam(
        station_id,
        timestamp_ms(utc_s) % PERIOD_MS / 1e3,
        VruParameters(
            has_additions=False,
            present=MOTION_PRESENT,
            basic=BasicContainer(PEDESTRIAN, ReferencePosition(*place_deg, ellipse)),
            motion=VruMotion(
                has_additions=False,
                present=0,
                heading=ReportedHeading(heading_rad),
                speed=ReportedSpeed(speed_m_s),
                acceleration=Acceleration(0.0),
            ),
        ),
    )


def a_psm(
    temporary_id: bytes,
    place_deg: tuple[float, float],
    utc_s: float,
    msg_cnt: int,
    *,
    speed_m_s: float = 0.0,
    heading_rad: float = 0.0,
) -> PersonalSafetyMessage:
    """Return the PSM of a pedestrian, as `a_vam`."""
    return PersonalSafetyMessage(
        has_additions=False,
        present=0,
        basic_type=PersonalDeviceUser.PEDESTRIAN,
        sec_mark_s=round(utc_s * 1e3) % 60_000 / 1e3,
        msg_cnt=msg_cnt,
        temporary_id=temporary_id,
        position=ReferencePoint(*place_deg),
        accuracy=PositionalAccuracy(PERSON_SIGMA_M, PERSON_SIGMA_M),
        speed_m_s=speed_m_s,
        heading_rad=heading_rad,
    )
