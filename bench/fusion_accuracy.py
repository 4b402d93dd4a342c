"""How well cars without a radio are known, beside the centralised filter that gets everything.

Root mean square errors of MVS, of a filter that uses all it got blindly, of covariance intersection
and of the own sensing alone, at 10 to 40 % radios, M = 5 to 20, 0 to 50 % loss. The reference of
each is the centralised filter over the same cars; the aim is 1.10 at 40 % and M = 10.

The NEES is 4 where a covariance is right. Cars that keep their place are better known than the
filter claims; whether it is right is seen with free cars, which move as it takes them to, beside
the centralised filter's.
"""

from collections.abc import Iterator

from bench import Figure
from sim_rig.studies.mvs_accuracy import CENTRALISED, MODELLED, OWN, Accuracy, accuracy
from sim_rig.studies.mvs_roads import FreeCars

SECONDS = 1.0
CASES = (
    (0.1, 10, 0.0), (0.2, 10, 0.0), (0.3, 10, 0.0), (0.4, 10, 0.0),
    (0.4, 5, 0.0), (0.4, 20, 0.0), (0.4, 10, 0.2), (0.4, 10, 0.5),
)  # fmt: skip
"""Share of radios, M, loss."""


def measure() -> Iterator[Figure]:
    """Yield errors and consistency of every method in every case."""
    for radio, entries, loss in CASES:
        settings = MODELLED.model_copy(update={"most_entries": entries})
        found = accuracy(settings, radio, loss, seed=1, seconds=SECONDS)
        yield from _figures(f"{radio:.0%}.M{entries}.loss{loss:.0%}", found)
    free = accuracy(MODELLED, 0.4, 0.0, seed=1, seconds=SECONDS, road=FreeCars)
    limit = free.errors[CENTRALISED].mean_nees
    for method, errors in free.errors.items():
        name = f"fusion_accuracy.free.{method}.nees"
        beside = "the centralised filter"
        yield Figure(name, errors.mean_nees, "1", len(errors.nees), beside, limit)


def _figures(case: str, found: Accuracy) -> Iterator[Figure]:
    for method, errors in found.errors.items():
        if method == CENTRALISED:
            continue
        limit = found.centralised_of_own if method == OWN else found.errors[CENTRALISED]
        n, name = len(errors.nees), f"fusion_accuracy.{case}.{method}"
        beside = "the centralised filter"
        yield Figure(
            f"{name}.position", errors.position_rmse_m, "m", n, beside, limit.position_rmse_m
        )
        yield Figure(f"{name}.speed", errors.speed_rmse_m_s, "m/s", n, beside, limit.speed_rmse_m_s)
        yield Figure(f"{name}.nees", errors.mean_nees, "1", n, "a right covariance", 4.0)
