"""Settings of the garbage collector that keep its pauses short."""

import gc

_THRESHOLDS = (50_000, 10, 10)
"""With a hundred vehicles nearby some 10,000 objects live for 2 s, most of them with many others in
them: one pass takes 20 ms. The cores make no circles, and with this a pass comes only once so many
more objects are alive than before, so that whatever makes circles cannot fill the memory."""


def freeze_start_up_objects() -> None:
    """Exclude present objects from collection: each pass over 100,000 of them takes 30 ms."""
    gc.unfreeze()  # after an earlier start in this process
    gc.collect()
    gc.freeze()
    gc.set_threshold(*_THRESHOLDS)
