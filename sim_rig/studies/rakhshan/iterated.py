"""Labels that are renewed while the cars brake ("a recursive algorithm", section III-B).

At the begin of each iteration every car is labelled by its present gap and speeds, and keeps the
access probability of its label until the next. So the mean number of slots until a reception
changes with time: a packet counts as received when the slots that passed, each as a share of the
mean number that was needed in it, add up to one.
"""

from itertools import count

import numpy as np
from numpy.typing import NDArray

from onboard.access.rear_end import Array
from sim_rig.studies.rakhshan.chain import lane_links
from sim_rig.studies.rakhshan.collisions import CarBraking, speed_after, travelled_m
from sim_rig.studies.rakhshan.highway import (
    CarStates,
    Drops,
    RakhshanHighwaySettings,
    collision_share_of_delays,
    is_unsafe,
    packet_s,
    road_interference,
)
from sim_rig.studies.rakhshan.slotted import asynchronous, slots_needed

_STANDS_M_S = 0.1
"""Slower cars are safe: they hit nobody."""


def iterated_collision_share(
    settings: RakhshanHighwaySettings, drops: Drops, safe_access: Array, unsafe_access: Array
) -> Array:
    """Share of each drop's following cars that hit the lead; see `collision_share`.

    Args:
        settings: of the highway, with an `iteration_s`.
        drops: all drops.
        safe_access: (safe,) access probabilities of safe cars.
        unsafe_access: (unsafe,) access probabilities of unsafe cars.

    Returns:
        (safe, unsafe, drops): for each pair of access probabilities.
    """
    interference = road_interference(settings, drops)
    result = np.empty((len(safe_access), len(unsafe_access), len(drops.unsafe)))
    for i, safe_p in enumerate(safe_access.tolist()):
        for j, unsafe_p in enumerate(unsafe_access.tolist()):
            delay_s = iterated_delay_s(settings, drops, interference, (safe_p, unsafe_p))
            result[i, j] = collision_share_of_delays(drops, delay_s)
    return result


def iterated_delay_s(
    settings: RakhshanHighwaySettings,
    drops: Drops,
    interference: Array,
    access: tuple[float, float],
) -> Array:
    """D(i) in s, (drops, lanes, cars), with relays that are informed in any way.

    Args:
        settings: of the highway, with an `iteration_s`.
        drops: all drops.
        interference: of `road_interference`.
        access: probabilities of safe and of unsafe cars.

    Raises:
        ValueError: the settings have no `iteration_s`.
    """
    step_s = settings.iteration_s
    if step_s is None:
        raise ValueError("iteration_s must be a time")
    informed_s = np.full(drops.unsafe.shape, np.inf)
    informed_s[..., :2] = 0.0
    waited = np.zeros_like(drops.wait_draws)
    needed = -np.log(drops.wait_draws) if settings.random_waits else np.ones_like(waited)
    for number in count():
        begin_s = number * step_s
        unsafe = _labels(settings, drops, _begins_s(drops, informed_s), begin_s)
        received_per_s = _receptions_per_s(settings, interference, np.where(unsafe, *access[::-1]))
        _inform(drops, informed_s, (waited, needed, received_per_s), (begin_s, begin_s + step_s))
        if np.isfinite(informed_s).all():
            return informed_s
    raise AssertionError("the loop above is endless")


def _begins_s(drops: Drops, informed_s: Array) -> Array:
    begins_s = informed_s + drops.reaction_s
    begins_s[..., 0] = 0.0
    return begins_s


def _labels(
    settings: RakhshanHighwaySettings, drops: Drops, begins_s: Array, now_s: float
) -> NDArray[np.bool_]:
    """Labels by the present state; those of before for cars whose gap has not changed."""
    braking = CarBraking(drops.braking_m_s2, begins_s)
    changed = begins_s < now_s
    changed[..., 1:] |= changed[..., :-1].copy()
    changed[..., 0] = False  # nothing is ahead of it
    unsafe = drops.unsafe.copy()
    if not changed.any():
        return unsafe
    speed_m_s = speed_after(now_s, settings.speed_m_s, braking)
    way_m = travelled_m(now_s, settings.speed_m_s, braking)
    gap_m = drops.gap_m.copy()
    gap_m[..., 1:] += way_m[..., :-1] - way_m[..., 1:]
    lead_m_s = np.roll(speed_m_s, 1, axis=-1)
    state = CarStates(
        np.maximum(gap_m[changed], 0.0),
        lead_m_s[changed],
        np.maximum(speed_m_s[changed], _STANDS_M_S),
        drops.usual_log_reaction[changed],
        drops.reaction_s[changed],
    )
    unsafe[changed] = is_unsafe(settings, state) & (speed_m_s[changed] > _STANDS_M_S)
    return unsafe


def _receptions_per_s(
    settings: RakhshanHighwaySettings, interference: Array, access: Array
) -> Array:
    """(drops, lanes, links) for a sender that has something to tell."""
    receiver_access = access if settings.synchronous else asynchronous(access)
    sender, receiver = lane_links(settings.cars_per_lane)
    road = receiver_access.reshape(len(access), 1, -1)
    success = np.prod(1.0 - road * interference, axis=-1).reshape(*access.shape[:2], -1)
    slots = slots_needed(success, access[..., sender], receiver_access[..., receiver])
    rate: Array = 1.0 / (slots * packet_s(settings))
    return rate


def _inform(
    drops: Drops,
    informed_s: Array,
    receptions: tuple[Array, Array, Array],
    within_s: tuple[float, float],
) -> None:
    """Enter who is informed within an iteration, and what each link has waited at its end."""
    waited, needed, per_s = receptions
    begin_s, end_s = within_s
    sender, receiver = (side.tolist() for side in lane_links(informed_s.shape[-1]))
    links = {pair: k for k, pair in enumerate(zip(sender, receiver, strict=True))}
    for i in range(2, informed_s.shape[-1]):
        known_s = np.minimum(informed_s[..., i], _begins_s(drops, informed_s)[..., i - 1])
        for j in range(i - 1):
            k = links[j, i]
            starts_s = np.maximum(begin_s, _begins_s(drops, informed_s)[..., j])
            arrives_s = starts_s + (needed[..., k] - waited[..., k]) / per_s[..., k]
            known_s = np.minimum(known_s, arrives_s)
            waited[..., k] += per_s[..., k] * np.maximum(end_s - starts_s, 0.0)
        informed_s[..., i] = np.where(known_s <= end_s, known_s, informed_s[..., i])
