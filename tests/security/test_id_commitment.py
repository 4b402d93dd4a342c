"""Certificates that commit to vehicle IDs: the right ones are proved, no others."""

import hashlib
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import SecretStr

from onboard.security.credentials import Credentials
from onboard.security.id_commitment import (
    MAX_PROOF,
    NODE_BYTES,
    is_proved,
    leaf,
    proof_of,
    root_in,
    root_of,
    ssp_of,
)
from onboard.security.key_files import (
    KeyFilesError,
    check_ids,
    read_credentials,
    read_own_credentials,
    write_credentials,
)
from onboard.security.plate_digest import PlateDigest
from onboard.security.settings import PlateDigestSettings, SecuritySettings
from onboard.tools.test_ca.authority import KnownPlate, make_pseudonyms
from tests.security.trial import BSM, ISSUING, LCCA, UTC_S, VALID, new_key
from tests.typed import a

DIGEST = PlateDigest(PlateDigestSettings(scrypt_log2_n=1))
IDS = st.lists(st.binary(min_size=8, max_size=8), min_size=1, max_size=40, unique=True)


def _credentials(*, implicit: bool = False) -> Credentials:
    known = KnownPlate("ABC123", DIGEST)
    return make_pseudonyms(
        ISSUING, 3, {BSM, LCCA}, new_key=new_key, implicit=implicit, plate=known, **VALID
    )


def test_each_derived_id_is_reported() -> None:
    """A day of validity takes 10 s of deriving, of which a progress bar tells."""
    derived: list[None] = []
    known = KnownPlate("ABC123", DIGEST, derived=lambda: derived.append(None))

    made = make_pseudonyms(ISSUING, 3, {BSM, LCCA}, new_key=new_key, plate=known, **VALID)

    assert len(derived) == sum(len(each.committed) for each in made.pseudonyms) > 0


def test_of_more_certificates_than_epochs_some_commit_to_nothing(tmp_path: Path) -> None:
    """As of 300 for a day: the vehicle uses one of them in each of three epochs."""
    valid = VALID | {"valid_for_s": 600.0}
    known = KnownPlate("ABC123", DIGEST)

    made = make_pseudonyms(ISSUING, 5, {BSM, LCCA}, new_key=new_key, plate=known, **valid)

    assert sorted(len(each.committed) for each in made.pseudonyms) == [0, 0, 1, 1, 1]
    write_credentials(tmp_path / "car", made)
    check_ids(tmp_path / "car", "ABC123", DIGEST)
    with pytest.raises(KeyFilesError, match="than ABC124"):
        check_ids(tmp_path / "car", "ABC124", DIGEST)


@given(IDS)
def test_every_id_of_a_certificate_is_proved(car_ids: list[bytes]) -> None:
    leaves = [leaf(epoch, car_id) for epoch, car_id in enumerate(car_ids)]
    root = a(bytes, root_in(ssp_of(leaves)))
    for own in leaves:
        proof = a(tuple, proof_of(own, leaves))
        assert len(proof) <= MAX_PROOF
        assert is_proved(own, proof, root)


@given(IDS, st.binary(min_size=8, max_size=8), st.data())
def test_no_other_id_is_proved_by_any_proof_of_these(
    car_ids: list[bytes], other: bytes, data: st.DataObject
) -> None:
    leaves = [leaf(epoch, car_id) for epoch, car_id in enumerate(car_ids)]
    proof = a(tuple, proof_of(data.draw(st.sampled_from(leaves)), leaves))
    for epoch in range(-1, len(car_ids) + 1):
        if car_ids[epoch : epoch + 1] != [other]:
            assert proof_of(leaf(epoch, other), leaves) is None
            assert not is_proved(leaf(epoch, other), proof, root_of(leaves))


def test_an_id_is_that_of_its_epoch_only() -> None:
    leaves = [leaf(epoch, bytes((epoch,)) * 8) for epoch in range(5)]
    proof = a(tuple, proof_of(leaves[2], leaves))
    proved = [is_proved(leaf(at, bytes((2,)) * 8), proof, root_of(leaves)) for at in range(5)]
    assert proved == [False, False, True, False, False]


def test_a_node_is_not_an_id() -> None:
    """The children of the root, as an ID of their own, would prove themselves without a proof."""
    one, two = leaf(0, b"AAAAAAAA"), leaf(1, b"BBBBBBBB")
    children = min(one, two) + max(one, two)
    as_epoch = int.from_bytes(children[:8], signed=True)
    assert not is_proved(leaf(as_epoch, children[8:]), (), root_of([one, two]))


def test_root_of_three_by_hand() -> None:
    """Independent of the module: the odd leaf moves up, children are hashed in their order."""

    def cut(data: bytes) -> bytes:
        return hashlib.sha256(data).digest()[:NODE_BYTES]

    one, two, three = (cut(bytes(8) + bytes((n,)) + bytes((n,)) * 8) for n in (1, 2, 3))
    pair = cut(b"\x01" + b"".join(sorted((one, two))))
    assert root_of([leaf(n, bytes((n,)) * 8) for n in (1, 2, 3)]) == cut(
        b"\x01" + b"".join(sorted((pair, three)))
    )


@pytest.mark.parametrize("ssp", [None, b"", b"\x02", b"\x01" + bytes(12), b"\x02" + bytes(13)])
def test_other_ssps_commit_to_nothing(ssp: bytes | None) -> None:
    assert root_in(ssp) is None


@pytest.mark.parametrize("implicit", [False, True])
def test_the_certificate_of_each_epoch_commits_to_its_id(*, implicit: bool) -> None:
    credentials = _credentials(implicit=implicit)
    assert credentials.commit_to_ids
    for number in range(-5, 60):
        utc_s = UTC_S + 300.0 * number
        epoch = DIGEST.epoch(utc_s)
        its_leaf = leaf(epoch, DIGEST.car_id("ABC123", utc_s))
        proved = [
            is_proved(
                its_leaf,
                proof_of(its_leaf, own.committed) or (),
                a(bytes, root_in(own.certificate.ssp(LCCA))),
            )
            for own in credentials.pseudonyms
        ]
        assert proved == [at == epoch % 3 for at in range(3)]


def test_no_certificate_has_an_id_of_another() -> None:
    """Else its siblings would link the pseudonyms of one vehicle."""
    committed = [set(own.committed) for own in _credentials().pseudonyms]
    assert all(committed)
    assert sum(map(len, committed)) == len(set().union(*committed))


def test_they_are_kept_beside_the_keys(tmp_path: Path) -> None:
    credentials = _credentials()
    write_credentials(tmp_path / "car", credentials)
    read = read_credentials(tmp_path / "car", {BSM, LCCA})
    assert [own.committed for own in read.pseudonyms] == [
        own.committed for own in credentials.pseudonyms
    ]


def _settings(folder: Path, key: str = "onboard-open-community") -> SecuritySettings:
    digest = PlateDigestSettings(scrypt_log2_n=1, community_key=SecretStr(key))
    return SecuritySettings(keys_folder=folder, plate_digest=digest)


def test_a_vehicle_starts_with_certificates_of_its_plate(tmp_path: Path) -> None:
    write_credentials(tmp_path / "car", _credentials())
    read = read_own_credentials(_settings(tmp_path / "car"), "ABC 123", {BSM, LCCA})
    assert read is not None
    assert read.commit_to_ids


@pytest.mark.parametrize(
    ("plate", "key"), [("ABC124", "onboard-open-community"), ("ABC123", "another community's key")]
)
def test_certificates_of_another_plate_or_community_key_are_an_error(
    tmp_path: Path, plate: str, key: str
) -> None:
    write_credentials(tmp_path / "car", _credentials())
    with pytest.raises(
        KeyFilesError, match=rf"pseudonyms/00\d\.cert: .* than {plate} \(`car.plate`"
    ):
        read_own_credentials(_settings(tmp_path / "car", key), plate)


def test_a_certificate_of_another_plate_among_the_own_is_an_error(tmp_path: Path) -> None:
    others = make_pseudonyms(
        ISSUING, 3, {BSM, LCCA}, new_key=new_key, plate=KnownPlate("XYZ9", DIGEST), **VALID
    )
    for number in range(3):
        mixed = list(_credentials().pseudonyms)
        mixed[number] = others.pseudonyms[number]
        folder = tmp_path / f"car{number}"
        write_credentials(folder, replace(others, pseudonyms=tuple(mixed)))
        with pytest.raises(KeyFilesError, match=rf"00{number}\.cert: .* than ABC123"):
            check_ids(folder, "ABC123", DIGEST)
    write_credentials(tmp_path / "own", _credentials())
    check_ids(tmp_path / "own", "ABC123", DIGEST)


def test_a_missing_file_of_ids_is_an_error(tmp_path: Path) -> None:
    write_credentials(tmp_path / "car", _credentials())
    (tmp_path / "car" / "pseudonyms" / "001.ids").unlink()
    with pytest.raises(KeyFilesError, match=r"001\.ids: cannot be read: No such file"):
        read_credentials(tmp_path / "car", {BSM, LCCA})


@pytest.mark.parametrize("content", [b"", b"x" * NODE_BYTES, b"x" * (NODE_BYTES + 1)])
def test_ids_of_another_certificate_are_an_error(tmp_path: Path, content: bytes) -> None:
    write_credentials(tmp_path / "car", _credentials())
    file = tmp_path / "car" / "pseudonyms" / "001.ids"
    file.write_bytes(content)
    with pytest.raises(KeyFilesError, match=r"001\.ids: is not of 001\.cert"):
        read_credentials(tmp_path / "car", {BSM, LCCA})
