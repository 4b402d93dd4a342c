"""Encoding and decoding of the LCCA messages."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.errors import DecodeError
from onboard.messages.lcca import (
    MAX_PROOF,
    MESSAGES,
    SIBLING_BYTES,
    VERSION,
    Answer,
    Inquiry,
    Join,
    LccaMessage,
    LccaPdu,
    Leave,
    LeaveReason,
    Reply,
    Update,
    Warn,
    WarnCause,
    as_dict,
    decode,
    encode,
)
from onboard.security import id_commitment
from tests.messages.strategies import records

A, B, C = b"car-aaaa", b"car-bbbb", b"car-cccc"

EXAMPLES: list[tuple[LccaMessage, str]] = [
    (
        Join(B, B, 1, A, 7, A, 258),
        "04 01 00" + B.hex() + B.hex() + "0001" + A.hex() + "0007" + A.hex() + "0102",
    ),
    (
        Reply(A, A, 1, B, 7, 99, 20.0, C),
        # 20.0 m/s is 2000 steps of 0.01
        "04 02 00" + A.hex() + A.hex() + "0001" + B.hex() + "0007 0063 07d0" + C.hex(),
    ),
    (
        Leave(B, A, 2, A, LeaveReason.NOT_AHEAD),
        "04 03 00" + B.hex() + A.hex() + "0002" + A.hex() + "02",
    ),
    (
        Update(B, A, 3, 99),
        "04 04 00" + B.hex() + A.hex() + "0003 0063",
    ),
    (
        Warn(C, A, 3, A, 6, 2, 1, 5, WarnCause.DECELERATION, 7.5, 0.042, 2),
        "04 05 00" + C.hex() + A.hex() + "0003" + A.hex() + "0006 0002 0001 0005 02 4b 002a 02",
    ),
    (
        Inquiry(B, 7, (A[:4], C[:4])),
        # 4 bits count the names after the first; 4 bits of padding end the message
        "04 06 00" + B.hex() + "0007" + f"1{A[:4].hex()}{C[:4].hex()}0",
    ),
    (
        Answer(A, B, 7, b"temp", 20.0),
        "04 07 00" + A.hex() + B.hex() + "0007" + b"temp".hex() + "07d0",
    ),
]


PROOFS = st.lists(st.binary(min_size=SIBLING_BYTES, max_size=SIBLING_BYTES), max_size=MAX_PROOF)


def messages() -> st.SearchStrategy[Any]:
    """Return every message that the declarations allow."""
    return st.one_of([records(record) for record in MESSAGES.values()])


@pytest.mark.parametrize(
    ("message", "wire"), EXAMPLES, ids=lambda value: getattr(value, "kind", "")
)
def test_the_bytes_are_the_declared_ones(message: LccaMessage, wire: str) -> None:
    assert encode(message).hex() == bytes.fromhex(wire).hex()
    assert decode(bytes.fromhex(wire)) == LccaPdu(message)


@pytest.mark.parametrize(
    ("message", "wire"), EXAMPLES, ids=lambda value: getattr(value, "kind", "")
)
def test_every_truncation_is_too_short(message: LccaMessage, wire: str) -> None:
    data = bytes.fromhex(wire)
    for size in range(len(data)):
        with pytest.raises(DecodeError) as refusal:
            decode(data[:size])
        assert refusal.value.reason == "too_short"
    if isinstance(message, Warn):
        assert decode(data + b"signed") == LccaPdu(message, origin=b"signed")
        return
    with pytest.raises(DecodeError) as refusal:
        decode(data + b"\0")
    assert refusal.value.reason == "trailing_bytes"


@given(messages(), PROOFS)
def test_every_declared_lcca_message_survives_encoding_and_decoding(
    message: LccaMessage, proof: list[bytes]
) -> None:
    assert decode(encode(message, proof)) == LccaPdu(message, tuple(proof))


@given(st.binary(max_size=64), st.sampled_from(sorted(MESSAGES)))
def test_any_bytes_are_refused_or_decoded_and_printed(data: bytes, code: int) -> None:
    for garbage in (data, bytes((VERSION, code)) + data):
        try:
            pdu = decode(garbage)
        except DecodeError:
            continue
        assert as_dict(pdu.message)
        assert encode(pdu.message, pdu.proof, pdu.origin) == garbage


def test_the_proof_stands_before_the_fields() -> None:
    message, wire = EXAMPLES[2]
    siblings = (b"sibling one.", b"sibling two.")
    assert (
        encode(message, siblings)
        == bytes.fromhex("04 03 02") + b"".join(siblings) + bytes.fromhex(wire)[3:]
    )


def test_a_proof_longer_than_any_certificate_needs_is_refused() -> None:
    message, _ = EXAMPLES[2]
    with pytest.raises(DecodeError) as refusal:
        decode(encode(message, (bytes(SIBLING_BYTES),) * (MAX_PROOF + 1)))
    assert refusal.value.reason == "out_of_range"


def test_proofs_are_those_of_the_certificates() -> None:
    assert (SIBLING_BYTES, MAX_PROOF) == (id_commitment.NODE_BYTES, id_commitment.MAX_PROOF)


def test_another_version_is_a_decode_error() -> None:
    data = bytearray(encode(EXAMPLES[0][0]))
    data[0] = VERSION + 1
    with pytest.raises(DecodeError) as refusal:
        decode(bytes(data))
    assert refusal.value.reason == "unknown_version"


def test_an_unknown_type_is_a_decode_error() -> None:
    with pytest.raises(DecodeError) as refusal:
        decode(bytes((VERSION, 77)) + bytes(30))
    assert refusal.value.reason == "unknown_type"


def test_a_leave_reason_of_a_later_version_is_kept() -> None:
    later = Leave(B, A, 2, A, 200)
    assert decode(encode(later)).message == later
    assert as_dict(later)["reason"] == "unknown_200"


def test_warn_has_the_highest_user_priority() -> None:
    assert Warn.user_priority == 7
    assert all(
        record.record.user_priority < 7 for record in MESSAGES.values() if record.record is not Warn
    )
