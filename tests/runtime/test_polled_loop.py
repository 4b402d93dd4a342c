"""The loop that tells whether input waits."""

import socket
from collections.abc import Iterator

import pytest

from onboard.runtime.polled_loop import PolledLoop


@pytest.fixture
def loop() -> Iterator[PolledLoop]:
    made = PolledLoop()
    yield made
    made.close()


def test_input_waits_from_its_arrival_until_it_is_read(loop: PolledLoop) -> None:
    near, far = socket.socketpair()
    with near, far:
        loop.add_reader(near, lambda: None)
        before = loop.has_input()
        far.send(b"frame")
        waiting = loop.has_input()
        near.recv(16)

        assert (before, waiting, loop.has_input()) == (False, True, False)
        loop.remove_reader(near)


def test_a_call_of_a_thread_is_input(loop: PolledLoop) -> None:
    loop.call_soon_threadsafe(lambda: None)

    assert loop.has_input()
