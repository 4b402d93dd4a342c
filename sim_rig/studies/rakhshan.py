"""Who should talk how often on a highway: the paper's figures 9, 10 and 11, and how firm they are.

Source: Rakhshan, Pishro-Nik, Nekoui, "Driver-Based Adaptation of Vehicular Ad hoc Networks for
Design of Active Safety Systems". What comes out, beside the paper's, is in docs/access.md.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from pydantic import Field

from onboard.access.rear_end import Array
from onboard.settings import Settings
from sim_rig.studies.rakhshan_highway import (
    Drops,
    RakhshanHighwaySettings,
    Spacing,
    collided,
    collided_with_perfect_radio,
    collided_without_radio,
    draw,
    mean_and_error,
    reduction_and_error,
)
from sim_rig.studies.rakhshan_slotted import (
    SlottedChannel,
    SlottedLinks,
    asynchronous,
    from_db,
    opportunities,
    packet_success,
    slots_needed,
    success_after,
)
from sim_rig.studies.results import write_results

BATCH = 50
"""Drops at once: what fits a cache."""

PAPERS_OPTIMUM = 0.05


class RakhshanSettings(Settings):
    """How much is simulated."""

    seed: int = Field(1, ge=0)
    drops: int = Field(4000, ge=4)
    """One is all lanes once. Half of them choose the best probabilities, the others judge them."""
    access: tuple[float, ...] = (
        0.001, 0.002, 0.005, 0.01, 0.015, 0.02, 0.025, 0.03, 0.04, 0.05,
        0.06, 0.08, 0.1, 0.12, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5,
    )  # fmt: skip
    highway: RakhshanHighwaySettings = RakhshanHighwaySettings()


FULL = RakhshanSettings()
BROAD = RakhshanSettings(drops=1000)
"""For many variants."""


@dataclass(frozen=True, slots=True, eq=False)
class CollisionShares:
    """Part of the cars that collide, for each drop."""

    pairs: Array
    """(safe, unsafe, drops)."""
    without_radio: Array
    perfect_radio: Array
    unsafe_share: float

    @property
    def equal(self) -> Array:
        """(access, drops): safe and unsafe alike."""
        return np.moveaxis(np.diagonal(self.pairs), -1, 0)


@dataclass(frozen=True, slots=True)
class Gain:
    """What tailoring brings over the best equal probability."""

    equal_access: float
    safe_access: float
    unsafe_access: float
    reduction: float
    """Of the collision probability, over drops that did not choose the probabilities."""
    error: float
    """Half of its 95 % interval."""
    all_at_once: float
    """The reduction if everybody knew at once. No strict bound: who knows late brakes late, and
    that helps the car behind."""


def simulate(settings: RakhshanSettings, *, shuffled: bool = False) -> CollisionShares:
    """Run all drops; `shuffled` gives the labels safe and unsafe to cars by lot, as a control."""
    rng, lots = np.random.default_rng(settings.seed).spawn(2)
    access = np.array(settings.access)
    highway = settings.highway
    pairs, dark, bright, unsafe = [], [], [], []
    for begin in range(0, settings.drops, BATCH):
        drops = draw(highway, min(BATCH, settings.drops - begin), rng)
        if shuffled:
            drops = _shuffled(drops, lots)
        pairs.append(collided(highway, drops, access, access))
        dark.append(collided_without_radio(drops))
        bright.append(collided_with_perfect_radio(drops))
        unsafe.append(drops.danger > highway.unsafe_threshold)
    return CollisionShares(
        np.concatenate(pairs, axis=-1),
        np.concatenate(dark),
        np.concatenate(bright),
        float(np.concatenate(unsafe).mean()),
    )


def gain(settings: RakhshanSettings, outcome: CollisionShares) -> Gain:
    """Choose the best probabilities by one half of the drops, and judge them by the other."""
    half = outcome.pairs.shape[-1] // 2
    equal = int(np.argmin(outcome.equal[:, :half].mean(axis=-1)))
    chosen = outcome.pairs[..., :half].mean(axis=-1)
    safe, unsafe = np.unravel_index(int(np.argmin(chosen)), chosen.shape)
    reference = outcome.equal[equal, half:]
    reduction, error = reduction_and_error(outcome.pairs[safe, unsafe, half:], reference)
    all_at_once, _ = reduction_and_error(outcome.perfect_radio[half:], reference)
    access = settings.access
    return Gain(access[equal], access[safe], access[unsafe], reduction, error, all_at_once)


def figure9(out_dir: Path, settings: RakhshanSettings = FULL) -> str:
    """P_s^D over the access probability, slots in step and not, near and far."""
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
        heard = access if name == "SSP" else asynchronous(access)
        everywhere = np.repeat(heard[:, None], len(position_m), axis=1)
        success = packet_success(position_m, everywhere, links, channel)
        slots = slots_needed(success, access[:, None], heard[:, None])
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
    return f"for the last car {best[0]:.3f} is the best access in step, {best[1]:.3f} out of step"


def figure10(out_dir: Path, settings: RakhshanSettings = FULL) -> str:
    """The collision probability over the access of safe and of unsafe cars."""
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
    return _told(found)


def figure11(out_dir: Path, settings: RakhshanSettings = FULL) -> str:
    """The collision probability over one access probability for all."""
    outcome = simulate(settings)
    mean, error = mean_and_error(outcome.equal)
    dark, bright = mean_and_error(np.stack([outcome.without_radio, outcome.perfect_radio]))[0]
    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    axes = figure.subplots()
    axes.errorbar(settings.access, mean, error, fmt="o-", ms=3, capsize=2)
    axes.axhline(dark, ls="--", color="C3", label="brake lights only")
    axes.axhline(bright, ls=":", color="C2", label="radio without delay")
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
        f" brake lights only {dark:.4f}, radio without delay {bright:.4f}"
    )


VARIANTS: dict[str, dict[str, object]] = {
    "as decided": {},
    "gaps even": {"spacing": Spacing.UNIFORM},
    "gaps lognormal": {"spacing": Spacing.LOGNORMAL},
    "gaps of 12 m": {"mean_gap_m": 12.0},
    "gaps of 35 m": {"mean_gap_m": 35.0},
    "path loss exponent 2": {"path_loss_exponent": 2.0},
    "path loss exponent 4": {"path_loss_exponent": 4.0},
    "reactions of 0.6 times": {"reaction_factor": 0.6},
    "reactions of 1.5 times": {"reaction_factor": 1.5},
    "unsafe above 0.3": {"unsafe_threshold": 0.3},
    "unsafe above 0.8": {"unsafe_threshold": 0.8},
    "waits drawn": {"random_waits": True},
    "slots not in step": {"synchronous": False},
    "one lane": {"lanes": 1},
    "slots of 2.2 ms": {"slots_per_packet": 10.0},
    "slots of 11 ms": {"slots_per_packet": 50.0},
    "slots of 44 ms": {"slots_per_packet": 200.0},
}
"""What is changed, one thing at a time."""


def sensitivity(out_dir: Path, settings: RakhshanSettings = BROAD) -> str:
    """What tailoring brings if what the paper leaves open is decided otherwise."""
    rows = []
    for name, changes in VARIANTS.items():
        for shuffled in (False, True):
            highway = settings.highway.model_copy(update=changes)
            changed = settings.model_copy(update={"highway": highway})
            outcome = simulate(changed, shuffled=shuffled)
            found = gain(changed, outcome)
            rows.append((
                name,
                "by lot" if shuffled else "by danger",
                outcome.unsafe_share,
                float(outcome.without_radio.mean()),
                float(outcome.equal.mean(axis=-1).min()),
                found.equal_access,
                found.safe_access,
                found.unsafe_access,
                found.reduction,
                found.error,
                found.all_at_once,
            ))  # fmt: skip
    columns = [
        "variant", "labels", "unsafe_share", "without_radio", "least_with_equal_access",
        "equal_access", "safe_access", "unsafe_access", "reduction", "half_interval_95",
        "all_at_once",
    ]  # fmt: skip
    write_results(out_dir, columns, rows, settings)
    return "\n".join(
        f"{name:24} {labels:10} {reduction:7.2%} +- {error:.2%}; all at once {ideal:.2%}"
        for name, labels, *_, reduction, error, ideal in rows
    )


def _shuffled(drops: Drops, lots: np.random.Generator) -> Drops:
    order = lots.permuted(drops.danger.reshape(len(drops.danger), -1), axis=1)
    return replace(drops, danger=order.reshape(drops.danger.shape))


def _told(found: Gain) -> str:
    return (
        f"equal at {found.equal_access:g}; safe {found.safe_access:g}, unsafe"
        f" {found.unsafe_access:g}: {found.reduction:.2%} +- {found.error:.2%} fewer collisions,"
        f" if all knew at once {found.all_at_once:.2%}"
    )
