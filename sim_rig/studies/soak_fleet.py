"""Two cars in a row, among strangers that come and go, for as long as one likes, in little time.

Everything is unsigned, and the air loses nothing: what is looked at is what the cores keep.
"""

import os
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import numpy as np

from onboard import psid
from onboard.config import CarConfig
from onboard.messages import bsm
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData
from onboard.observations import Lead, LeadIdentity, Position, Sensor, Speed, VehicleDetection
from onboard.security import ieee1609dot2
from onboard.settings import parse_settings
from onboard.stack import Stack
from onboard.wave_udp import wsmp
from onboard.wave_udp.wsmp import WaveShortMessage
from sim_rig.scenario.car_config import DIGEST

STEP_S = 0.2
STRANGERS = 12
STRANGER_STAYS_S = 60.0
SPEED_M_S = 15.0
OTHER_LEAD_EVERY_S = 45.0
"""So often somebody else drives ahead of the first car for a while."""
START_UTC_S = 1_750_000_000.0
_LATITUDE_DEG, _LONGITUDE_DEG = 25.0, 121.5
_DEGREE_M = 111_320.0


@dataclass(slots=True)
class _Stranger:
    temporary_id: bytes
    offset_m: float
    leaves_at: float
    messages: int = 0


class Fleet:
    """The cars and their surroundings."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._now = 0.0
        self._strangers: list[_Stranger] = []
        self._numbers = count(1)
        self.strangers_met = 0
        self.messages = 0
        """That each car has received from strangers."""
        sensors = (Sensor.SPEED, Sensor.CAMERA, Sensor.POSITION)
        self._cars = {
            plate: Stack(_config(plate), sensors, child, now=0.0, utc_s=START_UTC_S)
            for plate, child in zip(("AA1", "BB2"), rng.spawn(2), strict=True)
        }

    def drive(self, duration_s: float) -> None:
        """Go on for so long."""
        for _ in range(round(duration_s / STEP_S)):
            self._see()
            self._hear_strangers()
            end = self._now + STEP_S
            self._settle()
            while (at := min(car.get_timer() for car in self._cars.values())) < end:
                self._now = max(at, self._now + 1e-4)
                self._settle()
            self._now = end

    def _see(self) -> None:
        now = self._now
        ahead: str | None = None
        for number, (plate, car) in enumerate(self._cars.items()):
            place = _place(now, SPEED_M_S * now - 16.5 * number)
            car.receive_observation(Speed(now, SPEED_M_S, 0.28, "obd:7E8"), now)
            car.receive_observation(place, now)
            if ahead is None and now % (2 * OTHER_LEAD_EVERY_S) < OTHER_LEAD_EVERY_S:
                lead = Lead(now, LeadIdentity.NO_LEAD)
            else:
                text = ahead or f"X{int(now / OTHER_LEAD_EVERY_S)}"
                lead = Lead(now, LeadIdentity.KNOWN, text, 12.0, 0.4, 0.0, 0.5)
            car.receive_observation(lead, now)
            track = int(now / STRANGER_STAYS_S)
            car.receive_observation(VehicleDetection(now, track, 30.0, 1.0, 0.2, 0.01), now)
            ahead = plate

    def _hear_strangers(self) -> None:
        now = self._now
        self._strangers = [each for each in self._strangers if each.leaves_at > now]
        while len(self._strangers) < STRANGERS:
            stays_s = STRANGER_STAYS_S * float(self._rng.uniform(0.5, 1.5))
            identity = next(self._numbers).to_bytes(4)
            offset_m = float(self._rng.uniform(-200.0, 200.0))
            self._strangers.append(_Stranger(identity, offset_m, now + stays_s))
            self.strangers_met += 1
        for stranger in self._strangers:
            stranger.messages += 1
            wsm = _bsm_of(stranger, _place(now, SPEED_M_S * now + stranger.offset_m), now)
            self.messages += 1
            for car in self._cars.values():
                car.receive_wsm(wsm, now)

    def _settle(self) -> None:
        cars = self._cars.values()
        for car in cars:
            if car.get_timer() <= self._now:
                car.handle_timer(self._now)
            car.can_to_send(self._now)
        on_air = [(car, wsm) for car in cars for _, wsm in car.wsms_to_send(self._now)]
        for sender, wsm in on_air:
            for car in cars:
                if car is not sender:
                    car.receive_wsm(wsm, self._now)
        for car in cars:
            while car.next_event() is not None:
                pass


def resident_bytes() -> int:
    """What this process has in memory now."""
    pages = int(Path("/proc/self/statm").read_text("ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def _config(plate: str) -> CarConfig:
    return parse_settings(
        {"car": {"plate": plate}, "security": {"plate_digest": DIGEST}}, CarConfig, plate
    )


def _place(now: float, east_m: float) -> Position:
    """On a road that leads east."""
    longitude_deg = _LONGITUDE_DEG + east_m / _DEGREE_M / np.cos(np.radians(_LATITUDE_DEG))
    return Position(now, _LATITUDE_DEG, float(longitude_deg), 10.0, 1.5, SPEED_M_S, np.pi / 2)


def _bsm_of(stranger: _Stranger, place: Position, now: float) -> bytes:
    core = CoreData(
        stranger.messages % 128,
        stranger.temporary_id,
        sec_mark_s=(now + START_UTC_S) % 60.0,
        latitude_deg=place.latitude_deg,
        longitude_deg=place.longitude_deg,
        speed_m_s=SPEED_M_S,
        heading_rad=float(np.pi / 2),
    )
    data = ieee1609dot2.encode_unsecured(bsm.encode(BasicSafetyMessage(core)))
    return wsmp.encode(WaveShortMessage(psid=psid.BSM, payload=data))
