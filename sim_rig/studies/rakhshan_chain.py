"""How the news of braking comes down a lane: by radio, and by drivers who react (section III-B).

Car 0 brakes. Car i hears of it from car 0, or from a car between that has heard, has reacted and
says so itself, or sees the brake lights of the car right ahead once that one brakes:

    D(1) = 0
    D(i) = min( slot s(0, i),
                min over j = 1 .. i-2 of  D(j) + tau_j + slot s(j, i),
                D(i-1) + tau_(i-1) )

The paper lets a message be relayed once and writes s(j) where this has D(j); with D(j) the relays
may have been told by relays, as they are on the road. For chains in which car j is best told by car
0 itself the two are equal.
"""

from itertools import combinations

import numpy as np

from onboard.access.rear_end import Array
from sim_rig.studies.rakhshan_slotted import SlottedLinks


def lane_links(cars: int) -> SlottedLinks:
    """Every link from a car to one behind it that does not see it brake."""
    apart = [(j, i) for j, i in combinations(range(cars), 2) if i - j > 1]
    return SlottedLinks(*np.array(apart, dtype=np.int64).reshape(-1, 2).T)


def reception_delay_s(slots: Array, slot_s: float, reaction_s: Array) -> Array:
    """D(i) of each car of a lane.

    Args:
        slots: (..., k) mean slots of the links that `lane_links` gives.
        slot_s: length of a slot.
        reaction_s: (..., cars) tau; that of car 0 is not used.

    Returns:
        (..., cars), 0 for the first two.
    """
    cars = reaction_s.shape[-1]
    sender, receiver = lane_links(cars)
    pairs = zip(sender.tolist(), receiver.tolist(), strict=True)
    link_s = dict(zip(pairs, np.moveaxis(slots * slot_s, -1, 0), strict=True))
    shape = np.broadcast_shapes(slots.shape[:-1], reaction_s.shape[:-1])
    delay_s = np.zeros((*shape, cars))
    for i in range(2, cars):
        heard_s = [link_s[0, i], delay_s[..., i - 1] + reaction_s[..., i - 1]]
        heard_s += [delay_s[..., j] + reaction_s[..., j] + link_s[j, i] for j in range(1, i - 1)]
        delay_s[..., i] = np.min(np.broadcast_arrays(*heard_s), axis=0)
    return delay_s


def without_radio_s(reaction_s: Array) -> Array:
    """D(i) when only brake lights tell: each waits for the reactions of all ahead of it."""
    delay_s = np.zeros_like(reaction_s)
    delay_s[..., 2:] = np.cumsum(reaction_s[..., 1:-1], axis=-1)
    return delay_s
