"""The MVS paper's Fig. 3: probability that a red-light runner crashes, with plain DSRC."""

from dataclasses import replace

from pydantic import Field

from sim_rig.roads.events import TrafficEventKind
from sim_rig.scenario.setting_types import Several, Share
from sim_rig.studies.mvs import mvs_figure9_study
from sim_rig.studies.mvs.collisions import CollisionSettings
from sim_rig.studies.mvs.encounter import Method
from sim_rig.studies.mvs.mvs_figure9_study import CollisionResults


class Figure3Settings(CollisionSettings):
    """Fig. 3: red-light runners and plain DSRC."""

    runs: int = Field(1000, ge=1)
    kinds: Several[TrafficEventKind] = (TrafficEventKind.RED_LIGHT,)
    shares: Several[Share] = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
    methods: Several[Method] = (Method.DSRC,)
    compared_at: float | None = None


def summary(results: CollisionResults) -> str:
    """The collision probabilities without radios and at the largest share."""
    first, last = results.table[0], results.table[-1]
    return (
        f"P(collision) {first.p_collision:.2f} without radios,"
        f" {last.p_collision:.2f} at a share of {last.share_with_radio:g}"
    )


STUDY = replace(
    mvs_figure9_study.STUDY,
    name="mvs-figure3",
    sentence="How many red-light runners crash in spite of BSMs, by the share of radios.",
    settings=Figure3Settings,
    summary=summary,
)
