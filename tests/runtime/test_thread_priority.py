"""Threads beside the loop give way to it, however the process was started."""

import os
import threading

import pytest

from onboard.thread_priority import lower_thread_priority


@pytest.mark.parametrize("before", [0, 15])
def test_a_thread_gets_the_niceness_unless_it_has_more(before: int) -> None:
    niceness = []

    def work() -> None:
        own = os.getpriority(os.PRIO_PROCESS, threading.get_native_id())
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), max(own, before))
        lower_thread_priority(10)
        niceness.append((own, os.getpriority(os.PRIO_PROCESS, threading.get_native_id())))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    (own, after) = niceness[0]
    assert after == max(own, before, 10)
