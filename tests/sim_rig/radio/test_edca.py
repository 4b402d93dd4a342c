"""One station's contention: when may it transmit?"""

import math

import numpy as np
import pytest

from sim_rig.radio.edca import SIFS_S, SLOT_S, AccessCategory, QueuedFrame, Station

AIFSN = {"VO": 2, "VI": 3, "BE": 6, "BK": 9}
LEAST_WINDOW = {"VO": 3, "VI": 7, "BE": 15, "BK": 15}
FREE_S = 1.0 + SIFS_S
"""The channel was free again at 1 s."""


def station(seed: int = 0) -> Station:
    return Station(np.random.default_rng(seed))


def frame(number: int = 0) -> QueuedFrame:
    return QueuedFrame(number, 288, 0.0)


def slots_after_aifs(access_s: float, category: AccessCategory) -> float:
    return (access_s - FREE_S) / SLOT_S - AIFSN[category.name]


@pytest.mark.parametrize(
    ("user_priority", "category"),
    list(enumerate(["BE", "BK", "BK", "BE", "VI", "VI", "VO", "VO"])),
)
def test_user_priorities_have_the_categories_of_802_1d(user_priority: int, category: str) -> None:
    assert AccessCategory.of(user_priority).name == category


def test_nothing_queued_is_never_due() -> None:
    assert station().access_s == math.inf


@pytest.mark.parametrize("category", list(AccessCategory))
def test_on_a_free_channel_a_frame_goes_at_the_next_slot_boundary(
    category: AccessCategory,
) -> None:
    its = station()
    now = FREE_S + 100.3 * SLOT_S

    its.enqueue(frame(), category, now, FREE_S, busy=False)

    assert its.access_s == pytest.approx(FREE_S + 101 * SLOT_S, abs=1e-9)


@pytest.mark.parametrize("category", list(AccessCategory))
def test_right_after_a_frame_aifs_is_waited_for(category: AccessCategory) -> None:
    its = station()

    its.enqueue(frame(), category, 1.0 + 1e-6, FREE_S, busy=False)

    assert slots_after_aifs(its.access_s, category) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("category", list(AccessCategory))
def test_a_busy_channel_asks_for_a_backoff_out_of_the_window(category: AccessCategory) -> None:
    drawn = set()
    for seed in range(300):
        its = station(seed)
        its.enqueue(frame(), category, 0.9999, FREE_S, busy=True)
        drawn.add(round(slots_after_aifs(its.access_s, category), 6))

    assert drawn == set(range(LEAST_WINDOW[category.name] + 1))


def waiting(slots: int) -> Station:
    """A station with a voice frame and this many slots to go."""
    for seed in range(100):
        its = station(seed)
        its.enqueue(frame(), AccessCategory.VO, 0.9999, FREE_S, busy=True)
        if round(slots_after_aifs(its.access_s, AccessCategory.VO)) == slots:
            return its
    raise AssertionError(slots)


@pytest.mark.parametrize(("heard_slots", "left"), [(-0.5, 3), (0.5, 2), (1.5, 1), (2.5, 0)])
def test_what_has_been_counted_stays_counted_when_another_talks(
    heard_slots: float, left: int
) -> None:
    """The first slot goes at the end of AIFS, the others at the end of each free slot."""
    its = waiting(slots=3)

    its.pause(FREE_S + (2 + heard_slots) * SLOT_S, FREE_S)
    free_again_s = 2.0 + SIFS_S
    its.plan(1.5, free_again_s)

    assert its.access_s == pytest.approx(free_again_s + (2 + left) * SLOT_S)


def test_the_first_category_wins_inside_a_station_and_the_other_draws_again() -> None:
    its = station()
    its.enqueue(frame(1), AccessCategory.VI, 5.0, FREE_S, busy=False)
    its.enqueue(frame(2), AccessCategory.VO, 5.0, FREE_S, busy=False)
    now = its.access_s

    assert its.take(now, FREE_S).number == 2
    its.plan(now, now + 0.001)
    assert its.access_s >= now + 0.001 + AIFSN["VI"] * SLOT_S


def test_frames_of_one_category_are_sent_in_order_each_with_its_backoff() -> None:
    its = station(3)
    for number in range(3):
        its.enqueue(frame(number), AccessCategory.BE, 5.0, FREE_S, busy=False)
    free_s, went = FREE_S, []
    for _ in range(3):
        now = its.access_s
        went.append(its.take(now, free_s).number)
        free_s = now + 432e-6 + SIFS_S
        its.plan(now, free_s)

    assert went == [0, 1, 2]
    assert its.access_s == math.inf
