"""What comes first when more comes than can be looked at."""

from onboard.wave_udp import psid
from onboard.wave_udp.receive_queue import MOST_WAITING, ReceiveQueue
from onboard.wave_udp.wsmp import WaveShortMessage, encode


def wsm(service: int, number: int) -> bytes:
    return encode(WaveShortMessage(psid=service, payload=number.to_bytes(4)))


def test_group_messages_come_first_and_each_kind_in_its_order() -> None:
    queue = ReceiveQueue(psid.LCCA)
    for number in range(3):
        queue.put(wsm(psid.BSM, number))
        queue.put(wsm(psid.LCCA, number))

    taken = list(iter(queue.take, None))

    assert taken == [wsm(kind, n) for kind in (psid.LCCA, psid.BSM) for n in range(3)]
    assert not queue
    assert queue.take_shed() == 0


def test_when_time_is_over_only_group_messages_are_taken() -> None:
    queue = ReceiveQueue(psid.LCCA)
    queue.put(wsm(psid.BSM, 1))
    queue.put(wsm(psid.LCCA, 2))

    assert queue.take(only_urgent=True) == wsm(psid.LCCA, 2)
    assert queue.take(only_urgent=True) is None
    assert queue, "the other one still waits"


def test_of_too_many_bsms_the_newest_stay_and_the_rest_are_counted() -> None:
    queue = ReceiveQueue(psid.LCCA)
    queue.put(wsm(psid.LCCA, 7))
    for number in range(MOST_WAITING + 100):
        queue.put(wsm(psid.BSM, number))

    taken = list(iter(queue.take, None))

    assert taken[0] == wsm(psid.LCCA, 7)
    assert taken[1:] == [wsm(psid.BSM, 100 + number) for number in range(MOST_WAITING)]
    assert queue.take_shed() == 100
    assert queue.take_shed() == 0


def test_what_is_no_wsm_waits_like_a_bsm() -> None:
    queue = ReceiveQueue(psid.LCCA)
    queue.put(b"")
    queue.put(b"\xff garbage")

    assert list(iter(queue.take, None)) == [b"", b"\xff garbage"]
