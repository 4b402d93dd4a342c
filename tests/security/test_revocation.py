"""Revocation lists: what they name is refused, and only authorised ones count."""

import contextlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import asn1tools
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.security import ieee1609dot2, p256
from onboard.security.certificate_codec import (
    decode_certificate,
    encode_certificate,
    encode_signature,
    encode_to_be_signed,
)
from onboard.security.certificates import (
    Certificate,
    GroupLinkageValue,
    IssuePermission,
    LinkageData,
    Permission,
    Subject,
)
from onboard.security.credentials import Credential, Credentials
from onboard.security.crl import CrlContents, CrlSsp, HashIdCrl, LinkageCrl, LinkedRevocation
from onboard.security.crl_codec import decode_crl, decode_ssp, encode_crl, encode_ssp
from onboard.security.its_time import from_time32, to_time32
from onboard.security.linkage import LinkageSeed, after, linkage_values
from onboard.security.oer import Malformed, Unsupported
from onboard.security.rejection import RejectionReason
from onboard.security.secured_crl import load_crl, trust_store
from onboard.security.security_services import NotTrusted, SecurityServices
from onboard.tools.test_ca import authority
from onboard.tools.test_ca.authority import make_crl, make_issuing, make_pseudonyms
from onboard.wave_udp.psid import CRL
from tests.security.trial import ALICE, BOB, BSM, CAROL, ISSUING, ROOT, UTC_S, VALID, new_key
from tests.typed import a

ORACLE = asn1tools.compile_files(str(Path(__file__).with_name("crl_oracle.asn1")), "oer")
LIST: dict[str, Any] = {"serial": 1, "issued_utc_s": UTC_S - 60.0, "valid_for_s": 86_400.0}
IMPLICIT = make_pseudonyms(ISSUING, 2, {BSM}, new_key=new_key, implicit=True, **VALID)


def _certificates(credentials: Credentials) -> list[Certificate]:
    return [own.certificate for own in credentials.pseudonyms]


def _receiver(*crls: bytes, receiver: Credentials = BOB) -> SecurityServices:
    return SecurityServices(UTC_S, replace(receiver, crls=crls))


def _refused(receiver: SecurityServices, sender: Credentials, now: float = 0.0) -> RejectionReason:
    with pytest.raises(NotTrusted) as refusal:
        receiver.open(SecurityServices(UTC_S, sender).secure(b"bsm", BSM, now), BSM, now)
    return refusal.value.reason


def _accepted(receiver: SecurityServices, sender: Credentials, now: float = 0.0) -> bool:
    data = SecurityServices(UTC_S, sender).secure(b"bsm", BSM, now)
    return receiver.open(data, BSM, now).payload == b"bsm"


# ---- what a list ends ---------------------------------------------------------------------------


@pytest.mark.parametrize("car", [ALICE, IMPLICIT], ids=["explicit", "implicit"])
def test_messages_of_a_revoked_vehicle_are_refused_and_those_of_others_are_not(
    car: Credentials,
) -> None:
    crl = make_crl(ISSUING, _certificates(car), **LIST)
    receiver = _receiver(crl)
    for own in car.pseudonyms:
        sender = SecurityServices(UTC_S, replace(car, pseudonyms=(own,)))
        for now in (0.0, 0.1, 0.2):
            with pytest.raises(NotTrusted, match="revoked"):
                receiver.open(sender.secure(b"bsm", BSM, now), BSM, now)
    assert _accepted(receiver, CAROL)


def test_a_revoked_authority_takes_its_vehicles_along() -> None:
    second = make_issuing(ROOT, "second", new_key=new_key, **VALID)
    car = make_pseudonyms(second, 1, {BSM}, new_key=new_key, **VALID)
    crl = make_crl(ROOT, [second.credential.certificate], **LIST)
    both = replace(BOB, authorities=(*BOB.authorities, *second.authorities))
    assert _accepted(_receiver(receiver=both), car)
    receiver = _receiver(crl, receiver=both)
    assert _refused(receiver, car) == "revoked"
    assert _accepted(receiver, ALICE)


def test_a_list_revokes_certificates_that_are_already_known() -> None:
    trust = trust_store(BOB)
    known = trust.receive_certificate(_certificates(ALICE)[0])
    assert not trust.is_revoked(known)
    load_crl(make_crl(ISSUING, _certificates(ALICE), **LIST), trust)
    assert trust.is_revoked(known)
    assert trust.is_revoked(trust.receive_certificate(_certificates(ALICE)[1]))


def test_lists_add_up() -> None:
    crls = [make_crl(ISSUING, _certificates(car), **LIST) for car in (ALICE, CAROL)]
    for order in (crls, crls[::-1]):
        receiver = _receiver(*order)
        assert {_refused(receiver, car) for car in (ALICE, CAROL)} == {"revoked"}


# ---- which lists count --------------------------------------------------------------------------


def _contents(**changes: Any) -> CrlContents:
    ids = {each.digest[-10:]: each.subject.valid_until_utc_s for each in _certificates(ALICE)}
    craca_id8 = ISSUING.credential.certificate.hashed_id8
    contents = CrlContents(1, craca_id8, UTC_S - 60.0, UTC_S + 60.0, HashIdCrl(1, ids))
    return replace(contents, **changes)


def _signed(contents: CrlContents, credential: Credential, psid: int = CRL) -> bytes:
    to_be_signed = ieee1609dot2.encode_to_be_signed(encode_crl(contents), psid, None)
    digest = p256.digest_to_sign(to_be_signed, credential.certificate.digest)
    signature = p256.sign(credential.key, digest)
    return ieee1609dot2.encode_signed(to_be_signed, credential.certificate, signature)


def _load(data: bytes) -> RejectionReason:
    with pytest.raises(NotTrusted) as refusal:
        load_crl(data, trust_store(BOB))
    return refusal.value.reason


def test_an_unsigned_list_is_refused() -> None:
    assert _load(ieee1609dot2.encode_unsecured(encode_crl(_contents()))) == "unsigned"


def test_a_list_signed_by_a_vehicle_is_refused() -> None:
    assert _load(_signed(_contents(), CAROL.pseudonyms[0])) == "wrong_psid"


def test_a_list_signed_for_another_service_is_refused() -> None:
    assert _load(_signed(_contents(), ISSUING.credential, psid=BSM)) == "wrong_psid"


def test_a_list_for_another_authority_is_refused() -> None:
    """The root may not revoke what the authority issued, nor the other way round."""
    assert _load(_signed(_contents(), ROOT.credential)) == "untrusted_issuer"
    of_root = _contents(craca_id8=ROOT.credential.certificate.hashed_id8)
    assert _load(_signed(of_root, ISSUING.credential)) == "untrusted_issuer"


def test_a_list_of_a_series_that_the_signer_may_not_sign_is_refused() -> None:
    assert _load(_signed(_contents(series=2), ISSUING.credential)) == "untrusted_issuer"


def test_a_list_issued_before_the_signer_was_valid_is_refused() -> None:
    early = _contents(issued_utc_s=UTC_S - 86_400.0)
    assert _load(_signed(early, ISSUING.credential)) == "expired"


def test_a_list_of_an_unknown_signer_is_refused() -> None:
    unknown = make_issuing(ROOT, "unknown", new_key=new_key, **VALID)
    craca_id8 = unknown.credential.certificate.hashed_id8
    by_digest = make_crl(unknown, _certificates(ALICE), **LIST)
    assert _load(by_digest) == "unknown_certificate"
    forged = Credential(ISSUING.credential.certificate, unknown.credential.key)
    assert _load(_signed(_contents(), forged)) == "bad_signature"
    load_crl(_signed(_contents(craca_id8=craca_id8), unknown.credential), trust_store(BOB))


def test_a_list_of_a_revoked_signer_is_refused() -> None:
    trust = trust_store(BOB)
    load_crl(make_crl(ROOT, [ISSUING.credential.certificate], **LIST), trust)
    with pytest.raises(NotTrusted, match="revoked: its signer"):
        load_crl(make_crl(ISSUING, _certificates(ALICE), **LIST), trust)


def test_a_list_of_a_revoked_implicit_signer_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its key proves nothing before the signature does, so it is looked up afterwards."""
    permission = Permission(CRL, encode_ssp(CrlSsp(is_craca=False, series=frozenset({1}))))
    monkeypatch.setattr(authority, "Permission", lambda _psid, _ssp, **_: permission)
    signer = make_pseudonyms(ROOT, 1, {CRL}, new_key=new_key, implicit=True, **VALID).pseudonyms[0]
    craca_id8 = ROOT.credential.certificate.hashed_id8
    data = _signed(_contents(craca_id8=craca_id8), signer)
    load_crl(data, trust_store(BOB))
    trust = trust_store(BOB)
    load_crl(make_crl(ROOT, [signer.certificate], **LIST), trust)
    with pytest.raises(NotTrusted, match="revoked: its signer"):
        load_crl(data, trust)


def test_a_delegate_of_the_authority_may_sign() -> None:
    """Its permission names its issuer as CRACA (7.4.3.3)."""
    key = new_key()
    ssp = encode_ssp(CrlSsp(is_craca=False, series=frozenset({1})))
    subject = Subject(
        "delegate", UTC_S - 3600, 86_400.0, p256.compressed(key.public_key()),
        (Permission(CRL, ssp),),
    )  # fmt: skip
    body = encode_to_be_signed(subject)
    issuer = ROOT.credential
    signature = p256.sign(issuer.key, p256.digest_to_sign(body, issuer.certificate.digest))
    delegate = Credential(
        decode_certificate(
            encode_certificate(issuer.certificate.hashed_id8, body, encode_signature(signature))
        ),
        key,
    )
    trust = trust_store(BOB)
    ids = {ISSUING.credential.certificate.digest[-10:]: UTC_S}
    contents = _contents(craca_id8=issuer.certificate.hashed_id8, body=HashIdCrl(2, ids))
    load_crl(_signed(contents, delegate), trust)
    assert trust.is_revoked(trust.receive_certificate(_certificates(ALICE)[0]))


def test_a_changed_list_is_refused() -> None:
    data = make_crl(ISSUING, _certificates(ALICE), **LIST)
    load_crl(data, trust_store(BOB))
    for position in range(0, len(data), 5):
        changed = bytearray(data)
        changed[position] ^= 0x10
        with pytest.raises(NotTrusted):
            load_crl(bytes(changed), trust_store(BOB))


def test_a_list_counts_for_certificates_of_its_authority_and_series_only() -> None:
    """Certificates made for no list, or for another one, are not found by their hash."""
    own = ALICE.pseudonyms[0]
    for change in ({"crl_series": 2}, {"craca_id": b"abc"}, {"craca_id": bytes(3)}):
        subject = replace(own.certificate.subject, **change)
        body = encode_to_be_signed(subject)
        issuer = ISSUING.credential
        signature = p256.sign(issuer.key, p256.digest_to_sign(body, issuer.certificate.digest))
        other = decode_certificate(
            encode_certificate(issuer.certificate.hashed_id8, body, encode_signature(signature))
        )
        crl = make_crl(ISSUING, [other], **LIST)
        assert _accepted(_receiver(crl), replace(ALICE, pseudonyms=(Credential(other, own.key),)))


# ---- linkage values -----------------------------------------------------------------------------

# Crypto test vectors of the US SCMS (github.com/conz27/crypto-test-vectors), lv.txt and glv.txt.
LA_1, LA_2 = bytes.fromhex("8E09"), bytes.fromhex("59CE")
SEEDS = (
    LinkageSeed(LA_1, bytes.fromhex("4840ED221502D9AB6786BF68FBA9F210")),
    LinkageSeed(LA_2, bytes.fromhex("6B71A7EB5755F16E89981D2189A6DAEA")),
)
GROUP_SEEDS = (
    LinkageSeed(LA_1, bytes.fromhex("6B71A7EB5755F16E89981D2189A6DAEA")),
    LinkageSeed(LA_2, bytes.fromhex("CC4DB977F595AD233F0F4E65408D9A9C")),
)


@pytest.mark.parametrize(
    ("seeds", "period", "index", "value"),
    [
        (SEEDS, 0, "00000008", "688ACF70E25EC01F32"),
        (SEEDS, 1, "00000006", "38479FDA0B161A5357"),
        (GROUP_SEEDS, 0, "4840ED22", "66D7FD69915A3C9E0C"),
        (GROUP_SEEDS, 1, "548F7017", "C4052FFB0AE61AAF37"),
    ],
)
def test_linkage_values_are_the_published_ones(
    seeds: tuple[LinkageSeed, LinkageSeed], period: int, index: str, value: str
) -> None:
    values = linkage_values(after(seeds, period), [bytes.fromhex(index)])
    assert values == [bytes.fromhex(value)]


I_REV, I_MAX, J_MAX = 7, 30, 20


def _linked_car(linkage: LinkageData) -> Credentials:
    """A vehicle whose certificate has linkage data."""
    own = ALICE.pseudonyms[0]
    subject = replace(own.certificate.subject, linkage=linkage)
    body = encode_to_be_signed(subject)
    issuer = ISSUING.credential
    signature = p256.sign(issuer.key, p256.digest_to_sign(body, issuer.certificate.digest))
    certificate = decode_certificate(
        encode_certificate(issuer.certificate.hashed_id8, body, encode_signature(signature))
    )
    assert certificate.subject.linkage == linkage
    return replace(ALICE, pseudonyms=(Credential(certificate, own.key),))


def _value(seeds: tuple[LinkageSeed, LinkageSeed], periods: int, j: int) -> bytes:
    return linkage_values(after(seeds, periods), [j.to_bytes(4)])[0]


def _linked_receiver() -> SecurityServices:
    entries = (
        LinkedRevocation(I_MAX, J_MAX, SEEDS),
        LinkedRevocation(I_MAX, None, GROUP_SEEDS),
    )
    body = LinkageCrl(I_REV, 0, entries)
    return _receiver(_signed(_contents(body=body), ISSUING.credential))


@pytest.mark.parametrize(
    ("period", "j", "expected"),
    [
        (I_REV, 1, "revoked"),
        (I_REV + 1, J_MAX, "revoked"),
        (I_MAX, 0, "revoked"),
        (I_MAX + 1, 1, None),
        (I_REV, J_MAX + 1, None),
    ],
)
def test_two_seeds_revoke_all_certificates_of_a_vehicle_from_a_period_on(
    period: int, j: int, expected: str | None
) -> None:
    car = _linked_car(LinkageData(period, _value(SEEDS, period - I_REV, j)))
    if expected is None:
        assert _accepted(_linked_receiver(), car)
    else:
        assert _refused(_linked_receiver(), car) == expected


def test_certificates_of_earlier_periods_stay_unlinked() -> None:
    car = _linked_car(LinkageData(I_REV - 1, _value(SEEDS, 0, 1)))
    assert _accepted(_linked_receiver(), car)


def test_two_seeds_revoke_a_group_of_vehicles() -> None:
    j_value = bytes.fromhex("548F7017")
    value = linkage_values(after(GROUP_SEEDS, 3), [j_value])[0]
    for given_value, is_revoked in ((value, True), (bytes(9), False)):
        linkage = LinkageData(I_REV + 3, bytes(9), GroupLinkageValue(j_value, given_value))
        car = _linked_car(linkage)
        if is_revoked:
            assert _refused(_linked_receiver(), car) == "revoked"
        else:
            assert _accepted(_linked_receiver(), car)


# ---- encoding -----------------------------------------------------------------------------------

seeds = st.builds(
    LinkageSeed, st.binary(min_size=2, max_size=2), st.binary(min_size=16, max_size=16)
)
revocations = st.builds(
    LinkedRevocation,
    st.integers(0, 65535),
    st.none() | st.integers(0, 255),
    st.tuples(seeds, seeds),
)
times = st.integers(0, 2**32 - 2).map(from_time32)
bodies = st.builds(
    HashIdCrl,
    st.integers(0, 2**32 - 1),
    st.dictionaries(st.binary(min_size=10, max_size=10), times, max_size=5),
) | st.builds(
    LinkageCrl,
    st.integers(0, 65535),
    st.integers(0, 255),
    st.lists(revocations, max_size=4).map(
        lambda entries: tuple(sorted(entries, key=lambda entry: entry.j_max is None))
    ),
)
contents = st.builds(
    lambda series, craca, issued, body: CrlContents(series, craca, issued, issued + 1, body),
    st.integers(0, 65535),
    st.binary(min_size=8, max_size=8),
    times,
    bodies,
)


def _of_oracle(contents: CrlContents) -> dict[str, Any]:
    """Return the value of the oracle's `Contents`."""
    body = contents.body
    if isinstance(body, HashIdCrl):
        entries = [
            {"id": hashed_id10, "expiry": to_time32(utc_s)}
            for hashed_id10, utc_s in sorted(body.expiry_utc_s.items())
        ]
        choice = ("fullHash", {"serial": body.serial, "entries": entries})
    else:
        individual: list[dict[str, Any]] = []
        groups: list[dict[str, Any]] = []
        for entry in body.entries:
            one, two = entry.seeds
            if entry.j_max is None:
                groups.append(
                    {
                        "iMax": entry.i_max,
                        "la1": one.la_id,
                        "seed1": one.seed,
                        "la2": two.la_id,
                        "seed2": two.seed,
                    }
                )
            else:
                pair = {"seed1": one.seed, "seed2": two.seed}
                in_period = {"iMax": entry.i_max, "contents": [pair]}
                by_authority = {"la1": one.la_id, "la2": two.la_id, "contents": [in_period]}
                individual.append({"jMax": entry.j_max, "contents": [by_authority]})
        choice = (
            "fullLinked",
            {
                "iRev": body.i_rev,
                "indexWithinI": body.index_within_i,
                "individual": individual,
                "groups": groups,
            },
        )
    return {
        "version": 1,
        "series": contents.series,
        "craca": contents.craca_id8,
        "issued": to_time32(contents.issued_utc_s),
        "next": to_time32(contents.next_utc_s),
        "priority": {},
        "body": choice,
    }


@given(contents)
def test_lists_are_encoded_as_another_compiler_does_and_decoded_again(
    contents: CrlContents,
) -> None:
    encoded = encode_crl(contents)
    assert encoded == ORACLE.encode("Contents", _of_oracle(contents))
    assert decode_crl(encoded) == contents


def test_priorities_and_lists_of_several_in_a_group_are_read() -> None:
    value = _of_oracle(_contents(body=LinkageCrl(3, 1, ())))
    pairs = [{"seed1": bytes((n,)) * 16, "seed2": bytes((n + 1,)) * 16} for n in (1, 3)]
    periods = [{"iMax": i_max, "contents": pairs} for i_max in (5, 6)]
    group = {"la1": LA_1, "la2": LA_2, "contents": periods}
    kind, empty = value["body"]
    value["body"] = kind, empty | {"individual": [{"jMax": 9, "contents": [group, group]}]}
    value["priority"] = {"value": 4}
    body = a(LinkageCrl, decode_crl(ORACLE.encode("Contents", value)).body)
    assert [(entry.i_max, entry.j_max) for entry in body.entries] == [
        (5, 9), (5, 9), (6, 9), (6, 9)
    ] * 2  # fmt: skip
    first, second = body.entries[1].seeds
    assert (first, second) == (
        LinkageSeed(LA_1, bytes((3,)) * 16),
        LinkageSeed(LA_2, bytes((4,)) * 16),
    )


@given(st.booleans(), st.frozensets(st.integers(0, 65535), max_size=4))
def test_the_permission_to_sign_is_encoded_as_another_compiler_does(
    is_craca: bool, series: frozenset[Any] | frozenset[int]
) -> None:
    ssp = CrlSsp(is_craca, series)
    role = "isCraca" if is_craca else "issuerIsCraca"
    value = {"version": 1, "role": role, "series": sorted(series)}
    assert encode_ssp(ssp) == ORACLE.encode("Ssp", value)
    assert decode_ssp(encode_ssp(ssp)) == ssp


def test_the_permission_of_a_root_in_use_is_decoded() -> None:
    """Of rca.scms.co.kr (`ecqv_vectors`)."""
    assert decode_ssp(bytes.fromhex("00010001010100")) == CrlSsp(True, frozenset({256}))


@given(st.binary(max_size=150), st.integers(0, 60), st.booleans())
def test_any_bytes_raise_only_malformed_or_unsupported(
    noise: bytes, position: int, linked: bool
) -> None:
    body = LinkageCrl(3, 1, (LinkedRevocation(4, 5, SEEDS),)) if linked else HashIdCrl(1, {})
    valid = encode_crl(_contents(body=body))
    for data in (noise, valid[:position] + noise + valid[position + len(noise) :]):
        with contextlib.suppress(Malformed, Unsupported):
            decode_crl(data)
        with contextlib.suppress(Malformed, Unsupported):
            decode_ssp(data)
        with contextlib.suppress(NotTrusted):
            load_crl(data, trust_store(Credentials(BOB.pseudonyms, BOB.roots, ())))


@pytest.mark.parametrize("bit", [0x80, 0x08])
def test_a_list_with_unknown_parts_is_unsupported(bit: int) -> None:
    """What it revokes would be overlooked otherwise."""
    data = bytearray(encode_crl(_contents(body=LinkageCrl(3, 1, ()))))
    data[21] |= bit
    with pytest.raises(Unsupported):
        decode_crl(bytes(data))


def test_issue_permissions_of_lists_reach_authorities_only() -> None:
    """A root grants vehicles no permission to sign lists."""
    grants = ROOT.credential.certificate.subject.issue_permissions
    assert IssuePermission(frozenset(), any_ssp=frozenset({CRL})) in grants
    assert not any(grant.covers(Permission(CRL), 2) for grant in grants)
