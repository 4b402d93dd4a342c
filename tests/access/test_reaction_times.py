"""When the driver's braking is a reaction to the lead's braking."""

import pytest

from onboard.access.reaction_times import Reaction, ReactionObserver
from onboard.observations import BrakeCause, BrakePedal, HardBrake, Lead, LeadIdentity, Speed

SPEED = Speed(10.0, 20.0, 0.28, "obd:7e8")


def pedal(stamp_s: float, pressed: bool = True) -> BrakePedal:
    return BrakePedal(stamp_s, pressed, "dbc:BRAKE.PEDAL")


def hard_brake(stamp_s: float) -> HardBrake:
    return HardBrake(stamp_s, 6.0, "obd:7e8")


def lead(
    stamp_s: float, closing_m_s: float | None, gap_m: float | None = 30.0, sigma_m_s: float = 0.2
) -> Lead:
    return Lead(stamp_s, LeadIdentity.UNKNOWN, None, gap_m, 0.5, closing_m_s, sigma_m_s)


@pytest.fixture
def observer() -> ReactionObserver:
    """30 m behind the lead at 20 m/s; the gap is last steady at 10.0 s."""
    observer = ReactionObserver()
    for stamp_s in (9.9, 10.0):
        observer.receive_lead(lead(stamp_s, 0.1), SPEED)
    return observer


def close(observer: ReactionObserver, speed: Speed | None = SPEED) -> None:
    """The closing speed shows at 10.3 s that the lead brakes."""
    for stamp_s, closing_m_s in [(10.1, 0.8), (10.2, 1.6), (10.3, 2.4), (10.4, 3.2)]:
        observer.receive_lead(lead(stamp_s, closing_m_s), speed)


def test_the_reaction_time_counts_from_the_last_steady_frame(observer: ReactionObserver) -> None:
    close(observer)

    assert observer.receive_brake_pedal(pedal(11.1)) == pytest.approx(Reaction(1.1, 1.5))


def test_without_a_pedal_signal_hard_braking_ends_the_reaction(observer: ReactionObserver) -> None:
    close(observer)

    assert observer.receive_hard_brake(hard_brake(11.5)) == pytest.approx(Reaction(1.5, 1.5))


@pytest.mark.parametrize("is_over", [False, True])
def test_a_braking_that_began_before_is_no_reaction(
    observer: ReactionObserver, is_over: bool
) -> None:
    """Only its level changes, or it is over."""
    observer.receive_hard_brake(hard_brake(9.5))
    close(observer)

    change = HardBrake(11.5, 0.0 if is_over else 9.0, "obd:7e8", is_over=is_over)
    assert observer.receive_hard_brake(change) is None


def test_the_button_is_no_reaction(observer: ReactionObserver) -> None:
    close(observer)

    assert observer.receive_hard_brake(HardBrake(11.2, 4.0, "button", BrakeCause.TEST)) is None
    assert observer.receive_hard_brake(hard_brake(11.5)) == pytest.approx(Reaction(1.5, 1.5))


def test_one_braking_of_the_lead_gives_one_reaction(observer: ReactionObserver) -> None:
    close(observer)
    assert observer.receive_brake_pedal(pedal(11.1)) is not None

    assert observer.receive_brake_pedal(pedal(11.2)) is None
    assert observer.receive_hard_brake(hard_brake(11.6)) is None


def test_without_a_braking_lead_there_is_no_reaction(observer: ReactionObserver) -> None:
    assert observer.receive_brake_pedal(pedal(11.1)) is None


def test_a_pedal_that_was_pressed_before_gives_no_reaction(observer: ReactionObserver) -> None:
    observer.receive_brake_pedal(pedal(9.95))
    close(observer)

    assert observer.receive_brake_pedal(pedal(11.1)) is None


def test_an_old_pedal_signal_is_ignored(observer: ReactionObserver) -> None:
    """The message of the release was lost; hard braking still ends the reaction."""
    observer.receive_brake_pedal(pedal(8.0))
    close(observer)

    assert observer.receive_hard_brake(hard_brake(11.5)) == pytest.approx(Reaction(1.5, 1.5))


def test_a_vehicle_that_cuts_in_has_not_braked(observer: ReactionObserver) -> None:
    for tenth, gap_m in enumerate((14.0, 13.7, 13.4, 13.1), 1):
        observer.receive_lead(lead(10.0 + 0.1 * tenth, 3.0, gap_m), SPEED)

    assert observer.receive_brake_pedal(pedal(11.1)) is None


def test_a_vehicle_that_cut_in_and_then_brakes_gives_a_reaction(observer: ReactionObserver) -> None:
    for tenth, closing_m_s in enumerate((0.3, 0.3, 1.2, 2.4), 1):
        observer.receive_lead(lead(10.0 + 0.1 * tenth, closing_m_s, 14.0), SPEED)

    assert observer.receive_brake_pedal(pedal(11.1)) == pytest.approx(Reaction(0.9, 0.7))


def test_a_pedal_that_was_released_in_time_gives_a_reaction(observer: ReactionObserver) -> None:
    observer.receive_brake_pedal(pedal(9.8))
    observer.receive_brake_pedal(pedal(9.95, pressed=False))
    close(observer)

    assert observer.receive_brake_pedal(pedal(11.1)) is not None


def test_a_gap_that_stops_closing_gives_no_reaction(observer: ReactionObserver) -> None:
    close(observer)
    observer.receive_lead(lead(10.6, 0.2), SPEED)

    assert observer.receive_brake_pedal(pedal(12.0)) is None


@pytest.mark.parametrize("gone", [lead(10.6, None, None), lead(10.6, None)])
def test_a_lost_lead_gives_no_reaction(observer: ReactionObserver, gone: Lead) -> None:
    close(observer)
    observer.receive_lead(gone, SPEED)

    assert observer.receive_brake_pedal(pedal(11.1)) is None


def test_a_noisy_closing_speed_is_not_braking(observer: ReactionObserver) -> None:
    observer.receive_lead(lead(10.1, 3.0, sigma_m_s=1.0), SPEED)

    assert observer.receive_brake_pedal(pedal(11.1)) is None


def test_a_closing_speed_that_rises_slowly_is_not_braking(observer: ReactionObserver) -> None:
    for tenth in range(1, 20):
        observer.receive_lead(lead(10.0 + 0.1 * tenth, 0.5 + 0.1 * tenth), SPEED)

    assert observer.receive_brake_pedal(pedal(12.2)) is None


@pytest.mark.parametrize(
    "speed", [Speed(10.0, 4.0, 0.28, "obd:7e8"), Speed(9.0, 20.0, 0.28, "obd:7e8"), None]
)
def test_in_a_queue_or_without_a_recent_speed_there_is_no_reaction(
    observer: ReactionObserver, speed: Speed | None
) -> None:
    close(observer, speed)

    assert observer.receive_brake_pedal(pedal(11.1)) is None


def test_without_speed_and_steady_gap_there_is_no_reaction() -> None:
    observer = ReactionObserver()
    observer.receive_lead(lead(1.1, 5.0), None)

    assert observer.receive_hard_brake(hard_brake(2.0)) is None
