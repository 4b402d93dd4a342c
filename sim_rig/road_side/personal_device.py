"""The device of a pedestrian who walks in a scenario."""

from collections.abc import Callable, Iterator

from typing_extensions import override

from onboard.its_g5.road_users import PEDESTRIAN
from onboard.messages import psm, vam
from onboard.messages.message_frame import MESSAGE_COUNTS
from onboard.security.security_services import SecurityServices
from onboard.wave_udp import psid
from onboard.wave_udp.settings import RadioProfile
from sim_rig.radio.air import Air
from sim_rig.road_side.person_messages import a_psm, a_vam
from sim_rig.road_side.sending_station import SendingStation
from sim_rig.roads.breakpoints import BreakpointDrive
from sim_rig.roads.earth import to_degrees


class PersonalDevice(SendingStation):
    """Sends where the pedestrian is, by PSMs or VAMs, ten a second: T_GenVamMin (TS 103 300-3)."""

    user_priority = 3
    station_type = PEDESTRIAN

    def __init__(
        self,
        air: Air,
        name: str,
        profile: RadioProfile,
        at_s: Callable[[float], float],
        security: SecurityServices,
        *,
        now: float,
        walk: BreakpointDrive,
    ) -> None:
        """Start the device of who walks `walk`; for the other arguments see `SendingStation`."""
        super().__init__(air, name, profile, at_s, security, now=now)
        self._walk = walk
        self._temporary_id = name.encode()[:4].ljust(4, b"-")
        self._msg_cnt = 0

    @override
    def messages_to_send(self, now: float) -> Iterator[tuple[int, bytes]]:
        here, utc_s = self._walk.state(self._at_s(now)), now + self._security.utc_offset_s
        place_deg = to_degrees(here.x_m, here.y_m)
        motion = {"speed_m_s": here.speed_m_s, "heading_rad": here.heading_rad}
        if self._is_its:
            yield psid.VAM, vam.encode(a_vam(self._temporary_id, place_deg, utc_s, **motion))
            return
        self._msg_cnt = (self._msg_cnt + 1) % MESSAGE_COUNTS
        message = a_psm(self._temporary_id, place_deg, utc_s, self._msg_cnt, **motion)
        yield psid.PSM, psm.encode(message)
