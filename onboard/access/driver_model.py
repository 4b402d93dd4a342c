"""How fast one driver reacts: from few observations, on top of what the population does.

The mixed model of eq. 2 on the logarithm of the reaction time y, with the time headway h as
covariate, x = (1, log h):

    y = x (beta + gamma) + noise,   noise ~ N(0, sigma^2),   gamma ~ N(0, Sigma) for each driver

For one driver it is a Bayesian regression, updated in closed form with each reaction seen. Old
reactions are forgotten slowly, since drivers change: before each update the driver's own part is
drawn back towards the population by `forgetting`.
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
"""Below: the foot was on its way already."""
LONGEST_REACTION_S = 6.0
"""Above: the driver braked for something else."""


@dataclass(frozen=True, slots=True, eq=False)
class Population:
    """What is known of drivers nobody has watched."""

    coefficients: Array
    """beta, (2): of 1 and of the headway's logarithm."""
    spread: Array
    """Sigma, (2, 2): of the drivers about it."""
    noise_variance: float
    """sigma^2: of one driver's reactions about that driver's own mean."""


DEFAULT_POPULATION = Population(
    coefficients=np.array([math.log(0.95), 0.25]),
    spread=np.diag([0.25**2, 0.10**2]),
    noise_variance=0.25**2,
)
"""Median 0.95 s at a headway of 1 s, longer when the car ahead is far: of the order that studies
of braking for a car ahead find (docs/decisions/0090)."""


class DriverMemory(Settings):
    """What has been learned of one driver, as a file keeps it."""

    offset: tuple[float, float]
    """gamma: of this driver's coefficients from the population's."""
    covariance: tuple[tuple[float, float], tuple[float, float]]
    """Of the offset."""
    observed: int = Field(ge=0)

    @model_validator(mode="after")
    def _is_covariance(self) -> Self:
        (a, b), (c, d) = self.covariance
        if b != c or a <= 0.0 or d <= 0.0 or a * d <= b * b:
            raise ValueError("covariance must be symmetric and positive definite")
        return self


class DriverModel:
    """One driver's reaction times. Stays on the box."""

    def __init__(
        self,
        population: Population,
        forgetting: float = 0.995,
        memory: DriverMemory | None = None,
    ) -> None:
        """Know the population, and what is remembered of this driver.

        `forgetting` is the share kept at each update.
        """
        self._population = population
        self._forgetting = forgetting
        self.forget()
        if memory is not None:
            self._mean = np.array(memory.offset)
            self._covariance = np.array(memory.covariance)
            self.observed = memory.observed

    def memory(self) -> DriverMemory:
        """What to remember of this driver until the next drive."""
        (a, b), (_, d) = self._covariance.tolist()
        first, second = self._mean.tolist()
        return DriverMemory(
            offset=(first, second), covariance=((a, b), (b, d)), observed=self.observed
        )

    def forget(self) -> None:
        """Erase everything known of this driver."""
        self._mean = np.zeros(2)
        self._covariance = self._population.spread.copy()
        self.observed = 0
        self.left_out = 0

    def receive_reaction(self, reaction_s: float, headway_s: float) -> bool:
        """The lead braked, and after `reaction_s` the driver did, at the headway of then.

        What cannot be a reaction is left out and counted.

        Returns:
            whether it was one.
        """
        plausible = SHORTEST_REACTION_S <= reaction_s <= LONGEST_REACTION_S
        if not plausible or not 0.0 < headway_s < math.inf:
            self.left_out += 1
            return False
        keep = self._forgetting
        self._mean = keep * self._mean
        self._covariance = keep**2 * self._covariance + (1.0 - keep**2) * self._population.spread
        x = _covariates(headway_s)
        surprise = math.log(reaction_s) - x @ (self._population.coefficients + self._mean)
        along = self._covariance @ x
        gain = along / (x @ along + self._population.noise_variance)
        self._mean = self._mean + gain * surprise
        self._covariance = self._covariance - np.outer(gain, along)
        self._covariance = 0.5 * (self._covariance + self._covariance.T)
        self.observed += 1
        return True

    def log_reaction(self, headway_s: float) -> tuple[float, float]:
        """Mean and standard deviation of the next reaction's logarithm, all uncertainty in it."""
        x = _covariates(headway_s)
        mean = x @ (self._population.coefficients + self._mean)
        variance = x @ self._covariance @ x + self._population.noise_variance
        return float(mean), math.sqrt(variance)

    def percentile_s(self, share: float, headway_s: float) -> tuple[float, float, float]:
        """The reaction time below which `share` of this driver's reactions are.

        Returns:
            the estimate, and the ends of its central 90 % interval, in seconds.
        """
        x = _covariates(headway_s)
        mean = float(x @ (self._population.coefficients + self._mean))
        own = mean + _normal_quantile(share) * math.sqrt(self._population.noise_variance)
        half = _normal_quantile(0.95) * math.sqrt(float(x @ self._covariance @ x))
        return math.exp(own), math.exp(own - half), math.exp(own + half)


def _covariates(headway_s: float) -> Array:
    return np.array([1.0, math.log(headway_s)])


def _normal_quantile(share: float) -> float:
    return NormalDist().inv_cdf(share)
