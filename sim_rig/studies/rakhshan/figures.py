"""Driver-based channel access on a highway: the paper's figures 9 to 11, and their sensitivity.

Source: Rakhshan, Pishro-Nik, Nekoui, "Driver-Based Adaptation of Vehicular Ad hoc Networks for
Design of Active Safety Systems". docs/paper-access.md compares the results with the paper's.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from pydantic import Field

from onboard.access.rear_end import Array
from onboard.settings import Settings
from sim_rig.studies.campaigns.results import write_results
from sim_rig.studies.rakhshan.highway import (
    Drops,
    RakhshanHighwaySettings,
    Spacing,
    collision_share,
    collision_share_with_perfect_radio,
    collision_share_without_radio,
    draw,
    mean_and_error,
    reduction_and_error,
)
from sim_rig.studies.rakhshan.iterated import iterated_collision_share
from sim_rig.studies.rakhshan.slotted import (
    SlottedChannel,
    SlottedLinks,
    asynchronous,
    from_db,
    opportunities,
    packet_success,
    slots_needed,
    success_after,
)

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


FULL = RakhshanSettings()
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


def figure9(out_dir: Path, settings: RakhshanSettings = FULL) -> str:
    """Draw P_s^D over the access probability, for both kinds of slots and two distances."""
    highway = settings.highway
    cars = np.arange(highway.cars_per_lane) * (highway.mean_gap_m + highway.car_length_m)
    position_m = np.tile(cars, highway.lanes)
    links = SlottedLinks(np.zeros(2, int), np.array([2, highway.cars_per_lane - 1]))
    count = opportunities(np.array(0.05), highway.data_rate_mbit_s, highway.packet_bytes)
    access = np.geomspace(0.001, 0.5, 60)
    channel = SlottedChannel(from_db(highway.threshold_db), highway.path_loss_exponent)
    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    axes = figure.subplots()
    curves = []
    for name, style in (("SSP", "-"), ("SAP", "--")):
        receiver_access = access if name == "SSP" else asynchronous(access)
        everywhere = np.repeat(receiver_access[:, None], len(position_m), axis=1)
        success = packet_success(position_m, everywhere, links, channel)
        slots = slots_needed(success, access[:, None], receiver_access[:, None])
        curves.append(success_after(slots, count))
        for k, receiver in enumerate(links.receiver):
            label = f"{name}, car {receiver} ({cars[receiver]:.0f} m)"
            axes.plot(access, curves[-1][:, k], style, color=f"C{k}", label=label)
    axes.set(xscale="log", xlabel="channel access probability", ylabel="$P_s^D$")
    axes.set_title(f"Received from car 0 within {count:.0f} opportunities (0.05 s)")
    axes.legend(frameon=False, fontsize="small")
    names = [f"{mac}_car_{car}" for mac in ("ssp", "sap") for car in links.receiver]
    rows = np.column_stack([access, *curves]).tolist()
    write_results(out_dir, ["access", *names], rows, settings, figure)
    best = [access[np.argmax(curve[:, -1])] for curve in curves]
    return (
        f"for the last car {best[0]:.3f} is the best access with synchronous slots,"
        f" {best[1]:.3f} with asynchronous ones"
    )


def figure10(out_dir: Path, settings: RakhshanSettings = FULL) -> str:
    """Draw the collision probability over the access probabilities of safe and unsafe cars."""
    outcome = simulate(settings)
    found = gain(settings, outcome)
    mean, error = mean_and_error(outcome.pairs)
    access = np.array(settings.access)
    figure = Figure(figsize=(7.0, 5.5), layout="constrained")
    axes = figure.subplots()
    drawn = axes.contourf(access, access, mean.T, levels=24, cmap="viridis")
    figure.colorbar(drawn, label="collision probability")
    axes.plot(found.equal_access, found.equal_access, "wo", label="best equal")
    axes.plot(found.safe_access, found.unsafe_access, "r*", ms=12, label="best pair")
    axes.plot(access, access, "w:", lw=1)
    axes.set(xscale="log", yscale="log", xlabel="access of safe cars", ylabel="of unsafe cars")
    axes.legend(loc="lower left")
    rows = [
        (safe, unsafe, float(mean[i, j]), float(error[i, j]))
        for i, safe in enumerate(settings.access)
        for j, unsafe in enumerate(settings.access)
    ]
    columns = ["safe_access", "unsafe_access", "collision_probability", "half_interval_95"]
    write_results(out_dir, columns, rows, settings, figure)
    return _summary(found)


def figure11(out_dir: Path, settings: RakhshanSettings = FULL) -> str:
    """Draw the collision probability over one access probability for all cars."""
    outcome = simulate(settings)
    mean, error = mean_and_error(outcome.equal)
    without_radio, perfect_radio = mean_and_error(
        np.stack([outcome.without_radio, outcome.perfect_radio])
    )[0]
    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    axes = figure.subplots()
    axes.errorbar(settings.access, mean, error, fmt="o-", ms=3, capsize=2)
    axes.axhline(without_radio, ls="--", color="C3", label="brake lights only")
    axes.axhline(perfect_radio, ls=":", color="C2", label="radio without delay")
    axes.axvline(PAPERS_OPTIMUM, color="0.7", label="optimum of the paper")
    axes.set(xscale="log", xlabel="channel access probability", ylabel="collision probability")
    axes.legend(frameon=False)
    columns = ["access", "collision_probability", "half_interval_95"]
    write_results(
        out_dir,
        columns,
        zip(settings.access, mean.tolist(), error.tolist(), strict=True),
        settings,
        figure,
    )
    best = int(np.argmin(mean))
    floor = np.flatnonzero(mean <= 1.01 * mean[best])
    return (
        f"least at {settings.access[best]:g}: {mean[best]:.4f} +- {error[best]:.4f};"
        f" within 1 % of it from {settings.access[floor[0]]:g} to {settings.access[floor[-1]]:g};"
        f" brake lights only {without_radio:.4f}, radio without delay {perfect_radio:.4f}"
    )


VARIANTS: dict[str, dict[str, object]] = {
    "baseline": {},
    "uniform gaps": {"spacing": Spacing.UNIFORM},
    "log-normal gaps": {"spacing": Spacing.LOGNORMAL},
    "mean gap 12 m": {"mean_gap_m": 12.0},
    "mean gap 35 m": {"mean_gap_m": 35.0},
    "path loss exponent 2": {"path_loss_exponent": 2.0},
    "path loss exponent 4": {"path_loss_exponent": 4.0},
    "reaction times x 0.6": {"reaction_factor": 0.6},
    "reaction times x 1.5": {"reaction_factor": 1.5},
    "unsafe above 0.3": {"unsafe_threshold": 0.3},
    "unsafe above 0.8": {"unsafe_threshold": 0.8},
    "random waits": {"random_waits": True},
    "asynchronous slots": {"synchronous": False},
    "one lane": {"lanes": 1},
    "slots of 2.2 ms": {"slots_per_packet": 10.0},
    "slots of 11 ms": {"slots_per_packet": 50.0},
    "slots of 44 ms": {"slots_per_packet": 200.0},
}
"""Changes of the settings, one at a time."""


def sensitivity(out_dir: Path, settings: RakhshanSettings = BROAD) -> str:
    """Write the reduction by driver-based access for variants of what the paper leaves open."""
    rows = []
    for name, changes in VARIANTS.items():
        for shuffled in (False, True):
            highway = settings.highway.model_copy(update=changes)
            changed = settings.model_copy(update={"highway": highway})
            outcome = simulate(changed, shuffled=shuffled)
            found = gain(changed, outcome)
            rows.append((
                name,
                "random" if shuffled else "by probability",
                outcome.unsafe_share,
                float(outcome.without_radio.mean()),
                float(outcome.equal.mean(axis=-1).min()),
                found.equal_access,
                found.safe_access,
                found.unsafe_access,
                found.reduction,
                found.error,
                found.perfect_radio,
            ))  # fmt: skip
    columns = [
        "variant", "labels", "unsafe_share", "without_radio", "least_with_equal_access",
        "equal_access", "safe_access", "unsafe_access", "reduction", "half_interval_95",
        "perfect_radio",
    ]  # fmt: skip
    write_results(out_dir, columns, rows, settings)
    return "\n".join(
        f"{name:24} {labels:10} {reduction:7.2%} +- {error:.2%}; radio without delay {ideal:.2%}"
        for name, labels, *_, reduction, error, ideal in rows
    )


def _shuffle_labels(drops: Drops, label_rng: np.random.Generator) -> Drops:
    order = label_rng.permuted(drops.unsafe.reshape(len(drops.unsafe), -1), axis=1)
    return replace(drops, unsafe=order.reshape(drops.unsafe.shape))


def _summary(found: Gain) -> str:
    return (
        f"equal at {found.equal_access:g}; safe {found.safe_access:g}, unsafe"
        f" {found.unsafe_access:g}: {found.reduction:.2%} +- {found.error:.2%} fewer collisions,"
        f" radio without delay {found.perfect_radio:.2%}"
    )
