"""Fig. 9 and Fig. 3 of the MVS paper, small; and what their figures rest on."""

import csv
from pathlib import Path

import pytest
from statsmodels.stats.proportion import proportion_confint

from sim_rig.campaign import Workers
from sim_rig.roads.events import Kind
from sim_rig.studies.catalogue import run_study
from sim_rig.studies.mvs_collisions import CollisionSettings, cases, changed, run_one, wilson
from sim_rig.studies.mvs_encounter import EncounterSettings, Method
from sim_rig.studies.mvs_scenes import Scene

ENCOUNTER = EncounterSettings(
    scene=Scene.OWN_CROSSING, warm_s=0.5, watched_s=1.5, after_s=4.0, near_m=40.0
)
SMALL = CollisionSettings(
    runs=1, shares=(0.2,), methods=(Method.DSRC, Method.MVS), compared_at=None, encounter=ENCOUNTER
)


@pytest.mark.parametrize(("crashes", "runs"), [(0, 10), (3, 10), (500, 1000), (10, 10)])
def test_the_interval_is_wilsons(crashes: int, runs: int) -> None:
    p, low, high = wilson([True] * crashes + [False] * (runs - crashes))

    theirs = proportion_confint(crashes, runs, method="wilson")

    assert p == crashes / runs
    assert (low, high) == pytest.approx(theirs, abs=1e-4)


def test_crashes_are_compared_seed_by_seed() -> None:
    def rows(*crashes: bool) -> list[dict[str, object]]:
        return [{"kind": "k", "seed": seed, "crash": c} for seed, c in enumerate(crashes)]

    assert changed(rows(True, True, False), rows(False, True, True)) == (1, 1)
    brakes, lights = rows(True), [row | {"event": "other"} for row in rows(False)]
    assert changed([*brakes, *lights], [*brakes, *lights]) == (0, 0)


def test_every_case_has_the_same_event_for_one_seed() -> None:
    """Without radios a run is the same whatever else is in the campaign."""
    of_a_seed = cases(SMALL)
    other = SMALL.model_copy(update={"shares": (0.1, 0.3)})

    assert [case.method for case in of_a_seed[:3]] == [Method.NONE, Method.DSRC, Method.MVS]
    first = run_one(SMALL, 0)
    assert first["method"] == "none"
    assert first == run_one(other, 0)
    assert run_one(SMALL, len(of_a_seed))["seed"] == SMALL.seed + 1


def test_figure_9_is_written(tmp_path: Path) -> None:
    path = tmp_path / "small.yaml"
    path.write_text(
        "runs: 1\nshares: [0.1]\nmethods: [dsrc, mvs]\ncompared_at: null\n"
        "encounter: {scene: own-crossing, warm_s: 0.5, watched_s: 1.0, near_m: 40.0}\n"
    )

    told = run_study("mvs-figure9", tmp_path / "out", path, Workers())

    with (tmp_path / "out/table.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {(row["kind"], row["method"]) for row in rows} == {
        (kind, method)
        for kind in ("both", *(kind.value for kind in Kind))
        for method in ("none", "dsrc", "mvs")
    }
    assert (tmp_path / "out/figure.png").read_bytes().startswith(b"\x89PNG")
    assert told
