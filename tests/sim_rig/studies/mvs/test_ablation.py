"""From the paper's reading to the car as shipped: the steps, and what each counts."""

import csv
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from sim_rig.roads.events import TrafficEventKind
from sim_rig.studies.campaigns.campaign import Workers
from sim_rig.studies.campaigns.catalogue import run_study
from sim_rig.studies.mvs.collision_table import changed
from sim_rig.studies.mvs.encounter import Method
from sim_rig.studies.mvs.mvs_ablation_study import AblationSettings, Driver, SimulatedStep, table
from sim_rig.studies.mvs.outcomes import CrashOutcome
from tests.sim_rig.roads.lane_trace import write_lane

SETTINGS = AblationSettings(profiles=("paper", "camera-60"))
KEYS = ("profile", "driver", "alarm", "counted")


def rows_of_step(profile: str, driver: Driver, outcomes: tuple[str, str]) -> list[SimulatedStep]:
    """Two events that crash without radios: a crossing crash, and a rear-end crash.

    `outcomes` are those of the runs in which the two cars have radios, a quarter each.
    """
    rows = []
    for kind, angle_deg, outcome in (
        (TrafficEventKind.RED_LIGHT, 90.0, CrashOutcome(outcomes[0])),
        (TrafficEventKind.SUDDEN_BRAKE, 1.0, CrashOutcome(outcomes[1])),
    ):
        before = SimulatedStep(
            scene="city",
            kind=kind,
            method=Method.NONE,
            share=0.4,
            entries=10,
            loss=0.0,
            seed=7,
            pair=f"{kind} pair",
            pair_radios=None,
            probability=1.0,
            weight=1.0,
            crash=True,
            speed_m_s=10.0,
            angle_deg=angle_deg,
            outcome=None,
            known_before_s=None,
            warned_before_s=None,
            first_warning_s=None,
            warned=0,
            false_warnings=0,
            paper_alarm_crash=False,
            paper_alarm_same_pair=False,
            paper_alarm_before_s=None,
            paper_alarm_false=0,
            driven_s=9.0,
            messages=0,
            profile=profile,
            driver=driver,
        )
        with_mvs = replace(before, method=Method.MVS)
        rows += [
            before,
            replace(with_mvs, outcome=CrashOutcome.NO_RADIO, weight=0.0, probability=0.75),
            replace(
                with_mvs,
                crash=outcome is not CrashOutcome.AVOIDED,
                outcome=outcome,
                weight=0.25,
                probability=0.25,
                false_warnings=1,
            ),
        ]
    return rows


def test_a_step_counts_what_it_says() -> None:
    """With the car's alarm, one crash becomes another one: for the two of the event, it is none."""
    rows = [
        row
        for driver in (Driver.ONSET, Driver.OBSERVER)
        for row in rows_of_step("none", driver, ("avoided", "another"))
    ] + [
        row
        for driver, outcome in (
            (Driver.IN_VIEW, "avoided"),
            (Driver.WARNED, "another"),
            (Driver.BRAKES, "avoided"),
        )
        for profile in SETTINGS.profiles
        for row in rows_of_step(profile, driver, (outcome, "too_late"))
    ]

    lines = [asdict(line) for line in table(SETTINGS, rows)]

    steps = [tuple(line[key] for key in KEYS) for line in lines if line["crashes"] == "all"]
    assert steps == [
        ("none", "onset", "at the onset", "two"),
        ("none", "onset", "at the onset", "any"),
        ("none", "observer", "observer's", "two"),
        ("none", "observer", "observer's", "any"),
        ("paper", "in_view", "once in view", "two"),
        ("paper", "in_view", "once in view", "any"),
        ("camera-60", "in_view", "once in view", "two"),
        ("camera-60", "in_view", "once in view", "any"),
        ("paper", "warned", "paper's", "two"),
        ("paper", "warned", "paper's", "any"),
        ("paper", "warned", "car's", "two"),
        ("paper", "warned", "car's", "any"),
        ("camera-60", "warned", "car's", "two"),
        ("camera-60", "warned", "car's", "any"),
        ("paper", "brakes", "car's", "any"),
        ("camera-60", "brakes", "car's", "any"),
    ]
    reductions = {
        crashes: [line["reduction"] for line in lines if line["crashes"] == crashes]
        for crashes in ("all", "crossing", "rear-end")
    }
    assert reductions["crossing"] == [*11 * [0.25], 0.0, 0.25, 0.0, 0.25, 0.25]
    assert reductions["rear-end"] == [0.25, 0.0, 0.25, 0.0, *4 * [0.0], 0.25, 0.25, *6 * [0.0]]
    assert reductions["all"][:4] == [0.25, 0.125, 0.25, 0.125]
    assert reductions["all"][4:12] == [*4 * [0.125], 0.25, 0.25, 0.125, 0.0]
    assert {line["avoidable"] for line in lines} == {0.25}
    assert {(line["false_warnings"], line["driven_h"]) for line in lines[:16]} == {(2, 0.01)}


def test_a_calm_event_in_which_others_avoid_the_crash_counts_for_those_not_run() -> None:
    """One in ten is run; `changed` of `mvs-figure9` counts it ten times."""
    settings = SETTINGS.model_copy(update={"profiles": ("paper",), "drivers": (Driver.WARNED,)})
    rows = rows_of_step("paper", Driver.WARNED, ("too_late", "too_late"))
    rows[1] = replace(rows[1], crash=False, outcome=CrashOutcome.AVOIDED, weight=7.5)

    first, *_ = [line for line in table(settings, rows) if line.alarm == "car's"]

    without = [row for row in rows if row.method is Method.NONE]
    avoided = changed(without, [row for row in rows if row.method is Method.MVS]).avoided
    assert first.reduction == avoided / len(without) == 3.75


@pytest.mark.long
def test_the_ablation_is_written(tmp_path: Path) -> None:
    """The first of two cars brakes."""
    trace = write_lane(tmp_path / "lane.csv", 2)
    given = {
        "runs": 1,
        "kinds": ["sudden_brake"],
        "share": 1.0,
        "profiles": ["camera-60"],
        "encounter": {"scenes": [str(trace)]},
    }

    summary = run_study("mvs-ablation", tmp_path / "out", None, Workers(), given)

    with (tmp_path / "out/table.csv").open() as file:
        lines = list(csv.DictReader(file))
    assert {line["driver"] for line in lines} == set(Driver)
    assert (tmp_path / "out/figure.png").read_bytes().startswith(b"\x89PNG")
    assert summary.startswith("from 100.0% (none, at the onset alarm)")
    assert "camera-60" in summary
