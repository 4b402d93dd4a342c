"""Project Wycheproof's ECDSA P-256 vectors (`RIG_DATA`), as far as 1609.2 can carry them.

A Signature has 32 bytes for r and for s; vectors whose defect is in DER, or that need more bytes,
cannot be written down in it.
"""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric.utils import decode_dss_signature

from onboard.security import p256
from onboard.security.certificate_codec import encode_signature, read_signature
from onboard.security.oer import OerReader

NUMBER_BYTES = 32


def from_p1363(encoded: bytes) -> p256.Signature | None:
    if len(encoded) != 2 * NUMBER_BYTES:
        return None
    return int.from_bytes(encoded[:NUMBER_BYTES]), int.from_bytes(encoded[NUMBER_BYTES:])


def from_der(encoded: bytes) -> p256.Signature | None:
    try:
        numbers = decode_dss_signature(encoded)
    except ValueError:
        return None
    return numbers if all(0 <= each < 1 << 8 * NUMBER_BYTES for each in numbers) else None


@pytest.mark.realdata
@pytest.mark.parametrize(
    ("file", "signature_in", "carried"),
    [
        ("ecdsa_secp256r1_sha256_p1363_test.json", from_p1363, 241),
        ("ecdsa_secp256r1_sha256_test.json", from_der, 249),
    ],
)
def test_every_signature_that_a_message_can_carry_is_judged_as_the_vectors_say(
    rig_data: Path, file: str, signature_in: Callable[..., tuple[int, int] | None], carried: int
) -> None:
    judged = []
    for group in json.loads((rig_data / "crypto" / file).read_text())["testGroups"]:
        key = p256.public_key(bytes.fromhex(group["publicKey"]["uncompressed"]))
        for vector in group["tests"]:
            signature = signature_in(bytes.fromhex(vector["sig"]))
            if signature is None:
                assert vector["result"] == "invalid"
                continue
            received = read_signature(OerReader(encode_signature(signature)))
            digest = hashlib.sha256(bytes.fromhex(vector["msg"])).digest()
            judged.append((vector["tcId"], p256.is_signed(key, digest, received)))
            assert judged[-1][1] == (vector["result"] == "valid"), vector
    assert len(judged) == carried
