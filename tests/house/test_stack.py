"""Whole cars, joined by a wire that loses nothing: from observations to the other car's warning."""

from collections.abc import Iterator

import numpy as np
import pytest

from onboard.config import CarConfig
from onboard.observations import Lead, LeadIdentity, Sensor, SensorLost, Speed
from onboard.settings import parse_settings
from onboard.stack import Stack
from onboard.trace import Event, as_record

NOON_UTC_S = 1_700_000_100.0
SPEED_M_S = 15.0


def car(plate: str, epoch_s: float = 300.0) -> Stack:
    tree = {
        "car": {"plate": plate},
        "security": {"plate_digest": {"scrypt_log2_n": 1, "epoch_s": epoch_s}},
    }
    return Stack(
        parse_settings(tree, CarConfig, plate),
        (Sensor.SPEED, Sensor.CAMERA),
        np.random.default_rng(1),
        now=0.0,
        utc_s=NOON_UTC_S,
    )


class Platoon:
    """Cars in one lane that hear each other; every 0.1 s each has a speed and a picture."""

    def __init__(self, *plates: str, epoch_s: float = 300.0) -> None:
        self.cars = {plate: car(plate, epoch_s) for plate in plates}
        self.events: list[tuple[str, Event]] = []
        self.on_air: list[bytes] = []
        self.now = 0.0

    def drive(self, duration_s: float, gap_m: float = 15.0) -> None:
        ahead: str | None = None
        for _ in range(round(duration_s / 0.1)):
            for plate, stack in self.cars.items():
                stack.receive_observation(Speed(self.now, SPEED_M_S, 0.28, "obd:7E8"), self.now)
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


def test_the_brake_button_of_the_first_warns_the_second_and_third_and_not_itself() -> None:
    platoon = Platoon("AAA1", "BBB2", "CCC3")
    platoon.drive(3.0)

    platoon.cars["AAA1"].press_brake_button(platoon.now)
    platoon.drive(0.3)

    warned = {
        plate: [as_record(event) for event in platoon.said(plate, "warning")]
        for plate in platoon.cars
    }
    assert [len(warned[plate]) for plate in platoon.cars] == [0, 1, 1]
    assert warned["CCC3"][0]["group_number"] == 3
    assert warned["CCC3"][0]["origin_number"] == 1


def test_no_plate_is_ever_on_the_air() -> None:
    platoon = Platoon("AAA1", "BBB2")
    platoon.drive(2.0)

    assert platoon.on_air
    assert not any(plate.encode() in wsm for plate in platoon.cars for wsm in platoon.on_air)


def test_a_group_outlives_the_change_of_everybodys_id() -> None:
    platoon = Platoon("AAA1", "BBB2", epoch_s=10.0)
    platoon.drive(25.0)

    transitions = [as_record(event) for event in platoon.said("BBB2", "transition")]
    assert all(record["state"] == "member" for record in transitions)
    assert len({record["leader_id"] for record in transitions}) > 1, "the ID did change"

    platoon.cars["AAA1"].press_brake_button(platoon.now)
    platoon.drive(0.3)
    assert len(list(platoon.said("BBB2", "warning"))) == 1


@pytest.mark.parametrize(
    ("datagram", "room"),
    [(b"", "wsmp"), (b"\x03", "wsmp"), (b"garbage from a port scanner", "wsmp")],
)
def test_garbage_from_the_radio_is_counted_and_the_car_goes_on(datagram: bytes, room: str) -> None:
    platoon = Platoon("AAA1", "BBB2")
    platoon.cars["BBB2"].receive_wsm(datagram, 0.0)
    platoon.drive(2.0)

    first = next(platoon.said("BBB2", "discarded"))
    assert as_record(first)["room"] == room
    assert next(platoon.said("BBB2", "transition"), None) is not None


def test_a_car_without_samples_says_which_sensors_are_lost() -> None:
    stack = car("AAA1")
    now = stack.get_timer()
    while now < 1.0:
        stack.handle_timer(now)
        stack.can_to_send(now)
        stack.wsms_to_send(now)
        now = max(stack.get_timer(), now + 1e-6)
    lost = [event for event in iter(stack.next_event, None) if isinstance(event, SensorLost)]

    assert {event.sensor for event in lost} == {Sensor.SPEED, Sensor.CAMERA}
