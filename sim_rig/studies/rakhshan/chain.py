"""Propagation of the information that car 0 brakes along a lane, by radio and by brake lights.

Section III-B of the paper. Car i is informed by car 0, or by the messages of a car between that was
informed and has reacted, or by the brake lights of the car directly ahead:

    D(1) = 0
    D(i) = min( slot s(0, i),
                min over j = 1 .. i-2 of  D(j) + tau_j + slot s(j, i),
                D(i-1) + tau_(i-1) )

The paper allows one relay: it has s(j) in the place of D(j), and s(i-1) in that of D(i-1). With D a
relay may itself be informed by a relay, or by brake lights. `Relay` names the forms.
"""

from enum import StrEnum
from itertools import combinations

import numpy as np

from onboard.access.rear_end import Array
from sim_rig.studies.rakhshan.slotted import SlottedLinks


class Relay(StrEnum):
    """How a car that relays the information got it."""

    ANY = "any"
    """In any way: D(j)."""
    DIRECT = "direct"
    """From car 0: s(0, j)."""
    AS_PRINTED = "as-printed"
    """From car 0, and car j's message takes the s(i-j) that the paper prints: the slots of car 0's
    to car i-j."""


def lane_links(cars: int) -> SlottedLinks:
    """All links from a car to cars behind it that do not see its brake lights."""
    links = [(j, i) for j, i in combinations(range(cars), 2) if i - j > 1]
    return SlottedLinks(*np.array(links, dtype=np.int64).reshape(-1, 2).T)


def reception_delay_s(
    slots: Array, slot_s: float, reaction_s: Array, relay: Relay = Relay.ANY
) -> Array:
    """Reception delay D(i) of each car of a lane, in s.

    Args:
        slots: (..., k) mean slots of the links that `lane_links` gives.
        slot_s: duration of a slot.
        reaction_s: (..., cars) reaction times tau; that of car 0 is not used.
        relay: form of the equation.

    Returns:
        (..., cars), 0 for the first two.
    """
    cars = reaction_s.shape[-1]
    sender, receiver = lane_links(cars)
    pairs = zip(sender.tolist(), receiver.tolist(), strict=True)
    link_s = dict(zip(pairs, np.moveaxis(slots * slot_s, -1, 0), strict=True))
    shape = np.broadcast_shapes(slots.shape[:-1], reaction_s.shape[:-1])
    delay_s = np.zeros((*shape, cars))
    informed_s = delay_s if relay is Relay.ANY else np.zeros((*shape, cars))
    for i in range(2, cars):
        informed_s[..., i] = link_s[0, i]
        known_s = [link_s[0, i], informed_s[..., i - 1] + reaction_s[..., i - 1]]
        for j in range(1, i - 1):
            relayed_s = link_s[(0, i - j) if relay is Relay.AS_PRINTED else (j, i)]
            known_s.append(informed_s[..., j] + reaction_s[..., j] + relayed_s)
        delay_s[..., i] = np.min(np.broadcast_arrays(*known_s), axis=0)
    return delay_s


def without_radio_s(reaction_s: Array) -> Array:
    """D(i) with brake lights only: the sum of the reaction times of cars 1 to i-1."""
    delay_s = np.zeros_like(reaction_s)
    delay_s[..., 2:] = np.cumsum(reaction_s[..., 1:-1], axis=-1)
    return delay_s
