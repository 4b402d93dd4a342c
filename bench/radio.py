"""The 802.11p channel alone: CPU time for a second on the air, beside ns-3's for the same road.

ns-3's figures are those that came with its results (3.37, one core): the program is not run here.
"""

import time
import tracemalloc
from collections.abc import Iterator
from statistics import median

from bench import Figure
from sim_rig.studies.radio import RadioSettings, run_one

ROUNDS = 5
SECONDS = 4.8
NS3_CPU_S = {40: 0.17, 100: 0.82, 200: 2.3}
"""By number of cars, without fading."""


def measure() -> Iterator[Figure]:
    """Yield CPU seconds a simulated second, and the memory of a channel of 400 stations."""
    for cars, theirs_s in NS3_CPU_S.items():
        for name, fading in (("", "none"), ("_fading", "rayleigh")):
            settings = RadioSettings(cars=cars, fading=fading, seconds=SECONDS)
            spent_s = []
            for number in range(ROUNDS):
                began_s = time.process_time()
                run_one(settings, number)
                spent_s.append((time.process_time() - began_s) / SECONDS)
            yield Figure(
                f"radio.cpu_s_per_s_{cars}_cars{name}",
                median(spent_s),
                "s",
                ROUNDS,
                "ns-3 3.37 without fading, as measured with its results",
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
