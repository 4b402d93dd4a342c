"""Fig. 9 and Fig. 3 of the MVS paper, in small campaigns, and the functions behind them."""

import csv
import gzip
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from onboard.errors import UserError
from onboard.risk.settings import ImaSettings, RiskSettings
from sim_rig.roads.cars import Cars
from sim_rig.roads.crashes import Crash
from sim_rig.roads.driver import ReactionSettings
from sim_rig.roads.events import TrafficEventKind
from sim_rig.studies.campaigns.campaign import CampaignError, Workers
from sim_rig.studies.campaigns.catalogue import run_study
from sim_rig.studies.mvs import events, scenes
from sim_rig.studies.mvs.collision_table import changed
from sim_rig.studies.mvs.collisions import (
    CollisionSettings,
    SimulatedRun,
    SkippedRun,
    encounter_cases,
)
from sim_rig.studies.mvs.encounter import EncounterCase, Encounters, EncounterSettings, Method
from sim_rig.studies.mvs.events import EventSample
from sim_rig.studies.mvs.mvs_figure9_study import STUDY
from sim_rig.studies.mvs.outcomes import CrashOutcome, CrashPair
from sim_rig.studies.mvs.profiles import WORLD_PROFILES
from sim_rig.studies.mvs.scenes import SceneName
from tests.sim_rig.roads.lane_trace import write_lane

ENCOUNTER = EncounterSettings(
    scenes=(SceneName.OWN_CROSSING,), warm_s=0.5, watched_s=1.5, after_s=4.0, near_m=20.0
)
SMALL = CollisionSettings(
    runs=1, shares=(0.2,), methods=(Method.DSRC, Method.MVS), compared_at=None, encounter=ENCOUNTER
)


def test_crashes_are_compared_seed_by_seed() -> None:
    def rows(
        *crashes: bool, kind: TrafficEventKind = TrafficEventKind.RED_LIGHT
    ) -> list[SkippedRun]:
        return [
            SkippedRun(
                scene="city",
                kind=kind,
                method=Method.DSRC,
                share=0.1,
                entries=10,
                loss=0.0,
                seed=seed,
                pair=None,
                pair_radios=None,
                probability=1.0,
                weight=1.0,
                crash=crash,
                outcome=None,
            )
            for seed, crash in enumerate(crashes)
        ]

    assert changed(rows(True, True, False), rows(False, True, True)) == (1, 1, [1, 0, -1])
    brakes, lights = rows(True, kind=TrafficEventKind.SUDDEN_BRAKE), rows(False)
    assert changed([*brakes, *lights], [*brakes, *lights]) == (0, 0, [0, 0])


@pytest.mark.long
def test_every_case_has_the_same_event_for_one_seed() -> None:
    """A run without radios does not depend on the other cases of the campaign."""
    of_a_seed = encounter_cases(SMALL)
    other = SMALL.model_copy(update={"shares": (0.1, 0.3)})

    assert [case.method for case in of_a_seed] == [
        *(2 * [Method.NONE, *(4 * [Method.DSRC]), *(4 * [Method.MVS])])
    ]
    first = STUDY.one(SMALL, 0)
    assert first.method == "none"
    assert first == STUDY.one(other, 0)
    assert STUDY.one(SMALL, len(of_a_seed)).seed == SMALL.seed + 1


CRASH = Crash(5.0, ("ann", "bob"), 8.0, 0.0)
OTHERS = Crash(5.5, ("bob", "cid"), 8.0, 0.0)


@pytest.mark.parametrize(
    ("crash", "known", "warned", "equipped", "outcome"),
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
    crash: Crash | None, known: bool, warned: bool, equipped: set[str], outcome: CrashOutcome
) -> None:
    """Ann brakes; only Bob, behind her, can avoid the crash."""
    pair = CrashPair(CRASH, ["bob"])
    cars = platoon_of("ann", "bob")
    if known:
        pair.receive_perceived("bob", cars.middle_m[:1] + 1.0, cars)
    if warned:
        pair.receive_warning("bob", 3.5)

    assert pair.outcome(crash, equipped) is outcome
    assert pair.lead_times_s() == (3.0 if known else None, 1.5 if warned else None)


def platoon_of(*names: str) -> Cars:
    n = len(names)
    middle = np.array([[-20.0 * i, 0.0] for i in range(n)])
    return Cars(2.0, names, middle, *np.zeros((3, n)), *np.full((2, n), 2.0))


@pytest.mark.long
def test_events_that_radios_cannot_change_count_as_without_radios() -> None:
    """Neither car of the crash has a radio, so a skipped run has the result of a run."""
    settings = SMALL.model_copy(update={"shares": (0.001,), "methods": (Method.DSRC,), "seed": 4})
    some = settings.model_copy(update={"unaffected_every": 100})

    rows = [STUDY.one(each, number) for each in (settings, some) for number in (1, 6)]

    assert all(row.pair_radios == (False, False) for row in rows)
    assert [row.weight for row in rows] == [row.probability for row in rows[:2]] + [0, 0]
    assert [row.crash for row in rows[:2]] == [row.crash for row in rows[2:]]
    assert [row.outcome for row in rows[:2]] == [row.outcome for row in rows[2:]]


@pytest.mark.long
def test_each_way_in_which_the_two_cars_have_radios_counts_with_its_probability() -> None:
    """The red light of this seed ends in a crash without radios, the braking does not."""
    settings = SMALL.model_copy(update={"methods": (Method.DSRC,), "seed": 4})
    none, crash = ([STUDY.one(settings, number) for number in range(n, n + 4)] for n in (1, 6))

    assert [row.probability for row in none] == [1.0, 0.0, 0.0, 0.0]
    assert [row.probability for row in crash] == pytest.approx([0.64, 0.16, 0.16, 0.04])
    assert [row.outcome for row in crash].count(CrashOutcome.NO_RADIO) == 1
    assert len({row.pair for row in crash}) == 1
    assert [isinstance(row, SimulatedRun) for row in [*crash, *none]] == [True] * 5 + [False] * 3


@pytest.mark.long
def test_figure_9_is_written(tmp_path: Path) -> None:
    path = tmp_path / "small.yaml"
    path.write_text(
        "runs: 1\nshares: [0.1]\nmethods: [dsrc, mvs]\ncompared_at: null\n"
        "encounter:\n"
        "  {scenes: [own-crossing], warm_s: 0.5, watched_s: 0.5, after_s: 3.0, near_m: 20}\n"
    )

    summary = run_study("mvs-figure9", tmp_path / "out", path, Workers())

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
    assert summary


@pytest.mark.long
def test_without_a_crash_no_reduction_is_stated(tmp_path: Path) -> None:
    """One second after sudden braking no car has reached the braking car."""
    settings = SMALL.model_copy(
        update={
            "kinds": (TrafficEventKind.SUDDEN_BRAKE,),
            "shares": (0.4,),
            "methods": (Method.MVS,),
            "encounter": ENCOUNTER.model_copy(
                update={"watched_s": 0.5, "after_s": 1.0, "near_m": 10.0}
            ),
        }
    )

    assert (
        STUDY.write(tmp_path, settings, Workers())
        == "no event ends in a crash without radios (1 events)"
    )


@pytest.mark.long
def test_figure_3_is_written(tmp_path: Path) -> None:
    encounter = {"scenes": ["own-crossing"], "warm_s": 0.5, "watched_s": 0.5, "near_m": 40.0}

    given = {"runs": 1, "shares": [0.1], "encounter": encounter}
    summary = run_study("mvs-figure3", tmp_path, None, Workers(), given)

    assert summary.startswith("P(collision)")
    with (tmp_path / "table.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["kind"], row["method"]) for row in rows] == [
        ("red_light", "none"),
        ("red_light", "dsrc"),
    ]
    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.long
def test_the_papers_alarm_is_evaluated_in_the_same_run() -> None:
    """Both cars have a radio; then the red-light runner has none, and no alarm is possible."""
    scene = Encounters(
        ENCOUNTER.model_copy(update={"warm_s": 0.6, "watched_s": 2.5, "near_m": 20.0})
    )
    equipped_runner, unequipped_runner = (
        scene.run(EncounterCase(TrafficEventKind.RED_LIGHT, Method.DSRC, 0.1, pair_radios=pair), 0)
        for pair in ((True, True), (True, False))
    )

    assert equipped_runner.known_before_s is not None
    assert equipped_runner.paper_alarm_before_s is not None
    assert 0.0 < equipped_runner.paper_alarm_before_s <= equipped_runner.known_before_s
    assert equipped_runner.paper_alarm_crash is None
    assert equipped_runner.paper_alarm_false > equipped_runner.false_warnings
    assert unequipped_runner.crash_outcome is CrashOutcome.UNKNOWN
    assert unequipped_runner.paper_alarm_before_s is None
    assert unequipped_runner.paper_alarm_crash == unequipped_runner.crash
    assert (equipped_runner.paper_alarm_same_pair, unequipped_runner.paper_alarm_same_pair) == (
        False,
        True,
    )


@pytest.mark.parametrize(
    ("delay_s", "follower_has_radio", "outcome"),
    [
        (0.0, True, CrashOutcome.AVOIDED),
        (0.0, False, CrashOutcome.NO_RADIO),
        (3.0, True, CrashOutcome.TOO_LATE),
    ],
)
def test_a_warning_at_the_onset_reaches_those_who_can_act(
    tmp_path: Path, delay_s: float, follower_has_radio: bool, outcome: CrashOutcome
) -> None:
    """The first of two cars brakes."""
    reactions = ReactionSettings(distracted=1.0, warned_median_s=0.3)
    trace = write_lane(tmp_path / "lane.csv", 2)
    lane = Encounters(
        EncounterSettings(scenes=(trace,), reactions=reactions, onset_delay_s=delay_s)
    )
    brake = TrafficEventKind.SUDDEN_BRAKE
    crash = lane.run(EncounterCase(brake, Method.NONE, 0.0), seed=1).crash
    assert crash is not None
    radios = {"car0": True, "car1": follower_has_radio}
    first, second = crash.names
    pair_radios = radios[first], radios[second]

    onset = lane.run(EncounterCase(brake, Method.ONSET, 1.0, pair_radios=pair_radios), seed=1)

    assert onset.crash_outcome is outcome
    assert (onset.crash is None) == (outcome is CrashOutcome.AVOIDED)


def crossing_of_two(path: Path, settings: EncounterSettings) -> tuple[Encounters, int]:
    """Two cars cross at a right angle with 14 m/s, and the seed of an event in which they crash."""
    rows = [
        f"{at_s:.1f},{name},{x * way_m:.2f},{y * way_m:.2f},{heading_rad:.4f},14,4,2"
        for at_s in np.arange(0.0, 30.0, 0.1)
        for name, (x, y), meets_s in (("east", (1, 0), 12.0), ("north", (0, 1), 18.0))
        for way_m, heading_rad in ((14.0 * (at_s - meets_s), y * np.pi / 2.0),)
    ]
    path.write_text("\n".join(["t,id,x,y,heading,v,length,width", *rows]))
    crossing = Encounters(settings.model_copy(update={"scenes": (path,)}))
    case = EncounterCase(TrafficEventKind.RED_LIGHT, Method.NONE, 0.0)
    return crossing, next(seed for seed in range(6) if crossing.run(case, seed).crash is not None)


def test_a_warning_of_the_crash_before_the_event_begins_is_right(tmp_path: Path) -> None:
    """The event begins some 4 s before two cars meet; thresholds this low warn before that."""
    risk = RiskSettings(ima=ImaSettings(caution_p_c=0.01, warning_p_c=0.02))
    crossing, seed = crossing_of_two(
        tmp_path / "crossing.csv", EncounterSettings(warm_s=2.0, watched_s=0.5, risk=risk)
    )
    both = EncounterCase(TrafficEventKind.RED_LIGHT, Method.DSRC, 1.0, pair_radios=(True, True))

    outcome = crossing.run(both, seed)

    assert outcome.false_warnings == 0
    assert outcome.first_warning_s is not None
    assert outcome.first_warning_s < 0.0


@pytest.mark.parametrize(
    ("profile", "other_has_radio", "outcome"),
    [
        ("all-round-60", False, CrashOutcome.AVOIDED),
        ("plate-camera", False, CrashOutcome.UNKNOWN),
        ("plate-camera", True, CrashOutcome.AVOIDED),
    ],
)
def test_an_oracle_warns_of_what_the_sensors_have_in_view(
    tmp_path: Path, profile: str, other_has_radio: bool, outcome: CrashOutcome
) -> None:
    """Both are 45 degrees aside of each other, which a lens for plates does not see."""
    reactions = ReactionSettings(warned_median_s=0.3)
    settings = EncounterSettings(world=WORLD_PROFILES[profile], reactions=reactions)
    crossing, seed = crossing_of_two(tmp_path / "crossing.csv", settings)
    radios = True, other_has_radio
    case = EncounterCase(TrafficEventKind.RED_LIGHT, Method.IN_VIEW, 1.0, pair_radios=radios)

    assert crossing.run(case, seed).crash_outcome is outcome


@pytest.mark.long
def test_a_car_that_reaches_the_event_later_has_a_radio() -> None:
    scene = Encounters(ENCOUNTER.model_copy(update={"near_m": 20.0}))
    all_cars = EncounterCase(TrafficEventKind.RED_LIGHT, Method.DSRC, 1.0)

    for seed in (0, 4, 8):
        crash, _ = scene.without_radios(all_cars, seed)
        of = scene.event(TrafficEventKind.RED_LIGHT, seed)
        cars = of.recording.cars_at(of.event.at_s - ENCOUNTER.warm_s)
        equipped = scene._equipped(all_cars, seed, cars, of)

        assert crash is not None
        assert set(crash.names) <= equipped
        assert len(equipped) < len(cars)


def test_traffic_may_be_a_users_file(tmp_path: Path) -> None:
    trace = write_lane(tmp_path / "lane.csv", 2)
    settings = SMALL.model_copy(
        update={
            "kinds": (TrafficEventKind.SUDDEN_BRAKE,),
            "shares": (1.0,),
            "encounter": ENCOUNTER.model_copy(update={"scenes": (trace,)}),
        }
    )
    rows_of = [STUDY.one(settings, number) for number in (0, 4, 8)]

    assert [row.method for row in rows_of] == ["none", "dsrc", "mvs"]
    assert all(isinstance(row, SimulatedRun) and row.messages for row in rows_of[1:])


@pytest.mark.long
def test_a_study_whose_recording_is_missing_uses_sumo_throughout(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its settings state that, and it does not resume with the recording when that appears."""
    pytest.importorskip("libsumo", reason="SUMO lacks libraries", exc_type=ImportError)
    data, out = tmp_path / "data", tmp_path / "out"
    monkeypatch.setenv("RIG_DATA", str(data))
    monkeypatch.setattr(scenes, "_DRIVEN_S", 40.0)
    monkeypatch.setattr(events, "open_scene", scenes.open_scene.__wrapped__)
    settings = SMALL.model_copy(
        update={
            "kinds": (TrafficEventKind.SUDDEN_BRAKE,),
            "methods": (Method.DSRC,),
            "encounter": ENCOUNTER.model_copy(
                update={"scenes": (SceneName.CROSSING,), "watched_s": 0.5, "after_s": 1.0}
            ),
        }
    )

    STUDY.write(out, settings, Workers())

    assert "  scenes:\n  - sumo-crossing\n" in (out / "settings.yaml").read_text()
    (data / "traces").mkdir(parents=True)
    with gzip.open(data / "traces" / "crossing-signals-100-cars.csv.gz", "wt") as trace:
        trace.write("t,id,x,y,heading,v\n0,one,0,0,0,10\n0.1,one,1,0,0,10\n")
    with pytest.raises(CampaignError, match="other settings"):
        STUDY.write(out, settings, Workers())


def test_an_unknown_scene_is_an_error_that_lists_the_scenes(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"crossing, .*, city, .*a \.sumocfg, or a trace's file"):
        Encounters(EncounterSettings(scenes=(tmp_path / "none.csv",)))


def test_the_events_of_several_scenes_take_turns(tmp_path: Path) -> None:
    """In each, three cars follow each other: two pairs."""
    scenes = tuple(write_lane(tmp_path / f"{name}.csv", 3) for name in ("one", "other"))
    kind = TrafficEventKind.SUDDEN_BRAKE

    samples = [EventSample(scenes) for _ in range(2)]
    events, again = ([sample.event(kind, number) for number in range(8)] for sample in samples)

    assert all(one.source != next_one.source for one, next_one in pairwise(events))
    assert [of.event for of in events] == [of.event for of in again]
    assert {(of.source, of.event.car) for of in events[:4]} == {
        (scene, car) for scene in scenes for car in (0, 1)
    }
