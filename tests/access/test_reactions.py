"""Which pairs of braking are a reaction."""

import pytest

from onboard.access.reaction_times import Reaction, ReactionObserver
from onboard.observations import BrakePedal, HardBrake, Lead, LeadIdentity, Speed


def pedal(stamp_s: float, pressed: bool = True) -> BrakePedal:
    return BrakePedal(stamp_s, pressed, "dbc:BRAKE.PEDAL")


def hard(stamp_s: float) -> HardBrake:
    return HardBrake(stamp_s, 6.0, "obd:7e8")


def lead(
    stamp_s: float, closing_m_s: float | None, gap_m: float | None = 30.0, sigma_m_s: float = 0.2
) -> Lead:
    return Lead(stamp_s, LeadIdentity.UNKNOWN, None, gap_m, 0.5, closing_m_s, sigma_m_s)


@pytest.fixture
def watch() -> ReactionObserver:
    """Behind a car at 30 m and 20 m/s since 9.9 s, last seen steady at 10.0 s."""
    watch = ReactionObserver()
    watch.receive_speed(Speed(10.0, 20.0, 0.28, "obd:7e8"))
    for stamp_s in (9.9, 10.0):
        watch.receive_lead(lead(stamp_s, 0.1))
    return watch


def close(watch: ReactionObserver) -> None:
    """Be sure at 10.3 s that the car ahead brakes."""
    for stamp_s, closing_m_s in [(10.1, 0.8), (10.2, 1.6), (10.3, 2.4), (10.4, 3.2)]:
        watch.receive_lead(lead(stamp_s, closing_m_s))


def test_closing_is_dated_back_to_the_last_steady_frame(watch: ReactionObserver) -> None:
    close(watch)

    assert watch.receive_brake_pedal(pedal(11.1)) == pytest.approx(Reaction(1.1, 1.5))


def test_a_car_without_a_pedal_signal_shows_hard_braking_only(watch: ReactionObserver) -> None:
    close(watch)

    assert watch.receive_hard_brake(hard(11.5)) == pytest.approx(Reaction(1.5, 1.5))


def test_one_braking_is_one_reaction(watch: ReactionObserver) -> None:
    close(watch)
    assert watch.receive_brake_pedal(pedal(11.1)) is not None

    assert watch.receive_brake_pedal(pedal(11.2)) is None
    assert watch.receive_hard_brake(hard(11.6)) is None


def test_braking_for_nobody_is_no_reaction(watch: ReactionObserver) -> None:
    assert watch.receive_brake_pedal(pedal(11.1)) is None


def test_a_foot_that_was_on_the_brake_does_not_react(watch: ReactionObserver) -> None:
    watch.receive_brake_pedal(pedal(9.95))
    close(watch)

    assert watch.receive_brake_pedal(pedal(11.1)) is None


def test_a_pedal_that_has_not_been_heard_of_for_long_says_nothing(watch: ReactionObserver) -> None:
    """Pressed when its message was lost; hard braking still tells."""
    watch.receive_brake_pedal(pedal(8.0))
    close(watch)

    assert watch.receive_hard_brake(hard(11.5)) == pytest.approx(Reaction(1.5, 1.5))


def test_a_car_that_cuts_in_has_not_braked(watch: ReactionObserver) -> None:
    for tenth, gap_m in enumerate((14.0, 13.7, 13.4, 13.1), 1):
        watch.receive_lead(lead(10.0 + 0.1 * tenth, 3.0, gap_m))

    assert watch.receive_brake_pedal(pedal(11.1)) is None


def test_a_car_that_has_cut_in_and_brakes_is_reacted_to(watch: ReactionObserver) -> None:
    for tenth, closing_m_s in enumerate((0.3, 0.3, 1.2, 2.4), 1):
        watch.receive_lead(lead(10.0 + 0.1 * tenth, closing_m_s, 14.0))

    assert watch.receive_brake_pedal(pedal(11.1)) == pytest.approx(Reaction(0.9, 0.7))


def test_a_foot_that_came_off_in_time_does(watch: ReactionObserver) -> None:
    watch.receive_brake_pedal(pedal(9.8))
    watch.receive_brake_pedal(pedal(9.95, pressed=False))
    close(watch)

    assert watch.receive_brake_pedal(pedal(11.1)) is not None


def test_a_lead_that_drives_on_asked_for_nothing(watch: ReactionObserver) -> None:
    close(watch)
    watch.receive_lead(lead(10.6, 0.2))

    assert watch.receive_brake_pedal(pedal(12.0)) is None


@pytest.mark.parametrize("gone", [lead(10.6, None, None), lead(10.6, None)])
def test_a_lead_that_is_gone_asked_for_nothing(watch: ReactionObserver, gone: Lead) -> None:
    close(watch)
    watch.receive_lead(gone)

    assert watch.receive_brake_pedal(pedal(11.1)) is None


def test_noise_is_not_braking(watch: ReactionObserver) -> None:
    watch.receive_lead(lead(10.1, 3.0, sigma_m_s=1.0))

    assert watch.receive_brake_pedal(pedal(11.1)) is None


def test_coming_near_slowly_is_not_the_lead_braking(watch: ReactionObserver) -> None:
    for tenth in range(1, 20):
        watch.receive_lead(lead(10.0 + 0.1 * tenth, 0.5 + 0.1 * tenth))

    assert watch.receive_brake_pedal(pedal(12.2)) is None


@pytest.mark.parametrize(
    "speed", [Speed(10.0, 4.0, 0.28, "obd:7e8"), Speed(9.0, 20.0, 0.28, "obd:7e8")]
)
def test_in_a_queue_or_without_a_fresh_speed_nothing_is_learned(
    watch: ReactionObserver, speed: Speed
) -> None:
    watch.receive_speed(speed)
    close(watch)

    assert watch.receive_brake_pedal(pedal(11.1)) is None


def test_nothing_known_nothing_learned() -> None:
    watch = ReactionObserver()
    watch.receive_lead(lead(1.1, 5.0))

    assert watch.receive_hard_brake(hard(2.0)) is None
