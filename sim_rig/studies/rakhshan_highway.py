"""The paper's highway: the first car of each lane brakes, and cars that brake too late collide.

Vectorised over drops (realisations of all lanes) and over pairs of access probabilities, one for
safe and one for unsafe cars. All pairs use the same drops, so that they can be compared.

docs/design/access.md states and explains what the paper leaves open.
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
    from_db,
    interference_probability,
    slot_s,
    slots_needed,
)


class Spacing(StrEnum):
    """Distribution of the gaps about their mean."""

    EXPONENTIAL = "exponential"
    LOGNORMAL = "lognormal"
    UNIFORM = "uniform"


class RakhshanHighwaySettings(Settings):
    """Table III, and what it leaves open."""

    lanes: int = Field(4, ge=1)
    cars_per_lane: int = Field(10, ge=3)
    speed_m_s: float = Field(20.0, gt=0.0)
    deceleration_low_m_s2: float = Field(4.0, gt=0.0)
    deceleration_high_m_s2: float = Field(8.0, gt=0.0)
    """Each car's deceleration is uniform from low to high."""
    threshold_db: float = 11.0
    """Signal to interference ratio required at 9 Mbit/s (Table II)."""
    data_rate_mbit_s: float = Field(9.0, gt=0.0)
    packet_bytes: int = Field(250, gt=0)

    path_loss_exponent: float = Field(3.0, gt=1.0)
    spacing: Spacing = Spacing.EXPONENTIAL
    mean_gap_m: float = Field(20.0, gt=0.0)
    least_gap_m: float = Field(2.0, gt=0.0)
    car_length_m: float = Field(4.5, ge=0.0)
    reaction_factor: float = Field(1.0, gt=0.0)
    """Multiplies all reaction times."""
    unsafe_threshold: float = Field(0.5, gt=0.0, lt=1.0)
    """A car is unsafe if it would hit the car ahead with more than this probability."""
    synchronous: bool = True
    """Synchronous slots (SSP) or asynchronous ones (SAP)."""
    slots_per_packet: float = Field(1.0, gt=0.0)
    """Slot duration in packet durations, for guard times or slower beacons."""
    random_waits: bool = False
    """Draw each link's waiting time instead of using its mean."""


@dataclass(frozen=True, slots=True, eq=False)
class Drops:
    """Random draws, (drops, lanes, cars) each."""

    position_m: Array
    lag_s: Array
    """Longest delay after the car ahead brakes that avoids a collision with it."""
    reaction_s: Array
    crash_probability: Array
    """Probability that the car hits the car ahead when both brake, without radio."""
    wait_draws: Array
    """(drops, lanes, links) uniform draws for random waiting times."""


def draw(settings: RakhshanHighwaySettings, drops: int, rng: np.random.Generator) -> Drops:
    """Draw positions, decelerations and drivers.

    Args:
        settings: of the highway.
        drops: number of drops.
        rng: source of all draws.
    """
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


def collision_share(
    settings: RakhshanHighwaySettings, drops: Drops, safe_access: Array, unsafe_access: Array
) -> Array:
    """Share of each drop's following cars that hit the car ahead after the first cars brake.

    The logarithm of P_s is a sum over cars. So each class is summed once for each of its
    probabilities, and a pair only adds two sums.

    Args:
        settings: of the highway.
        drops: all drops.
        safe_access: (safe,) access probabilities of safe cars.
        unsafe_access: (unsafe,) access probabilities of unsafe cars.

    Returns:
        (safe, unsafe, drops): for each pair of access probabilities.
    """
    unsafe = drops.crash_probability > settings.unsafe_threshold
    road = len(unsafe), settings.lanes * settings.cars_per_lane
    interference = interference_probability(
        drops.position_m.reshape(road), _all_links(settings), _channel(settings)
    )
    log_safe = _log_survival(settings, interference, ~unsafe.reshape(road), safe_access)
    log_unsafe = _log_survival(settings, interference, unsafe.reshape(road), unsafe_access)
    sender, receiver = lane_links(settings.cars_per_lane)
    result = np.empty((len(safe_access), len(unsafe_access), len(unsafe)))
    for i, safe_p in enumerate(safe_access):
        for j, unsafe_p in enumerate(unsafe_access):
            access = np.where(unsafe, unsafe_p, safe_p)
            receiver_access = access if settings.synchronous else asynchronous(access)
            success = np.exp(log_safe[i] + log_unsafe[j]).reshape(*unsafe.shape[:2], -1)
            slots = slots_needed(success, access[..., sender], receiver_access[..., receiver])
            result[i, j] = _collided(settings, drops, slots)
    return result


def collision_share_without_radio(drops: Drops) -> Array:
    """Share (drops,) of the cars that collide with brake lights only."""
    return collision_share_of_delays(drops, without_radio_s(drops.reaction_s))


def collision_share_with_perfect_radio(drops: Drops) -> Array:
    """Share (drops,) of the cars that collide with a radio without delay."""
    return collision_share_of_delays(drops, np.zeros_like(drops.reaction_s))


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
        slots = slots * -np.log(drops.wait_draws)
    length_s = settings.slots_per_packet * slot_s(settings.data_rate_mbit_s, settings.packet_bytes)
    return collision_share_of_delays(drops, reception_delay_s(slots, length_s, drops.reaction_s))


def collision_share_of_delays(drops: Drops, delay_s: Array) -> Array:
    """Share (drops,) of the following cars that brake too late, with `delay_s` D(i)."""
    begins_s = delay_s + drops.reaction_s
    begins_s[..., 0] = 0.0
    late = np.diff(begins_s, axis=-1) > drops.lag_s[..., 1:]
    part: Array = late.mean(axis=(-2, -1))
    return part


def _log_survival(
    settings: RakhshanHighwaySettings,
    interference: Array,
    members: NDArray[np.bool_],
    access: Array,
) -> Array:
    """Logarithm (access, drops, links) of the factor of P_s that one class contributes."""
    interferer_access = access if settings.synchronous else asynchronous(access)
    return np.stack(
        [
            np.einsum("dkn,dn->dk", np.log1p(-p * interference), members.astype(float))
            for p in interferer_access
        ]
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
