"""The order of received frames when more arrive than can be verified."""

from collections.abc import Callable

import pytest

from onboard.messages import bsm
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData
from onboard.security.ieee1609dot2 import (
    encode_signed,
    encode_to_be_signed,
    encode_unsecured,
    signer_in,
)
from onboard.vehicle.framing import bsm_sender
from onboard.wave_udp import psid
from onboard.wave_udp.receive_queue import (
    KEEP_ALL_BELOW,
    MAX_SENDERS,
    MAX_URGENT_OF_SIGNER,
    ReceiveQueue,
)
from onboard.wave_udp.unknown_signers import MAX_WAITING
from onboard.wave_udp.wsmp import WaveShortMessage, encode


def wsm(service: int, number: int) -> bytes:
    return encode(WaveShortMessage(psid=service, payload=number.to_bytes(4)))


def signed(payload: bytes) -> bytes:
    return encode_signed(encode_to_be_signed(payload, psid.BSM, 1), b"signer..", (1, 1))


def test_group_messages_come_before_bsms_and_each_kind_in_its_order() -> None:
    queue = ReceiveQueue(psid.LCCA, bsm_sender)
    for number in range(3):
        queue.put(wsm(psid.BSM, number))
        queue.put(wsm(psid.LCCA, number))

    taken = list(iter(queue.take, None))

    assert taken == [wsm(kind, n) for kind in (psid.LCCA, psid.BSM) for n in range(3)]
    assert not queue
    assert queue.take_dropped() == 0


def test_only_urgent_takes_group_messages_only() -> None:
    queue = ReceiveQueue(psid.LCCA, bsm_sender)
    queue.put(wsm(psid.BSM, 1))
    queue.put(wsm(psid.LCCA, 2))

    assert queue.take(only_urgent=True) == wsm(psid.LCCA, 2)
    assert queue.take(only_urgent=True) is None
    assert queue, "the other one still waits"


def said_by(sender: int, number: int, *, secure: Callable[[bytes], bytes]) -> bytes:
    message = BasicSafetyMessage(CoreData(number, sender.to_bytes(4)))
    return encode(WaveShortMessage(psid=psid.BSM, payload=secure(bsm.encode(message))))


@pytest.mark.parametrize("secure", [encode_unsecured, signed])
def test_all_frames_are_kept_while_few_wait(secure: Callable[[bytes], bytes]) -> None:
    """Otherwise a forged frame under another's temporary ID would displace its BSM."""
    queue = ReceiveQueue(psid.LCCA, bsm_sender)
    said = [said_by(1, number, secure=secure) for number in range(KEEP_ALL_BELOW)]
    for frame in said:
        queue.put(frame)

    assert list(iter(queue.take, None)) == said
    assert queue.take_dropped() == 0


@pytest.mark.parametrize("secure", [encode_unsecured, signed])
def test_under_overload_the_newest_bsm_of_each_sender_waits_and_senders_take_turns(
    secure: Callable[[bytes], bytes],
) -> None:
    queue = ReceiveQueue(psid.LCCA, bsm_sender)
    crowd = [said_by(number, 0, secure=secure) for number in range(100, 100 + KEEP_ALL_BELOW)]
    for frame in crowd:
        queue.put(frame)
    for number in range(3):
        for sender in (1, 2, 3):
            queue.put(said_by(sender, number, secure=secure))
    queue.put(said_by(1, 3, secure=secure))

    taken = list(iter(queue.take, None))

    newest = {1: 3, 2: 2, 3: 2}
    three = [said_by(sender, newest[sender], secure=secure) for sender in (1, 2, 3)]
    assert taken == crowd + three
    assert queue.take_dropped() == 7
    assert queue.take_dropped() == 0


def test_a_sender_whose_frame_was_taken_queues_again_at_the_end() -> None:
    queue = ReceiveQueue(psid.LCCA, bsm_sender)
    one, two, again = (said_by(s, n, secure=encode_unsecured) for s, n in ((1, 0), (2, 0), (1, 1)))
    queue.put(one)
    queue.put(two)

    assert queue.take() == one
    queue.put(again)
    assert list(iter(queue.take, None)) == [two, again]


def test_forged_senders_cannot_fill_the_memory_or_displace_group_messages() -> None:
    queue = ReceiveQueue(psid.LCCA, bsm_sender)
    queue.put(wsm(psid.LCCA, 7))
    frames = [said_by(n, 0, secure=encode_unsecured) for n in range(MAX_SENDERS + 100)]
    for frame in frames:
        queue.put(frame)

    taken = list(iter(queue.take, None))

    assert taken == [wsm(psid.LCCA, 7), *frames[100:]]
    assert queue.take_dropped() == 100


def test_has_urgent_is_true_while_a_group_message_waits() -> None:
    queue = ReceiveQueue(psid.LCCA, bsm_sender)
    queue.put(wsm(psid.BSM, 1))
    assert not queue.has_urgent
    queue.put(wsm(psid.LCCA, 2))
    assert queue.has_urgent


def test_malformed_frames_wait_like_those_of_unknown_signers() -> None:
    queue = ReceiveQueue(psid.LCCA, bsm_sender)
    queue.put(b"")
    queue.put(b"\xff garbage")

    assert not queue.has_known
    assert list(iter(queue.take_unknown, None)) == [b"\xff garbage", b""]
    assert not queue


def signed_by(name: bytes, number: int, service: int = psid.LCCA) -> bytes:
    data = encode_signed(encode_to_be_signed(number.to_bytes(4), service, 1), name, (1, 1))
    return encode(WaveShortMessage(psid=service, payload=data))


KNOWN = b"leader..", b"follower"


def queue_with_keys() -> ReceiveQueue:
    def known_signer(message: WaveShortMessage) -> bytes | None:
        signer = signer_in(message.payload)
        return signer if signer in KNOWN else None

    return ReceiveQueue(psid.LCCA, bsm_sender, known_signer)


def test_group_messages_of_unknown_signers_do_not_delay_those_of_known_ones() -> None:
    queue = queue_with_keys()
    for number in range(1000):
        queue.put(signed_by(number.to_bytes(8), number))
    queue.put(signed_by(KNOWN[0], 1))

    assert queue.has_urgent
    assert list(iter(queue.take, None)) == [signed_by(KNOWN[0], 1)]
    assert not queue.has_known
    waiting = list(iter(queue.take_unknown, None))
    newest = range(999, 999 - MAX_WAITING, -1)
    assert waiting == [signed_by(n.to_bytes(8), n) for n in newest]
    assert queue.take_dropped() == 1000 - MAX_WAITING


def test_what_is_forged_in_the_name_of_one_signer_costs_another_one_turn() -> None:
    queue = queue_with_keys()
    for number in range(1000):
        queue.put(signed_by(KNOWN[0], number))
    queue.put(signed_by(KNOWN[1], 7))

    first_two = [queue.take(), queue.take()]

    assert first_two == [signed_by(KNOWN[0], 1000 - MAX_URGENT_OF_SIGNER), signed_by(KNOWN[1], 7)]
    assert len(list(iter(queue.take, None))) == MAX_URGENT_OF_SIGNER - 1


def certified(certificate: bytes, number: int) -> bytes:
    return wsm(psid.BSM, int.from_bytes(certificate) << 8 | number)


def queue_with_certificates(*, issuer: bytes = b"") -> ReceiveQueue:
    """All BSMs carry a certificate, which the first three bytes of their payload name.

    If `issuer` is given, only those certificates may be valid that begin with it.
    """
    return ReceiveQueue(
        psid.LCCA,
        bsm_sender,
        lambda _: None,
        lambda each: (each.payload[:3], each.payload.startswith(issuer)),
    )


def test_certificates_that_cannot_be_valid_delay_none_that_may_be() -> None:
    """Not even one that was never there before."""
    queue = queue_with_certificates(issuer=b"c")
    queue.put(certified(b"car", 1))
    for number in range(1000):
        queue.put(certified((number % 500).to_bytes(3), 0))

    assert certified(b"car", 1) in [queue.take_unknown() for _ in range(2)]


def test_a_certificate_that_comes_again_waits_for_none_that_is_made_up() -> None:
    queue = queue_with_certificates()
    queue.put(certified(b"car", 1))
    for number in range(1000):
        queue.put(certified(number.to_bytes(3), 0))
    queue.put(certified(b"car", 2))
    for number in range(1000, 2000):
        queue.put(certified(number.to_bytes(3), 0))

    assert certified(b"car", 2) in [queue.take_unknown() for _ in range(3)]


def test_an_answer_waits_for_neither_made_up_certificates_nor_repeated_ones() -> None:
    queue = queue_with_certificates()
    for number in range(1000):
        queue.put(certified((number % 500).to_bytes(3), 0))
    answer = wsm(psid.PEER_TO_PEER, 7)
    queue.put(answer)

    assert answer in [queue.take_unknown() for _ in range(3)]


def test_repeated_certificates_take_turns() -> None:
    queue = queue_with_certificates()
    for number in (0, 1, 2, 3):
        queue.put(certified(b"two", number))
    for number in (0, 1):
        queue.put(certified(b"car", number))

    repeated = [certified(b"two", 1), certified(b"car", 1), certified(b"two", 2)]
    assert [each for each in iter(queue.take_unknown, None) if each in repeated] == repeated
    assert queue.take_dropped() == 0
