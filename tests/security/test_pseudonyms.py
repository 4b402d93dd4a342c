"""Pseudonyms: certificate, temporary ID and communication ID change together."""

import itertools
import math

import numpy as np

from onboard.security.credentials import Credentials
from onboard.security.plate_digest import PlateDigest
from onboard.security.pseudonyms import Pseudonyms
from onboard.security.settings import PlateDigestSettings
from onboard.tools.test_ca.authority import DAY_S, make_pseudonyms
from tests.security.trial import ALICE, BSM, ISSUING, UTC_S, VALID, new_key

DIGEST = PlateDigest(PlateDigestSettings(scrypt_log2_n=1))


def _pseudonyms(credentials: Credentials | None = ALICE, seed: int = 1) -> Pseudonyms:
    return Pseudonyms("ABC123", DIGEST, credentials, np.random.default_rng(seed))


def test_a_pseudonym_is_valid_to_the_end_of_its_epoch() -> None:
    pseudonyms = _pseudonyms()
    first = pseudonyms.at(UTC_S)
    assert first.ends_at_utc_s == DIGEST.epoch_ends_at(UTC_S)
    assert pseudonyms.at(math.nextafter(first.ends_at_utc_s, 0)) is first
    assert first.car_id == DIGEST.car_id("abc 123", UTC_S)
    assert len(first.temporary_id) == 4
    assert 0 <= first.first_msg_cnt <= 127


def test_all_identifiers_change_together() -> None:
    pseudonyms = _pseudonyms()
    first = pseudonyms.at(UTC_S)
    second = pseudonyms.at(first.ends_at_utc_s)
    assert second.car_id != first.car_id
    assert second.temporary_id != first.temporary_id
    assert second.credential is not first.credential


def test_certificates_are_taken_in_turns() -> None:
    pseudonyms = _pseudonyms()
    taken = [pseudonyms.at(UTC_S + 300 * i).credential for i in range(6)]
    assert {id(credential) for credential in taken[:3]} == {id(own) for own in ALICE.pseudonyms}
    assert taken[3:] == taken[:3]


def test_a_restarted_car_uses_the_same_certificate() -> None:
    signing = {id(_pseudonyms(seed=seed).at(UTC_S).credential) for seed in range(30)}
    assert len(signing) == 1


def test_only_certificates_valid_for_the_whole_epoch_are_used() -> None:
    tomorrow = make_pseudonyms(
        ISSUING, 2, {BSM}, new_key=new_key, valid_from_utc_s=UTC_S + DAY_S, valid_for_s=DAY_S
    )
    today = ALICE.pseudonyms[:2]
    batch = Credentials(
        (tomorrow.pseudonyms[0], today[0], tomorrow.pseudonyms[1], today[1]), (), ()
    )
    for seed in range(4):
        pseudonyms = _pseudonyms(batch, seed)
        taken = [pseudonyms.at(UTC_S + 300 * i).credential for i in range(4)]
        assert {id(credential) for credential in taken} == {id(own) for own in today}
        assert all(now is not before for before, now in itertools.pairwise(taken))
        assert pseudonyms.at(UTC_S + 1.5 * DAY_S).credential in tomorrow.pseudonyms


def test_a_car_without_valid_certificates_uses_an_expired_one() -> None:
    long_after = UTC_S + 2 * VALID["valid_for_s"]
    assert _pseudonyms().at(long_after).credential in ALICE.pseudonyms


def test_a_car_without_keys_changes_its_ids_too() -> None:
    pseudonyms = _pseudonyms(credentials=None)
    first, second = pseudonyms.at(UTC_S), pseudonyms.at(UTC_S + 300)
    assert first.credential is second.credential is None
    assert first.car_id != second.car_id


def test_the_same_seed_gives_the_same_pseudonyms() -> None:
    assert _pseudonyms(seed=5).at(UTC_S) == _pseudonyms(seed=5).at(UTC_S)
