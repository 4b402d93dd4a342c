"""The paper's highway: lanes of cars whose first ones brake, and who then runs into whom.

Vectorised over drops (one drop is all lanes once) and over pairs of access probabilities, one for
safe cars and one for unsafe ones. All pairs meet the same drops, so that they can be compared.

Where the paper is silent, docs/decisions/0091 says what is taken and why.
"""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from onboard.access.crash_probability import rear_end_crash_probability
from onboard.access.driver_model import DEFAULT_POPULATION
from onboard.access.rear_end import Array, tolerable_lag_s
from onboard.settings import Settings
from sim_rig.studies.rakhshan_chain import lane_links, reception_delay_s, without_radio_s
from sim_rig.studies.rakhshan_slotted import (
    SlottedChannel,
    SlottedLinks,
    asynchronous,
    drowning,
    from_db,
    slot_s,
    slots_needed,
)


class Spacing(StrEnum):
    """How gaps are spread about their mean."""

    EXPONENTIAL = "exponential"
    LOGNORMAL = "lognormal"
    UNIFORM = "uniform"


class RakhshanHighwaySettings(Settings):
    """Table III, and what it does not say."""

    lanes: int = Field(4, ge=1)
    cars_per_lane: int = Field(10, ge=3)
    speed_m_s: float = Field(20.0, gt=0.0)
    deceleration_low_m_s2: float = Field(4.0, gt=0.0)
    deceleration_high_m_s2: float = Field(8.0, gt=0.0)
    """Each car's own, evenly from low to high."""
    threshold_db: float = 11.0
    """Signal to interference that 9 Mbit/s need (Table II)."""
    data_rate_mbit_s: float = Field(9.0, gt=0.0)
    packet_bytes: int = Field(250, gt=0)

    path_loss_exponent: float = Field(3.0, gt=1.0)
    spacing: Spacing = Spacing.EXPONENTIAL
    mean_gap_m: float = Field(20.0, gt=0.0)
    least_gap_m: float = Field(2.0, gt=0.0)
    car_length_m: float = Field(4.5, ge=0.0)
    reaction_factor: float = Field(1.0, gt=0.0)
    """Stretches everybody's reaction time."""
    unsafe_threshold: float = Field(0.5, gt=0.0, lt=1.0)
    """A car is unsafe if it would run into the car ahead with more than this probability."""
    synchronous: bool = True
    """Slots in step (SSP) or not (SAP)."""
    slots_per_packet: float = Field(1.0, gt=0.0)
    """Stretches the slot beyond a packet: what guard times or a slower beacon would do."""
    random_waits: bool = False
    """Draw each link's wait instead of taking its mean."""


@dataclass(frozen=True, slots=True, eq=False)
class Drops:
    """What chance decides: (drops, lanes, cars)."""

    position_m: Array
    lag_s: Array
    """How much later than the car ahead it may brake."""
    reaction_s: Array
    danger: Array
    """That it runs into the car ahead without radio, both braking."""
    luck: Array
    """(drops, lanes, links) even draws for random waits."""


def draw(settings: RakhshanHighwaySettings, drops: int, rng: np.random.Generator) -> Drops:
    """Place cars and drivers."""
    shape = (drops, settings.lanes, settings.cars_per_lane)
    gap_m = settings.least_gap_m + _spread(settings, shape, rng)
    first_m = rng.uniform(0.0, settings.mean_gap_m + settings.car_length_m, (*shape[:2], 1))
    position_m = first_m + np.cumsum(gap_m + settings.car_length_m, axis=-1)
    braking_m_s2 = rng.uniform(
        settings.deceleration_low_m_s2, settings.deceleration_high_m_s2, shape
    )
    lag_s = np.full(shape, np.inf)
    lag_s[..., 1:] = tolerable_lag_s(
        gap_m[..., 1:],
        settings.speed_m_s,
        settings.speed_m_s,
        braking_m_s2[..., :-1],
        braking_m_s2[..., 1:],
    )
    usual = _usual_log_reaction(settings, gap_m, rng)
    noise = math.sqrt(DEFAULT_POPULATION.noise_variance)
    return Drops(
        position_m,
        lag_s,
        np.exp(usual + noise * rng.standard_normal(shape)),
        rear_end_crash_probability(
            gap_m,
            settings.speed_m_s,
            settings.speed_m_s,
            (usual, noise),
            (settings.deceleration_low_m_s2, settings.deceleration_high_m_s2),
        ),
        rng.uniform(size=(*shape[:2], len(lane_links(settings.cars_per_lane).sender))),
    )


def collided(
    settings: RakhshanHighwaySettings, drops: Drops, safe_access: Array, unsafe_access: Array
) -> Array:
    """Part of each drop's following cars that run into the car ahead, the first cars braking.

    The logarithm of P_s is a sum over cars, so each class is summed once for each of its
    probabilities, and the pairs only add the two.

    Returns:
        (safe, unsafe, drops): for each pair of access probabilities.
    """
    unsafe = drops.danger > settings.unsafe_threshold
    road = len(unsafe), settings.lanes * settings.cars_per_lane
    drowned = drowning(drops.position_m.reshape(road), _all_links(settings), _channel(settings))
    log_safe = _log_survival(settings, drowned, ~unsafe.reshape(road), safe_access)
    log_unsafe = _log_survival(settings, drowned, unsafe.reshape(road), unsafe_access)
    sender, receiver = lane_links(settings.cars_per_lane)
    result = np.empty((len(safe_access), len(unsafe_access), len(unsafe)))
    for i, safe_p in enumerate(safe_access):
        for j, unsafe_p in enumerate(unsafe_access):
            access = np.where(unsafe, unsafe_p, safe_p)
            hearing = access if settings.synchronous else asynchronous(access)
            success = np.exp(log_safe[i] + log_unsafe[j]).reshape(*unsafe.shape[:2], -1)
            slots = slots_needed(success, access[..., sender], hearing[..., receiver])
            result[i, j] = _collided(settings, drops, slots)
    return result


def collided_without_radio(drops: Drops) -> Array:
    """The same (drops,) with brake lights only."""
    return late(drops, without_radio_s(drops.reaction_s))


def collided_with_perfect_radio(drops: Drops) -> Array:
    """The same (drops,) if everybody knew at once: no channel access can do better."""
    return late(drops, np.zeros_like(drops.reaction_s))


def mean_and_error(samples: Array) -> tuple[Array, Array]:
    """Mean over the last axis, and half of its 95 % confidence interval."""
    mean: Array = samples.mean(axis=-1)
    error: Array = 1.96 * samples.std(axis=-1, ddof=1) / math.sqrt(samples.shape[-1])
    return mean, error


def reduction_and_error(samples: Array, reference: Array) -> tuple[float, float]:
    """1 - mean / mean of the reference over the same drops, and half of its 95 % interval."""
    ratio = samples.mean() / reference.mean()
    residual = samples - ratio * reference
    error = 1.96 * residual.std(ddof=1) / math.sqrt(len(samples)) / reference.mean()
    return float(1.0 - ratio), float(error)


def _collided(settings: RakhshanHighwaySettings, drops: Drops, slots: Array) -> Array:
    if settings.random_waits:
        slots = slots * -np.log(drops.luck)
    length_s = settings.slots_per_packet * slot_s(settings.data_rate_mbit_s, settings.packet_bytes)
    return late(drops, reception_delay_s(slots, length_s, drops.reaction_s))


def late(drops: Drops, delay_s: Array) -> Array:
    """Part of each drop's following cars that brake too late, `delay_s` being D(i); (drops,)."""
    begins_s = delay_s + drops.reaction_s
    begins_s[..., 0] = 0.0
    late = np.diff(begins_s, axis=-1) > drops.lag_s[..., 1:]
    part: Array = late.mean(axis=(-2, -1))
    return part


def _log_survival(
    settings: RakhshanHighwaySettings, drowned: Array, members: NDArray[np.bool_], access: Array
) -> Array:
    """Logarithm of what the members of one class leave of P_s: (access, drops, links)."""
    heard = access if settings.synchronous else asynchronous(access)
    return np.stack(
        [np.einsum("dkn,dn->dk", np.log1p(-p * drowned), members.astype(float)) for p in heard]
    )


def _spread(
    settings: RakhshanHighwaySettings, shape: tuple[int, ...], rng: np.random.Generator
) -> Array:
    mean_m = settings.mean_gap_m - settings.least_gap_m
    match settings.spacing:
        case Spacing.EXPONENTIAL:
            return rng.exponential(mean_m, shape)
        case Spacing.LOGNORMAL:
            return mean_m * rng.lognormal(-0.125, 0.5, shape)
        case Spacing.UNIFORM:
            return rng.uniform(0.0, 2.0 * mean_m, shape)


def _usual_log_reaction(
    settings: RakhshanHighwaySettings, gap_m: Array, rng: np.random.Generator
) -> Array:
    own = rng.multivariate_normal(np.zeros(2), DEFAULT_POPULATION.spread, gap_m.shape)
    coefficients = DEFAULT_POPULATION.coefficients + own
    log_headway = np.log(gap_m / settings.speed_m_s)
    usual: Array = coefficients[..., 0] + coefficients[..., 1] * log_headway
    return usual + math.log(settings.reaction_factor)


def _all_links(settings: RakhshanHighwaySettings) -> SlottedLinks:
    one = lane_links(settings.cars_per_lane)
    first = np.arange(settings.lanes)[:, None] * settings.cars_per_lane
    return SlottedLinks((first + one.sender).ravel(), (first + one.receiver).ravel())


def _channel(settings: RakhshanHighwaySettings) -> SlottedChannel:
    return SlottedChannel(from_db(settings.threshold_db), settings.path_loss_exponent)
