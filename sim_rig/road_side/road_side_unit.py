"""The road-side unit of a scenario's crossing, on the radio channel of the cars."""

from collections.abc import Callable, Mapping

import numpy as np

from onboard.its_g5.infrastructure import encode_map, encode_spat
from onboard.messages import map_data, spat
from onboard.messages.its_common import ROAD_SIDE_UNIT
from onboard.security.credentials import Credentials
from onboard.security.security_services import SecurityServices
from onboard.vehicle.framing import RadioFraming, WaveFraming
from onboard.vehicle.its_g5_framing import ItsG5Framing
from onboard.wave_udp import psid
from onboard.wave_udp.settings import RadioProfile
from sim_rig.radio.air import Air, CarsAt, Delivery
from sim_rig.radio.models import open_air
from sim_rig.road_side.signal_messages import map_message, spat_message
from sim_rig.roads.road import CarState
from sim_rig.scenario.schema import Scenario
from sim_rig.scenario.signal_settings import SignalSettings

NAME = "road_side_unit"
"""Its name on the channel and in certificates."""
SPAT_INTERVAL_S = 0.1
MAPS_EVERY = 10
"""SPAT messages between two MAP messages: one a second (CTI 4501)."""
USER_PRIORITY = 5
"""Of both messages."""
STATION_ID = b"unit"
"""Of its messages with ITS-G5."""
_MAST_M = 0.5
"""Width of its mast, which shadows no signal."""


def road_side_units(scenario: Scenario) -> list[str]:
    """Names of the stations beside the cars: the unit's, if the crossing has signals."""
    return [] if scenario.signal is None else [NAME]


def open_channel(
    scenario: Scenario,
    cars_at: CarsAt,
    at_s: Callable[[float], float],
    rng: np.random.Generator,
    *,
    now: float,
    utc_s: float,
    credentials: Mapping[str, Credentials],
) -> Air:
    """Return the radio channel of a scenario's cars, and of its road-side unit if it has one.

    Args:
        scenario: the scenario of the run.
        cars_at: states of all cars at a `now`.
        at_s: time since the start of the scenario at a `now`, s.
        rng: source of all random effects.
        now: monotonic time, s.
        utc_s: UTC at `now`, s.
        credentials: by name of the station; a unit without any sends unsigned messages.
    """
    settings = scenario.signal
    if settings is None:
        return open_air(scenario.radio, cars_at, scenario.equipped, rng)
    x_m, y_m = settings.place_m
    mast = CarState(x_m, y_m, 0.0, 0.0, 0.0, 0.0, 0.0, _MAST_M, _MAST_M, 0.0)
    stations = [*scenario.equipped, NAME]
    air = open_air(scenario.radio, lambda at: {**cars_at(at), NAME: mast}, stations, rng)
    security = SecurityServices(utc_s - now, credentials.get(NAME))
    return RoadSideUnit(air, scenario, settings, at_s, security, now=now)


class RoadSideUnit:
    """Adds the messages of the unit to another `Air`."""

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
        """Start the unit.

        Args:
            air: the channel, of which the unit is a station.
            scenario: the scenario of the run.
            settings: its crossing.
            at_s: time since the start of the scenario at a `now`, s.
            security: signs its messages.
            now: monotonic time, s.
        """
        self._air = air
        self._settings = settings
        self._at_s = at_s
        self._security = security
        self._is_its = scenario.profile is RadioProfile.ITS_G5
        self._framing: RadioFraming = (
            ItsG5Framing(psid.LCCA, lambda: None, ROAD_SIDE_UNIT) if self._is_its else WaveFraming()
        )
        self._map = map_message(scenario, settings)
        self._due_at = now
        self._sent = 0

    def receive_wsm(self, sender: str, wsm: bytes, user_priority: int, now: float) -> None:
        """Transmit a frame of a car.

        Args:
            sender: name of the car.
            wsm: the frame.
            user_priority: its user priority.
            now: monotonic time, s.
        """
        self._air.receive_wsm(sender, wsm, user_priority, now)

    def wsms_to_deliver(self, now: float) -> list[Delivery]:
        """Return the copies that have arrived at cars by `now`, after sending what is due."""
        if self._due_at <= now:
            late_s = now - self._due_at
            # What a late rig has missed is not sent: it would be stale.
            self._due_at += SPAT_INTERVAL_S * (1 + late_s // SPAT_INTERVAL_S)
            if self._sent % MAPS_EVERY == 0:
                if self._is_its:
                    self._send(encode_map(self._map, STATION_ID), psid.MAPEM, now)
                else:
                    self._send(map_data.encode(self._map), psid.MAP, now)
            self._sent += 1
            utc_s = now + self._security.utc_offset_s
            message = spat_message(self._settings, self._at_s(now), utc_s)
            if self._is_its:
                self._send(encode_spat(message, STATION_ID), psid.SPATEM, now)
            else:
                self._send(spat.encode(message), psid.SPAT, now)
        return [each for each in self._air.wsms_to_deliver(now) if each.receiver != NAME]

    def get_timer(self) -> float:
        """Return when the next copy arrives or the next message is due."""
        return min(self._due_at, self._air.get_timer())

    def _send(self, payload: bytes, service: int, now: float) -> None:
        utc_s = self._security.utc_s(now)
        signed_part = self._framing.signed_part(payload, service, USER_PRIORITY, now, utc_s)
        frame = self._framing.frame(service, self._security.secure(signed_part, service, now))
        self._air.receive_wsm(NAME, frame, USER_PRIORITY, now)
