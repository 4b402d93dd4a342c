"""Guesses at the page's token, in virtual time."""

import pytest

from onboard.hmi.guess_limiter import GUESS_S, MOST_AT_ONCE, MOST_CLIENTS, GuessLimiter


def looked_at(limiter: GuessLimiter, addresses: list[str], seconds: float, rate_hz: int) -> int:
    """How many wrong tokens are looked at, if the addresses offer them in turns."""
    count = 0
    for number in range(round(seconds * rate_hz)):
        address, now = addresses[number % len(addresses)], number / rate_hz
        if limiter.may_offer(address, now):
            limiter.receive_wrong(address, now)
            count += 1
    return count


def test_after_some_mistakes_one_guess_a_second_is_looked_at() -> None:
    tried = looked_at(GuessLimiter(), ["192.168.1.7"], 100.0, 400)
    assert tried == pytest.approx(MOST_AT_ONCE + 100.0 / GUESS_S, abs=1)


def test_who_waits_may_make_the_same_mistakes_again() -> None:
    limiter = GuessLimiter()
    for began_at in (0.0, MOST_AT_ONCE * GUESS_S):
        for _ in range(MOST_AT_ONCE):
            assert limiter.may_offer("192.168.1.7", began_at)
            limiter.receive_wrong("192.168.1.7", began_at)
        assert not limiter.may_offer("192.168.1.7", began_at)


def test_another_client_is_not_shut_out() -> None:
    limiter = GuessLimiter()
    looked_at(limiter, ["192.168.1.7"], 10.0, 400)
    assert limiter.may_offer("192.168.1.8", 10.0)


def test_addresses_of_one_ipv6_network_are_one_client() -> None:
    addresses = [f"2001:db8::{number:x}" for number in range(1000)]
    assert looked_at(GuessLimiter(), addresses, 10.0, 400) <= MOST_AT_ONCE + 11
    assert looked_at(GuessLimiter(), ["fe80::1%wlan0", "fe80::2"], 10.0, 400) <= MOST_AT_ONCE + 11


def test_of_too_many_clients_those_that_guess_are_remembered() -> None:
    limiter = GuessLimiter()
    looked_at(limiter, ["192.168.1.7"], 1.0, 400)
    for number in range(MOST_CLIENTS - 1):
        limiter.receive_wrong(f"10.0.{number // 256}.{number % 256}", 0.5)
    assert not limiter.may_offer("192.168.1.7", 0.5)
    limiter.receive_wrong("10.1.0.0", 0.5)
    assert limiter.may_offer("192.168.1.7", 0.5)
