"""The paper's highway: the first car of each lane brakes, and cars that brake too late collide.

Vectorised over drops (realisations of all lanes) and over pairs of access probabilities, one for
safe and one for unsafe cars. All pairs use the same drops, so that they can be compared.

docs/paper-access.md states what the paper leaves open.
"""

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from onboard.access.crash_probability import rear_end_crash_probability
from onboard.access.driver_model import DEFAULT_POPULATION
from onboard.access.rear_end import Array, tolerable_lag_s
from onboard.settings import Settings
from sim_rig.studies.campaigns.intervals import half_interval
from sim_rig.studies.rakhshan.chain import Relay, lane_links, reception_delay_s, without_radio_s
from sim_rig.studies.rakhshan.collisions import CarBraking, hits_in_pile_up
from sim_rig.studies.rakhshan.slotted import (
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


_NOISE = math.sqrt(DEFAULT_POPULATION.noise_variance)
"""Standard deviation of the logarithm of a driver's reaction times."""
_KNOWN = 1e-3
"""The same where the reaction time is known."""


class Labels(StrEnum):
    """What makes a car unsafe."""

    PROBABILITY = "probability"
    """It would hit the lead with more than `unsafe_threshold`, its driver's usual reaction
    times given."""
    KNOWN_REACTION = "known-reaction"
    """The same, with the very reaction time of this braking known."""
    GAP_AND_REACTION = "gap-and-reaction"
    """Its gap is below the mean gap, and its driver reacts later than the average one does at that
    gap."""


class RakhshanHighwaySettings(Settings):
    """Table III, and what it leaves open."""

    lanes: int = Field(4, ge=1)
    """Number of lanes; the first car of each brakes."""
    cars_per_lane: int = Field(10, ge=3)
    """Number of cars in a lane."""
    speed_m_s: float = Field(20.0, gt=0.0)
    """Of all cars before they brake."""
    deceleration_low_m_s2: float = Field(4.0, gt=0.0)
    """Least deceleration of a car."""
    deceleration_high_m_s2: float = Field(8.0, gt=0.0)
    """Each car's deceleration is uniform from low to high."""
    threshold_db: float = 11.0
    """Signal to interference ratio required at 9 Mbit/s (Table II)."""
    data_rate_mbit_s: float = Field(9.0, gt=0.0)
    """Of the channel."""
    packet_bytes: int = Field(250, gt=0)
    """Length of a packet, whose duration is that of a slot."""

    path_loss_exponent: float = Field(3.0, gt=1.0)
    """alpha of the path loss r^-alpha."""
    spacing: Spacing = Spacing.EXPONENTIAL
    """Distribution of the gaps about their mean."""
    mean_gap_m: float = Field(20.0, gt=0.0)
    """Mean gap, bumper to bumper."""
    least_gap_m: float = Field(2.0, gt=0.0)
    """Least gap, bumper to bumper."""
    car_length_m: float = Field(4.5, ge=0.0)
    """Of each car."""
    reaction_factor: float = Field(1.0, gt=0.0)
    """Multiplies all reaction times."""
    unsafe_threshold: float = Field(0.5, gt=0.0, lt=1.0)
    """A car is unsafe if it would hit the lead with more than this probability."""
    synchronous: bool = True
    """Synchronous slots (SSP) or asynchronous ones (SAP)."""
    slots_per_packet: float = Field(1.0, gt=0.0)
    """Slot duration in packet durations, for guard times or slower beacons."""
    random_waits: bool = False
    """Draw each link's waiting time instead of using its mean."""
    relay: Relay = Relay.ANY
    """How a car that relays the information got it."""
    labels: Labels = Labels.PROBABILITY
    """What makes a car unsafe."""
    first_car: Literal["as the others", "safe", "unsafe"] = "as the others"
    """Label of the first cars; as the others, by a lead that is not simulated."""
    iteration_s: float | None = Field(None, gt=0.0)
    """Labels are renewed this often while the cars brake, from their gaps and speeds then; once,
    before the braking, if null."""
    common_deceleration: bool = False
    """All cars brake alike, instead of each with its own deceleration."""
    one_lane_brakes: bool = False
    """The cars of the other lanes only send."""
    pile_ups: bool = False
    """A car that hits its lead comes to rest no further than behind it."""


@dataclass(frozen=True, slots=True, eq=False)
class Drops:
    """Random draws, (drops, lanes, cars) each."""

    position_m: Array
    gap_m: Array
    """To the lead."""
    braking_m_s2: Array
    lag_s: Array
    """Longest delay after the lead brakes that avoids a collision with it; infinite in lanes
    that do not brake."""
    usual_log_reaction: Array
    """Mean of the logarithm of the driver's reaction times in s."""
    reaction_s: Array
    crash_probability: Array
    """Probability that the car hits the lead when both brake, without radio."""
    unsafe: NDArray[np.bool_]
    """Before the braking."""
    wait_draws: Array
    """(drops, lanes, links) uniform draws for random waiting times."""
    pile_up_speed_m_s: float | None
    """Speed before the braking if pile-ups count; else `None`."""


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
    if settings.common_deceleration:
        braking_m_s2 = np.broadcast_to(braking_m_s2[:, :1, :1], shape)
    lag_s = np.full(shape, np.inf)
    lag_s[..., 1:] = tolerable_lag_s(
        gap_m[..., 1:],
        settings.speed_m_s,
        settings.speed_m_s,
        braking_m_s2[..., :-1],
        braking_m_s2[..., 1:],
    )
    if settings.one_lane_brakes:
        lag_s[:, 1:] = np.inf
    usual = _usual_log_reaction(settings, gap_m, rng)
    reaction_s = np.exp(usual + _NOISE * rng.standard_normal(shape))
    speed_m_s = np.full(shape, settings.speed_m_s)
    state = CarStates(gap_m, speed_m_s, speed_m_s, usual, reaction_s)
    unsafe = is_unsafe(settings, state)
    if settings.first_car != "as the others":
        unsafe[..., 0] = settings.first_car == "unsafe"
    return Drops(
        position_m,
        gap_m,
        braking_m_s2,
        lag_s,
        usual,
        reaction_s,
        _crash_probability(settings, state, (usual, _NOISE)),
        unsafe,
        rng.uniform(size=(*shape[:2], len(lane_links(settings.cars_per_lane).sender))),
        settings.speed_m_s if settings.pile_ups else None,
    )


@dataclass(frozen=True, slots=True, eq=False)
class CarStates:
    """What a label depends on; all arrays broadcast."""

    gap_m: Array
    lead_speed_m_s: Array
    speed_m_s: Array
    usual_log_reaction: Array
    reaction_s: Array


def is_unsafe(settings: RakhshanHighwaySettings, state: CarStates) -> NDArray[np.bool_]:
    """Whether each car is unsafe in its present state."""
    if settings.labels is Labels.GAP_AND_REACTION:
        average = DEFAULT_POPULATION.coefficients @ [
            1.0,
            math.log(settings.mean_gap_m / settings.speed_m_s),
        ] + math.log(settings.reaction_factor)
        unsafe: NDArray[np.bool_] = (state.gap_m < settings.mean_gap_m) & (
            state.usual_log_reaction > average
        )
        return unsafe
    if settings.labels is Labels.KNOWN_REACTION:
        log_reaction = np.log(state.reaction_s), _KNOWN
    else:
        log_reaction = state.usual_log_reaction, _NOISE
    return _crash_probability(settings, state, log_reaction) > settings.unsafe_threshold


def _crash_probability(
    settings: RakhshanHighwaySettings, state: CarStates, log_reaction: tuple[Array, float]
) -> Array:
    return rear_end_crash_probability(
        state.gap_m,
        state.lead_speed_m_s,
        state.speed_m_s,
        log_reaction,
        (settings.deceleration_low_m_s2, settings.deceleration_high_m_s2),
    )


def collision_share(
    settings: RakhshanHighwaySettings, drops: Drops, safe_access: Array, unsafe_access: Array
) -> Array:
    """Share of each drop's following cars that hit the lead after the first cars brake.

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
    unsafe = drops.unsafe
    road = len(unsafe), settings.lanes * settings.cars_per_lane
    interference = road_interference(settings, drops)
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
            result[i, j] = collision_share_of_delays(drops, _delay_s(settings, drops, slots))
    return result


def delay_s(settings: RakhshanHighwaySettings, drops: Drops, access: float) -> Array:
    """D(i) in s, (drops, lanes, cars), if all cars have one access probability."""
    everywhere = np.full(drops.unsafe.shape, access)
    receiver_access = everywhere if settings.synchronous else asynchronous(everywhere)
    sender, receiver = lane_links(settings.cars_per_lane)
    success = np.prod(1.0 - receiver_access.flat[0] * road_interference(settings, drops), axis=-1)
    slots = slots_needed(
        success.reshape(*drops.unsafe.shape[:2], -1),
        everywhere[..., sender],
        receiver_access[..., receiver],
    )
    return _delay_s(settings, drops, slots)


def road_interference(settings: RakhshanHighwaySettings, drops: Drops) -> Array:
    """Probability (drops, links of all lanes, cars of all lanes) that a car destroys a packet."""
    road = len(drops.unsafe), settings.lanes * settings.cars_per_lane
    channel = SlottedChannel(from_db(settings.threshold_db), settings.path_loss_exponent)
    return interference_probability(drops.position_m.reshape(road), _all_links(settings), channel)


def packet_s(settings: RakhshanHighwaySettings) -> float:
    """Duration of a slot in s."""
    return settings.slots_per_packet * slot_s(settings.data_rate_mbit_s, settings.packet_bytes)


def collision_share_without_radio(drops: Drops) -> Array:
    """Share (drops,) of the cars that collide with brake lights only."""
    return collision_share_of_delays(drops, without_radio_s(drops.reaction_s))


def collision_share_with_perfect_radio(drops: Drops) -> Array:
    """Share (drops,) of the cars that collide with a radio without delay."""
    return collision_share_of_delays(drops, np.zeros_like(drops.reaction_s))


def mean_and_error(samples: Array) -> tuple[Array, Array]:
    """Mean over the last axis, and half of its 95 % confidence interval."""
    mean: Array = samples.mean(axis=-1)
    return mean, half_interval(samples)


def reduction_and_error(samples: Array, reference: Array) -> tuple[float, float]:
    """1 - mean / mean of the reference over the same drops, and half of its 95 % interval.

    Both are 0 if nothing collides in the reference.
    """
    if not reference.any():
        return 0.0, 0.0
    ratio = samples.mean() / reference.mean()
    residual = samples - ratio * reference
    error = half_interval(residual) / reference.mean()
    return float(1.0 - ratio), float(error)


def _delay_s(settings: RakhshanHighwaySettings, drops: Drops, slots: Array) -> Array:
    if settings.random_waits:
        slots = slots * -np.log(drops.wait_draws)
    return reception_delay_s(slots, packet_s(settings), drops.reaction_s, settings.relay)


def collision_share_of_delays(drops: Drops, delay_s: Array) -> Array:
    """Share (drops,) of the following cars that brake too late, with `delay_s` D(i)."""
    begins_s = delay_s + drops.reaction_s
    begins_s[..., 0] = 0.0
    lag_s = drops.lag_s[..., 1:]
    hits = np.diff(begins_s, axis=-1) > lag_s
    if drops.pile_up_speed_m_s is not None:
        braking = CarBraking(drops.braking_m_s2, begins_s)
        hits = hits_in_pile_up(drops.gap_m, drops.pile_up_speed_m_s, braking, hits)
        hits &= np.isfinite(lag_s)
    share: Array = hits.mean(axis=(-2, -1))
    return share


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
