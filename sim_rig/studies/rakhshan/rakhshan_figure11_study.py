"""Figure 11: collision probability over one access probability for all cars."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from sim_rig.studies.campaigns.study import Case, Results, Study
from sim_rig.studies.rakhshan.best_access import (
    PAPERS_OPTIMUM,
    CollisionShares,
    RakhshanSettings,
    simulate,
)
from sim_rig.studies.rakhshan.highway import mean_and_error


@dataclass(frozen=True, slots=True)
class EqualAccessLine:
    """One line of the table: an access probability."""

    access: float
    collision_probability: float
    half_interval_95: float


EqualAccessResults = Results[RakhshanSettings, CollisionShares, EqualAccessLine]


def run(settings: RakhshanSettings, _case: Case) -> CollisionShares:
    """Simulate all pairs, of which the equal ones are used."""
    return simulate(settings)


def table(settings: RakhshanSettings, rows: Sequence[CollisionShares]) -> list[EqualAccessLine]:
    """A line for each access probability."""
    mean, error = mean_and_error(rows[0].equal)
    values = zip(settings.access, mean.tolist(), error.tolist(), strict=True)
    return [EqualAccessLine(*each) for each in values]


def picture(results: EqualAccessResults) -> Figure:
    """Draw the probability with the bounds by no radio and by one without delay."""
    settings, (found,) = results.settings, results.rows
    mean, error = mean_and_error(found.equal)
    without_radio, perfect_radio = _bounds(found)
    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    axes = figure.subplots()
    axes.errorbar(settings.access, mean, error, fmt="o-", ms=3, capsize=2)
    axes.axhline(without_radio, ls="--", color="C3", label="brake lights only")
    axes.axhline(perfect_radio, ls=":", color="C2", label="radio without delay")
    axes.axvline(PAPERS_OPTIMUM, color="0.7", label="optimum of the paper")
    axes.set(xscale="log", xlabel="channel access probability", ylabel="collision probability")
    axes.legend(frameon=False)
    return figure


def _bounds(found: CollisionShares) -> tuple[float, float]:
    """Collision probability with brake lights only, and with a radio without delay."""
    both, _ = mean_and_error(np.stack([found.without_radio, found.perfect_radio]))
    return float(both[0]), float(both[1])


def summary(results: EqualAccessResults) -> str:
    """The least probability, and how wide its valley is."""
    access, (found,) = results.settings.access, results.rows
    mean, error = mean_and_error(found.equal)
    without_radio, perfect_radio = _bounds(found)
    best = int(np.argmin(mean))
    floor = np.flatnonzero(mean <= 1.01 * mean[best])
    return (
        f"least at {access[best]:g}: {mean[best]:.4f} +- {error[best]:.4f};"
        f" within 1 % of it from {access[floor[0]]:g} to {access[floor[-1]]:g};"
        f" brake lights only {without_radio:.4f}, radio without delay {perfect_radio:.4f}"
    )


STUDY = Study(
    name="rakhshan-figure11",
    sentence="Figure 11: how many cars collide, by one access probability for all.",
    settings=RakhshanSettings,
    takes_settings=False,
    about_s=lambda _: 14.0,
    case=Case,
    run=run,
    table=table,
    line=EqualAccessLine,
    picture=picture,
    summary=summary,
)
