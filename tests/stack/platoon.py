"""Whole cars in one lane, joined by a wire that loses nothing."""

from collections.abc import Iterator

import numpy as np

from onboard.config import CarConfig
from onboard.observations import Lead, LeadIdentity, Sensor, Speed
from onboard.security.credentials import Credentials
from onboard.settings import parse_settings
from onboard.stack import Stack
from onboard.trace.trace_line import Event

NOON_UTC_S = 1_700_000_100.0
SPEED_M_S = 15.0


def car(
    plate: str,
    epoch_s: float = 300.0,
    credentials: Credentials | None = None,
    utc_s: float = NOON_UTC_S,
    seed: int = 1,
) -> Stack:
    tree = {
        "car": {"plate": plate},
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
    """Cars in one lane that hear each other; every 0.1 s each has a speed and a picture."""

    def __init__(self, cars: dict[str, Stack]) -> None:
        self.cars = cars
        self.speed_m_s = dict.fromkeys(cars, SPEED_M_S)
        self.events: list[tuple[str, Event]] = []
        self.on_air: list[bytes] = []
        self.now = 0.0

    def drive(self, duration_s: float, gap_m: float = 15.0) -> None:
        ahead: str | None = None
        for _ in range(round(duration_s / 0.1)):
            for plate, stack in self.cars.items():
                stack.receive_observation(
                    Speed(self.now, self.speed_m_s[plate], 0.28, "obd:7E8"), self.now
                )
                lead = (
                    Lead(self.now, LeadIdentity.NO_LEAD)
                    if ahead is None
                    else Lead(self.now, LeadIdentity.KNOWN, ahead, gap_m, 0.3, 0.0, 0.3)
                )
                stack.receive_observation(lead, self.now)
                ahead = plate
            ahead = None
            tick = self.now + 0.1
            self.settle()
            while (at := min(stack.get_timer() for stack in self.cars.values())) < tick:
                self.now = max(at, self.now + 1e-4)
                self.settle()
            self.now = tick

    def settle(self) -> None:
        """Let everything be said that is to be said now."""
        for stack in self.cars.values():
            if stack.get_timer() <= self.now:
                stack.handle_timer(self.now)
            stack.can_to_send(self.now)
        on_air = [
            (plate, wsm)
            for plate, stack in self.cars.items()
            for _, wsm in stack.wsms_to_send(self.now)
        ]
        for sender, wsm in on_air:
            self.on_air.append(wsm)
            for plate, stack in self.cars.items():
                if plate != sender:
                    stack.receive_wsm(wsm, self.now)
        for plate, stack in self.cars.items():
            while (event := stack.next_event()) is not None:
                self.events.append((plate, event))

    def said(self, plate: str, kind: str) -> Iterator[Event]:
        return (event for who, event in self.events if who == plate and event.kind == kind)
