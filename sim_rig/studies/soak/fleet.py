"""Two cars in a row among remote vehicles that come and go, in virtual time.

Messages are unsigned, and none is lost: the study measures the memory that the cores keep.
"""

import os
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import numpy as np

from onboard.messages import bsm
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData
from onboard.observations import (
    Lead,
    LeadIdentity,
    PlateCandidate,
    Position,
    Sensor,
    Speed,
    VehicleDetection,
)
from onboard.security import ieee1609dot2
from onboard.settings import parse_settings
from onboard.step import Input, ReceivedWsm
from onboard.vehicle.config import CarConfig
from onboard.vehicle.stack import Stack
from onboard.wave_udp import psid, wsmp
from onboard.wave_udp.wsmp import WaveShortMessage
from sim_rig.scenario.car_config import DIGEST

STEP_S = 0.2
REMOTE_VEHICLES = 12
REMOTE_VEHICLE_STAYS_S = 60.0
SPEED_M_S = 15.0
LEAD_CHANGES_EVERY_S = 45.0
"""Another vehicle is the lead of the first car every other interval of this length."""
START_UTC_S = 1_750_000_000.0
_LATITUDE_DEG, _LONGITUDE_DEG = 25.0, 121.5
_DEGREE_M = 111_320.0


@dataclass(slots=True)
class _RemoteVehicle:
    temporary_id: bytes
    offset_m: float
    leaves_at: float
    messages: int = 0


class Fleet:
    """The two cars and the remote vehicles around them."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._now = 0.0
        self._remote_vehicles: list[_RemoteVehicle] = []
        self._numbers = count(1)
        self.remote_vehicles_met = 0
        self.messages = 0
        """Messages that each car has received from remote vehicles."""
        sensors = (Sensor.SPEED, Sensor.CAMERA, Sensor.POSITION)
        self._inputs: dict[str, list[Input]] = {"AA1": [], "BB2": []}
        """Of each car's next step."""
        self._cars = {
            plate: Stack(_config(plate), sensors, child, now=0.0, utc_s=START_UTC_S)
            for plate, child in zip(self._inputs, rng.spawn(2), strict=True)
        }

    def drive(self, duration_s: float) -> None:
        """Simulate for so long."""
        for _ in range(round(duration_s / STEP_S)):
            self._observe()
            self._receive_bsms()
            end = self._now + STEP_S
            self._step()
            while (at := min(car.get_timer() for car in self._cars.values())) < end:
                self._now = max(at, self._now + 1e-4)
                self._step()
            self._now = end

    def _observe(self) -> None:
        now = self._now
        ahead: str | None = None
        for number, plate in enumerate(self._cars):
            fix = _fix(now, SPEED_M_S * now - 16.5 * number)
            if ahead is None and now % (2 * LEAD_CHANGES_EVERY_S) < LEAD_CHANGES_EVERY_S:
                lead = Lead(now, LeadIdentity.NO_LEAD)
            else:
                text = ahead or f"X{int(now / LEAD_CHANGES_EVERY_S)}"
                lead = Lead(
                    now,
                    LeadIdentity.KNOWN,
                    text,
                    12.0,
                    0.4,
                    0.0,
                    0.5,
                    track_id=int(now / LEAD_CHANGES_EVERY_S),
                    candidates=(PlateCandidate(text, 0.98),),
                )
            track = int(now / REMOTE_VEHICLE_STAYS_S)
            detection = VehicleDetection(now, track, 30.0, 1.0, 0.2, 0.01)
            self._inputs[plate] += [Speed(now, SPEED_M_S, 0.28, "obd:7E8"), fix, lead, detection]
            ahead = plate

    def _receive_bsms(self) -> None:
        now = self._now
        self._remote_vehicles = [each for each in self._remote_vehicles if each.leaves_at > now]
        while len(self._remote_vehicles) < REMOTE_VEHICLES:
            stays_s = REMOTE_VEHICLE_STAYS_S * float(self._rng.uniform(0.5, 1.5))
            identity = next(self._numbers).to_bytes(4)
            offset_m = float(self._rng.uniform(-200.0, 200.0))
            self._remote_vehicles.append(_RemoteVehicle(identity, offset_m, now + stays_s))
            self.remote_vehicles_met += 1
        for remote in self._remote_vehicles:
            remote.messages += 1
            wsm = _bsm_of(remote, _fix(now, SPEED_M_S * now + remote.offset_m), now)
            self.messages += 1
            for inputs in self._inputs.values():
                inputs.append(ReceivedWsm(now, wsm))

    def _step(self) -> None:
        """Step the vehicles until none has inputs; what one sends is an input of the other."""
        self._step_all()
        while any(self._inputs.values()):
            self._step_all()

    def _step_all(self) -> None:
        for sender, car in self._cars.items():
            inputs, self._inputs[sender] = self._inputs[sender], []
            for sent in car.step(inputs, self._now).wsms:
                for plate, received in self._inputs.items():
                    if plate != sender:
                        received.append(ReceivedWsm(self._now, sent.data))


def resident_bytes() -> int:
    """Resident memory of this process."""
    pages = int(Path("/proc/self/statm").read_text("ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def _config(plate: str) -> CarConfig:
    return parse_settings(
        {"car": {"plate": plate}, "security": {"plate_digest": DIGEST}}, CarConfig, plate
    )


def _fix(now: float, east_m: float) -> Position:
    """A fix on a road that leads east."""
    longitude_deg = _LONGITUDE_DEG + east_m / _DEGREE_M / np.cos(np.radians(_LATITUDE_DEG))
    return Position(now, _LATITUDE_DEG, float(longitude_deg), 10.0, 1.5, SPEED_M_S, np.pi / 2)


def _bsm_of(remote: _RemoteVehicle, fix: Position, now: float) -> bytes:
    core = CoreData(
        remote.messages % 128,
        remote.temporary_id,
        sec_mark_s=(now + START_UTC_S) % 60.0,
        latitude_deg=fix.latitude_deg,
        longitude_deg=fix.longitude_deg,
        speed_m_s=SPEED_M_S,
        heading_rad=float(np.pi / 2),
    )
    data = ieee1609dot2.encode_unsecured(bsm.encode(BasicSafetyMessage(core)))
    return wsmp.encode(WaveShortMessage(psid=psid.BSM, payload=data))
