"""The 802.11p channel alone: CPU time for a second on the air, beside ns-3's for the same road.

ns-3 is not run here: its figures are medians that were taken in turns with ours (docs/radio.md), so
the ratio is worth little on another machine.
"""

import time
import tracemalloc
from collections.abc import Iterator
from statistics import median

from bench import Figure
from sim_rig.studies.radio import RadioSettings, run_one

ROUNDS = 5
SECONDS = 4.8
NS3_CPU_S = {
    (40, "none"): 0.118,
    (40, "rayleigh"): 0.115,
    (100, "none"): 0.635,
    (100, "rayleigh"): 0.594,
    (200, "none"): 1.90,
    (200, "rayleigh"): 1.83,
}
"""By number of cars and fading."""


def measure() -> Iterator[Figure]:
    """Yield CPU seconds a simulated second, and the memory of a channel of 400 stations."""
    for (cars, fading), theirs_s in NS3_CPU_S.items():
        settings = RadioSettings(cars=cars, fading=fading, seconds=SECONDS)
        spent_s = []
        for number in range(ROUNDS):
            began_s = time.process_time()
            run_one(settings, number)
            spent_s.append((time.process_time() - began_s) / SECONDS)
        yield Figure(
            f"radio.cpu_s_per_s_{cars}_cars{'' if fading == 'none' else '_fading'}",
            median(spent_s),
            "s",
            ROUNDS,
            "ns-3 3.37 (Debian's), in turns with ours on one machine",
            theirs_s,
        )
    yield _memory()


def _memory() -> Figure:
    """At most while 400 cars send for two seconds, beside the one matrix that it cannot avoid."""
    tracemalloc.start()
    run_one(RadioSettings(cars=400, seconds=2.0, spacing_m=5.0), 0)
    _, peak_bytes = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return Figure(
        "radio.memory_400_cars",
        peak_bytes / 2**20,
        "MiB",
        1,
        "the mean power of each pair",
        400 * 400 * 8 / 2**20,
    )
