"""Whole vehicles in one lane, connected by a lossless channel."""

from collections.abc import Iterator

import numpy as np

from onboard.observations import Lead, LeadIdentity, Sensor, Speed
from onboard.security.credentials import Credentials
from onboard.settings import parse_settings
from onboard.step import Input, ReceivedWsm
from onboard.trace.trace_line import Event
from onboard.vehicle.config import CarConfig
from onboard.vehicle.stack import Stack
from tests.leads import known_lead

NOON_UTC_S = 1_700_000_100.0
SPEED_M_S = 15.0


def car(
    plate: str,
    epoch_s: float = 300.0,
    credentials: Credentials | None = None,
    utc_s: float = NOON_UTC_S,
    seed: int = 1,
    *,
    beacons: bool = True,
) -> Stack:
    tree = {
        "car": {"plate": plate},
        "beacons": beacons,
        "security": {"plate_digest": {"scrypt_log2_n": 1, "epoch_s": epoch_s}},
    }
    return Stack(
        parse_settings(tree, CarConfig, plate),
        (Sensor.SPEED, Sensor.CAMERA),
        np.random.default_rng(seed),
        now=0.0,
        utc_s=utc_s,
        credentials=credentials,
    )


class Platoon:
    """Vehicles in one lane that receive each other; every 0.1 s each has a speed and a lead."""

    def __init__(self, cars: dict[str, Stack], reach: int = 1000) -> None:
        """Take the vehicles by plate, the first one in front.

        Args:
            cars: the vehicles.
            reach: how many vehicles ahead and behind each radio reaches.
        """
        self.cars = cars
        self._place = {plate: place for place, plate in enumerate(cars)}
        self._reach = reach
        self.speed_m_s = dict.fromkeys(cars, SPEED_M_S)
        self.events: list[tuple[str, Event]] = []
        self.on_air: list[bytes] = []
        self.now = 0.0
        self._inputs: dict[str, list[Input]] = {plate: [] for plate in cars}

    def drive(self, duration_s: float, gap_m: float = 15.0) -> None:
        for _ in range(round(duration_s / 0.1)):
            ahead: str | None = None
            for plate in self.cars:
                lead = (
                    Lead(self.now, LeadIdentity.NO_LEAD)
                    if ahead is None
                    else known_lead(self.now, ahead, gap_m)
                )
                self.receive(plate, Speed(self.now, self.speed_m_s[plate], 0.28, "obd:7E8"), lead)
                ahead = plate
            tick = self.now + 0.1
            self.settle()
            while (at := min(stack.get_timer() for stack in self.cars.values())) < tick:
                self.now = max(at, self.now + 1e-4)
                self.settle()
            self.now = tick

    def receive(self, plate: str, *inputs: Input) -> None:
        """Give a vehicle inputs for its next step."""
        self._inputs[plate] += inputs

    def settle(self) -> None:
        """Step the vehicles until no frame is on its way."""
        self.step()
        while any(self._inputs.values()):
            self.step()

    def step(self) -> None:
        """Step the vehicles once."""
        all_inputs, self._inputs = self._inputs, {plate: [] for plate in self.cars}
        for plate, stack in self.cars.items():
            outputs = stack.step(all_inputs[plate], self.now)
            self.events += [(plate, event) for event in outputs.events]
            for wsm in outputs.wsms:
                self.on_air.append(wsm.data)
                for other, place in self._place.items():
                    if 0 < abs(place - self._place[plate]) <= self._reach:
                        self.receive(other, ReceivedWsm(self.now, wsm.data))

    def events_of(self, plate: str, kind: str) -> Iterator[Event]:
        return (event for name, event in self.events if name == plate and event.kind == kind)
