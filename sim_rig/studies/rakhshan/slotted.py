"""Slotted p-persistent access: probability of reception of a packet, and the delay.

In each slot car i sends with probability p_i and listens otherwise. With path loss r^-alpha,
Rayleigh fading and no noise, a packet is received if its signal exceeds the sum of the others' by
beta (section II-B). All functions broadcast over leading dimensions: chains, probabilities, draws.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from onboard.access.rear_end import Array

Indices = NDArray[np.int64]

DECODING_THRESHOLD_DB = {
    3.0: 5.0, 4.5: 6.0, 6.0: 8.0, 9.0: 11.0, 12.0: 15.0, 18.0: 20.0, 24.0: 25.0
}  # fmt: skip
"""Table II: least signal to interference ratio at each data rate in Mbit/s."""


class SlottedLinks(NamedTuple):
    """Indices of k senders and of their k receivers."""

    sender: Indices
    receiver: Indices


class SlottedChannel(NamedTuple):
    """Path loss and reception threshold."""

    threshold: float
    """beta, as a power ratio."""
    path_loss_exponent: float
    """alpha."""


def from_db(ratio_db: float) -> float:
    """Convert decibels to a power ratio."""
    return float(10.0 ** (ratio_db / 10.0))


def asynchronous(access: Array) -> Array:
    """p'_i of asynchronous slots: an interferer's packet overlaps two of them."""
    return access + access - access * access


def interference_probability(
    position_m: Array, links: SlottedLinks, channel: SlottedChannel
) -> Array:
    """Probability that a car which sends in a link's slot destroys the packet; 0 for its two ends.

    Args:
        position_m: (..., n) positions of all cars along the road, of all lanes.
        links: k links.
        channel: path loss and threshold.

    Returns:
        (..., k, n) probabilities: 1 / (1 + (r_i / r)^alpha / beta).

    Raises:
        ValueError: both ends of a link have the same position.
    """
    sender, receiver = links
    link_m = np.abs(position_m[..., sender] - position_m[..., receiver])
    if np.any(link_m <= 0.0):
        raise ValueError("the ends of a link must not have the same position")
    interferer_m = np.abs(position_m[..., None, :] - position_m[..., receiver, None])
    relative_m = interferer_m / link_m[..., None]
    interference = 1.0 / (1.0 + relative_m**channel.path_loss_exponent / channel.threshold)
    link = np.arange(len(sender))
    interference[..., link, sender] = 0.0
    interference[..., link, receiver] = 0.0
    return interference


def packet_success(
    position_m: Array, access: Array, links: SlottedLinks, channel: SlottedChannel
) -> Array:
    """P_s of Theorem 1: probability that a packet that is sent is received at the end of its link.

    Args:
        position_m: (..., n) positions of all cars along the road, of all lanes.
        access: (..., n) access probabilities; for asynchronous slots those of `asynchronous`.
        links: k links.
        channel: path loss and threshold.

    Returns:
        (..., k) probabilities.

    Raises:
        ValueError: a probability is not in [0, 1], or both ends of a link have the same position.
    """
    if np.any((access < 0.0) | (access > 1.0)):
        raise ValueError("channel access probabilities are 0 to 1")
    survives = 1.0 - access[..., None, :] * interference_probability(position_m, links, channel)
    success: Array = np.prod(survives, axis=-1)
    return success


def slots_needed(success: Array, sender_access: Array, receiver_access: Array) -> Array:
    """Mean number of slots until a packet is received (s of section III-B).

    Args:
        success: P_s of the link.
        sender_access: access probability of the sender.
        receiver_access: access probability of the receiver, which listens otherwise.
    """
    with np.errstate(divide="ignore"):
        slots: Array = 1.0 / (success * sender_access * (1.0 - receiver_access))
    return slots


def opportunities(tolerable_s: Array, data_rate_mbit_s: float, packet_bytes: int) -> Array:
    """D: number of whole slots within the tolerable delay.

    Args:
        tolerable_s: tolerable delay.
        data_rate_mbit_s: of the channel.
        packet_bytes: a slot is as long as such a packet.
    """
    return np.floor(np.asarray(tolerable_s) / slot_s(data_rate_mbit_s, packet_bytes))


def slot_s(data_rate_mbit_s: float, packet_bytes: int) -> float:
    """L / R: duration of a packet, in s."""
    return packet_bytes * 8.0 / (data_rate_mbit_s * 1e6)


def success_after(slots: Array, opportunity_count: Array) -> Array:
    """P_s^D: probability that at least one of D opportunities succeeds."""
    with np.errstate(divide="ignore"):
        result: Array = 1.0 - (1.0 - 1.0 / slots) ** opportunity_count
    return result
