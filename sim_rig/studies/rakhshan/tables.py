"""Table I (kinds of collisions) and Table II (data rates) of Rakhshan et al. on their highway."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from onboard.access.rear_end import Array
from sim_rig.studies.campaigns.results import write_results
from sim_rig.studies.rakhshan.chain import without_radio_s
from sim_rig.studies.rakhshan.collisions import KINDS, CarBraking, collision_kind
from sim_rig.studies.rakhshan.figures import BATCH, BROAD, PAPERS_OPTIMUM, RakhshanSettings
from sim_rig.studies.rakhshan.highway import (
    Drops,
    RakhshanHighwaySettings,
    collision_share_of_delays,
    delay_s,
    draw,
)
from sim_rig.studies.rakhshan.slotted import DECODING_THRESHOLD_DB


def table1(out_dir: Path, settings: RakhshanSettings = BROAD) -> str:
    """Write the share of the following cars that collide, by the kinds of Table I.

    Rows are all followers and car 1 alone, which radio does not help: with brake lights only, with
    radio at the paper's access probability, and with a radio without delay.
    """
    shares: dict[str, list[Array]] = {}
    for drops in _batches(settings, settings.highway):
        for name, delay in (
            ("brake lights only", without_radio_s(drops.reaction_s)),
            ("radio", delay_s(settings.highway, drops, PAPERS_OPTIMUM)),
            ("radio without delay", np.zeros_like(drops.reaction_s)),
        ):
            kinds = _kinds(settings.highway, drops, delay)
            for cars, of_cars in (("all", kinds), ("car 1", kinds[..., :1])):
                of_kind = [(of_cars == kind).mean(axis=(-2, -1)) for kind in KINDS]
                shares.setdefault(f"{name}, {cars}", []).append(np.stack(of_kind))
    rows = []
    for name, batches in shares.items():
        percent = 100.0 * np.concatenate(batches, axis=-1).mean(axis=-1)
        rows.append((*name.split(", "), *percent.tolist(), float(percent.sum())))
    columns = ["information", "cars", *(f"collision_{kind}_percent" for kind in KINDS), "percent"]
    write_results(out_dir, columns, rows, settings, _bars(rows))
    return "; ".join(
        f"{name}, {cars}: " + ", ".join(f"{value:.1f}" for value in percent) + " %"
        for name, cars, *percent in rows
    )


def table2(out_dir: Path, settings: RakhshanSettings = BROAD) -> str:
    """Write the best equal access probability at each data rate, and the delay with it."""
    rows = []
    for rate_mbit_s, threshold_db in DECODING_THRESHOLD_DB.items():
        highway = settings.highway.model_copy(
            update={"data_rate_mbit_s": rate_mbit_s, "threshold_db": threshold_db}
        )
        share, last_s = (np.zeros(len(settings.access)) for _ in "ab")
        batches = list(_batches(settings, highway))
        for drops in batches:
            for k, access in enumerate(settings.access):
                delay = delay_s(highway, drops, access)
                share[k] += collision_share_of_delays(drops, delay).mean() / len(batches)
                last_s[k] += delay[..., -1].mean() / len(batches)
        fastest = int(np.argmin(last_s))
        rows.append((
            rate_mbit_s,
            threshold_db,
            settings.access[int(np.argmin(share))],
            float(share.min()),
            settings.access[fastest],
            1e3 * float(last_s[fastest]),
        ))  # fmt: skip
    columns = ["data_rate_mbit_s", "threshold_db", "equal_access", "collision_probability"]
    write_results(out_dir, [*columns, "fastest_access", "last_car_delay_ms"], rows, settings)
    return "; ".join(
        f"{rate:g} Mbit/s: {collided:.4f} at {access:g}, the last car informed after {last:.0f} ms"
        for rate, _, access, collided, _, last in rows
    )


def _batches(settings: RakhshanSettings, highway: RakhshanHighwaySettings) -> Iterator[Drops]:
    rng = np.random.default_rng(settings.seed)
    for begin in range(0, settings.drops, BATCH):
        yield draw(highway, min(BATCH, settings.drops - begin), rng)


def _kinds(highway: RakhshanHighwaySettings, drops: Drops, delay: Array) -> Array:
    """Kinds (drops, lanes, cars - 1) of the collisions of the following cars."""
    begins_s = delay + drops.reaction_s
    begins_s[..., 0] = 0.0
    lead = CarBraking(drops.braking_m_s2[..., :-1], begins_s[..., :-1])
    follower = CarBraking(drops.braking_m_s2[..., 1:], begins_s[..., 1:])
    return collision_kind(drops.gap_m[..., 1:], highway.speed_m_s, lead, follower).astype(float)


def _bars(rows: list[tuple[object, ...]]) -> Figure:
    figure = Figure(figsize=(7.0, 4.0), layout="constrained")
    axes = figure.subplots()
    names = [f"{name},\n{cars}" for name, cars, *_ in rows]
    left = np.zeros(len(rows))
    for k, kind in enumerate(KINDS):
        percent = np.array([row[2 + k] for row in rows], dtype=float)
        axes.barh(names, percent, left=left, label=f"collision {kind}")
        left += percent
    axes.set_xlabel("following cars that collide, %")
    axes.legend(frameon=False)
    return figure
