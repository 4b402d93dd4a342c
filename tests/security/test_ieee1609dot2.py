"""1609.2 data, compatible with another implementation."""

import hashlib
import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.utils import Prehashed, encode_dss_signature
from cryptography.hazmat.primitives.hashes import SHA256
from hypothesis import given
from hypothesis import strategies as st

from onboard.messages import bsm
from onboard.security import ieee1609dot2, its_time
from onboard.security.ieee1609dot2 import SignedData
from onboard.security.security_services import NotTrusted, SecurityServices
from tests.security.trial import ALICE, BSM, UTC_S, reread, security
from tests.typed import a

OWN = ALICE.pseudonyms[0].certificate


# ---- time ---------------------------------------------------------------------------------------


def test_the_epoch_of_time64_and_the_leap_seconds_since() -> None:
    new_year_2017 = datetime(2017, 1, 1, tzinfo=UTC).timestamp()
    days = (datetime(2017, 1, 1, tzinfo=UTC) - datetime(2004, 1, 1, tzinfo=UTC)).days
    assert its_time.to_time64(new_year_2017) == (days * 86_400 + 5) * 1_000_000
    assert its_time.to_time32(new_year_2017) == days * 86_400 + 5


@given(st.integers(0, 2**52))
def test_times_survive(time64: int) -> None:
    assert its_time.to_time64(its_time.from_time64(time64)) == time64


# ---- messages -----------------------------------------------------------------------------------


@given(payload=st.binary(max_size=300), psid=st.integers(0, 2**28))
def test_another_implementation_decodes_our_signed_data(
    oracle: Any, payload: bytes, psid: int
) -> None:
    alice = security(ALICE)
    with_certificate = alice.secure(
        payload, psid, now=1.0, expires_in_s=0.25, location=ieee1609dot2.Location(1.5, -2.5, 3.0)
    )
    value = reread(oracle.Ieee1609Dot2Data, with_certificate)
    kind, signed = value["content"]
    header = signed["tbsData"]["headerInfo"]
    assert (value["protocolVersion"], kind, signed["hashId"]) == (3, "signedData", "sha256")
    assert header == {
        "psid": psid,
        "generationTime": its_time.to_time64(UTC_S + 1.0),
        "expiryTime": its_time.to_time64(UTC_S + 1.25),
        "generationLocation": {"latitude": 15000000, "longitude": -25000000, "elevation": 4126},
    }
    inner = signed["tbsData"]["payload"]["data"]
    assert inner == {"protocolVersion": 3, "content": ("unsecuredData", payload)}
    assert signed["signer"][0] == "certificate"

    alice.secure(payload, BSM, now=1.0)
    by_digest = reread(oracle.Ieee1609Dot2Data, alice.secure(payload, BSM, now=1.1))
    assert by_digest["content"][1]["signer"] == ("digest", OWN.hashed_id8)


@given(payload=st.binary(max_size=300), noise=st.binary(max_size=20))
def test_the_payload_is_found_without_decoding_the_rest(payload: bytes, noise: bytes) -> None:
    for secured in (
        ieee1609dot2.encode_unsecured(payload),
        security(ALICE).secure(payload, BSM, now=1.0),
    ):
        found = ieee1609dot2.payload_in(secured)
        assert found is not None
        assert found.startswith(payload)
    for head in (b"", b"\x03\x80", b"\x03\x81\x00\x40\x03\x80"):
        ieee1609dot2.payload_in(head + noise)
    assert ieee1609dot2.payload_in(b"\x02" + noise) is None


def test_the_signature_covers_the_hashes_of_the_standard(oracle: Any) -> None:
    """IEEE 1609.2, 5.3.1.2.2, computed from the fields that the oracle decodes."""
    value = reread(oracle.Ieee1609Dot2Data, security(ALICE).secure(b"words", BSM, now=0.0))
    signed = value["content"][1]
    oracle.ToBeSignedData.set_val(signed["tbsData"])
    oracle.Certificate.set_val(signed["signer"][1][0])
    words, signer = (
        hashlib.sha256(structure.to_coer()).digest()
        for structure in (oracle.ToBeSignedData, oracle.Certificate)
    )
    _, parts = signed["signature"]
    signature = encode_dss_signature(
        int.from_bytes(parts["rSig"][1]), int.from_bytes(parts["sSig"])
    )
    _, (_, (parity, x)) = signed["signer"][1][0]["toBeSigned"]["verifyKeyIndicator"]
    point = (b"\x02" if parity == "compressed-y-0" else b"\x03") + x
    key = ec.EllipticCurvePublicKey.from_encoded_point(ec.SECP256R1(), point)
    digest = hashlib.sha256(words + signer).digest()
    key.verify(signature, digest, ec.ECDSA(Prehashed(SHA256())))


points = st.one_of(
    st.tuples(st.sampled_from(["x-only", "compressed-y-0", "compressed-y-1"]), st.binary(
        min_size=32, max_size=32)),
    st.tuples(
        st.just("uncompressedP256"),
        st.fixed_dictionaries(
            {axis: st.binary(min_size=32, max_size=32) for axis in ("x", "y")}
        ),
    ),
)  # fmt: skip
times = st.integers(0, 2**64 - 1)


@given(
    payload=st.binary(max_size=200),
    header=st.fixed_dictionaries(
        {"psid": st.integers(0, 2**32)},
        optional={
            "generationTime": times,
            "expiryTime": times,
            "generationLocation": st.fixed_dictionaries(
                {
                    "latitude": st.integers(-900_000_000, 900_000_000),
                    "longitude": st.integers(-1_799_999_999, 1_800_000_000),
                    "elevation": st.integers(0, 65535),
                }
            ),
            "p2pcdLearningRequest": st.binary(min_size=3, max_size=3),
            "inlineP2pcdRequest": st.lists(st.binary(min_size=3, max_size=3), max_size=3),
            "pduFunctionalType": st.integers(0, 255),
        },
    ),
    signature=st.tuples(points, st.binary(min_size=32, max_size=32)),
    digest=st.binary(min_size=8, max_size=8),
)
def test_signed_data_of_another_implementation_are_decoded(
    oracle: Any,
    payload: bytes,
    header: Any,
    signature: tuple[tuple[str, Any], bytes],
    digest: bytes,
) -> None:
    r, s = signature
    to_be_signed = {
        "payload": {"data": {"protocolVersion": 3, "content": ("unsecuredData", payload)}},
        "headerInfo": header,
    }
    oracle.Ieee1609Dot2Data.set_val(
        {
            "protocolVersion": 3,
            "content": (
                "signedData",
                {
                    "hashId": "sha256",
                    "tbsData": to_be_signed,
                    "signer": ("digest", digest),
                    "signature": ("ecdsaNistP256Signature", {"rSig": r, "sSig": s}),
                },
            ),
        }
    )
    read = a(SignedData, ieee1609dot2.decode(oracle.Ieee1609Dot2Data.to_coer()))
    oracle.ToBeSignedData.set_val(to_be_signed)
    x = r[1]["x"] if r[0] == "uncompressedP256" else r[1]
    assert read.payload == payload
    assert read.psid == header["psid"]
    assert read.generation_time64 == header.get("generationTime")
    assert read.expiry_time64 == header.get("expiryTime")
    assert (read.location is None) == ("generationLocation" not in header)
    assert read.to_be_signed == oracle.ToBeSignedData.to_coer()
    assert read.signer == digest
    assert read.signature == (int.from_bytes(x), int.from_bytes(s))
    again = ieee1609dot2.encode_signed(read.to_be_signed, read.signer, read.signature)
    if r[0] == "x-only":
        assert again == oracle.Ieee1609Dot2Data.to_coer()


# ---- real units ---------------------------------------------------------------------------------


@pytest.fixture
def real_data(rig_data: Path) -> list[tuple[bytes, dict[str, int | str]]]:
    rows = (rig_data / "wsm/real-wsms.jsonl").read_text().splitlines()
    parsed = [json.loads(row) for row in rows]
    return [(bytes.fromhex(row["wsm"])[-row["wsmp"]["length"] :], row["core"]) for row in parsed]


@pytest.mark.realdata
def test_eighteen_signed_messages_of_a_real_unit_are_decoded_down_to_the_bsm(
    real_data: list[tuple[bytes, dict[str, int | str]]], oracle: Any
) -> None:
    assert len(real_data) == 18
    for data, expected in real_data:
        signed = a(SignedData, ieee1609dot2.decode(data))
        value = reread(oracle.Ieee1609Dot2Data, data)
        header = value["content"][1]["tbsData"]["headerInfo"]
        assert (signed.psid, signed.generation_time64) == (32, header["generationTime"])
        core = bsm.decode(signed.payload).core
        assert (core.msg_cnt, core.temporary_id.hex()) == (expected["msgCnt"], expected["id"])
        seconds = (a(float, signed.generation_utc_s) - a(float, core.sec_mark_s)) % 60
        assert seconds < 0.5, "made when the BSM says, half a second earlier at most"


@pytest.mark.realdata
def test_its_certificate_has_the_hashed_id8_of_the_other_messages(
    real_data: list[tuple[bytes, dict[str, int | str]]],
) -> None:
    signers = [a(SignedData, ieee1609dot2.decode(data)).signer for data, _ in real_data]
    digests = {signer for signer in signers if isinstance(signer, bytes)}
    certificates = {signer[0].hashed_id8 for signer in signers if not isinstance(signer, bytes)}
    assert len(certificates) == 1
    assert certificates == digests


@pytest.mark.realdata
def test_all_of_them_are_refused_because_their_issuer_is_unknown(
    real_data: list[tuple[bytes, dict[str, int | str]]],
) -> None:
    bob = SecurityServices(0.0, ALICE)
    refusals = set()
    for data, _ in real_data:
        now = a(float, a(SignedData, ieee1609dot2.decode(data)).generation_utc_s)
        with pytest.raises(NotTrusted) as refusal:
            bob.open(data, BSM, now)
        refusals.add(str(refusal.value))
    assert refusals == {
        "unknown_certificate: afc46273f760137e",
        "unknown_issuer: c620fb90caad3b9c",
    }


@pytest.mark.parametrize(
    ("latitude", "longitude"), [(900_000_001, 115_000_000), (481_000_000, 1_800_000_001)]
)
def test_a_location_that_its_sender_does_not_know_is_none(latitude: int, longitude: int) -> None:
    """NinetyDegreeInt and OneEightyDegreeInt have a code for that."""
    unknown = ieee1609dot2.Location(latitude / 1e7, longitude / 1e7, 0.0)
    data = security(ALICE).secure(b"", BSM, now=1.0, location=unknown)
    assert a(SignedData, ieee1609dot2.decode(data)).location is None


# ---- the signer, before anything is verified ----------------------------------------------------


@given(payload=st.binary(max_size=300), psid=st.integers(0, 2**28))
def test_the_signer_is_named_by_digest_and_by_certificate(payload: bytes, psid: int) -> None:
    to_be_signed = ieee1609dot2.encode_to_be_signed(payload, psid, 1)
    for signer in (OWN, OWN.hashed_id8):
        data = ieee1609dot2.encode_signed(to_be_signed, signer, (1, 1))
        assert ieee1609dot2.signer_in(data) == OWN.hashed_id8


@given(st.binary(max_size=300), st.integers(0, 200))
def test_any_bytes_name_some_signer_or_none(noise: bytes, kept: int) -> None:
    head = security(ALICE).secure(b"", BSM, now=1.0)[:kept]
    for data in (noise, head, head + noise):
        named = ieee1609dot2.signer_in(data)
        assert named is None or len(named) == 8


def test_unsecured_data_name_no_signer() -> None:
    assert ieee1609dot2.signer_in(ieee1609dot2.encode_unsecured(b"1234")) is None
