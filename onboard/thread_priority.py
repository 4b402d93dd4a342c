"""Priority of the threads beside the loop: each has one of its own on Linux."""

import os
import threading


def lower_thread_priority(niceness: int) -> None:
    """Give the calling thread at least this niceness.

    A process that was started with more keeps it: only root may take it back.
    """
    thread_id = threading.get_native_id()
    present = os.getpriority(os.PRIO_PROCESS, thread_id)
    os.setpriority(os.PRIO_PROCESS, thread_id, max(present, niceness))
