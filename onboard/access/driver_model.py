"""Reaction times of one driver, from few observations and those of the population.

The mixed model of eq. 2 for the logarithm y of the reaction time, with the headway h as covariate,
x = (1, log h):

    y = x (beta + gamma) + noise,   noise ~ N(0, sigma^2),   gamma ~ N(0, Sigma) for each driver

For one driver this is a Bayesian regression, updated in closed form with each reaction. Since
drivers change, old reactions lose weight: before each update, gamma and its covariance are drawn
towards the population by the factor `forgetting`.
"""

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import Self

import numpy as np
from pydantic import Field, model_validator

from onboard.access.rear_end import Array
from onboard.settings import Settings

SHORTEST_REACTION_S = 0.15
"""Shorter times are no reaction: the driver had begun to brake before the lead vehicle did."""
LONGEST_REACTION_S = 6.0
"""Longer times are no reaction: the driver braked for something else."""


@dataclass(frozen=True, slots=True, eq=False)
class Population:
    """Distribution of reaction times over all drivers."""

    coefficients: Array
    """beta, shape (2): intercept, and factor of the logarithm of the headway."""
    spread: Array
    """Sigma, shape (2, 2): covariance of gamma over the drivers."""
    noise_variance: float
    """sigma^2: variance of one driver's log reaction times about that driver's mean."""


DEFAULT_POPULATION = Population(
    coefficients=np.array([math.log(0.95), 0.25]),
    spread=np.diag([0.25**2, 0.10**2]),
    noise_variance=0.25**2,
)
"""Median 0.95 s at a headway of 1 s, longer at longer headways: the order of magnitude of published
studies (docs/design/access.md)."""


class DriverMemory(Settings):
    """State of one driver's model, as the driver file keeps it."""

    offset: tuple[float, float]
    """Mean of gamma."""
    covariance: tuple[tuple[float, float], tuple[float, float]]
    """Covariance of gamma."""
    observed: int = Field(ge=0)
    """Number of reactions it was learned from."""

    @model_validator(mode="after")
    def _is_covariance(self) -> Self:
        (a, b), (c, d) = self.covariance
        if b != c or a <= 0.0 or d <= 0.0 or a * d <= b * b:
            raise ValueError("covariance must be symmetric and positive definite")
        return self


class DriverModel:
    """Distribution of one driver's reaction times. Never leaves the computer."""

    def __init__(
        self,
        population: Population,
        forgetting: float = 0.995,
        memory: DriverMemory | None = None,
    ) -> None:
        """Start from the population, or from a stored state.

        Args:
            population: prior of the driver.
            forgetting: factor of the weight of old reactions at each update; 1 keeps all.
            memory: state to continue from.
        """
        self._population = population
        self._forgetting = forgetting
        self.reset()
        if memory is not None:
            self._mean = np.array(memory.offset)
            self._covariance = np.array(memory.covariance)
            self.observed = memory.observed

    def memory(self) -> DriverMemory:
        """Return the state to store for the next drive."""
        (a, b), (_, d) = self._covariance.tolist()
        first, second = self._mean.tolist()
        return DriverMemory(
            offset=(first, second), covariance=((a, b), (b, d)), observed=self.observed
        )

    def reset(self) -> None:
        """Return to the distribution of the population."""
        self._mean = np.zeros(2)
        self._covariance = self._population.spread.copy()
        self.observed = 0
        self.rejected = 0

    def receive_reaction(self, reaction_s: float, headway_s: float) -> bool:
        """Update the model with one reaction time and the headway when the lead began to brake.

        Returns:
            whether the value is a possible reaction; others are counted in `rejected`.
        """
        plausible = SHORTEST_REACTION_S <= reaction_s <= LONGEST_REACTION_S
        if not plausible or not 0.0 < headway_s < math.inf:
            self.rejected += 1
            return False
        keep = self._forgetting
        self._mean = keep * self._mean
        self._covariance = keep**2 * self._covariance + (1.0 - keep**2) * self._population.spread
        x = _covariates(headway_s)
        innovation = math.log(reaction_s) - x @ (self._population.coefficients + self._mean)
        covariance_x = self._covariance @ x
        gain = covariance_x / (x @ covariance_x + self._population.noise_variance)
        self._mean = self._mean + gain * innovation
        self._covariance = self._covariance - np.outer(gain, covariance_x)
        self._covariance = 0.5 * (self._covariance + self._covariance.T)
        self.observed += 1
        return True

    def log_reaction(self, headway_s: float) -> tuple[float, float]:
        """Return mean and standard deviation of the logarithm of the next reaction time.

        The deviation includes the uncertainty of the model.
        """
        x = _covariates(headway_s)
        mean = x @ (self._population.coefficients + self._mean)
        variance = x @ self._covariance @ x + self._population.noise_variance
        return float(mean), math.sqrt(variance)

    def percentile_s(self, share: float, headway_s: float) -> tuple[float, float, float]:
        """Return the quantile `share` of this driver's reaction times.

        Returns:
            the estimate and the limits of its central 90 % interval, in s.
        """
        x = _covariates(headway_s)
        mean = float(x @ (self._population.coefficients + self._mean))
        quantile = mean + _normal_quantile(share) * math.sqrt(self._population.noise_variance)
        half = _normal_quantile(0.95) * math.sqrt(float(x @ self._covariance @ x))
        return math.exp(quantile), math.exp(quantile - half), math.exp(quantile + half)


def _covariates(headway_s: float) -> Array:
    return np.array([1.0, math.log(headway_s)])


def _normal_quantile(share: float) -> float:
    return NormalDist().inv_cdf(share)
