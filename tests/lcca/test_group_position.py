"""A car never numbers itself behind itself."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.lcca.group_position import GroupPosition, is_newer

ME, LEADER, OTHER = b"me-me-me", b"leader--", b"other---"


def member(number: int, beat: int, now: float = 0.0) -> GroupPosition:
    place = GroupPosition(ME, memory_s=3.0, beat=0)
    place.take(LEADER, number, beat, now)
    return place


def test_a_car_alone_is_number_1_under_itself() -> None:
    place = GroupPosition(ME, memory_s=3.0, beat=7)
    assert place.header == (ME, ME, 1)
    assert place.beat == 7


def test_a_leader_counts_its_replies_and_a_member_hands_the_count_on() -> None:
    leader = GroupPosition(ME, memory_s=3.0, beat=65534)
    assert [leader.next_beat() for _ in range(3)] == [65535, 0, 1]
    place = member(number=4, beat=500)
    assert [place.next_beat() for _ in range(3)] == [500, 500, 500]


@pytest.mark.parametrize(
    ("number", "beat", "closes"),
    [
        (5, 100, False),  # where we are
        (4, 100, False),  # closer to the leader
        (6, 100, True),  # farther, with no newer news: perhaps our own, come round
        (4, 99, True),  # old news
        (6, 101, False),  # the leader has counted on since: not from behind us
    ],
)
def test_a_place_under_the_same_leader_needs_a_newer_beat_or_no_larger_number(
    number: int, beat: int, closes: bool
) -> None:
    assert member(number=5, beat=100).closes_circle(LEADER, number, beat, 1.0) is closes


def test_the_smallest_number_counts_not_the_last_one() -> None:
    place = member(number=3, beat=100)
    place.take(LEADER, 2, 100, 0.0)
    assert place.closes_circle(LEADER, 3, 100, 0.0)


def test_no_car_follows_one_that_it_leads_under_either_of_its_ids() -> None:
    place = GroupPosition(ME, memory_s=3.0, beat=0)
    place.rename(OTHER)
    assert place.leader_id == OTHER
    assert place.closes_circle(ME, 2, 9, 0.0)
    assert place.closes_circle(OTHER, 2, 9, 0.0)
    place.drop_previous_id()
    assert not place.closes_circle(ME, 2, 9, 0.0)


def test_a_member_that_changes_its_id_keeps_its_leader() -> None:
    place = member(number=3, beat=1)
    place.rename(OTHER)
    assert place.header == (OTHER, LEADER, 3)


def test_a_car_that_leads_anew_has_newer_news_than_when_it_led_before() -> None:
    # Or those behind, closer to it then, would refuse the larger numbers they have now.
    place = GroupPosition(ME, memory_s=3.0, beat=7)
    before = place.beat
    place.take(LEADER, 2, 100, 0.0)
    place.lead()
    assert is_newer(place.beat, before)


def test_a_former_leader_is_remembered_for_as_long_as_old_news_of_it_may_be_about() -> None:
    place = member(number=3, beat=100, now=0.0)
    place.lead()
    assert place.closes_circle(LEADER, 7, 100, 2.9)
    assert not place.closes_circle(LEADER, 7, 100, 3.0)


@given(st.integers(0, 65535), st.integers(1, 32767))
def test_counts_are_compared_across_their_wrap(beat: int, ahead: int) -> None:
    later = (beat + ahead) % 65536
    assert is_newer(later, beat)
    assert not is_newer(beat, later)
    assert not is_newer(beat, beat)
