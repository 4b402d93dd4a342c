"""A single core, whose camera and radio inputs the test gives."""

from typing import Any

import numpy as np

from onboard.lcca.events import MeasuredLead, Transition
from onboard.lcca.group import WarningGroup
from onboard.lcca.parameters import GroupParameters
from onboard.messages.lcca import NO_ID, CarId, GroupMessage, Join, Reply
from onboard.observations import Discarded
from tests.lcca.road import car_id

A, B = (car_id(name) for name in "AB")


class OneCar:
    """B, unless given otherwise, alone at 20 m/s."""

    def __init__(self, own_id: CarId = B, **settings: float) -> None:
        prompt = GroupParameters(**{"spread_s": 0.0, **settings})  # type: ignore[arg-type]
        self.group = WarningGroup(prompt, own_id, np.random.default_rng(1))
        self.group.receive_speed(20.0, 0.0)

    def sees(
        self, ahead: CarId | None, now: float, gap_m: float = 20.0, closing: float = 0.0
    ) -> None:
        self.group.receive_speed(20.0, now)
        self.group.receive_lead(MeasuredLead(ahead, gap_m, closing), now)

    def says(self, now: float) -> list[GroupMessage]:
        self.group.handle_timer(now)
        return self.group.messages_to_send(now)

    def asks(self, now: float) -> Join:
        joins = [message for message in self.says(now) if isinstance(message, Join)]
        assert len(joins) == 1
        return joins[0]

    def hears(self, message: GroupMessage, now: float) -> list[str]:
        """What the core made of it: events and refusals as words."""
        self.group.receive_message(message, now)
        words = []
        while (event := self.group.next_event()) is not None:
            assert isinstance(event, Transition | Discarded)
            words.append(event.reason if isinstance(event, Discarded) else event.event.value)
        return words


def answer(
    join: Join, leader: CarId = A, number: int = 1, leader_sequence: int = 10, speed: float = 20.0
) -> Reply:
    return Reply(
        join.to_id, leader, number, join.sender_id, join.sequence, leader_sequence, speed, NO_ID
    )


def member_of_a(**settings: Any) -> OneCar:
    car = OneCar(**settings)
    car.sees(A, 0.0)
    assert car.hears(answer(car.asks(0.0)), 0.0) == ["joined"]
    return car
