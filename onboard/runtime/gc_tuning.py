"""Garbage collection that does not hold up what a program does ten times a second."""

import gc

_THRESHOLDS = (10_000, 10, 50)
"""A tenth of a second with a hundred cars around makes some 20,000 things that live for 2 s."""


def freeze_start_up_objects() -> None:
    """Or 100,000 things that stay are looked at again and again, for 30 ms each time."""
    gc.unfreeze()  # what was started in this process before
    gc.collect()
    gc.freeze()
    gc.set_threshold(*_THRESHOLDS)
