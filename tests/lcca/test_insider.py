"""One insider, whose messages are signed and fit the group, silences no warning.

It is in radio range of everybody, has an ID of its own, and sends as many messages as it likes. It
is not in the row: who is followed can do more.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

import pytest

from onboard.messages.lcca import CarId, GroupMessage, Update, Warn, WarnCause
from tests.lcca.road import Air, Car, Road, car_id

INSIDER = b"insider!"
A = car_id("A")
NAMES = "ABCDEF"
EVERY_S = 0.125
BRAKINGS = 5

Forgery = Callable[[int], Iterator[GroupMessage]]
"""Messages that are forged at once, by the newest event sequence number of the leader."""


def braking(sequence: int, **changes: object) -> Warn:
    """A braking of the leader, as a member of its group would repeat it."""
    warn = Warn(INSIDER, A, 1, A, sequence, 5, 1, sequence, WarnCause.DECELERATION, 8.0, 0.01, 1)
    return replace(warn, **changes)  # type: ignore[arg-type]


def updates(newest: int) -> Iterator[GroupMessage]:
    for leader in (A, INSIDER):
        yield Update(INSIDER, leader, 60, newest)


def ends(newest: int) -> Iterator[GroupMessage]:
    for sequence in range(newest - 3, newest + 17):
        for first in (newest, newest + 1, sequence):
            yield braking(sequence, first_sequence=first, cause=WarnCause.OVER)


def levels(newest: int) -> Iterator[GroupMessage]:
    for sequence in range(newest + 1, newest + 17):
        yield braking(sequence, first_sequence=newest + 1)


def aged_copies(newest: int) -> Iterator[GroupMessage]:
    yield braking(newest, age_s=2.98)


class Attack:
    """An insider beside a row of six, two of which are in each other's radio range."""

    def __init__(self, forgery: Forgery) -> None:
        self.road = Road(Air(reach_m=45.0))
        self.road.add_row(NAMES)
        self.road.run(3.0)
        self.road.brake("A")  # By it the insider learns the leader's sequence number.
        self.road.run(0.5)
        self.road.release("A")
        self.road.run(7.0)
        self._forgery = forgery

    def send(self) -> None:
        for message in self._forgery(self.newest()):
            for name in NAMES:
                self.receive(name, message)

    def newest(self) -> int:
        """The leader's newest event sequence number."""
        return next(
            entry.message.event_sequence
            for entry in reversed(self.road.sent)
            if isinstance(entry.message, Warn) and entry.message.event_origin_id == A
        )

    def receive(self, name: str, message: GroupMessage) -> None:
        car = self.road.cars[name]
        self.road.do(car, lambda now: car.group.receive_message(message, now))

    def run(self, duration_s: float, *, attacks: bool) -> None:
        for _ in range(round(duration_s / EVERY_S)):
            if attacks:
                self.send()
            self.road.run(EVERY_S)

    def raised(self, origin: CarId, since: float) -> str:
        """Who was warned of a braking since then."""
        return "".join(
            name
            for name, car in self.road.cars.items()
            if any(each.origin_id == origin and each.stamp_s >= since for each in car.warnings)
        )


@pytest.mark.long
@pytest.mark.parametrize("forgery", [updates, ends])
def test_under_forged_updates_and_ends_every_braking_is_warned_of(forgery: Forgery) -> None:
    attack = Attack(forgery)
    for _ in range(BRAKINGS):
        attack.run(1.0, attacks=True)
        began_at = attack.road.now
        attack.road.brake("A")
        attack.run(0.5, attacks=True)
        assert attack.raised(A, began_at) == "BCDEF"
        attack.run(2.0, attacks=True)
        assert not any(map(ended, members(attack)))
        attack.road.release("A")
        attack.run(3.25, attacks=True)
        assert all(map(ended, members(attack)))


def members(attack: Attack) -> list[Car]:
    return [attack.road.cars[name] for name in NAMES[1:]]


def ended(car: Car) -> bool:
    states = [each.kind for each in car.said if each.kind in ("warning", "warning_over")]
    return states[-1] == "warning_over"


@pytest.mark.parametrize("pause_s", [3.25, 4.0, 5.5, 7.0])
def test_forged_brakings_do_not_make_a_later_true_one_a_copy(pause_s: float) -> None:
    attack = Attack(levels)
    attack.run(0.5, attacks=True)
    attack.run(pause_s, attacks=False)
    began_at = attack.road.now
    attack.road.brake("A")
    attack.run(0.25, attacks=False)
    assert attack.raised(A, began_at) == "BCDEF"


def test_a_forged_braking_that_falls_silent_leaves_the_true_one_on() -> None:
    attack = Attack(levels)
    attack.road.brake("A")
    attack.run(1.0, attacks=True)
    attack.run(9.0, attacks=False)
    assert not any(map(ended, members(attack)))


def test_copies_that_pretend_to_be_old_end_no_braking_early() -> None:
    attack = Attack(aged_copies)
    began_at = attack.road.now
    attack.road.brake("A")
    attack.road.run(0.1)
    attack.run(0.75, attacks=True)
    assert attack.raised(A, began_at) == "BCDEF"
    overs = [e for car in members(attack) for e in car.said if e.kind == "warning_over"]
    assert not any(event.stamp_s >= began_at for event in overs)


def test_forged_brakings_end_by_themselves() -> None:
    attack = Attack(levels)
    attack.run(0.5, attacks=True)
    attack.run(3.5, attacks=False)
    assert all(map(ended, members(attack)))


def test_forged_acknowledgements_of_a_later_braking_do_not_keep_it_from_being_repeated() -> None:
    # E acknowledges a forged braking that D did not receive. The true one has its number.
    attack = Attack(levels)
    attack.receive("E", braking(attack.newest() + 1))
    attack.road.run(3.5)
    attack.road.drops = lambda entry, to: (
        to == "E" and isinstance(entry.message, Warn) and entry.sender != "D"
    )
    began_at = attack.road.now
    attack.road.brake("A")
    attack.road.run(0.5)
    assert attack.raised(A, began_at) == "BCDEF"
