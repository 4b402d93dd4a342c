"""Implicit certificates: published figures, and what a receiver accepts under them."""

import contextlib
import hashlib

import pytest
from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePrivateKey
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.security import ecqv, ieee1609dot2, p256
from onboard.security.certificate_codec import decode_certificate, encode_certificate
from onboard.security.credentials import Credential, Credentials
from onboard.security.its_time import to_time64
from onboard.security.rejection import RejectionReason
from onboard.security.security_services import NotTrusted, SecurityServices
from onboard.security.trust import TrustStore
from onboard.tools.test_ca.authority import make_pseudonyms, make_root
from tests.security import ecqv_vectors
from tests.security.ecqv_vectors import ISSUED, VECTORS, Issued, Vector
from tests.security.trial import BOB, BSM, ISSUING, LCCA, ROOT, UTC_S, VALID, new_key, security
from tests.typed import a

IMPLICIT = make_pseudonyms(ISSUING, 2, {BSM, LCCA}, new_key=new_key, implicit=True, **VALID)
OWN = IMPLICIT.pseudonyms[0]
WARN = b"\x01\x05 a car ahead of you brakes hard"

keys = st.integers(1, p256.ORDER - 1)


def _key(text: str) -> EllipticCurvePrivateKey:
    return p256.private_key(int(text, 16))


# ---- the scheme ---------------------------------------------------------------------------------


@settings(max_examples=30)
@given(factor=st.integers(1, p256.ORDER - 2) | st.sampled_from([1, 2, p256.ORDER - 2]),
       point=keys, addend=keys)  # fmt: skip
def test_a_multiple_and_a_sum_of_points_are_those_of_their_numbers(
    factor: int, point: int, addend: int
) -> None:
    for added in (addend, factor * point % p256.ORDER):
        total = p256.multiply_add(
            factor, p256.private_key(point).public_key(), p256.private_key(added).public_key()
        )
        number = (factor * point + added) % p256.ORDER
        assert total == p256.private_key(number).public_key()


@pytest.mark.parametrize("factor", [0, p256.ORDER - 1, p256.ORDER, 5])
def test_a_factor_out_of_range_or_a_sum_at_infinity_is_a_value_error(factor: int) -> None:
    point, opposite = (p256.private_key(number).public_key() for number in (3, p256.ORDER - 15))
    with pytest.raises(ValueError, match=r"."):
        p256.multiply_add(factor, point, opposite)


@pytest.mark.parametrize("vector", VECTORS.values(), ids=VECTORS)
def test_each_role_computes_the_published_figures(vector: Vector) -> None:
    request, issuer, point = _key(ecqv_vectors.K_U), _key(ecqv_vectors.D_CA), vector.point
    digest = hashlib.sha256(ecqv_vectors.TEXT + bytes.fromhex(point)).digest()
    e = int.from_bytes(digest) >> 1 if vector.drops_last_bit else ecqv.scalar(digest)
    if vector.k is not None:
        ephemeral = _key(vector.k)
        assert ecqv.reconstruction_point(request.public_key(), ephemeral) == bytes.fromhex(point)
        assert ecqv.private_reconstruction(e, ephemeral, issuer) == int(vector.r, 16)
    assert p256.number(ecqv.private_key(e, request, int(vector.r, 16))) == int(vector.d_u, 16)
    expected = p256.public_key(bytes.fromhex(vector.q_u))
    assert ecqv.public_key(bytes.fromhex(point), e, issuer.public_key()) == expected
    assert _key(vector.d_u).public_key() == expected


# ---- certificates of other makers ---------------------------------------------------------------


@pytest.mark.parametrize("issued", ISSUED.values(), ids=ISSUED)
def test_the_keys_of_certificates_that_were_in_use_are_reconstructed(issued: Issued) -> None:
    issuer, certificate = (
        decode_certificate(bytes.fromhex(text)) for text in (issued.issuer, issued.certificate)
    )
    assert certificate.is_implicit
    assert certificate.encoded == bytes.fromhex(issued.certificate)
    assert certificate.issuer_id == issuer.hashed_id8
    e = ecqv.scalar(p256.digest_to_sign(certificate.to_be_signed, issuer.digest))
    private = ecqv.private_key(e, _key(issued.k_u), int(issued.r, 16))
    assert p256.number(private) == int(issued.d_u, 16)
    point = certificate.subject.reconstruction_value
    issuer_key = p256.public_key(a(bytes, issuer.subject.public_key))
    public = ecqv.public_key(a(bytes, point), e, issuer_key)
    assert public == private.public_key()


@pytest.mark.parametrize("name", ["SCMS_KR 2cd1cef68fdabe62", "SCMS_KR 907f01f94d22d971"])
def test_a_message_under_a_foreign_root_is_verified(name: str) -> None:
    root, *authorities = (
        decode_certificate(bytes.fromhex(text))
        for text in (
            ecqv_vectors.SCMS_KR_ROOT,
            ecqv_vectors.SCMS_KR_INTERMEDIATE,
            ecqv_vectors.SCMS_KR_ISSUER,
        )
    )
    certificate = decode_certificate(bytes.fromhex(ISSUED[name].certificate))
    utc_s = certificate.subject.valid_from_utc_s + 60.0
    receiver = SecurityServices(utc_s, Credentials(BOB.pseudonyms, (root,), tuple(authorities)))
    data = _message(Credential(certificate, _key(ISSUED[name].d_u)), utc_s)
    assert receiver.open(data, BSM, now=0.0).payload == WARN


# ---- messages -----------------------------------------------------------------------------------


def _message(own: Credential, utc_s: float = UTC_S) -> bytes:
    to_be_signed = ieee1609dot2.encode_to_be_signed(WARN, BSM, to_time64(utc_s))
    digest = p256.digest_to_sign(to_be_signed, own.certificate.digest)
    return ieee1609dot2.encode_signed(to_be_signed, own.certificate, p256.sign(own.key, digest))


def _refused(receiver: SecurityServices, data: bytes, now: float = 0.0) -> RejectionReason:
    with pytest.raises(NotTrusted) as refusal:
        receiver.open(data, BSM, now)
    return refusal.value.reason


@pytest.fixture
def bob() -> SecurityServices:
    return security(BOB)


@pytest.fixture
def alice() -> SecurityServices:
    return security(IMPLICIT)


def test_messages_under_an_implicit_certificate_are_verified_by_certificate_and_digest(
    alice: SecurityServices, bob: SecurityServices
) -> None:
    sizes = set()
    for count in range(10):
        data = alice.secure(WARN, BSM, now=count / 10)
        opened = bob.open(data, BSM, now=count / 10)
        assert (opened.payload, opened.signer_id) == (WARN, OWN.certificate.hashed_id8)
        sizes.add(len(data))
    assert len(sizes) == 2


def test_an_implicit_certificate_is_shorter_by_its_signature() -> None:
    explicit = BOB.pseudonyms[0].certificate
    assert len(explicit.encoded) - len(OWN.certificate.encoded) == 67


def test_its_key_is_reconstructed_once(
    alice: SecurityServices, bob: SecurityServices, monkeypatch: pytest.MonkeyPatch
) -> None:
    bob.open(alice.secure(WARN, LCCA, now=0.0), LCCA, now=0.0)
    monkeypatch.delattr(p256, "multiply_add")
    bob.open(alice.secure(WARN, LCCA, now=0.1), LCCA, now=0.1)


def test_a_changed_message_is_refused(alice: SecurityServices, bob: SecurityServices) -> None:
    data = alice.secure(WARN, BSM, now=0.0)
    for position in range(0, len(data), 7):
        changed = bytearray(data)
        changed[position] ^= 0x01
        assert _refused(bob, bytes(changed)) != "replay"
    assert bob.open(data, BSM, now=0.0).payload == WARN


def test_a_forged_certificate_gives_a_key_that_signs_nothing_and_is_not_kept(
    bob: SecurityServices,
) -> None:
    """Its maker knows the point, but not the number of the key that it gives."""
    guessed = new_key()
    point = p256.compressed(guessed.public_key())
    to_be_signed = OWN.certificate.to_be_signed[:-33] + bytes((0x80 | point[0],)) + point[1:]
    forged = decode_certificate(
        encode_certificate(OWN.certificate.issuer_id, to_be_signed, signature=None)
    )
    assert _refused(bob, _message(Credential(forged, guessed))) == "bad_signature"
    trust = TrustStore(BOB.roots, BOB.authorities)
    trust.receive_certificate(forged)
    assert trust.find(forged.hashed_id8) is None


def test_a_point_that_is_not_on_the_curve_is_a_bad_certificate(bob: SecurityServices) -> None:
    for x in range(2, 50):
        to_be_signed = OWN.certificate.to_be_signed[:-32] + x.to_bytes(32)
        off = decode_certificate(
            encode_certificate(OWN.certificate.issuer_id, to_be_signed, signature=None)
        )
        reason = _refused(bob, _message(Credential(off, OWN.key)))
        assert reason in {"bad_certificate", "bad_signature"}
        if reason == "bad_certificate":
            return
    raise AssertionError("half of all x are on no point of the curve")


def test_an_implicit_certificate_grants_nothing_beyond_its_issuer_and_its_time(
    bob: SecurityServices,
) -> None:
    generous = make_pseudonyms(ISSUING, 1, {BSM, 0x87}, new_key=new_key, implicit=True, **VALID)
    assert _refused(bob, _message(generous.pseudonyms[0])) == "untrusted_issuer"
    by_root = make_pseudonyms(ROOT, 1, {BSM}, new_key=new_key, implicit=True, **VALID)
    assert _refused(bob, _message(by_root.pseudonyms[0])) == "untrusted_issuer"
    old = make_pseudonyms(
        ISSUING, 1, {BSM}, new_key=new_key, implicit=True, valid_from_utc_s=UTC_S - 60,
        valid_for_s=30,
    )  # fmt: skip
    assert _refused(bob, _message(old.pseudonyms[0])) == "expired"


def test_an_unknown_issuer_is_a_reason_of_its_own(bob: SecurityServices) -> None:
    elsewhere = make_root("elsewhere", {BSM}, new_key=new_key, **VALID)
    car = make_pseudonyms(elsewhere, 1, {BSM}, new_key=new_key, implicit=True, **VALID)
    assert _refused(bob, _message(car.pseudonyms[0])) == "unknown_issuer"


def test_an_authority_with_an_implicit_certificate_is_unsupported() -> None:
    """Nothing would prove it: an authority signs certificates, not messages."""
    below = type(ISSUING)(OWN, ISSUING.roots, (*ISSUING.authorities, OWN.certificate))
    car = make_pseudonyms(below, 1, {BSM}, new_key=new_key, **VALID).pseudonyms[0]
    receiver = SecurityServices(UTC_S, Credentials(BOB.pseudonyms, below.roots, below.authorities))
    assert _refused(receiver, _message(car)) == "unsupported"


@given(noise=st.binary(min_size=1, max_size=80), position=st.integers(0, 200))
def test_any_bytes_raise_only_not_trusted(noise: bytes, position: int) -> None:
    data = _message(OWN)
    garbled = data[:position] + noise + data[position + len(noise) :]
    with contextlib.suppress(NotTrusted):
        assert security(BOB).open(garbled, BSM, now=0.0).payload == WARN
