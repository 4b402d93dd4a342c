"""What goes into the footers of several cars: how much, how often, and of whom."""

from collections.abc import Sequence

import numpy as np
import pytest

from onboard.messages import mvs_footer
from onboard.mvs.footer_reading import read
from onboard.mvs.multi_vehicle_sensing import MultiVehicleSensing
from onboard.mvs.settings import MvsSettings
from onboard.observations import Position, VehicleDetection
from onboard.tracking.evidence import measured_ms
from tests.mvs.world import (
    EXACT,
    Car,
    Message,
    World,
    assert_lists_each_measurement_once,
    to_degrees,
)
from tests.typed import a


@pytest.mark.parametrize("selection", ["mvs", "mo", "rs"])
def test_a_footer_keeps_to_m_entries_and_to_its_bytes(selection: str) -> None:
    observers = [Car("a", 0, 0, 0, 10, sees=frozenset(f"x{k}" for k in range(12)))]
    observers += [Car("b", 200, 0, 0, 10, sees=frozenset(f"x{k}" for k in range(12)))]
    others = [Car(f"x{k}", 8.0 * k - 40, 60 + k, 0, 10, radio=False) for k in range(12)]
    changes = {"selection": selection, "max_entries": 5, "max_bytes": 150}
    world = World(
        observers + others, settings=MvsSettings.model_validate(
            EXACT.model_dump(mode="python") | changes, strict=False)
    )  # fmt: skip

    world.run(2.0)

    footers = [mvs_footer.decode(a(bytes, message.footer)) for message in world.sent[20:]]
    entries = [len(footer.measurements) + len(footer.estimates) for footer in footers]
    assert max(entries) <= 5
    assert max(len(a(bytes, message.footer)) for message in world.sent) <= 150
    assert min(entries) >= 2
    assert_lists_each_measurement_once(world)


@pytest.mark.parametrize("interval_s", [0.07, 0.1, 0.105, 0.25])
def test_received_evidence_is_relayed_once_at_any_footer_timing(
    interval_s: float,
) -> None:
    cars = [Car("a", 0, 0, 0, 10, sees=frozenset({"x"})), Car("x", 0, 40, 0, 10, radio=False)]
    world = World(cars)
    world.run(4.0)
    mvs = MultiVehicleSensing(EXACT, b"-own", np.random.default_rng(0))
    sent: list[int] = []
    for k in range(round(4.0 / interval_s)):
        now = world.start + 0.14 + k * interval_s
        fix = Position(now, *to_degrees(0.0, -50.0), None, 0.5, 0.0, 0.0)
        mvs.receive_position(fix)
        while world.sent and (heard_at := world.sent[0].state.stamp_s + 0.02) <= now:
            message = world.sent.pop(0)
            mvs.receive_bsm(message.sender.id, message.state, message.footer, heard_at)
        for provenance in read(mvs.footer_to_send(now)).provenances:
            sent += [measured_ms(each) for each in provenance]

    assert len(sent) == len(set(sent))
    assert set(range(1_001_000, 1_003_600, 100)) <= set(sent)


def test_what_comes_back_from_others_is_not_sent_again() -> None:
    """Otherwise old measurements go with every new one, and make it too old to be relayed."""

    def radio(message: Message, receiver: Car, t: float) -> list[float]:
        return [0.03 + 0.1 * (round(t * 10) % 2)]  # so b relays two at a time

    cars = [
        Car("a", 0, 0, 0, 10, sees=frozenset({"x"})),
        Car("b", 0, -60, 0, 10),
        Car("x", 0, 40, 0, 10, radio=False),
    ]
    world = World(cars, radio=radio)

    world.run(3.0)

    of_a = [read(a(bytes, m.footer)) for m in world.sent if m.sender.name == "a"]
    of_b = [read(a(bytes, m.footer)) for m in world.sent if m.sender.name == "b"]
    assert [len(provenance) for footer in of_a[5:] for provenance in footer.provenances] == [1] * 25
    assert {len(provenance) for footer in of_b for provenance in footer.provenances} == {2}


def test_two_cars_alive_never_go_by_one_number_on_the_wire() -> None:
    """A number has 8 bits there: of cars 1 and 257 the receiver never knew either."""
    mvs = MultiVehicleSensing(EXACT, b"-own", np.random.default_rng(0))
    sent: list[Sequence[int]] = []
    for k in range(12):
        at = 1000.0 + k / 10
        mvs.receive_position(Position(at, 48.1, 11.5, None, 0.5, 10.0, 0.0))
        for number in range(1 if k < 4 else 2):
            mvs.receive_detection(VehicleDetection(at, number, 30.0, 0.3, 0.6 * number, 0.01))
        sent.append(read(mvs.footer_to_send(at)).numbers)
        mvs._tracks._last_number = 256

    assert {track.number for track in mvs._tracks} == {1, 257}
    assert (1,) in sent
    assert set(sent[-1]) == {1, 2}


def test_what_did_not_fit_into_a_footer_is_sent_first_in_the_next() -> None:
    """Else the last of three cars in view would never be sent, where two fit at most."""
    tight = EXACT.model_copy(update={"max_bytes": 50})
    mvs = MultiVehicleSensing(tight, b"-own", np.random.default_rng(0))
    sent: list[int] = []
    for k in range(12):
        now = 1000.0 + k / 10
        mvs.receive_position(Position(now, 48.1, 11.5, None, 0.5, 10.0, 0.0))
        for number in range(3):
            mvs.receive_detection(VehicleDetection(now, number, 30.0, 0.3, 0.5 * number, 0.01))
        sent += read(mvs.footer_to_send(now)).numbers

    times_sent = [sent.count(car) for car in sorted(set(sent))]
    assert len(times_sent) == 3
    assert max(times_sent) - min(times_sent) <= 1


def test_no_footer_has_more_measurements_than_are_accepted() -> None:
    """Estimates that come back grow with each round, up to all that anybody measured lately."""
    names = [f"r{k}" for k in range(4)]
    cars = [Car(name, 9.0 * k, 0, 0, 10, sees=frozenset({"x"})) for k, name in enumerate(names)]
    world = World(
        [*cars, Car("x", 12, 50, 0, 10, radio=False)],
        max_measurements=8,
    )

    world.run(2.0)

    assert [world.discarded(name) for name in names] == [[]] * 4
    longest = [
        max(map(len, read(a(bytes, message.footer)).provenances)) for message in world.sent[20:]
    ]
    assert max(longest) == 8
    assert all(len(world.without_radio(name)) == 1 for name in names)
