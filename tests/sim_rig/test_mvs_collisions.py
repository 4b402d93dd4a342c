"""Fig. 9 and Fig. 3 of the MVS paper, small; and what their figures rest on."""

import csv
from pathlib import Path

import numpy as np
import pytest
from statsmodels.stats.proportion import proportion_confint

from onboard.errors import UserError
from sim_rig.roads.cars import Cars
from sim_rig.roads.crashes import Crash
from sim_rig.roads.events import TrafficEventKind
from sim_rig.studies.campaign import CampaignError, Workers
from sim_rig.studies.catalogue import run_study
from sim_rig.studies.mvs_collisions import (
    CollisionSettings,
    cases,
    changed,
    figure9,
    run_one,
    wilson,
)
from sim_rig.studies.mvs_encounter import EncounterCase, Encounters, EncounterSettings, Method
from sim_rig.studies.mvs_outcomes import Concerned, CrashOutcome
from sim_rig.studies.mvs_scenes import SceneName

ENCOUNTER = EncounterSettings(
    scene=SceneName.OWN_CROSSING, warm_s=0.5, watched_s=1.5, after_s=4.0, near_m=40.0
)
SMALL = CollisionSettings(
    runs=1, shares=(0.2,), methods=(Method.DSRC, Method.MVS), compared_at=None, encounter=ENCOUNTER
)


@pytest.mark.parametrize(("crashes", "runs"), [(0, 10), (3, 10), (500, 1000), (10, 10)])
def test_the_interval_is_wilsons(crashes: int, runs: int) -> None:
    p, low, high = wilson(crashes / runs, runs)

    theirs = proportion_confint(crashes, runs, method="wilson")

    assert p == crashes / runs
    assert (low, high) == pytest.approx(theirs, abs=1e-4)


def test_crashes_are_compared_seed_by_seed() -> None:
    def rows(*crashes: bool) -> list[dict[str, object]]:
        return [
            {"kind": "k", "seed": seed, "crash": c, "weight": 1} for seed, c in enumerate(crashes)
        ]

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


CRASH = Crash(5.0, ("ann", "bob"), 8.0)
OTHERS = Crash(5.5, ("bob", "cid"), 8.0)


@pytest.mark.parametrize(
    ("crash", "known", "warned", "equipped", "fate"),
    [
        (None, True, True, {"bob"}, CrashOutcome.AVOIDED),
        (OTHERS, True, True, {"bob"}, CrashOutcome.ANOTHER),
        (CRASH, False, False, {"ann", "cid"}, CrashOutcome.NO_RADIO),
        (CRASH, False, False, {"bob"}, CrashOutcome.UNKNOWN),
        (CRASH, True, False, {"bob"}, CrashOutcome.UNWARNED),
        (CRASH, True, True, {"bob"}, CrashOutcome.TOO_LATE),
    ],
)
def test_a_crash_has_one_fate(
    crash: Crash | None, known: bool, warned: bool, equipped: set[str], fate: CrashOutcome
) -> None:
    """Ann brakes; Bob behind her is the one who can do something."""
    concerned = Concerned(CRASH, ["bob"])
    cars = platoon_of("ann", "bob")
    if known:
        concerned.receive_known("bob", cars.middle_m[:1] + 1.0, cars)
    if warned:
        concerned.receive_warning("bob", 3.5)

    assert concerned.fate(crash, equipped) is fate
    assert concerned.before_s() == (3.0 if known else None, 1.5 if warned else None)


def platoon_of(*names: str) -> Cars:
    n = len(names)
    middle = np.array([[-20.0 * i, 0.0] for i in range(n)])
    return Cars(2.0, names, middle, *np.zeros((3, n)), *np.full((2, n), 2.0))


def test_calm_events_are_counted_as_without_radios(tmp_path: Path) -> None:
    """Nobody has a radio in any of them, so what is not run gives what it would have given."""
    settings = SMALL.model_copy(update={"shares": (0.001,), "methods": (Method.DSRC,)})
    some = settings.model_copy(update={"calm_every": 100})

    rows = [run_one(each, number) for each in (settings, some) for number in (1, 3)]

    assert [row["weight"] for row in rows] == [1, 1, 0, 0]
    assert [row["crash"] for row in rows[:2]] == [row["crash"] for row in rows[2:]]
    assert [row["fate"] for row in rows[:2]] == [row["fate"] for row in rows[2:]]


def test_figure_9_is_written(tmp_path: Path) -> None:
    path = tmp_path / "small.yaml"
    path.write_text(
        "runs: 1\nshares: [0.1]\nmethods: [dsrc, mvs]\ncompared_at: null\n"
        "encounter: {scene: own-crossing, warm_s: 0.5, watched_s: 1.0, near_m: 40.0}\n"
    )

    told = run_study("mvs-figure9", tmp_path / "out", path, Workers())

    with (tmp_path / "out/table.csv").open() as file:
        columns = next(file).strip().split(",")
        rows = list(csv.DictReader(file, columns))
    assert len(set(columns)) == len(columns)
    assert {(row["kind"], row["method"]) for row in rows} == {
        (kind, method)
        for kind in ("both", *(kind.value for kind in TrafficEventKind))
        for method in ("none", "dsrc", "mvs")
    }
    assert (tmp_path / "out/figure.png").read_bytes().startswith(b"\x89PNG")
    assert told


def test_where_nobody_crashes_nothing_is_said_to_be_reduced(tmp_path: Path) -> None:
    """A second after a sudden brake nobody has run into the car yet."""
    settings = SMALL.model_copy(
        update={
            "kinds": (TrafficEventKind.SUDDEN_BRAKE,),
            "shares": (0.4,),
            "methods": (Method.MVS,),
            "encounter": ENCOUNTER.model_copy(update={"watched_s": 0.5, "after_s": 1.0}),
        }
    )

    assert figure9(tmp_path, settings) == "no event ends in a crash without radios (1 events)"


def test_figure_3_is_written(tmp_path: Path) -> None:
    encounter = {"scene": "own-crossing", "warm_s": 0.5, "watched_s": 0.5, "near_m": 40.0}

    given = {"runs": 1, "shares": [0.1], "encounter": encounter}
    told = run_study("mvs-figure3", tmp_path, None, Workers(), given)

    assert told.startswith("P(collision)")
    with (tmp_path / "table.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["kind"], row["method"]) for row in rows] == [
        ("red_light", "none"),
        ("red_light", "dsrc"),
    ]
    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")


def test_the_papers_alarm_is_judged_in_the_same_run() -> None:
    """One runner is heard of; of another nobody hears, and no alarm changes that."""
    scene = Encounters(
        ENCOUNTER.model_copy(update={"warm_s": 0.6, "watched_s": 2.5, "near_m": 20.0})
    )
    half = EncounterCase(TrafficEventKind.RED_LIGHT, Method.DSRC, 0.5)

    heard, unknown = scene.run(half, 6), scene.run(half, 2)

    assert heard.known_before_s is not None
    assert heard.straight_on_before_s is not None
    assert 0.0 < heard.straight_on_before_s <= heard.known_before_s
    assert heard.straight_on_crash is None
    assert heard.straight_on_false > heard.false_warnings
    assert unknown.fate is CrashOutcome.UNKNOWN
    assert unknown.straight_on_before_s is None
    assert unknown.straight_on_crash == unknown.crash
    assert (heard.straight_on_these_two, unknown.straight_on_these_two) == (False, True)


def test_who_will_be_there_has_a_radio_though_he_is_far_when_the_event_begins() -> None:
    scene = Encounters(ENCOUNTER.model_copy(update={"near_m": 20.0}))
    everybody = EncounterCase(TrafficEventKind.RED_LIGHT, Method.DSRC, 1.0)

    for seed in range(4):
        crash, _ = scene.without_radios(everybody, seed)
        event = scene._event(TrafficEventKind.RED_LIGHT, seed)
        cars = scene.recording.cars_at(event.at_s - ENCOUNTER.warm_s)
        equipped = scene._equipped(everybody, seed, cars, event)

        assert crash is not None
        assert set(crash.names) <= equipped
        assert len(equipped) < len(cars)


def test_traffic_may_be_a_file_of_ones_own(tmp_path: Path) -> None:
    """Two cars at 15 m/s, 12 m from bumper to bumper."""
    trace = tmp_path / "lane.csv"
    rows = [
        f"{at_s:.1f},{name},{15.0 * at_s - behind_m},0,0,15,4,2"
        for at_s in np.arange(0.0, 30.0, 0.1)
        for name, behind_m in (("first", 0.0), ("second", 16.0))
    ]
    trace.write_text("\n".join(["t,id,x,y,heading,v,length,width", *rows]))
    settings = SMALL.model_copy(
        update={
            "kinds": (TrafficEventKind.SUDDEN_BRAKE,),
            "shares": (1.0,),
            "encounter": ENCOUNTER.model_copy(update={"scene": trace}),
        }
    )
    rows_of = [run_one(settings, number) for number in range(3)]

    assert [row["method"] for row in rows_of] == ["none", "dsrc", "mvs"]
    assert all(row["messages"] for row in rows_of[1:])


def test_a_study_of_a_recording_that_is_missing_is_one_of_sumo_to_its_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its settings say so; and it does not go on with the recording once that is there."""
    data, out = tmp_path / "data", tmp_path / "out"
    monkeypatch.setenv("RIG_DATA", str(data))
    settings = SMALL.model_copy(
        update={
            "kinds": (TrafficEventKind.SUDDEN_BRAKE,),
            "methods": (Method.DSRC,),
            "encounter": ENCOUNTER.model_copy(update={"scene": SceneName.CROSSING}),
        }
    )

    figure9(out, settings)

    assert "  scene: sumo-crossing\n" in (out / "settings.yaml").read_text()
    (data / "traces").mkdir(parents=True)
    (data / "traces" / "crossing-signals-100-cars.csv.gz").touch()
    with pytest.raises(CampaignError, match="other settings"):
        figure9(out, settings)


def test_no_such_traffic_is_said_with_what_there_is(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"crossing, .*, city, .*a \.sumocfg, or a trace's file"):
        Encounters(EncounterSettings(scene=tmp_path / "none.csv"))
