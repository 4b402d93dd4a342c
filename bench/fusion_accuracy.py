"""Accuracy of the tracks of cars without a radio, compared with a centralised filter.

Root mean square errors of MVS, of a filter that treats all evidence as independent, of covariance
intersection and of own sensing alone, at 10 to 40 % radios, M = 5 to 20, 0 to 50 % loss, and with
SDSMs instead of the footer, and beside it. The
reference is the centralised filter over the same cars; the aim is a ratio of 1.10 at 40 % and M =
10.

The NEES is 4 if a covariance is consistent. Cars that keep their lane are tracked better than the
filter's model predicts, so consistency is also measured with free cars, which move as in the model.
"""

from collections.abc import Iterator

from bench import Figure
from onboard.mvs.settings import SharedIn
from sim_rig.studies.mvs.accuracy import CENTRALISED, MODELLED, OWN, Accuracy, accuracy
from sim_rig.studies.mvs.roads import FreeCars

SECONDS = 1.0
CASES = (
    (0.1, 10, 0.0), (0.2, 10, 0.0), (0.3, 10, 0.0), (0.4, 10, 0.0),
    (0.4, 5, 0.0), (0.4, 20, 0.0), (0.4, 10, 0.2), (0.4, 10, 0.5),
)  # fmt: skip
"""Share of radios, M, loss."""


def measure() -> Iterator[Figure]:
    """Yield the errors and the NEES of every method in every case."""
    for radio, entries, loss in CASES:
        settings = MODELLED.model_copy(update={"max_entries": entries})
        result = accuracy(settings, radio, loss, seed=1, seconds=SECONDS)
        yield from _figures(f"{radio:.0%}.M{entries}.loss{loss:.0%}", result)
    for shared_in in (SharedIn.SDSM, SharedIn.BOTH):
        settings = MODELLED.model_copy(update={"shared_in": shared_in})
        result = accuracy(settings, 0.4, 0.0, seed=1, seconds=SECONDS)
        yield from _figures(f"40%.M10.loss0%.{shared_in}", result)
    free = accuracy(MODELLED, 0.4, 0.0, seed=1, seconds=SECONDS, road=FreeCars)
    limit = free.errors[CENTRALISED].mean_nees
    for method, errors in free.errors.items():
        name = f"fusion_accuracy.free.{method}.nees"
        reference = "the centralised filter"
        yield Figure(name, errors.mean_nees, "1", len(errors.nees), reference, limit)


def _figures(case: str, result: Accuracy) -> Iterator[Figure]:
    for method, errors in result.errors.items():
        if method == CENTRALISED:
            continue
        limit = result.centralised_of_own if method == OWN else result.errors[CENTRALISED]
        n, name = len(errors.nees), f"fusion_accuracy.{case}.{method}"
        reference = "the centralised filter"
        yield Figure(
            f"{name}.position", errors.position_rmse_m, "m", n, reference, limit.position_rmse_m
        )
        yield Figure(
            f"{name}.speed", errors.speed_rmse_m_s, "m/s", n, reference, limit.speed_rmse_m_s
        )
        yield Figure(f"{name}.nees", errors.mean_nees, "1", n, "a consistent covariance", 4.0)
