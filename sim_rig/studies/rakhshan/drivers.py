"""Reaction times: a population model fitted to data, and one driver's distribution within it.

The mixed model of eq. 2 is fitted offline by statsmodels (restricted maximum likelihood); `onboard`
uses the resulting `Population`. The data are simulated, as in the paper.
"""

import math
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from pydantic import Field
from scipy.stats import lognorm
from statsmodels.regression.mixed_linear_model import MixedLM
from statsmodels.tools.sm_exceptions import ConvergenceWarning

from onboard.access.driver_model import DEFAULT_POPULATION, DriverModel, Population
from onboard.access.rear_end import Array
from onboard.settings import Settings
from sim_rig.studies.campaigns.results import write_results


class DriversSettings(Settings):
    """Number of drivers and reactions."""

    seed: int = Field(1, ge=0)
    """Of all draws."""
    drivers: int = Field(100, ge=10)
    """Number of drivers."""
    reactions: int = Field(20, ge=3)
    """Reactions of each driver."""
    least_headway_s: float = Field(0.5, gt=0.0)
    """Shortest time headway."""
    most_headway_s: float = Field(3.0, gt=0.0)
    """Longest time headway."""
    one_drivers_reactions: int = Field(15, ge=1)
    """Observed reactions of the driver of figure 7."""


FULL = DriversSettings()


@dataclass(frozen=True, slots=True, eq=False)
class Reactions:
    """Observed reactions; one entry for each."""

    driver: NDArray[np.int64]
    headway_s: Array
    reaction_s: Array


def simulate_reactions(
    population: Population, settings: DriversSettings, rng: np.random.Generator
) -> Reactions:
    """Draw drivers from a population, and reactions of each.

    Args:
        population: coefficients, their spread and the noise.
        settings: number of drivers and reactions, and range of headways.
        rng: source of all draws.
    """
    driver = np.repeat(np.arange(settings.drivers), settings.reactions)
    own = rng.multivariate_normal(population.coefficients, population.spread, settings.drivers)
    headway_s = rng.uniform(settings.least_headway_s, settings.most_headway_s, len(driver))
    noise = math.sqrt(population.noise_variance) * rng.standard_normal(len(driver))
    log_s = own[driver, 0] + own[driver, 1] * np.log(headway_s) + noise
    return Reactions(driver, headway_s, np.exp(log_s))


def fit_population(reactions: Reactions) -> Population:
    """Fit beta, Sigma and sigma^2 by restricted maximum likelihood.

    Raises:
        RuntimeError: the fit does not converge.
    """
    x = np.column_stack([np.ones(len(reactions.headway_s)), np.log(reactions.headway_s)])
    model = MixedLM(np.log(reactions.reaction_s), x, groups=reactions.driver, exog_re=x)
    with warnings.catch_warnings():
        # statsmodels warns of the boundary for any variance of the coefficients below 0.01.
        warnings.simplefilter("ignore", ConvergenceWarning)
        fit = model.fit(method="lbfgs")
    if not fit.converged:
        raise RuntimeError("the mixed model did not converge: more drivers or reactions are needed")
    return Population(np.asarray(fit.fe_params), np.asarray(fit.cov_re), float(fit.scale))


def figure6(out_dir: Path, settings: DriversSettings = FULL) -> str:
    """Draw reaction times of a simulated population over the headway, and the fitted model."""
    rng = np.random.default_rng(settings.seed)
    observed = simulate_reactions(DEFAULT_POPULATION, settings, rng)
    fitted = fit_population(observed)
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
    rows = list(zip(_NAMES, _numbers(DEFAULT_POPULATION), _numbers(fitted), strict=True))
    write_results(out_dir, ["parameter", "truth", "fitted"], rows, settings, figure)
    return "; ".join(f"{name} {truth:.3f} as {found:.3f}" for name, truth, found in rows)


def figure7(out_dir: Path, settings: DriversSettings = FULL) -> str:
    """Draw the true and the estimated distribution of one slow driver's reaction times."""
    rng = np.random.default_rng(settings.seed)
    fitted = fit_population(simulate_reactions(DEFAULT_POPULATION, settings, rng))
    headway_s, slower = 1.5, 0.35
    usual = DEFAULT_POPULATION.coefficients @ np.array([1.0, math.log(headway_s)]) + slower
    noise = math.sqrt(DEFAULT_POPULATION.noise_variance)
    driver = DriverModel(fitted)
    for log_s in rng.normal(usual, noise, settings.one_drivers_reactions):
        driver.receive_reaction(math.exp(log_s), headway_s)
    estimate, spread = driver.log_reaction(headway_s)
    time_s = np.linspace(0.3, 4.0, 200)
    curves = {
        "the driver": (usual, noise),
        "estimate, noise variance only": (estimate, math.sqrt(fitted.noise_variance)),
        "estimate, all uncertainty": (estimate, spread),
        "population": DriverModel(fitted).log_reaction(headway_s),
    }
    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    axes = figure.subplots()
    rows = []
    for (name, (mean, sd)), colour in zip(curves.items(), ("k", "C0", "C3", "0.7"), strict=True):
        spread_of = lognorm(sd, scale=math.exp(mean))
        low_s, middle_s, high_s = (float(spread_of.ppf(share)) for share in (0.1, 0.5, 0.9))
        axes.plot(time_s, spread_of.pdf(time_s), color=colour, label=name)
        for at_s in (low_s, high_s):
            axes.axvline(at_s, color=colour, lw=0.6)
        rows.append((name, low_s, middle_s, high_s))
    axes.set(xlabel="reaction time in s", ylabel="density")
    axes.legend(frameon=False)
    columns = ["distribution", "percentile_10_s", "median_s", "percentile_90_s"]
    write_results(out_dir, columns, rows, settings, figure)
    return "; ".join(f"{name}: {low:.2f} to {high:.2f} s" for name, low, _, high in rows)


_NAMES = ["beta_1", "beta_log_headway", "Sigma_11", "Sigma_12", "Sigma_22", "sigma_squared"]


def _numbers(population: Population) -> list[float]:
    spread = population.spread
    corners = [spread[0, 0], spread[0, 1], spread[1, 1]]
    return [float(value) for value in (*population.coefficients, *corners)] + [
        population.noise_variance
    ]
