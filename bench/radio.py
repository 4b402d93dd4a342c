"""The 802.11p channel: processor time for a simulated second, compared with ns-3 for the same road.

ns-3 is not run here. Its figures are medians measured alternately with ours on one machine
(docs/radio.md), so the ratio is not valid on another machine.
"""

import time
import tracemalloc
from collections.abc import Iterator
from statistics import median

from bench import Figure
from sim_rig.studies.radio.radio_study import STUDY, RadioSettings

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
"""Processor seconds of ns-3 for a simulated second, by number of cars and fading."""


def measure() -> Iterator[Figure]:
    """Yield processor seconds for a simulated second, and the memory with 400 stations."""
    for (cars, fading), ns3_s in NS3_CPU_S.items():
        settings = RadioSettings(cars=cars, fading=fading, seconds=SECONDS)
        spent_s = []
        for number in range(ROUNDS):
            began_s = time.process_time()
            STUDY.one(settings, number)
            spent_s.append((time.process_time() - began_s) / SECONDS)
        yield Figure(
            f"radio.cpu_s_per_s_{cars}_cars{'' if fading == 'none' else '_fading'}",
            median(spent_s),
            "s",
            ROUNDS,
            "ns-3 3.37 (Debian's), measured alternately on one machine",
            ns3_s,
        )
    yield _memory()


def _memory() -> Figure:
    """Peak memory while 400 cars send for two seconds, compared with one matrix of all pairs."""
    tracemalloc.start()
    STUDY.one(RadioSettings(cars=400, seconds=2.0, spacing_m=5.0), 0)
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
