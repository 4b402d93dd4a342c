"""Slotted p-persistent access: how likely a packet gets through, and how long that takes.

In each slot car i sends with probability p_i and listens otherwise. Path loss r^-alpha, Rayleigh
fading, no noise: a packet is received if its signal exceeds the sum of the others' by beta
(section II-B). All functions broadcast over leading dimensions: chains, probabilities, draws.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from onboard.access.rear_end import Array

Indices = NDArray[np.int64]


class SlottedLinks(NamedTuple):
    """Who sends to whom: indices of k senders and of their k receivers."""

    sender: Indices
    receiver: Indices


class SlottedChannel(NamedTuple):
    """What is between the cars."""

    threshold: float
    """beta, as a power ratio."""
    path_loss_exponent: float
    """alpha."""


def from_db(ratio_db: float) -> float:
    """A power ratio from decibels."""
    return float(10.0 ** (ratio_db / 10.0))


def asynchronous(access: Array) -> Array:
    """p'_i of slots that are not synchronised: an interferer reaches into two of them."""
    return access + access - access * access


def drowning(position_m: Array, links: SlottedLinks, channel: SlottedChannel) -> Array:
    """That a car which sends in a link's slot drowns the packet; 0 for the link's own two ends.

    Args:
        position_m: (..., n) places of all cars along the road, of all lanes.
        links: k of them.
        channel: what is between.

    Returns:
        (..., k, n) probabilities: 1 / (1 + (r_i / r)^alpha / beta).

    Raises:
        ValueError: a link's ends are in one place.
    """
    sender, receiver = links
    link_m = np.abs(position_m[..., sender] - position_m[..., receiver])
    if np.any(link_m <= 0.0):
        raise ValueError("the ends of a link must not be in one place")
    interferer_m = np.abs(position_m[..., None, :] - position_m[..., receiver, None])
    relative_m = interferer_m / link_m[..., None]
    drowned = 1.0 / (1.0 + relative_m**channel.path_loss_exponent / channel.threshold)
    link = np.arange(len(sender))
    drowned[..., link, sender] = 0.0
    drowned[..., link, receiver] = 0.0
    return drowned


def packet_success(
    position_m: Array, access: Array, links: SlottedLinks, channel: SlottedChannel
) -> Array:
    """P_s of Theorem 1: that a packet which is sent gets to the other end of its link.

    Args:
        position_m: (..., n) places of all cars along the road, of all lanes.
        access: (..., n) probabilities that they send in a slot, for asynchronous slots those of
            `asynchronous`.
        links: k of them.
        channel: what is between.

    Returns:
        (..., k) probabilities.

    Raises:
        ValueError: a probability is not in [0, 1], or a link's ends are in one place.
    """
    if np.any((access < 0.0) | (access > 1.0)):
        raise ValueError("channel access probabilities are 0 to 1")
    survives = 1.0 - access[..., None, :] * drowning(position_m, links, channel)
    success: Array = np.prod(survives, axis=-1)
    return success


def slots_needed(success: Array, sender_access: Array, receiver_access: Array) -> Array:
    """Mean slots (s of section III-B) until a packet is sent, listened to and received."""
    with np.errstate(divide="ignore"):
        slots: Array = 1.0 / (success * sender_access * (1.0 - receiver_access))
    return slots


def opportunities(tolerable_s: Array, data_rate_mbit_s: float, packet_bytes: int) -> Array:
    """D: whole slots, each as long as a packet, within the tolerable delay."""
    return np.floor(np.asarray(tolerable_s) / slot_s(data_rate_mbit_s, packet_bytes))


def slot_s(data_rate_mbit_s: float, packet_bytes: int) -> float:
    """L / R: how long a packet takes, in seconds."""
    return packet_bytes * 8.0 / (data_rate_mbit_s * 1e6)


def success_after(slots: Array, opportunity_count: Array) -> Array:
    """P_s^D: that at least one of D opportunities succeeds."""
    with np.errstate(divide="ignore"):
        result: Array = 1.0 - (1.0 - 1.0 / slots) ** opportunity_count
    return result
