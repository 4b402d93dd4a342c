"""The seeds of new pseudonyms: secret in a car, the same at each start of a test."""

from onboard.runtime.entropy_source import entropy_source
from onboard.security.pseudonyms import ENTROPY_BYTES


def some_of(seed: int | None) -> list[bytes | None]:
    source = entropy_source(seed)
    return [source() for _ in range(3)]


def test_without_a_seed_nobody_can_know_the_next_one() -> None:
    found = some_of(None) + some_of(None)
    assert len(set(found)) == len(found)


def test_a_vehicle_that_is_started_again_with_its_seed_gets_the_same_ones() -> None:
    large = 2**127 + 1
    for seed in (7, large):
        first = some_of(seed)
        assert first == some_of(seed)
        assert {len(each or b"") for each in first} == {ENTROPY_BYTES}
        assert len(set(first)) == len(first)
    assert some_of(7) != some_of(large)
