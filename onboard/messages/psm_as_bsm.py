"""Vulnerable road users by PSMs: the same values that BSMs give of vehicles.

Their sizes, which few state, are ours: those of an adult, and of a bicycle.
"""

from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData, VehicleSize
from onboard.messages.psm import PersonalDeviceUser, PersonalSafetyMessage

PERSON = VehicleSize(width_m=0.6, length_m=0.6)
BICYCLE = VehicleSize(width_m=0.7, length_m=1.8)


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
