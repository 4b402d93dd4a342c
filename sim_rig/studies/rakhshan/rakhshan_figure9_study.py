"""Figure 9: P_s^D over the access probability, for both kinds of slots and two distances."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from onboard.access.rear_end import Array
from sim_rig.studies.campaigns.study import Case, Results, Study
from sim_rig.studies.rakhshan.best_access import RakhshanSettings
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

WITHIN_S = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class ReceptionCurves:
    """Probabilities of reception from car 0."""

    access: Array
    """(n,) access probabilities."""
    receivers: NDArray[np.int64]
    """(2,) numbers of the receiving cars."""
    distance_m: Array
    """(2,) from car 0."""
    opportunities: float
    """Number of slots within `WITHIN_S`."""
    success: dict[str, Array]
    """(n, 2) with synchronous slots (SSP) and with asynchronous ones (SAP)."""


def run(settings: RakhshanSettings, _case: Case) -> ReceptionCurves:
    """Compute both curves for car 2 and for the last one."""
    highway = settings.highway
    cars = np.arange(highway.cars_per_lane) * (highway.mean_gap_m + highway.car_length_m)
    position_m = np.tile(cars, highway.lanes)
    links = SlottedLinks(np.zeros(2, int), np.array([2, highway.cars_per_lane - 1]))
    count = opportunities(np.array(WITHIN_S), highway.data_rate_mbit_s, highway.packet_bytes)
    access = np.geomspace(0.001, 0.5, 60)
    channel = SlottedChannel(from_db(highway.threshold_db), highway.path_loss_exponent)
    curves = {}
    for slots in ("SSP", "SAP"):
        receiver_access = access if slots == "SSP" else asynchronous(access)
        everywhere = np.repeat(receiver_access[:, None], len(position_m), axis=1)
        success = packet_success(position_m, everywhere, links, channel)
        needed = slots_needed(success, access[:, None], receiver_access[:, None])
        curves[slots] = success_after(needed, count)
    return ReceptionCurves(
        access, links.receiver, cars[links.receiver].astype(np.float64), float(count), curves
    )


def table(_settings: RakhshanSettings, rows: Sequence[ReceptionCurves]) -> list[dict[str, object]]:
    """A line for each access probability, a column for each curve."""
    (found,) = rows
    columns = [f"{slots.lower()}_car_{car}" for slots in found.success for car in found.receivers]
    values = np.column_stack([found.access, *found.success.values()]).tolist()
    return [dict(zip(["access", *columns], each, strict=True)) for each in values]


def picture(
    results: Results[RakhshanSettings, ReceptionCurves, dict[str, object]],
) -> Figure:
    """Draw the curves."""
    (found,) = results.rows
    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    axes = figure.subplots()
    for (slots, success), style in zip(found.success.items(), ("-", "--"), strict=True):
        for k, receiver in enumerate(found.receivers):
            label = f"{slots}, car {receiver} ({found.distance_m[k]:.0f} m)"
            axes.plot(found.access, success[:, k], style, color=f"C{k}", label=label)
    axes.set(xscale="log", xlabel="channel access probability", ylabel="$P_s^D$")
    axes.set_title(f"Received from car 0 within {found.opportunities:.0f} opportunities (0.05 s)")
    axes.legend(frameon=False, fontsize="small")
    return figure


def summary(results: Results[RakhshanSettings, ReceptionCurves, dict[str, object]]) -> str:
    """The best access probabilities for the last car."""
    (found,) = results.rows
    best = [found.access[np.argmax(curve[:, -1])] for curve in found.success.values()]
    return (
        f"for the last car {best[0]:.3f} is the best access with synchronous slots,"
        f" {best[1]:.3f} with asynchronous ones"
    )


STUDY = Study(
    name="rakhshan-figure9",
    sentence="Figure 9: how likely a packet is received, by the access probability.",
    settings=RakhshanSettings,
    takes_settings=False,
    case=Case,
    run=run,
    table=table,
    line=dict,
    picture=picture,
    summary=summary,
)
