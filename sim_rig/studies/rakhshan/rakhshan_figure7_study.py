"""Figure 7: the true and the estimated distribution of one slow driver's reaction times."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import lognorm

from onboard.access.driver_model import DEFAULT_POPULATION, DriverModel
from sim_rig.studies.campaigns.study import Case, Results, Study
from sim_rig.studies.rakhshan.drivers import DriversSettings, fit_population, simulate_reactions

HEADWAY_S = 1.5
SLOWER = 0.35
"""By how much the logarithm of the driver's reaction times is above the population's."""


@dataclass(frozen=True, slots=True)
class LogNormal:
    """A distribution of reaction times."""

    name: str
    mean: float
    """Of the logarithm of the time in s."""
    sd: float
    """Standard deviation of that."""

    def percentile_s(self, share: float) -> float:
        """The time that this share of all reactions is shorter than."""
        return float(lognorm(self.sd, scale=math.exp(self.mean)).ppf(share))


@dataclass(frozen=True, slots=True)
class DistributionLine:
    """One line of the table: a distribution."""

    distribution: str
    percentile_10_s: float
    median_s: float
    percentile_90_s: float


DriverResults = Results[DriversSettings, list[LogNormal], DistributionLine]


def run(settings: DriversSettings, _case: Case) -> list[LogNormal]:
    """Estimate a slow driver from some reactions."""
    rng = np.random.default_rng(settings.seed)
    fitted = fit_population(simulate_reactions(DEFAULT_POPULATION, settings, rng))
    usual = DEFAULT_POPULATION.coefficients @ np.array([1.0, math.log(HEADWAY_S)]) + SLOWER
    noise = math.sqrt(DEFAULT_POPULATION.noise_variance)
    driver = DriverModel(fitted)
    for log_s in rng.normal(usual, noise, settings.one_drivers_reactions):
        driver.receive_reaction(math.exp(log_s), HEADWAY_S)
    estimate, spread = driver.log_reaction(HEADWAY_S)
    return [
        LogNormal("the driver", float(usual), noise),
        LogNormal("estimate, noise variance only", estimate, math.sqrt(fitted.noise_variance)),
        LogNormal("estimate, all uncertainty", estimate, spread),
        LogNormal("population", *DriverModel(fitted).log_reaction(HEADWAY_S)),
    ]


def table(_settings: DriversSettings, rows: Sequence[list[LogNormal]]) -> list[DistributionLine]:
    """A line for each distribution."""
    return [
        DistributionLine(each.name, *(each.percentile_s(share) for share in (0.1, 0.5, 0.9)))
        for each in rows[0]
    ]


def picture(results: DriverResults) -> Figure:
    """Draw the densities, with the times that one in ten reactions is shorter or longer than."""
    time_s = np.linspace(0.3, 4.0, 200)
    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    axes = figure.subplots()
    for each, line, colour in zip(
        results.rows[0], results.table, ("k", "C0", "C3", "0.7"), strict=True
    ):
        density = lognorm(each.sd, scale=math.exp(each.mean)).pdf(time_s)
        axes.plot(time_s, density, color=colour, label=each.name)
        for at_s in (line.percentile_10_s, line.percentile_90_s):
            axes.axvline(at_s, color=colour, lw=0.6)
    axes.set(xlabel="reaction time in s", ylabel="density")
    axes.legend(frameon=False)
    return figure


def summary(results: DriverResults) -> str:
    """The range of each distribution without its extreme tenths."""
    return "; ".join(
        f"{line.distribution}: {line.percentile_10_s:.2f} to {line.percentile_90_s:.2f} s"
        for line in results.table
    )


STUDY = Study(
    name="rakhshan-figure7",
    sentence="Figure 7: how well one slow driver's reaction times are estimated from a few.",
    settings=DriversSettings,
    takes_settings=False,
    case=Case,
    run=run,
    table=table,
    line=DistributionLine,
    picture=picture,
    summary=summary,
)
