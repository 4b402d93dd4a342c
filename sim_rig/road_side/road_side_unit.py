"""The road-side unit of a scenario's crossing."""

from collections.abc import Callable, Iterator

from typing_extensions import override

from onboard.its_g5.infrastructure import encode_map, encode_spat
from onboard.messages import map_data, spat
from onboard.messages.its_common import ROAD_SIDE_UNIT
from onboard.security.security_services import SecurityServices
from onboard.wave_udp import psid
from sim_rig.radio.air import Air
from sim_rig.road_side.sending_station import SendingStation
from sim_rig.road_side.signal_messages import map_message, spat_message
from sim_rig.roads.road import CarState
from sim_rig.scenario.schema import Scenario
from sim_rig.scenario.signal_settings import SignalSettings

NAME = "road_side_unit"
"""Its name on the channel and in certificates."""
MAPS_EVERY = 10
"""SPAT messages between two MAP messages: one a second (CTI 4501)."""
STATION_ID = b"unit"
"""Of its messages with ITS-G5."""
_MAST_M = 0.5
"""Width of its mast, which shadows no signal."""


class RoadSideUnit(SendingStation):
    """Sends SPAT and MAP messages, or SPATEM and MAPEM."""

    user_priority = 5
    station_type = ROAD_SIDE_UNIT

    def __init__(
        self,
        air: Air,
        scenario: Scenario,
        settings: SignalSettings,
        at_s: Callable[[float], float],
        security: SecurityServices,
        *,
        now: float,
    ) -> None:
        """Start the unit of the crossing with `settings`; for the rest see `SendingStation`."""
        super().__init__(air, NAME, scenario.profile, at_s, security, now=now)
        self._settings = settings
        self._map = map_message(scenario, settings)
        self._sent = 0

    @override
    def messages_to_send(self, now: float) -> Iterator[tuple[int, bytes]]:
        if self._sent % MAPS_EVERY == 0:
            if self._is_its:
                yield psid.MAPEM, encode_map(self._map, STATION_ID)
            else:
                yield psid.MAP, map_data.encode(self._map)
        self._sent += 1
        utc_s = now + self._security.utc_offset_s
        message = spat_message(self._settings, self._at_s(now), utc_s)
        if self._is_its:
            yield psid.SPATEM, encode_spat(message, STATION_ID)
        else:
            yield psid.SPAT, spat.encode(message)


def mast(settings: SignalSettings) -> CarState:
    """Return where the unit is, for the channel."""
    x_m, y_m = settings.place_m
    return CarState(x_m, y_m, 0.0, 0.0, 0.0, 0.0, 0.0, _MAST_M, _MAST_M, 0.0)
