"""Figure 6: reaction times of a simulated population over the headway, and the fitted model."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from onboard.access.driver_model import DEFAULT_POPULATION, DriverModel, Population
from sim_rig.studies.campaigns.study import Case, Results, Study
from sim_rig.studies.rakhshan.drivers import (
    DriversSettings,
    Reactions,
    fit_population,
    simulate_reactions,
)


@dataclass(frozen=True, slots=True, eq=False)
class FittedPopulation:
    """A simulated population, and the model that is fitted to it."""

    observed: Reactions
    fitted: Population


@dataclass(frozen=True, slots=True)
class ParameterLine:
    """One line of the table: a parameter of the model."""

    parameter: str
    truth: float
    fitted: float


PopulationResults = Results[DriversSettings, FittedPopulation, ParameterLine]


def run(settings: DriversSettings, _case: Case) -> FittedPopulation:
    """Simulate the population, and fit the model."""
    rng = np.random.default_rng(settings.seed)
    observed = simulate_reactions(DEFAULT_POPULATION, settings, rng)
    return FittedPopulation(observed, fit_population(observed))


def table(_settings: DriversSettings, rows: Sequence[FittedPopulation]) -> list[ParameterLine]:
    """A line for each parameter."""
    values = zip(_NAMES, _numbers(DEFAULT_POPULATION), _numbers(rows[0].fitted), strict=True)
    return [ParameterLine(*each) for each in values]


_NAMES = ["beta_1", "beta_log_headway", "Sigma_11", "Sigma_12", "Sigma_22", "sigma_squared"]


def _numbers(population: Population) -> list[float]:
    spread = population.spread
    corners = [spread[0, 0], spread[0, 1], spread[1, 1]]
    return [float(value) for value in (*population.coefficients, *corners)] + [
        population.noise_variance
    ]


def picture(results: PopulationResults) -> Figure:
    """Draw all reactions, three drivers with their models, and the model of the population."""
    settings, (found,) = results.settings, results.rows
    observed, fitted = found.observed, found.fitted
    headway_s = np.linspace(settings.least_headway_s, settings.most_headway_s, 60)
    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    axes = figure.subplots()
    axes.plot(observed.headway_s, observed.reaction_s, ".", ms=2, color="0.7")
    for one, colour in zip((0, 1, 2), ("C0", "C1", "C2"), strict=True):
        driver = DriverModel(fitted, forgetting=1.0)
        mine = observed.driver == one
        for reaction_s, at_s in zip(
            observed.reaction_s[mine], observed.headway_s[mine], strict=True
        ):
            driver.receive_reaction(float(reaction_s), float(at_s))
        axes.plot(observed.headway_s[mine], observed.reaction_s[mine], "o", ms=4, color=colour)
        median_s = [driver.percentile_s(0.5, at_s)[0] for at_s in headway_s]
        axes.plot(headway_s, median_s, color=colour, label=f"driver {one + 1}")
    average = DriverModel(fitted)
    median_s = [average.percentile_s(0.5, at_s)[0] for at_s in headway_s]
    axes.plot(headway_s, median_s, "k", lw=2, label="population")
    axes.set(yscale="log", xlabel="time headway in s", ylabel="reaction time in s")
    axes.legend(frameon=False)
    return figure


def summary(results: PopulationResults) -> str:
    """All parameters, true and fitted."""
    return "; ".join(
        f"{line.parameter} {line.truth:.3f} as {line.fitted:.3f}" for line in results.table
    )


STUDY = Study(
    name="rakhshan-figure6",
    sentence="Figure 6: how well a population's reaction times are fitted.",
    settings=DriversSettings,
    takes_settings=False,
    case=Case,
    run=run,
    table=table,
    line=ParameterLine,
    picture=picture,
    summary=summary,
)
