"""The communication ID follows from the plate and changes every epoch."""

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic.types import SecretStr

from onboard.security.plate_digest import PlateDigest, normalised
from onboard.security.settings import PlateDigestSettings

CHEAP = PlateDigestSettings(scrypt_log2_n=1)
EPOCH_BEGIN_S = 1_700_000_100.0


def test_two_cars_derive_the_same_id_from_a_plate() -> None:
    written, read = PlateDigest(CHEAP), PlateDigest(CHEAP)
    assert written.car_id("abc-01 23", EPOCH_BEGIN_S) == read.car_id("ABC0123", EPOCH_BEGIN_S)


def test_look_alike_characters_give_the_same_id() -> None:
    digest = PlateDigest(CHEAP)
    assert digest.car_id("7OI X", EPOCH_BEGIN_S) == digest.car_id("701X", EPOCH_BEGIN_S)


def test_the_id_is_valid_for_one_epoch_and_changes_at_its_end() -> None:
    digest = PlateDigest(CHEAP)
    first = digest.car_id("ABC123", EPOCH_BEGIN_S)
    ends_at = digest.epoch_ends_at(EPOCH_BEGIN_S)
    assert ends_at == EPOCH_BEGIN_S + 300.0
    assert digest.car_id("ABC123", math.nextafter(ends_at, 0)) == first
    assert digest.car_id("ABC123", ends_at) != first
    assert digest.epoch_ends_at(ends_at) == ends_at + 300.0


def test_another_community_key_gives_other_ids() -> None:
    ours = PlateDigest(CHEAP)
    theirs = PlateDigest(CHEAP.model_copy(update={"community_key": _secret("another community!")}))
    assert ours.car_id("ABC123", EPOCH_BEGIN_S) != theirs.car_id("ABC123", EPOCH_BEGIN_S)


def _secret(key: str) -> SecretStr:
    return PlateDigestSettings.model_validate({"community_key": key}, strict=False).community_key


def test_the_community_key_is_not_printed_with_the_settings() -> None:
    assert "open-community" not in repr(PlateDigestSettings())


@given(plate=st.text(min_size=1), utc_s=st.floats(min_value=0, max_value=4e9))
def test_every_plate_has_an_id_of_eight_bytes_or_is_refused(plate: str, utc_s: float) -> None:
    digest = PlateDigest(CHEAP)
    try:
        text = normalised(plate)
    except ValueError:
        with pytest.raises(ValueError, match="letters or digits"):
            digest.car_id(plate, utc_s)
        return
    assert len(digest.car_id(plate, utc_s)) == 8
    assert normalised(text) == text
    assert utc_s < digest.epoch_ends_at(utc_s) <= utc_s + 300.0 + 1e-6


def test_a_derivation_is_done_once_an_epoch(monkeypatch: pytest.MonkeyPatch) -> None:
    digest = PlateDigest(CHEAP)
    first = digest.car_id("ABC123", EPOCH_BEGIN_S)
    monkeypatch.setattr("hashlib.scrypt", lambda *_, **__: pytest.fail("derived again"))
    assert digest.car_id("abc 123", EPOCH_BEGIN_S + 299) == first


@pytest.mark.long
def test_ids_are_derived_at_the_highest_cost() -> None:
    digest = PlateDigest(PlateDigestSettings(scrypt_log2_n=20))
    assert len(digest.car_id("ABC123", EPOCH_BEGIN_S)) == 8


def test_it_is_known_which_ids_are_derived() -> None:
    digest = PlateDigest(CHEAP)
    assert not digest.is_derived("ABC123", EPOCH_BEGIN_S)

    digest.car_id("abc-i23", EPOCH_BEGIN_S)

    assert digest.is_derived("ABC123", EPOCH_BEGIN_S + 299.0)
    assert not digest.is_derived("ABC123", EPOCH_BEGIN_S + 300.0)
    assert not digest.is_derived("ABC124", EPOCH_BEGIN_S)


def test_the_ids_of_a_lead_outlast_those_of_vehicles_that_come_and_go() -> None:
    digest = PlateDigest(CHEAP)
    lead = [f"LEAD{number}" for number in range(16)]
    for other in range(40):
        for number in range(16):
            digest.car_id(f"OTHER{other}N{number}", EPOCH_BEGIN_S)
        for text in lead:
            digest.car_id(text, EPOCH_BEGIN_S)

    assert all(digest.is_derived(text, EPOCH_BEGIN_S) for text in lead)
    assert not digest.is_derived("OTHER0N0", EPOCH_BEGIN_S)


def test_threads_that_share_a_digest_get_the_same_ids() -> None:
    digest, reference = PlateDigest(CHEAP), PlateDigest(CHEAP)
    plates = [f"AB{number}" for number in range(300)]  # more than the cache holds

    def ids(seed: int) -> dict[str, bytes]:
        order = np.random.default_rng(seed).permutation(plates)
        return {plate: digest.car_id(plate, EPOCH_BEGIN_S) for plate in order}

    with ThreadPoolExecutor(8) as threads:
        results = list(threads.map(ids, range(8)))

    expected = {plate: reference.car_id(plate, EPOCH_BEGIN_S) for plate in plates}
    assert all(result == expected for result in results)
