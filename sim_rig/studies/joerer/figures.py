"""Draws the paper's figures 5 to 11."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from sim_rig.studies.joerer.traffic import ApproachOutcome, Array

GROUPS = ("CRASH", "NEAR CRASH", "NO CRASH")


def draw_boxes(highest: Mapping[str, Array], outcome: NDArray[np.int64], path: Path) -> None:
    """Draw figures 5, 6 and 8: the highest P_C of each car by outcome.

    Args:
        highest: (2 n,) values by title, a panel each.
        outcome: (2 n,) of `ApproachOutcome`.
        path: PNG to write.
    """
    figure, panels = _panels(len(highest), "maximum collision probability")
    for axes, (title, values) in zip(panels, highest.items(), strict=True):
        groups = [values[outcome == group] for group in ApproachOutcome]
        axes.boxplot([group if len(group) else [np.nan] for group in groups])
        axes.set_xticks([1, 2, 3], GROUPS, fontsize=7)
        axes.set_title(title, fontsize=9)
        axes.set_ylim(-0.03, 1.03)
    figure.savefig(path)


def draw_bins(binned: Mapping[str, Array], bin_m: float, path: Path) -> None:
    """Draw figures 7 and 9: P_C by distance of receiver and sender.

    Args:
        binned: (bins, bins) values by title, a panel each.
        bin_m: width of a bin.
        path: PNG to write.
    """
    figure, panels = _panels(len(binned), "sender from the crossing in m")
    for axes, (title, values) in zip(panels, binned.items(), strict=True):
        at = np.nonzero(np.isfinite(values))
        share = values[at]
        receiver_m, sender_m = ((index + 0.5) * bin_m for index in at)
        axes.scatter(receiver_m, sender_m, s=3 + 22 * share, c=share, vmin=0, vmax=1)
        axes.set_title(title, fontsize=9)
        axes.set_xlabel("receiver from the crossing in m", fontsize=8)
        axes.set_xlim(0, len(values) * bin_m)
        axes.set_ylim(0, len(values) * bin_m)
    figure.colorbar(mpl.cm.ScalarMappable(), ax=list(panels), label="collision probability")
    figure.savefig(path)


def draw_evolution(
    exact: tuple[Array, Array], beacons: Mapping[float, tuple[Array, Array]], path: Path
) -> None:
    """Draw figure 10: P_C over the time to the crash.

    Args:
        exact: times in s and P_C from exact data.
        beacons: the same at received beacons, by beacon interval in s.
        path: PNG to write.
    """
    figure, (axes,) = _panels(1, "collision probability")
    axes.plot(*exact, color="0.7", label="exact data")
    for interval_s, (time_s, p_c) in beacons.items():
        axes.step(
            np.append(time_s, 0.0), np.append(p_c, p_c[-1:]), where="post",
            label=f"beacon each {interval_s:g} s",
        )  # fmt: skip
    axes.set_xlabel("time to the crash in s")
    axes.set_xlim(-6, 0)
    axes.legend(fontsize=7)
    figure.savefig(path)


def draw_eccdf(lbu: Mapping[str, Mapping[float, Array]], path: Path) -> None:
    """Draw figure 11: the eCCDF of P_C at the last beacons before unavoidable."""
    figure, panels = _panels(len(lbu), "eCCDF")
    for axes, (title, of_interval) in zip(panels, lbu.items(), strict=True):
        for interval_s, values in of_interval.items():
            finite = np.sort(values[np.isfinite(values)])
            share = 1.0 - np.arange(len(finite)) / max(len(finite), 1)
            axes.step(finite, share, where="pre", label=f"{interval_s:g} s")
        axes.set_title(title, fontsize=9)
        axes.set_xlabel("collision probability of LBU beacons", fontsize=8)
        axes.set_xlim(0, 1)
        axes.legend(fontsize=7)
    figure.savefig(path)


def _panels(count: int, label: str) -> tuple[Figure, Sequence[Axes]]:
    figure = Figure(figsize=(3.4 * count + 1.0, 3.4), dpi=120, layout="constrained")
    panels = figure.subplots(1, count, sharey=True, squeeze=False)[0]
    panels[0].set_ylabel(label)
    return figure, panels
