"""An update in slices, between which a vehicle receives, ends as an update at once."""

from collections.abc import Callable, Sized

from onboard.messages import mvs_footer
from onboard.mvs.multi_vehicle_sensing import MultiVehicleSensing
from onboard.mvs.waiting_footers import FOOTERS_TOGETHER
from onboard.observations import Position
from onboard.tracking.tracks import TRACKS_AT_ONCE
from tests.mvs.attacker import ATTACKER, NOW, WITNESS, estimate_at, footer_with, victim

VEHICLES = TRACKS_AT_ONCE + 8


def report(mvs: MultiVehicleSensing, sender: bytes, tick: int, vehicles: int = VEHICLES) -> None:
    """A vehicle ahead reports others beside the road."""
    at, reference_ms = NOW + 0.1 * tick, round(NOW * 1000) + 100 * tick
    mvs.receive_position(Position(at, 48.1, 11.5, None, 0.5, 10.0, 0.0))
    stamps_ms = [reference_ms - 50, reference_ms - 20]
    footer = footer_with(
        *(
            estimate_at(9.0 * (number % 8), 12.0 * (number // 8) + 100.0 + tick, stamps_ms, sender)
            for number in range(vehicles)
        ),
        reference_ms=reference_ms,
    )
    place = Position(at, 48.1009, 11.5, None, 0.5, 10.0, 0.0)
    mvs.receive_bsm(sender, place, mvs_footer.encode(footer), at)


def at_once(mvs: MultiVehicleSensing, now: float, between: Callable[[], None]) -> None:
    mvs.update(now)
    between()


def in_slices(mvs: MultiVehicleSensing, now: float, between: Callable[[], None]) -> None:
    mvs.update_slice(now)
    between()
    mvs.kinematic_info(now)
    while not mvs.update_slice(now):
        pass


def drive(update: Callable[[MultiVehicleSensing, float, Callable[[], None]], None]) -> list[Sized]:
    mvs = victim()
    seen: list[Sized] = []
    for tick in range(6):
        report(mvs, ATTACKER, tick)
        update(mvs, NOW + 0.1 * tick, lambda tick=tick: report(mvs, WITNESS, tick))  # type: ignore[misc]
        seen.append(mvs.kinematic_info(NOW + 0.1 * tick))
        seen.append(mvs.footer_to_send(NOW + 0.1 * tick + 0.05))
    return seen


def test_slices_end_as_an_update_at_once() -> None:
    ended = drive(at_once)
    assert len(ended[-2]) > TRACKS_AT_ONCE
    assert drive(in_slices) == ended


def test_many_footers_are_read_in_slices_as_at_once() -> None:
    senders = [bytes([0, 0, 1, number]) for number in range(2 * FOOTERS_TOGETHER + 1)]
    at_once, mvs = victim(), victim()
    for each in (at_once, mvs):
        for number, sender in enumerate(senders):
            report(each, sender, 0, 1 + number % 3)
    at_once.update(NOW)
    slices = 1
    while not mvs.update_slice(NOW):
        slices += 1
    assert slices > 3 * 3
    assert mvs.kinematic_info(NOW) == at_once.kinematic_info(NOW)
    assert mvs.footer_to_send(NOW + 0.05) == at_once.footer_to_send(NOW + 0.05) != b""


def slices_of(vehicles: int) -> int:
    mvs = victim()
    report(mvs, ATTACKER, 0, vehicles)
    slices = 1
    while not mvs.update_slice(NOW):
        slices += 1
    return slices


def test_few_vehicles_are_one_slice_and_many_are_several() -> None:
    assert slices_of(TRACKS_AT_ONCE // 2) == 1
    assert slices_of(VEHICLES) > 8


def test_a_footer_is_sent_in_the_middle_of_an_update() -> None:
    mvs = victim()
    for tick in range(3):
        report(mvs, ATTACKER, tick)
        mvs.update(NOW + 0.1 * tick)
    report(mvs, ATTACKER, 3)
    assert not mvs.update_slice(NOW + 0.3)
    assert mvs_footer.decode(mvs.footer_to_send(NOW + 0.3)).estimates
    assert mvs.update_slice(NOW + 0.3)


def ready_to_send() -> MultiVehicleSensing:
    mvs = victim()
    for tick in range(3):
        report(mvs, ATTACKER, tick)
    mvs.update(NOW + 0.2)
    return mvs


def test_a_footer_composed_in_slices_is_the_one_composed_at_once() -> None:
    """What arrives in between is not in it."""
    at_once, mvs = ready_to_send(), ready_to_send()
    slices = 1
    while not mvs.footer_slice(NOW + 0.25):
        slices += 1
        report(mvs, WITNESS, 2)
    assert slices >= 4
    assert mvs.footer_to_send(NOW + 0.26) == at_once.footer_to_send(NOW + 0.25) != b""


def test_a_footer_that_has_begun_is_not_sent_under_another_id() -> None:
    mvs, fresh = ready_to_send(), ready_to_send()
    while not mvs.footer_slice(NOW + 0.25):
        pass
    mvs.set_own_id(b"next")
    fresh.set_own_id(b"next")
    assert mvs.footer_to_send(NOW + 0.35)[:7] == fresh.footer_to_send(NOW + 0.35)[:7]
