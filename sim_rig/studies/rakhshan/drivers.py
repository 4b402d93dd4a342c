"""Reaction times: a population model fitted to data, and one driver's distribution within it.

The mixed model of eq. 2 is fitted offline by statsmodels (restricted maximum likelihood); `onboard`
uses the resulting `Population`. The data are simulated, as in the paper.
"""

import math
import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from statsmodels.regression.mixed_linear_model import MixedLM
from statsmodels.tools.sm_exceptions import ConvergenceWarning

from onboard.access.driver_model import Population
from onboard.access.rear_end import Array
from onboard.settings import Settings


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
