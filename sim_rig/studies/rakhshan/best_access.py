"""The best access probabilities of safe and unsafe cars, and what they gain over equal ones.

Source: Rakhshan, Pishro-Nik, Nekoui, "Driver-Based Adaptation of Vehicular Ad hoc Networks for
Design of Active Safety Systems". docs/paper-access.md compares the results with the paper's.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from pydantic import Field

from onboard.access.rear_end import Array
from onboard.settings import Settings
from sim_rig.studies.rakhshan.highway import (
    Drops,
    RakhshanHighwaySettings,
    collision_share,
    collision_share_with_perfect_radio,
    collision_share_without_radio,
    draw,
    reduction_and_error,
)
from sim_rig.studies.rakhshan.iterated import iterated_collision_share

BATCH = 50
"""Drops in one batch, which fits the processor's cache."""

PAPERS_OPTIMUM = 0.05


class RakhshanSettings(Settings):
    """Number of drops, access probabilities, and the highway."""

    seed: int = Field(1, ge=0)
    """Of all draws."""
    drops: int = Field(4000, ge=4)
    """A drop is one realisation of all lanes. One half selects the best probabilities, the other
    evaluates them."""
    access: tuple[float, ...] = (
        0.001, 0.002, 0.005, 0.01, 0.015, 0.02, 0.025, 0.03, 0.04, 0.05,
        0.06, 0.08, 0.1, 0.12, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5,
    )  # fmt: skip
    """Access probabilities, in all pairs for safe and unsafe cars."""
    highway: RakhshanHighwaySettings = RakhshanHighwaySettings()
    """The paper's highway, and what it leaves open."""


BROAD = RakhshanSettings(drops=1000)
"""For studies of many variants."""


@dataclass(frozen=True, slots=True, eq=False)
class CollisionShares:
    """Share of the cars that collide in each drop."""

    pairs: Array
    """(safe, unsafe, drops)."""
    without_radio: Array
    perfect_radio: Array
    unsafe_share: float

    @property
    def equal(self) -> Array:
        """(access, drops): the same probability for safe and unsafe cars."""
        return np.moveaxis(np.diagonal(self.pairs), -1, 0)


@dataclass(frozen=True, slots=True)
class Gain:
    """Reduction of collisions by driver-based access, compared with the best equal probability."""

    equal_access: float
    safe_access: float
    unsafe_access: float
    reduction: float
    """Reduction of the collision probability, over the drops that evaluate."""
    error: float
    """Half of its 95 % interval."""
    perfect_radio: float
    """The reduction by a radio without delay. It is not a strict bound: a car that is informed late
    brakes late, which helps the car behind it."""

    def sentence(self) -> str:
        """The gain in words."""
        return (
            f"equal at {self.equal_access:g}; safe {self.safe_access:g}, unsafe"
            f" {self.unsafe_access:g}: {self.reduction:.2%} +- {self.error:.2%} fewer collisions,"
            f" radio without delay {self.perfect_radio:.2%}"
        )


def simulate(settings: RakhshanSettings, *, shuffled: bool = False) -> CollisionShares:
    """Simulate all drops; `shuffled` assigns the labels safe and unsafe at random, as a control."""
    rng, label_rng = np.random.default_rng(settings.seed).spawn(2)
    access = np.array(settings.access)
    highway = settings.highway
    pairs, without_radio, perfect_radio, unsafe = [], [], [], []
    for begin in range(0, settings.drops, BATCH):
        drops = draw(highway, min(BATCH, settings.drops - begin), rng)
        if shuffled:
            drops = _shuffle_labels(drops, label_rng)
        share = collision_share if highway.iteration_s is None else iterated_collision_share
        pairs.append(share(highway, drops, access, access))
        without_radio.append(collision_share_without_radio(drops))
        perfect_radio.append(collision_share_with_perfect_radio(drops))
        unsafe.append(drops.unsafe)
    return CollisionShares(
        np.concatenate(pairs, axis=-1),
        np.concatenate(without_radio),
        np.concatenate(perfect_radio),
        float(np.concatenate(unsafe).mean()),
    )


def gain(settings: RakhshanSettings, outcome: CollisionShares) -> Gain:
    """Select the best probabilities by one half of the drops, and evaluate them by the other."""
    half = outcome.pairs.shape[-1] // 2
    equal = int(np.argmin(outcome.equal[:, :half].mean(axis=-1)))
    chosen = outcome.pairs[..., :half].mean(axis=-1)
    safe, unsafe = np.unravel_index(int(np.argmin(chosen)), chosen.shape)
    reference = outcome.equal[equal, half:]
    reduction, error = reduction_and_error(outcome.pairs[safe, unsafe, half:], reference)
    perfect_radio, _ = reduction_and_error(outcome.perfect_radio[half:], reference)
    access = settings.access
    return Gain(access[equal], access[safe], access[unsafe], reduction, error, perfect_radio)


def batches(settings: RakhshanSettings, highway: RakhshanHighwaySettings) -> Iterator[Drops]:
    """All drops of a highway, in batches."""
    rng = np.random.default_rng(settings.seed)
    for begin in range(0, settings.drops, BATCH):
        yield draw(highway, min(BATCH, settings.drops - begin), rng)


def _shuffle_labels(drops: Drops, label_rng: np.random.Generator) -> Drops:
    order = label_rng.permuted(drops.unsafe.reshape(len(drops.unsafe), -1), axis=1)
    return replace(drops, unsafe=order.reshape(drops.unsafe.shape))
