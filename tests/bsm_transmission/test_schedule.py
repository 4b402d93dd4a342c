"""The BSM schedule: 10 Hz, less often at high density, at once for a critical event."""

import numpy as np
import pytest
from numpy.typing import NDArray

from onboard.bsm_transmission.schedule import (
    FULL_RATE_1_S,
    JITTER_S,
    MAXIMUM_INTERVAL_S,
    MINIMUM_INTERVAL_S,
    BsmSchedule,
)


def _schedule(seed: int = 1) -> BsmSchedule:
    return BsmSchedule(np.random.default_rng(seed), now=0.0)


def _sent(
    schedule: BsmSchedule, until_s: float, cars: int = 0, distance_m: float | None = 50.0
) -> NDArray[np.float64]:
    """Run `schedule` by its timer, with `cars` received at 10 Hz."""
    times, heard_at = [], 0.0
    while (now := schedule.get_timer()) < until_s:
        if now >= heard_at:
            heard_at = now + 0.1
            for car in range(cars):
                schedule.receive_remote_vehicle(car.to_bytes(4), distance_m, now)
        schedule.handle_timer(now)
        if schedule.take_due(now):
            times.append(now)
    return np.array(times)


def test_a_car_alone_sends_10_hz_bsms_within_the_jitter() -> None:
    gaps = np.diff(_sent(_schedule(), 60.0))
    assert len(gaps) == pytest.approx(600, abs=3)
    assert np.all(np.abs(gaps - 0.1) <= JITTER_S + 1e-9)
    assert gaps.std() > JITTER_S / 3


def test_cars_switched_on_together_send_at_different_times() -> None:
    firsts = [_sent(_schedule(seed), 0.2)[0] for seed in range(50)]
    assert max(firsts) - min(firsts) > 0.09
    assert all(0 <= first <= MINIMUM_INTERVAL_S for first in firsts)


@pytest.mark.parametrize(
    ("cars", "interval_s"),
    [(0, 0.1), (25, 0.1), (50, 0.2), (100, 0.4), (149, 0.596), (150, 0.6), (400, 0.6)],
)
def test_the_interval_grows_with_the_vehicle_density(cars: int, interval_s: float) -> None:
    schedule = _schedule()
    late = np.diff(_sent(schedule, 40.0, cars))[-20:]
    assert late.mean() == pytest.approx(interval_s, abs=0.004)
    assert schedule.interval_s == pytest.approx(interval_s, abs=0.002)


def test_distant_cars_are_not_counted_and_cars_at_unknown_distance_are() -> None:
    assert np.diff(_sent(_schedule(), 40.0, 100, distance_m=100.1))[-1] < 0.11
    assert np.diff(_sent(_schedule(), 40.0, 100, distance_m=None))[-1] > 0.39


def test_silent_cars_are_no_longer_counted() -> None:
    schedule = _schedule()
    _sent(schedule, 40.0, 150)
    _sent(schedule, 80.0, 0)
    assert schedule.interval_s == MINIMUM_INTERVAL_S


def test_a_critical_event_is_sent_at_once_and_at_10_hz_while_it_lasts() -> None:
    schedule = _schedule()
    last = _sent(schedule, 40.0, 200)[-1]
    assert not schedule.take_due(last + 0.2)
    schedule.receive_event_flags(is_critical=True, now=last + 0.2)
    assert schedule.get_timer() == last + 0.2
    assert schedule.take_due(last + 0.2)
    schedule.receive_event_flags(is_critical=True, now=last + 0.21)
    assert not schedule.take_due(last + 0.21), "the same event is not new"
    assert schedule.take_due(last + 0.2 + MINIMUM_INTERVAL_S + JITTER_S)
    schedule.receive_event_flags(is_critical=False, now=last + 0.31)
    assert schedule.take_due(last + 0.45)
    assert not schedule.take_due(last + 0.45 + MAXIMUM_INTERVAL_S - JITTER_S - 0.01)


def test_many_forged_senders_take_bounded_memory() -> None:
    schedule = _schedule()
    for sender in range(5000):
        schedule.receive_remote_vehicle(sender.to_bytes(4), 10.0, now=0.01)
    assert len(schedule._in_range_until) <= 1024


def test_the_phase_is_another_one_when_it_begins_anew() -> None:
    """Else the time of the next BSM, known to `JITTER_S`, would link two IDs."""
    phases_s = []
    for seed in range(200):
        schedule = BsmSchedule(np.random.default_rng(seed), 0.0)
        sent_at = schedule.get_timer()
        schedule.handle_timer(sent_at)
        while not schedule.take_due(sent_at):
            sent_at = schedule.get_timer()
            schedule.handle_timer(sent_at)
        schedule.begin_anew(sent_at)
        next_at = sent_at
        while not schedule.take_due(next_at):
            next_at = schedule.get_timer()
            schedule.handle_timer(next_at)
        phases_s.append(next_at - sent_at)
    assert np.histogram(phases_s, 4, (0.0, 0.1))[0].min() >= 30


def bsms_a_second(cars: int, unsafe: int) -> tuple[float, float]:
    """Return the rate of one unsafe vehicle, and of all, after they have been near for 20 s."""
    schedules = [_schedule(seed) for seed in range(cars)]
    for schedule in schedules[:unsafe]:
        schedule.receive_max_interval(MINIMUM_INTERVAL_S, 0.0)
    sent = [0] * cars
    for step in range(3000):
        now = 0.01 * step
        due = []
        for car, schedule in enumerate(schedules):
            schedule.handle_timer(now)
            if schedule.take_due(now):
                due.append(car)
                sent[car] += now >= 20.0
        for car in due:
            for other, schedule in enumerate(schedules):
                if other != car:
                    schedule.receive_remote_vehicle(car.to_bytes(4), 50.0, now)
    return sent[0] / 10.0, sum(sent) / 10.0


def test_one_of_many_that_is_to_send_more_often_does() -> None:
    own, everybody = bsms_a_second(cars=75, unsafe=1)

    assert own > 8.0
    assert everybody < FULL_RATE_1_S


def test_many_that_are_to_send_more_often_do_not_fill_the_channel() -> None:
    """A jam of unsafe vehicles had sent 750 BSMs a second instead of 250."""
    own, everybody = bsms_a_second(cars=75, unsafe=75)

    assert everybody < 1.05 * FULL_RATE_1_S
    assert own > everybody / 75 * 0.8
