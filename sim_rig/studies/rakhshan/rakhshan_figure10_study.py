"""Figure 10: collision probability over the access probabilities of safe and unsafe cars."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from sim_rig.studies.campaigns.study import Case, Results, Study
from sim_rig.studies.rakhshan.best_access import (
    CollisionShares,
    RakhshanSettings,
    gain,
    simulate,
)
from sim_rig.studies.rakhshan.highway import mean_and_error


@dataclass(frozen=True, slots=True)
class PairLine:
    """One line of the table: a pair of access probabilities."""

    safe_access: float
    unsafe_access: float
    collision_probability: float
    half_interval_95: float


PairResults = Results[RakhshanSettings, CollisionShares, PairLine]


def run(settings: RakhshanSettings, _case: Case) -> CollisionShares:
    """Simulate all pairs."""
    return simulate(settings)


def table(settings: RakhshanSettings, rows: Sequence[CollisionShares]) -> list[PairLine]:
    """A line for each pair."""
    mean, error = mean_and_error(rows[0].pairs)
    return [
        PairLine(safe, unsafe, float(mean[i, j]), float(error[i, j]))
        for i, safe in enumerate(settings.access)
        for j, unsafe in enumerate(settings.access)
    ]


def picture(results: PairResults) -> Figure:
    """Draw the probability as contours, with the best equal and the best pair."""
    found = gain(results.settings, results.rows[0])
    mean, _ = mean_and_error(results.rows[0].pairs)
    access = np.array(results.settings.access)
    figure = Figure(figsize=(7.0, 5.5), layout="constrained")
    axes = figure.subplots()
    drawn = axes.contourf(access, access, mean.T, levels=24, cmap="viridis")
    figure.colorbar(drawn, label="collision probability")
    axes.plot(found.equal_access, found.equal_access, "wo", label="best equal")
    axes.plot(found.safe_access, found.unsafe_access, "r*", ms=12, label="best pair")
    axes.plot(access, access, "w:", lw=1)
    axes.set(xscale="log", yscale="log", xlabel="access of safe cars", ylabel="of unsafe cars")
    axes.legend(loc="lower left")
    return figure


def summary(results: PairResults) -> str:
    """The best equal probability, the best pair, and what it gains."""
    return gain(results.settings, results.rows[0]).sentence()


STUDY = Study(
    name="rakhshan-figure10",
    sentence="Figure 10: how many cars collide, by the access of safe and unsafe cars.",
    settings=RakhshanSettings,
    takes_settings=False,
    about_s=lambda _: 14.0,
    case=Case,
    run=run,
    table=table,
    line=PairLine,
    picture=picture,
    summary=summary,
)
