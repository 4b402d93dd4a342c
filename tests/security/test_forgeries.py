"""Forged, replayed, expired and stale messages: each is refused with its own reason."""

import numpy as np
import pytest
from cryptography.hazmat.primitives.asymmetric import ec
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.strategies._internal.core import DataObject

from onboard.security import ieee1609dot2, p256
from onboard.security.certificate_codec import encode_certificate, encode_signature
from onboard.security.its_time import to_time64
from onboard.security.rejection import RejectionReason
from onboard.security.security_services import NotTrusted, SecurityServices
from onboard.tools.test_ca.authority import make_issuing, make_pseudonyms, make_root
from tests.security.trial import (
    ALICE,
    BOB,
    BSM,
    ISSUING,
    LCCA,
    ROOT,
    UTC_S,
    VALID,
    new_key,
    security,
)
from tests.typed import a

WARN = b"\x01\x05 a car ahead of you brakes hard"
P256_ORDER = 0xFFFFFFFF00000000FFFFFFFFFFFFFFFFBCE6FAADA7179E84F3B9CAC2FC632551


@pytest.fixture
def alice() -> SecurityServices:
    return security(ALICE)


@pytest.fixture
def bob() -> SecurityServices:
    return security(BOB)


def refused(
    receiver: SecurityServices, data: bytes, psid: int = LCCA, now: float = 0.0
) -> RejectionReason:
    with pytest.raises(NotTrusted) as refusal:
        receiver.open(data, psid, now)
    return refusal.value.reason


def test_a_signed_message_is_accepted_once(alice: SecurityServices, bob: SecurityServices) -> None:
    opened = bob.open(alice.secure(WARN, LCCA, now=10.0), LCCA, now=10.02)
    assert opened.payload == WARN
    assert opened.signer_id == ALICE.pseudonyms[0].certificate.hashed_id8
    assert opened.generation_utc_s == pytest.approx(UTC_S + 10.0, abs=1e-6)


# ---- changed or repeated ------------------------------------------------------------------------


def test_a_message_with_a_changed_bit_is_refused(
    alice: SecurityServices, bob: SecurityServices
) -> None:
    """Every bit of the message, one at a time."""
    data = alice.secure(WARN, LCCA, now=0.0)
    reasons = set()
    for i in range(len(data)):
        for bit in range(8):
            changed = bytearray(data)
            changed[i] ^= 1 << bit
            try:
                opened = bob.open(bytes(changed), LCCA, now=0.0)
            except NotTrusted as refusal:
                reasons.add(str(refusal.reason))
                continue
            # How the point in a signature is written may differ: the form that is hashed and
            # signed does not have it (IEEE 1609.2, 6.4).
            assert i in {len(data) - 65, len(data) - 66 - 65}
            assert opened.payload == WARN
            bob = security(BOB)
    assert {"bad_signature", "malformed", "untrusted_issuer", "wrong_psid"} <= reasons


def test_a_duplicate_message_is_refused_as_a_replay(
    alice: SecurityServices, bob: SecurityServices
) -> None:
    data = alice.secure(WARN, LCCA, now=0.0)
    bob.open(data, LCCA, now=0.1)
    assert refused(bob, data, now=0.2) == "replay"
    assert refused(bob, data, now=6.0) == "stale"


def test_a_replay_with_another_valid_signature_over_the_same_data_is_refused(
    alice: SecurityServices, bob: SecurityServices
) -> None:
    """(r, n - s) verifies too: the window holds digests of the data, not signatures."""
    data = alice.secure(WARN, LCCA, now=0.0)
    r, s = data[-64:-32], int.from_bytes(data[-32:])
    twin = data[:-64] + r + (P256_ORDER - s).to_bytes(32)
    assert security(BOB).open(twin, LCCA, now=0.1).payload == WARN
    bob.open(data, LCCA, now=0.1)
    assert refused(bob, twin, now=0.2) == "replay"


def test_a_forged_copy_that_arrives_first_does_not_block_the_genuine_message(
    alice: SecurityServices, bob: SecurityServices
) -> None:
    data = alice.secure(WARN, LCCA, now=0.0)
    assert refused(bob, data[:-1] + bytes((data[-1] ^ 1,))) == "bad_signature"
    assert bob.open(data, LCCA, now=0.1).payload == WARN


def test_equal_payloads_signed_at_the_same_time_are_two_messages(
    alice: SecurityServices, bob: SecurityServices
) -> None:
    for data in [alice.secure(WARN, LCCA, now=1.0) for _ in range(3)]:
        assert bob.open(data, LCCA, now=1.0).payload == WARN


def test_the_host_vehicles_own_message_is_refused_as_an_echo(alice: SecurityServices) -> None:
    data = alice.secure(WARN, LCCA, now=0.0)
    assert refused(alice, data) == "own_echo"
    alice.sign_with(ALICE.pseudonyms[1])
    assert refused(alice, data) == "own_echo", "also under the identity before"
    alice.secure(WARN, BSM, now=0.0)
    by_digest = alice.secure(WARN, BSM, now=0.1)
    assert refused(alice, by_digest, BSM, now=0.1) == "own_echo"


def test_what_may_wait_carries_the_certificate_as_rarely_as_bsms(alice: SecurityServices) -> None:
    carried = [
        ieee1609dot2.certificate_in(alice.secure(WARN, LCCA, now, may_wait=may_wait)) is not None
        for now, may_wait in ((0.0, True), (0.1, True), (0.2, False), (0.5, True), (0.7, True))
    ]
    assert carried == [True, False, True, False, True]


# ---- time ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("received_at", "reason"),
    [(5.001, "stale"), (3600.0, "stale"), (-2.001, "from_the_future"), (-3600, "from_the_future")],
)
def test_a_stale_or_future_message_is_refused(
    alice: SecurityServices, bob: SecurityServices, received_at: float, reason: str
) -> None:
    assert refused(bob, alice.secure(WARN, LCCA, now=0.0), now=received_at) == reason


@pytest.mark.parametrize("received_at", [4.999, -1.999])
def test_clocks_may_differ_within_the_tolerance(
    alice: SecurityServices, bob: SecurityServices, received_at: float
) -> None:
    assert bob.open(alice.secure(WARN, LCCA, now=0.0), LCCA, received_at).payload == WARN


def test_a_message_after_its_expiry_time_is_refused(
    alice: SecurityServices, bob: SecurityServices
) -> None:
    data = alice.secure(WARN, LCCA, now=0.0, expires_in_s=0.5)
    assert security(BOB).open(data, LCCA, now=0.499).payload == WARN
    assert refused(bob, data, now=0.5) == "expired"


@pytest.mark.parametrize(
    ("now", "reason"), [(VALID["valid_for_s"], "expired"), (-3601.0, "not_yet_valid")]
)
def test_a_message_with_an_expired_certificate_is_refused(
    alice: SecurityServices, bob: SecurityServices, now: float, reason: str
) -> None:
    assert refused(bob, alice.secure(WARN, LCCA, now=now), now=now) == reason


def test_a_certificate_expires_with_that_of_its_issuer(bob: SecurityServices) -> None:
    short = make_issuing(
        ROOT, "short", new_key=new_key, valid_from_utc_s=UTC_S - 60, valid_for_s=120
    )
    mallory = security(make_pseudonyms(short, 1, {LCCA}, new_key=new_key, **VALID))
    trusting = SecurityServices(
        UTC_S, type(BOB)(BOB.pseudonyms, BOB.roots, (*BOB.authorities, *short.authorities))
    )
    assert trusting.open(mallory.secure(WARN, LCCA, now=0.0), LCCA, now=0.0).payload == WARN
    assert refused(trusting, mallory.secure(WARN, LCCA, now=60.0), now=60.0) == "expired"
    assert refused(trusting, mallory.secure(WARN, LCCA, now=-61.0), now=-61.0) == "not_yet_valid"
    assert refused(bob, mallory.secure(WARN, LCCA, now=0.0)) == "unknown_issuer"


def test_a_message_without_generation_time_is_stale(bob: SecurityServices) -> None:
    own = ALICE.pseudonyms[0]
    stamped = ieee1609dot2.encode_to_be_signed(WARN, LCCA, to_time64(UTC_S))
    unstamped = stamped[: -8 - 4] + b"\x00" + stamped[-8 - 3 : -8]
    digest = p256.digest_to_sign(unstamped, own.certificate.digest)
    data = ieee1609dot2.encode_signed(unstamped, own.certificate, p256.sign(own.key, digest))
    assert refused(bob, data) == "stale"


# ---- who ----------------------------------------------------------------------------------------


def test_unsecured_data_is_refused_as_unsigned(bob: SecurityServices) -> None:
    assert refused(bob, security().secure(WARN, LCCA, now=0.0)) == "unsigned"


def test_a_digest_is_unknown_until_its_certificate_was_received(
    alice: SecurityServices, bob: SecurityServices
) -> None:
    first, second = (alice.secure(b"bsm", BSM, now) for now in (0.0, 0.1))
    assert refused(bob, second, BSM, now=0.1) == "unknown_certificate"
    assert bob.open(first, BSM, now=0.1).payload == b"bsm"
    assert bob.open(second, BSM, now=0.1).payload == b"bsm"


def test_cars_of_another_root_are_refused(bob: SecurityServices) -> None:
    root = make_root("another root", {LCCA}, new_key=new_key, **VALID)
    issuing = make_issuing(root, "another issuing", new_key=new_key, **VALID)
    stranger = security(make_pseudonyms(issuing, 1, {LCCA}, new_key=new_key, **VALID))
    assert refused(bob, stranger.secure(WARN, LCCA, now=0.0)) == "unknown_issuer"


def test_a_self_signed_certificate_is_refused(bob: SecurityServices) -> None:
    root = make_root("myself", {LCCA}, new_key=new_key, **VALID)
    mallory = security(type(BOB)((root.credential,), (), ()))
    assert refused(bob, mallory.secure(WARN, LCCA, now=0.0)) == "untrusted_issuer"


def test_a_certificate_issued_by_a_car_is_refused(bob: SecurityServices) -> None:
    """Alice's own certificate grants nothing to others."""
    as_authority = type(ISSUING)(
        ALICE.pseudonyms[0], ISSUING.roots, (*ISSUING.authorities, ALICE.pseudonyms[0].certificate)
    )
    friend = security(make_pseudonyms(as_authority, 1, {LCCA}, new_key=new_key, **VALID))
    alice = security(ALICE)
    bob.open(alice.secure(WARN, LCCA, now=0.0), LCCA, now=0.0)
    assert refused(bob, friend.secure(WARN, LCCA, now=0.0)) == "untrusted_issuer"


def test_a_certificate_not_signed_by_its_issuer_is_refused(bob: SecurityServices) -> None:
    """A forged certificate that names the issuing authority."""
    root = make_root("mallory", {BSM, LCCA}, new_key=new_key, **VALID)
    forger = type(ISSUING)(
        type(ALICE.pseudonyms[0])(ISSUING.credential.certificate, root.credential.key),
        ISSUING.roots,
        ISSUING.authorities,
    )
    forged = security(make_pseudonyms(forger, 1, {LCCA}, new_key=new_key, **VALID))
    assert refused(bob, forged.secure(WARN, LCCA, now=0.0)) == "bad_certificate"


def test_a_message_signed_without_the_certificates_key_is_refused(bob: SecurityServices) -> None:
    stolen = type(ALICE.pseudonyms[0])(ALICE.pseudonyms[0].certificate, new_key())
    mallory = security(type(ALICE)((stolen,), ALICE.roots, ALICE.authorities))
    assert refused(bob, mallory.secure(WARN, LCCA, now=0.0)) == "bad_signature"


# ---- what they may say --------------------------------------------------------------------------


def test_a_message_signed_for_another_service_is_refused(
    alice: SecurityServices, bob: SecurityServices
) -> None:
    assert refused(bob, alice.secure(b"bsm", BSM, now=0.0), LCCA) == "wrong_psid"


def test_a_service_that_the_certificate_does_not_permit_is_refused(bob: SecurityServices) -> None:
    only_bsm = security(make_pseudonyms(ISSUING, 1, {BSM}, new_key=new_key, **VALID))
    assert refused(bob, only_bsm.secure(WARN, LCCA, now=0.0)) == "wrong_psid"
    assert bob.open(only_bsm.secure(b"bsm", BSM, now=0.0), BSM, now=0.0).payload == b"bsm"


def test_an_authority_grants_only_what_it_was_granted(bob: SecurityServices) -> None:
    generous = security(make_pseudonyms(ISSUING, 1, {LCCA, 0x87}, new_key=new_key, **VALID))
    assert refused(bob, generous.secure(WARN, LCCA, now=0.0)) == "untrusted_issuer"


def test_a_root_does_not_issue_cars_directly(bob: SecurityServices) -> None:
    skipped = security(make_pseudonyms(ROOT, 1, {LCCA}, new_key=new_key, **VALID))
    assert refused(bob, skipped.secure(WARN, LCCA, now=0.0)) == "untrusted_issuer"


def test_an_authority_below_an_authority_is_one_too_many(bob: SecurityServices) -> None:
    below = make_issuing(ISSUING, "below", new_key=new_key, **VALID)
    car = make_pseudonyms(below, 1, {LCCA}, new_key=new_key, **VALID).pseudonyms[0]
    to_be_signed = ieee1609dot2.encode_to_be_signed(WARN, LCCA, to_time64(UTC_S))
    digest = p256.digest_to_sign(to_be_signed, car.certificate.digest)
    alone = ieee1609dot2.encode_signed(to_be_signed, car.certificate, p256.sign(car.key, digest))
    start = alone.index(b"\x81\x01\x01" + car.certificate.encoded)
    chain = (
        alone[:start]
        + b"\x81\x01\x02"
        + car.certificate.encoded
        + below.credential.certificate.encoded
        + encode_signature(p256.sign(car.key, digest))
    )
    assert refused(bob, alone) == "unknown_issuer"
    assert refused(bob, chain) == "untrusted_issuer"


def test_an_attached_authority_certificate_is_kept(bob: SecurityServices) -> None:
    second = make_issuing(ROOT, "second", new_key=new_key, **VALID)
    car = make_pseudonyms(second, 1, {LCCA}, new_key=new_key, **VALID).pseudonyms[0]
    to_be_signed = ieee1609dot2.encode_to_be_signed(WARN, LCCA, to_time64(UTC_S))
    digest = p256.digest_to_sign(to_be_signed, car.certificate.digest)
    signature = p256.sign(car.key, digest)
    data = (
        b"\x03\x81\x00"
        + to_be_signed
        + b"\x81\x01\x02"
        + car.certificate.encoded
        + second.credential.certificate.encoded
        + encode_signature(signature)
    )
    assert bob.open(data, LCCA, now=0.0).payload == WARN


def test_a_key_off_the_curve_is_a_bad_certificate(bob: SecurityServices) -> None:
    encoded = ALICE.pseudonyms[0].certificate.encoded
    point = next(
        bytes((2,)) + x.to_bytes(32) for x in range(2, 50) if not _is_on_curve(x.to_bytes(32))
    )
    off = encoded[: -66 - 33] + b"\x82" + point[1:] + encoded[-66:]
    to_be_signed = ieee1609dot2.encode_to_be_signed(WARN, LCCA, to_time64(UTC_S))
    data = b"\x03\x81\x00" + to_be_signed + b"\x81\x01\x01" + off + encode_signature((1, 1))
    assert refused(bob, data) == "bad_certificate"


def _is_on_curve(x: bytes) -> bool:
    try:
        ec.EllipticCurvePublicKey.from_encoded_point(ec.SECP256R1(), b"\x02" + x)
    except ValueError:
        return False
    return True


# ---- rubbish ------------------------------------------------------------------------------------


def test_every_truncation_is_malformed(alice: SecurityServices, bob: SecurityServices) -> None:
    data = alice.secure(WARN, LCCA, now=0.0)
    assert {refused(bob, data[:cut]) for cut in range(len(data))} == {"malformed"}
    assert refused(bob, data + b"\x00") == "malformed"


@given(noise=st.binary(max_size=200), data=st.data())
def test_any_bytes_raise_only_not_trusted(noise: bytes, data: DataObject) -> None:
    whole = bytearray(security(ALICE).secure(WARN, LCCA, now=0.0))
    for _ in range(data.draw(st.integers(1, 5))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    bob = security(BOB)
    for given_bytes in (noise, b"\x03\x81\x00" + noise, bytes(whole)):
        try:
            opened = bob.open(given_bytes, LCCA, now=0.0)
        except NotTrusted:
            continue
        assert opened.payload == WARN


def test_encrypted_data_is_unsupported(bob: SecurityServices) -> None:
    assert refused(bob, b"\x03\x82\x01\x01") == "unsupported"


def test_two_cars_of_a_trial_in_files_or_memory_are_signed_the_same(
    alice: SecurityServices,
) -> None:
    """Signing is deterministic (RFC 6979): a run can be repeated to the bit."""
    assert alice.secure(WARN, LCCA, now=0.0) == security(ALICE).secure(WARN, LCCA, now=0.0)


def test_a_certificate_assembled_by_hand_is_the_one_that_was_issued() -> None:
    own = ALICE.pseudonyms[1].certificate
    signature = encode_signature(a(tuple, own.signature))
    again = encode_certificate(own.issuer_id, own.to_be_signed, signature)
    assert again == own.encoded


# ---- the certificate's interval -----------------------------------------------------------------


def _size(alice: SecurityServices, psid: int, now: float) -> int:
    return len(alice.secure(b"x", psid, now))


def test_a_bsm_carries_the_certificate_every_450_ms_and_its_digest_between(
    alice: SecurityServices,
) -> None:
    sizes = [_size(alice, BSM, now=i / 10) for i in range(20)]
    attached = [i for i, size in enumerate(sizes) if size == max(sizes)]
    assert attached == [0, 5, 10, 15]
    assert max(sizes) - min(sizes) > 100


def test_messages_of_other_services_put_off_no_certificate_of_a_bsm(
    alice: SecurityServices,
) -> None:
    """Receivers of BSMs need not receive these services."""
    sizes = [(_size(alice, LCCA, i / 10), _size(alice, BSM, i / 10 + 0.01))[1] for i in range(20)]
    assert [i for i, size in enumerate(sizes) if size == max(sizes)] == [0, 5, 10, 15]
    assert max(sizes) - min(sizes) > 100


def test_group_messages_always_carry_the_certificate(alice: SecurityServices) -> None:
    sizes = {_size(alice, LCCA, now=i / 10) for i in range(20)}
    assert len(sizes) == 1


def test_the_first_bsm_of_a_pseudonym_carries_its_certificate(alice: SecurityServices) -> None:
    assert _size(alice, BSM, 0.0) > _size(alice, BSM, 0.1)
    alice.sign_with(ALICE.pseudonyms[1])
    assert _size(alice, BSM, 0.2) > _size(alice, BSM, 0.3)


def test_the_certificate_interval_is_a_parameter() -> None:
    eager = SecurityServices(UTC_S, ALICE, certificate_interval_s=0.0)
    assert len({_size(eager, BSM, now=i / 100) for i in range(5)}) == 1


# ---- without credentials ------------------------------------------------------------------------


def test_a_car_without_keys_opens_signed_messages_without_verifying(
    alice: SecurityServices,
) -> None:
    opened = security().open(alice.secure(WARN, LCCA, now=0.0), LCCA, now=0.0)
    assert (opened.payload, opened.signer_id) == (WARN, None)
    assert opened.generation_utc_s == UTC_S
    assert refused(security(), alice.secure(WARN, LCCA, now=0.0), BSM) == "wrong_psid"


def test_keys_of_a_simulation_follow_from_its_seed() -> None:
    first, second = (p256.key_from(np.random.default_rng(7))() for _ in range(2))
    assert first.private_numbers() == second.private_numbers()


def test_a_signer_is_known_by_a_valid_signature_only(
    alice: SecurityServices, bob: SecurityServices
) -> None:
    """A copied certificate under a forged signature gains nothing."""
    signer_id = ALICE.pseudonyms[0].certificate.hashed_id8
    forged = bytearray(alice.secure(WARN, LCCA, now=1.0))
    forged[-1] ^= 1
    assert refused(bob, bytes(forged), now=1.0) == "bad_signature"
    assert not bob.has_verified(signer_id)

    bob.open(alice.secure(WARN, LCCA, now=1.1), LCCA, now=1.1)

    assert bob.has_verified(signer_id)
