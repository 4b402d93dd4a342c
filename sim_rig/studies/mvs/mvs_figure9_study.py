"""The MVS paper's Fig. 9: probability of a crash, by method and share of radios."""

import math

import numpy as np
from matplotlib.figure import Figure

from sim_rig.studies.campaigns.study import Results, Study
from sim_rig.studies.mvs.collision_table import CollisionLine, table
from sim_rig.studies.mvs.collisions import (
    MOST_COMPARED,
    CollisionCase,
    CollisionRow,
    CollisionSettings,
    axes,
    run,
    with_available_scenes,
)
from sim_rig.studies.mvs.encounter import Method
from sim_rig.studies.mvs.scenes import SceneName, SceneSource

PAPER_REDUCTION: dict[SceneSource, float] = {
    SceneName.CROSSING: 0.615,
    SceneName.SUMO_CROSSING: 0.615,
    SceneName.CITY: 0.601,
    SceneName.CITY_TRACE: 0.601,
}
"""Reduction of the collision probability by MVS at 40 %: all that the paper prints of Fig. 9."""

CollisionResults = Results[CollisionSettings, CollisionRow, CollisionLine]


def prepared(settings: CollisionSettings) -> CollisionSettings:
    """The settings with the scenes that are used."""
    encounter = with_available_scenes(settings.encounter)
    return settings.model_copy(update={"encounter": encounter})


def picture(results: CollisionResults) -> Figure:
    """Draw the probability of a collision over the share of radios, by method."""
    settings, table = results.settings, results.table
    shown = _shown(settings)
    figure = Figure(figsize=(5.5, 4.0), layout="constrained")
    axes = figure.subplots()
    lines = [line for line in table if (line.kind, line.M, line.loss) == (shown, 10, 0.0)]
    none = next(line for line in lines if line.method == Method.NONE.value)
    for method in settings.methods:
        mine = [none, *(line for line in lines if line.method == method.value)]
        shares = np.array([line.share_with_radio for line in mine])
        p, low, high = np.array([(line.p_collision, line.low_95, line.high_95) for line in mine]).T
        label = method.value.upper()
        axes.errorbar(shares, p, [p - low, high - p], marker="o", capsize=3, label=label)
        if method is settings.methods[-1]:
            alarm = [line.paper_alarm_p_collision for line in mine]
            axes.plot(shares, alarm, "k--", label=f"{label}, the paper's alarm")
            no_radio = np.array([line.outcome_no_radio / line.events for line in mine])
            bound = np.where(shares > 0.0, no_radio, p)
            axes.plot(shares, bound, "k:", label="no car to be warned")
    paper = _paper_reduction(settings)
    if paper is not None and Method.MVS in settings.methods:
        at = none.p_collision * (1.0 - paper)
        axes.plot([MOST_COMPARED], [at], "k*", markersize=12, label=f"paper: -{paper:.1%}")
    axes.set_xlabel("share of cars with a radio")
    axes.set_ylabel("probability of a collision")
    axes.set_ylim(0.0, 1.0)
    axes.legend()
    return figure


def summary(results: CollisionResults) -> str:
    """What MVS avoids at the share of which the paper gives a number."""
    settings = results.settings
    shown = _shown(settings)
    line = next(
        (
            line
            for line in results.table
            if (line.kind, line.method, line.share_with_radio, line.M, line.loss)
            == (shown, Method.MVS.value, MOST_COMPARED, 10, 0.0)
        ),
        None,
    )
    if line is None:
        return f"{len(results.rows)} runs"
    if math.isnan(line.reduction):
        return f"no event ends in a crash without radios ({line.events} events)"
    paper = _paper_reduction(settings)
    text = f"at {MOST_COMPARED:.0%} MVS reduces crashes by {line.reduction:.1%}"
    text += f" ({line.reduction_low_95:.0%} to {line.reduction_high_95:.0%}, {line.pairs} pairs)"
    text += f" of {line.avoidable:.0%} that can be avoided"
    text += f", of the two cars alone {line.two_cars_reduction:.1%}"
    return text if paper is None else f"{text} (paper: {paper:.1%})"


def _paper_reduction(settings: CollisionSettings) -> float | None:
    """What the paper prints for the scene of a campaign; None for several."""
    scenes = settings.encounter.scenes
    return PAPER_REDUCTION.get(scenes[0]) if len(scenes) == 1 else None


def _shown(settings: CollisionSettings) -> str:
    """Kind of events of figure and summary."""
    return "both" if len(settings.kinds) > 1 else settings.kinds[0].value


STUDY = Study(
    name="mvs-figure9",
    sentence="How many crashes each method avoids, by the share of cars with a radio.",
    settings=CollisionSettings,
    prepare=prepared,
    axes=axes,
    repeat=lambda settings: settings.runs,
    case=CollisionCase,
    run=run,
    row=CollisionRow,
    table=table,
    line=CollisionLine,
    picture=picture,
    summary=summary,
)
