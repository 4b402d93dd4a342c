"""Certificates: compatible with another implementation, and what they grant."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.strategies._internal.core import DataObject

from onboard.security import its_time, p256
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
    Permission,
    SspRange,
    Subject,
    may_grant,
)
from onboard.security.oer import Malformed, Unsupported
from onboard.security.region import (
    CircularRegion,
    IdentifiedRegion,
    PolygonalRegion,
    RectangularRegion,
    TwoDLocation,
)
from onboard.tools.test_ca.authority import make_pseudonyms
from tests.security.trial import ALICE, BSM, ISSUING, ROOT, UTC_S, VALID, new_key, reread
from tests.typed import a

OWN = ALICE.pseudonyms[0].certificate
IMPLICIT = (
    make_pseudonyms(ISSUING, 1, {BSM}, new_key=new_key, implicit=True, **VALID)
    .pseudonyms[0]
    .certificate
)


@pytest.mark.parametrize(
    "certificate",
    [ROOT.credential.certificate, ISSUING.credential.certificate, OWN, IMPLICIT],
    ids=["root", "issuing", "pseudonym", "implicit pseudonym"],
)
def test_another_implementation_decodes_our_certificates(
    oracle: Any, certificate: Certificate
) -> None:
    value = reread(oracle.Certificate, certificate.encoded)
    is_implicit = certificate is IMPLICIT
    assert (value["type"], "signature" in value) == (
        ("implicit", False) if is_implicit else ("explicit", True)
    )
    body = value["toBeSigned"]
    assert body["verifyKeyIndicator"][0] == (
        "reconstructionValue" if is_implicit else "verificationKey"
    )
    assert body["id"] == (
        ("name", certificate.subject.name) if certificate.subject.name else ("none", 0)
    )
    assert body["validityPeriod"]["start"] == its_time.to_time32(UTC_S - 3600)
    oracle.ToBeSignedCertificate.set_val(body)
    assert oracle.ToBeSignedCertificate.to_coer() == certificate.to_be_signed
    assert decode_certificate(certificate.encoded) == certificate


def test_a_pseudonym_names_nobody_and_differs_from_the_next() -> None:
    certificates = [own.certificate for own in ALICE.pseudonyms]
    assert {certificate.subject.name for certificate in certificates} == {None}
    assert len({certificate.subject.public_key for certificate in certificates}) == 3
    assert len({certificate.hashed_id8 for certificate in certificates}) == 3


eight = st.binary(min_size=8, max_size=8)
small = st.integers(0, 65535)
key_points = st.tuples(
    st.sampled_from(["compressed-y-0", "compressed-y-1"]), st.binary(min_size=32, max_size=32)
)
regions = st.one_of(
    st.tuples(
        st.just("circularRegion"),
        st.fixed_dictionaries(
            {"center": st.just({"latitude": 1, "longitude": -1}), "radius": small}
        ),
    ),
    st.tuples(
        st.just("rectangularRegion"),
        st.lists(
            st.just(
                {
                    "northWest": {"latitude": 5, "longitude": -6},
                    "southEast": {"latitude": 3, "longitude": -4},
                }
            ),
            min_size=1,
            max_size=3,
        ),
    ),
    st.tuples(
        st.just("rectangularRegion"),
        st.lists(
            st.fixed_dictionaries(
                {
                    "northWest": st.just({"latitude": 5, "longitude": -6}),
                    "southEast": st.just({"latitude": 3, "longitude": -4}),
                }
            ),
            min_size=1,
            max_size=3,
        ),
    ),
    st.tuples(
        st.just("polygonalRegion"),
        st.lists(st.just({"latitude": 1, "longitude": 2}), min_size=3, max_size=5),
    ),
    st.tuples(
        st.just("identifiedRegion"),
        st.lists(
            st.one_of(
                st.tuples(st.just("countryOnly"), small),
                st.tuples(
                    st.just("countryAndRegions"),
                    st.fixed_dictionaries(
                        {
                            "countryOnly": small,
                            "regions": st.lists(st.integers(0, 255), min_size=1, max_size=3),
                        }
                    ),
                ),
                st.tuples(
                    st.just("countryAndSubregions"),
                    st.fixed_dictionaries(
                        {
                            "country": small,
                            "regionAndSubregions": st.lists(
                                st.fixed_dictionaries(
                                    {
                                        "region": st.integers(0, 255),
                                        "subregions": st.lists(small, min_size=1, max_size=2),
                                    }
                                ),
                                min_size=1,
                                max_size=2,
                            ),
                        }
                    ),
                ),
            ),
            min_size=1,
            max_size=3,
        ),
    ),
)
psid_groups = st.lists(
    st.fixed_dictionaries(
        {
            "subjectPermissions": st.one_of(
                st.just(("all", 0)),
                st.tuples(
                    st.just("explicit"),
                    st.lists(
                        st.fixed_dictionaries(
                            {"psid": small},
                            optional={
                                "sspRange": st.sampled_from(
                                    [
                                        ("all", 0),
                                        ("opaque", [b"", b"abc"]),
                                        ("bitmapSspRange", {"sspValue": b"a", "sspBitmask": b"b"}),
                                    ]
                                )
                            },
                        ),
                        min_size=1,
                        max_size=3,
                    ),
                ),
            )
        },
        optional={
            "minChainLength": st.integers(2, 300),
            "chainLengthRange": st.sampled_from([-1, 1, 2]),
        },
    ),
    min_size=1,
    max_size=3,
)
bodies = st.fixed_dictionaries(
    {
        "id": st.one_of(
            st.just(("none", 0)),
            st.tuples(st.just("name"), st.text(max_size=20)),
            st.tuples(st.just("binaryId"), st.binary(min_size=1, max_size=64)),
            st.tuples(
                st.just("linkageData"),
                st.fixed_dictionaries(
                    {"iCert": small, "linkage-value": st.binary(min_size=9, max_size=9)},
                    optional={
                        "group-linkage-value": st.fixed_dictionaries(
                            {
                                "jValue": st.binary(min_size=4, max_size=4),
                                "value": st.binary(min_size=9, max_size=9),
                            }
                        )
                    },
                ),
            ),
        ),
        "cracaId": st.binary(min_size=3, max_size=3),
        "crlSeries": small,
        "validityPeriod": st.fixed_dictionaries(
            {
                "start": st.integers(0, 2**32 - 1),
                "duration": st.tuples(
                    st.sampled_from(["milliseconds", "seconds", "hours", "sixtyHours", "years"]),
                    small,
                ),
            }
        ),
        "verifyKeyIndicator": st.tuples(
            st.just("verificationKey"), st.tuples(st.just("ecdsaNistP256"), key_points)
        ),
    },
    optional={
        "region": regions,
        "assuranceLevel": st.binary(min_size=1, max_size=1),
        "appPermissions": st.lists(
            st.fixed_dictionaries(
                {"psid": small},
                optional={
                    "ssp": st.tuples(st.just("opaque"), st.binary())
                    | st.tuples(st.just("bitmapSsp"), st.binary(max_size=31))
                },
            ),
            min_size=1,
            max_size=4,
        ),
        "certIssuePermissions": psid_groups,
        "certRequestPermissions": psid_groups,
        "canRequestRollover": st.just(0),
        "encryptionKey": st.fixed_dictionaries(
            {
                "supportedSymmAlg": st.just("aes128Ccm"),
                "publicKey": st.tuples(st.just("eciesNistP256"), key_points),
            }
        ),
    },
)


@given(body=bodies, issuer=st.just(("self", "sha256")) | st.tuples(
    st.just("sha256AndDigest"), eight), s=st.binary(min_size=32, max_size=32))  # fmt: skip
def test_certificates_of_another_implementation_are_decoded(
    oracle: Any, body: Any, issuer: tuple[str, bytes | str], s: bytes
) -> None:
    oracle.Certificate.set_val(
        {
            "version": 3,
            "type": "explicit",
            "issuer": issuer,
            "toBeSigned": body,
            "signature": ("ecdsaNistP256Signature", {"rSig": ("x-only", bytes(32)), "sSig": s}),
        }
    )
    encoded = oracle.Certificate.to_coer()
    read = decode_certificate(encoded)
    assert read.encoded == encoded
    oracle.ToBeSignedCertificate.set_val(body)
    assert read.to_be_signed == oracle.ToBeSignedCertificate.to_coer()
    assert read.issuer_id == (issuer[1] if issuer[0] == "sha256AndDigest" else None)
    assert read.subject.permissions == tuple(
        Permission(p["psid"], p["ssp"][1], is_bitmap=p["ssp"][0] == "bitmapSsp")
        if "ssp" in p
        else Permission(p["psid"])
        for p in body.get("appPermissions", [])
    )
    assert read.subject.region == (_region(*body["region"]) if "region" in body else None)
    level = body.get("assuranceLevel")
    assert read.subject.assurance_level == (None if level is None else level[0])
    assert (read.subject.craca_id, read.subject.crl_series) == (body["cracaId"], body["crlSeries"])
    kind, identifier = body["id"]
    assert read.subject.name == (identifier if kind == "name" else None)
    assert read.subject.binary_id == (identifier if kind == "binaryId" else None)
    assert (read.subject.linkage is not None) == (kind == "linkageData")
    if read.subject.linkage is not None:
        assert read.subject.linkage.i_cert == identifier["iCert"]
        assert read.subject.linkage.linkage_value == identifier["linkage-value"]
        group = identifier.get("group-linkage-value")
        assert read.subject.linkage.group == (
            group and GroupLinkageValue(group["jValue"], group["value"])
        )
    assert {ssps for grant in read.subject.issue_permissions for ssps in grant.some_ssps} == {
        SspRange(psid, frozenset(value))
        if kind == "opaque"
        else SspRange(psid, bitmap=(value["sspValue"], value["sspBitmask"]))
        for group in body.get("certIssuePermissions", [])
        if group["subjectPermissions"][0] == "explicit"
        for psid, (kind, value) in (
            (one["psid"], one["sspRange"])
            for one in group["subjectPermissions"][1]
            if "sspRange" in one
        )
        if kind != "all"
    }
    assert [
        (grant.psids is None, grant.min_chain_length, grant.chain_length_range)
        for grant in read.subject.issue_permissions
    ] == [
        (
            group["subjectPermissions"][0] == "all",
            group.get("minChainLength", 1),
            group.get("chainLengthRange", 0),
        )
        for group in body.get("certIssuePermissions", [])
    ]
    parity, x = body["verifyKeyIndicator"][1][1]
    assert read.subject.public_key == (b"\x02" if parity == "compressed-y-0" else b"\x03") + x


def _location(value: dict[str, int]) -> TwoDLocation:
    return TwoDLocation(value["latitude"] / 1e7, value["longitude"] / 1e7)


def _region(
    kind: str, value: Any
) -> CircularRegion | PolygonalRegion | tuple[IdentifiedRegion | RectangularRegion, ...]:
    match kind:
        case "circularRegion":
            return CircularRegion(_location(value["center"]), value["radius"])
        case "polygonalRegion":
            return PolygonalRegion(tuple(map(_location, value)))
        case "rectangularRegion":
            return tuple(
                RectangularRegion(_location(one["northWest"]), _location(one["southEast"]))
                for one in value
            )
    return tuple(_identified(*one) for one in value)


def _identified(kind: str, value: Any) -> IdentifiedRegion:
    if kind == "countryOnly":
        return IdentifiedRegion(value)
    if kind == "countryAndRegions":
        return IdentifiedRegion(value["countryOnly"], tuple(value["regions"]))
    both = value["regionAndSubregions"]
    return IdentifiedRegion(
        value["country"],
        tuple(one["region"] for one in both),
        tuple(tuple(one["subregions"]) for one in both),
    )


def test_uncompressed_points_are_compressed_before_hashing(oracle: Any) -> None:
    """IEEE 1609.2, 6.4: the hash does not depend on how the certificate was written."""
    value = reread(oracle.Certificate, OWN.encoded)
    key = p256.public_key(a(bytes, OWN.subject.public_key)).public_numbers()
    value["toBeSigned"]["verifyKeyIndicator"] = (
        "verificationKey",
        (
            "ecdsaNistP256",
            ("uncompressedP256", {"x": key.x.to_bytes(32), "y": key.y.to_bytes(32)}),
        ),
    )
    r = value["signature"][1]["rSig"][1]
    value["signature"][1]["rSig"] = ("compressed-y-1", r)
    oracle.Certificate.set_val(value)
    assert oracle.Certificate.to_coer() != OWN.encoded
    assert decode_certificate(oracle.Certificate.to_coer()) == OWN


@pytest.mark.parametrize("valid_for_s", [1, 65_535, 65_536, 604_800, 3.15e8, 9e9])
def test_a_certificate_is_valid_for_at_least_the_requested_time(valid_for_s: float) -> None:
    credentials = make_pseudonyms(
        ISSUING, 1, {BSM}, new_key=new_key, valid_from_utc_s=UTC_S, valid_for_s=valid_for_s
    )
    subject = credentials.pseudonyms[0].certificate.subject
    assert valid_for_s <= subject.valid_for_s <= max(valid_for_s * 1.01, valid_for_s + 1)


@pytest.mark.parametrize(
    "change",
    [
        {"public_key": None},
        {"reconstruction_value": OWN.subject.public_key},
        {"permissions": ()},
        {"valid_for_s": 1e13},
        {"region": (IdentifiedRegion(840),)},
    ],
    ids=["no key", "two keys", "no permission", "longer than years can say", "region"],
)
def test_a_subject_that_cannot_be_certified_is_a_value_error(change: Any) -> None:
    fields = {
        "name": None,
        "valid_from_utc_s": UTC_S,
        "valid_for_s": 60.0,
        "public_key": OWN.subject.public_key,
        "permissions": (Permission(BSM),),
    }
    with pytest.raises(ValueError, match=r"has a public key|longer than|only read"):
        encode_to_be_signed(Subject(**fields | change))


BITMAP = SspRange(BSM, bitmap=(b"\x01\x50", b"\xff\xf0"))
"""Version 1, and of the permissions in the last octet 5 for the first four bits."""


def _some(ssps: SspRange) -> IssuePermission:
    return IssuePermission(frozenset(), some_ssps=frozenset({ssps}))


@pytest.mark.parametrize(
    "listed",
    [
        _some(BITMAP),
        IssuePermission(frozenset({BSM})),
        IssuePermission(frozenset(), any_ssp=frozenset({BSM}), min_chain_length=2),
    ],
)
def test_all_applications_are_all_that_are_not_listed(listed: IssuePermission) -> None:
    """Else a list of SSPs would limit nothing beside a permission for all."""
    grants = (IssuePermission(None), listed)
    assert not may_grant(grants, Permission(BSM, b"any"), 1)
    assert may_grant(grants, Permission(0x21, b"any"), 1)


@pytest.mark.parametrize(
    ("grant", "permission", "heights"),
    [
        (IssuePermission(frozenset({BSM})), Permission(BSM), [1]),
        (IssuePermission(frozenset({BSM})), Permission(BSM, ssp=b"any"), []),
        (IssuePermission(frozenset(), any_ssp=frozenset({BSM})), Permission(BSM, b"any"), [1]),
        (IssuePermission(frozenset({BSM})), Permission(0x21), []),
        (IssuePermission(None), Permission(0x21, ssp=b"any"), [1]),
        (_some(SspRange(BSM, frozenset({b"a", b"b"}))), Permission(BSM, b"b"), [1]),
        (_some(SspRange(BSM, frozenset({b"a", b"b"}))), Permission(BSM, b"c"), []),
        (_some(SspRange(BSM, frozenset({b"a"}))), Permission(BSM, b"a", is_bitmap=True), []),
        (_some(SspRange(BSM, frozenset({b"a"}))), Permission(BSM), []),
        (_some(SspRange(BSM, frozenset({b"a"}))), Permission(0x21, b"a"), []),
        (_some(BITMAP), Permission(BSM, b"\x01\x53", is_bitmap=True), [1]),
        (_some(BITMAP), Permission(BSM, b"\x02\x53", is_bitmap=True), []),
        (_some(BITMAP), Permission(BSM, b"\x01\x43", is_bitmap=True), []),
        (_some(BITMAP), Permission(BSM, b"\x01", is_bitmap=True), []),
        (_some(BITMAP), Permission(BSM, b"\x01\x53"), []),
        (IssuePermission(None, min_chain_length=2), Permission(BSM), [2]),
        (IssuePermission(None, min_chain_length=1, chain_length_range=1), Permission(BSM), [1, 2]),
        (IssuePermission(None, min_chain_length=2, chain_length_range=-1), Permission(1), [2, 3]),
    ],
)
def test_an_issue_permission_covers_permissions_at_allowed_depths(
    grant: IssuePermission, permission: Permission, heights: list[int]
) -> None:
    assert [height for height in (1, 2, 3) if grant.covers(permission, height)] == heights


psid_sets = st.frozensets(st.integers(0, 2**20), max_size=4)
ssps = st.binary(min_size=1, max_size=32)
ssp_ranges = st.builds(
    lambda psid, opaque, bitmap: SspRange(psid, frozenset() if bitmap else opaque, bitmap),
    st.integers(2**20 + 1, 2**21),
    st.frozensets(ssps, max_size=3),
    st.none() | st.tuples(ssps, ssps),
)


@given(
    st.lists(
        st.builds(
            lambda psids, any_ssp, some, shortest, further: IssuePermission(
                psids and psids - any_ssp, any_ssp, some, shortest, further
            ),
            psid_sets,
            psid_sets,
            st.frozensets(ssp_ranges, max_size=2),
            st.integers(1, 5),
            st.integers(-1, 3),
        )
        | st.just(IssuePermission(None)),
        min_size=1,
        max_size=3,
    )
)
def test_issue_permissions_survive_encoding_and_decoding(grants: list[IssuePermission]) -> None:
    subject = Subject("a", UTC_S, 60.0, OWN.subject.public_key, (), tuple(grants))
    body = encode_to_be_signed(subject)
    own = decode_certificate(encode_certificate(None, body, encode_signature((1, 1))))
    assert own.subject == subject


def test_bitmaps_of_permissions_survive_encoding_and_decoding() -> None:
    permissions = (Permission(BSM, b"\x30\x40", is_bitmap=True), Permission(38, b"\x01"))
    subject = Subject("a", UTC_S, 60.0, OWN.subject.public_key, permissions)
    encoded = encode_certificate(None, encode_to_be_signed(subject), encode_signature((1, 1)))
    assert decode_certificate(encoded).subject == subject


@given(st.binary(max_size=120), st.data())
def test_any_bytes_raise_only_malformed_or_unsupported(noise: bytes, data: DataObject) -> None:
    changed = bytearray(OWN.encoded)
    changed[data.draw(st.integers(0, len(changed) - 1))] = data.draw(st.integers(0, 255))
    for given_bytes in (noise, b"\x80\x03\x00" + noise, bytes(changed)):
        try:
            decode_certificate(given_bytes)
        except (Malformed, Unsupported):
            continue
