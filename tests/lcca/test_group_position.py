"""A vehicle never numbers itself behind itself."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.lcca.group_position import GroupPosition, is_newer

ME, LEADER, OTHER = b"me-me-me", b"leader--", b"other---"


def member(number: int, leader_sequence: int) -> GroupPosition:
    position = GroupPosition(ME, leader_sequence=0)
    position.take(LEADER, number, leader_sequence)
    return position


def test_a_vehicle_without_group_has_number_1_and_leads_itself() -> None:
    position = GroupPosition(ME, leader_sequence=7)
    assert position.header == (ME, ME, 1)
    assert position.leader_sequence == 7


def test_a_leader_counts_its_replies_and_a_member_passes_the_count_on() -> None:
    leader = GroupPosition(ME, leader_sequence=65534)
    assert [leader.next_leader_sequence() for _ in range(3)] == [65535, 0, 1]
    position = member(number=4, leader_sequence=500)
    assert [position.next_leader_sequence() for _ in range(3)] == [500, 500, 500]


@pytest.mark.parametrize(
    ("number", "leader_sequence", "closes"),
    [
        (5, 100, False),  # where we are
        (4, 100, False),  # closer to the leader
        (6, 100, True),  # farther, with no newer news: perhaps our own, come round
        (4, 99, True),  # old news
        (6, 101, False),  # the leader has counted on since: not from behind us
    ],
)
def test_a_position_needs_a_newer_sequence_number_or_no_larger_group_number(
    number: int, leader_sequence: int, closes: bool
) -> None:
    position = member(number=5, leader_sequence=100)
    assert position.forms_loop(LEADER, number, leader_sequence) is closes


def test_the_smallest_group_number_counts_not_the_last_one() -> None:
    position = member(number=3, leader_sequence=100)
    position.take(LEADER, 2, 100)
    assert position.forms_loop(LEADER, 3, 100)


def test_a_vehicle_never_follows_its_own_group() -> None:
    position = GroupPosition(ME, leader_sequence=0)
    position.rename({ME: OTHER})
    assert position.leader_id == OTHER
    assert position.forms_loop(OTHER, 2, 9)


def test_a_member_that_changes_its_id_keeps_its_leader() -> None:
    position = member(number=3, leader_sequence=1)
    position.rename({ME: OTHER})
    assert position.header == (OTHER, LEADER, 3)


def test_a_renamed_leader_keeps_its_sequence_number() -> None:
    position = member(number=3, leader_sequence=7)
    position.rename({LEADER: OTHER})
    assert position.header == (ME, OTHER, 3)
    assert not position.is_newer(OTHER, 7)
    assert position.forms_loop(OTHER, 4, 7)


def test_a_vehicle_that_leads_again_has_a_newer_sequence_number() -> None:
    # Or those behind, closer to it then, would refuse the larger numbers they have now.
    position = GroupPosition(ME, leader_sequence=7)
    before = position.leader_sequence
    position.take(LEADER, 2, 100)
    position.become_first()
    assert is_newer(position.leader_sequence, before)


def test_nothing_is_stored_of_a_former_leader_whose_daemon_may_have_been_restarted() -> None:
    position = member(number=3, leader_sequence=100)
    position.become_first()
    assert position.is_newer(LEADER, 7)
    assert not position.forms_loop(LEADER, 7, 7)


@given(st.integers(0, 65535), st.integers(1, 32767))
def test_sequence_numbers_are_compared_across_their_wrap(leader_sequence: int, ahead: int) -> None:
    later = (leader_sequence + ahead) % 65536
    assert is_newer(later, leader_sequence)
    assert not is_newer(leader_sequence, later)
    assert not is_newer(leader_sequence, leader_sequence)
