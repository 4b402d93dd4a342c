"""Settings of the garbage collector that keep its pauses short."""

import gc

_THRESHOLDS = (10_000, 10, 50)
"""With a hundred vehicles nearby, 0.1 s creates some 20,000 objects that live for 2 s."""


def freeze_start_up_objects() -> None:
    """Exclude present objects from collection: each pass over 100,000 of them takes 30 ms."""
    gc.unfreeze()  # after an earlier start in this process
    gc.collect()
    gc.freeze()
    gc.set_threshold(*_THRESHOLDS)
