"""Any messages in any order leave a consistent state and bounded memory."""

import math
import tracemalloc
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.lcca.events import MeasuredLead
from onboard.lcca.group import WarningGroup
from onboard.lcca.parameters import GroupParameters
from onboard.lcca.transitions import GroupState
from onboard.messages.lcca import (
    GroupMessage,
    Join,
    Leave,
    LeaveReason,
    Reply,
    Update,
    Warn,
    encode,
)
from onboard.observations import HardBrake

OWN, A, B, C = b"own-----", b"car-aaaa", b"car-bbbb", b"car-cccc"

ids = st.sampled_from([OWN, A, A, A, B, C])
numbers = st.integers(1, 5) | st.just(65535)
counts = st.integers(0, 3) | st.just(65535)
header = {"sender_id": ids, "leader_id": ids, "number": numbers}
event = {"event_origin_id": ids, "event_sequence": counts, "reach": counts}

messages = st.one_of(
    st.builds(
        Join,
        **header,
        to_id=ids,
        sequence=counts,
        acknowledged_origin_id=ids,
        acknowledged_sequence=counts,
    ),
    st.builds(
        Reply,
        **header,
        to_id=st.just(OWN),
        sequence=counts,
        leader_sequence=counts,
        speed_m_s=st.none(),
    ),
    st.builds(Leave, **header, to_id=ids, reason=st.just(LeaveReason.GAP)),
    st.builds(Update, **header, leader_sequence=counts),
    st.builds(
        Warn,
        **header,
        **event,
        origin_number=numbers,
        deceleration_m_s2=st.just(6.0),
        age_s=st.sampled_from([0.0, 2.9, 60.0]),
        hops=st.sampled_from([1, 255]),
    ),
)


class Frame:
    """A camera frame that shows a car, close or far, or none."""

    def __init__(self, car_id: bytes | None, gap_m: float) -> None:
        self.ahead = MeasuredLead(car_id, gap_m, None)


Step = GroupMessage | Frame | float | str

steps = st.one_of(
    messages,
    st.builds(Frame, st.sampled_from([A, A, A, B, OWN, None]), st.sampled_from([10.0, 10.0, 99.0])),
    st.sampled_from([0.01, 0.1, 0.5, 2.0]),
    st.sampled_from(["answer", "answer", "brake", "rename"]),
)


@pytest.mark.long
@given(st.lists(steps, max_size=60))
@settings(max_examples=300, derandomize=True, database=None)
def test_any_sequence_of_inputs_leaves_a_consistent_state(
    script: list[Step],
) -> None:
    group = WarningGroup(GroupParameters(), OWN, np.random.default_rng(0))
    now, last_join, renamed = 0.0, None, 0
    for step in script:
        group.receive_speed(20.0, now)
        match step:
            case float():
                now += step
                group.handle_timer(now)
            case Frame():
                group.receive_lead(step.ahead, now)
            case "answer" if last_join is not None:
                leader_sequence = int(now * 10) % 65536
                answer = Reply(
                    last_join.to_id, A, 3, OWN, last_join.sequence, leader_sequence, None, A
                )
                group.receive_message(answer, now)
            case "brake":
                group.receive_hard_brake(HardBrake(now, 6.0, "test"), now)
            case "rename":
                renamed += 1
                group.set_own_id(f"own-{renamed:04d}".encode(), now)
            case Join() | Reply() | Leave() | Update() | Warn():
                group.receive_message(step, now)
        for message in group.messages_to_send(now):
            assert encode(message)
            last_join = message if isinstance(message, Join) else last_join
        timer = group.get_timer()
        assert timer == math.inf or timer < now + 60.0
        follows = group.predecessor_id is not None
        assert (group.state is GroupState.MEMBER) is follows
        assert (group.group_number > 1) is follows
        assert (group.state is GroupState.REGULAR) is (not follows and not group.followers)


@given(st.lists(messages, max_size=30))
@settings(max_examples=100, derandomize=True, database=None)
def test_a_regular_vehicle_is_never_warned(
    script: list[GroupMessage],
) -> None:
    group = WarningGroup(GroupParameters(), OWN, np.random.default_rng(0))
    for message in script:
        group.receive_message(message, 0.0)
        while (event := group.next_event()) is not None:
            assert event.kind != "warning"


def made_up_joins(to_id: bytes) -> Iterator[Join]:
    """Each from another car, which is in our group and acknowledges a message nobody has sent."""
    for name in range(1_000_000):
        yield Join(name.to_bytes(8), OWN, 2, to_id, 0, b"made-up-", 7)


@pytest.mark.parametrize("to_id", [OWN, A], ids=["to us", "to another"])
def test_a_sender_of_many_ids_fills_no_memory(to_id: bytes) -> None:
    group = WarningGroup(GroupParameters(), OWN, np.random.default_rng(1))
    joins = made_up_joins(to_id)

    def hear_them_for(seconds: float, since: float) -> None:
        for step in range(int(seconds * 500)):
            now = since + step / 500
            group.receive_message(next(joins), now)
            group.handle_timer(now)
            group.messages_to_send(now)
            while group.next_event() is not None:
                pass

    tracemalloc.start()
    try:
        hear_them_for(4.0, since=0.0)
        of_the_first_s, _ = tracemalloc.get_traced_memory()
        hear_them_for(6.0, since=4.0)
        of_all, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()

    assert of_all < of_the_first_s + 50_000, "bytes: a name that is not heard again is forgotten"
