"""The crossing study: statements of the paper about its figures, on small samples."""

import csv
from pathlib import Path

import numpy as np
import pytest

from sim_rig.studies.campaigns.campaign import Workers
from sim_rig.studies.joerer.criticality import (
    BEHAVIOURS,
    UNAVOIDABLE,
    Beacons,
    last_before_unavoidable,
)
from sim_rig.studies.joerer.joerer_study import STUDY, ApproachResults, JoererSettings, simulate
from sim_rig.studies.joerer.radio import BeaconSettings, is_received
from sim_rig.studies.joerer.traffic import ApproachOutcome, TrafficSettings, simulate_approaches

SMALL = JoererSettings(traffic=TrafficSettings(approaches=250, start_m=(60.0, 110.0)))


@pytest.fixture(scope="module")
def results() -> ApproachResults:
    return simulate(SMALL)


def test_the_sample_contains_crashes_and_harmless_approaches(results: ApproachResults) -> None:
    counts = np.bincount(results.approaches.outcome, minlength=3)

    assert counts[ApproachOutcome.CRASH] >= 8
    assert counts[ApproachOutcome.NO_CRASH] >= 200


@pytest.mark.parametrize("behaviour", BEHAVIOURS)
def test_every_crash_reaches_100_percent(results: ApproachResults, behaviour: str) -> None:
    highest = np.nanmax(results.p_c[behaviour], axis=1)

    assert (highest[results.approaches.outcome == ApproachOutcome.CRASH] >= UNAVOIDABLE).all()


@pytest.mark.parametrize("behaviour", BEHAVIOURS)
def test_p_c_stays_low_in_approaches_without_crash(
    results: ApproachResults, behaviour: str
) -> None:
    """The paper's limit of 40 % holds, except for cars that pass at little more than 0.4 m."""
    highest = np.nanmax(results.p_c[behaviour], axis=1)[
        results.approaches.outcome == ApproachOutcome.NO_CRASH
    ]

    assert (highest > 0.40).mean() < 0.005
    assert highest.max() < 0.45


def test_cars_that_obey_the_right_of_way_do_not_crash(results: ApproachResults) -> None:
    assert (
        results.approaches.outcome[~results.approaches.ignores_rules] == ApproachOutcome.NO_CRASH
    ).all()


def test_more_frequent_beacons_give_a_higher_p_c_at_the_last_one(results: ApproachResults) -> None:
    medians = [
        np.nanmedian(results.lbu("uniform", interval_s)) for interval_s in (1.0, 0.5, 0.1, 0.04)
    ]

    assert medians == sorted(medians)


def test_a_crash_is_an_overlap_of_the_cars() -> None:
    """Compared with the rectangles at each step of a run that records all steps."""
    traffic = TrafficSettings(approaches=120, ticks_every=1, start_m=(60.0, 70.0))
    approaches = simulate_approaches(traffic, np.random.default_rng(3))
    half_m = (traffic.length_m + traffic.width_m) / 2

    near = np.abs(approaches.distance_m) < half_m
    overlap = np.any(np.all(near, axis=2), axis=1)

    crashed = approaches.outcome == ApproachOutcome.CRASH
    assert crashed[overlap].all()
    assert crashed.sum() - overlap.sum() <= 1  # Contact for less than a step.


@pytest.mark.parametrize(
    ("distance_m", "received"),
    [
        ((5.0, 300.0), True),  # Along the road.
        ((9.0, 9.0), True),  # In front of the buildings.
        ((20.0, 20.0), True),  # 18 dB of walls and almost no distance inside.
        ((60.0, 60.0), False),
        ((-60.0, 60.0), False),  # The building at another corner.
    ],
)
def test_buildings_block_beacons(distance_m: tuple[float, float], received: bool) -> None:
    assert is_received(np.array(distance_m), BeaconSettings()) == received


def test_the_loss_of_a_building_is_that_of_table_2() -> None:
    """At 40 m each, the line of sight crosses the building from (30, 10) to (10, 30)."""
    just = BeaconSettings(transmit_power_w=0.025)
    at = np.array((40.0, 40.0))
    apart_m = np.hypot(*at)
    loss_db = 20 * np.log10(4 * np.pi * apart_m * 5.89e9 / 299_792_458) + 18 + 0.4 * 20 * np.sqrt(2)

    needed_w = 10 ** ((loss_db - 94.0) / 10) / 1e3

    assert is_received(at, just.model_copy(update={"transmit_power_w": needed_w * 1.001}))
    assert not is_received(at, just.model_copy(update={"transmit_power_w": needed_w * 0.999}))


def test_the_last_beacon_before_unavoidable_is_the_one_before_the_first_at_100_percent() -> None:
    p_c = np.array([[0.1, 0.3, 0.6, 1.0, 1.0], [0.1, 0.2, 0.2, 0.1, 0.0], [1.0] * 5])
    beacons = Beacons(car=np.array([0, 0, 0, 1, 2, 2, 4]), tick=np.array([0, 2, 4, 3, 1, 3, 2]))

    lbu = last_before_unavoidable(p_c, beacons)

    # Cars 1 and 4 received only beacons with 100 %, car 2 received none with 100 %.
    assert lbu == pytest.approx([0.6, np.nan, 0.1, np.nan, np.nan, np.nan], nan_ok=True)


@pytest.mark.long
def test_all_figures_and_the_papers_values_are_written(tmp_path: Path) -> None:
    tiny = JoererSettings(traffic=TrafficSettings(approaches=60, start_m=(60.0, 80.0)))

    summary = STUDY.write(tmp_path, tiny, Workers())

    assert "NO_CRASH" in summary
    figures = {f"figure{number}.{kind}" for number in range(5, 11) for kind in ("csv", "png")}
    others = {"figure11.png", "table3.csv", "outcomes.csv", "merging.csv", "settings.yaml"}
    assert {path.name for path in tmp_path.iterdir()} == figures | others
    with (tmp_path / "table3.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["paper_95"] for row in rows[:4]] == ["25.0", "48.0", "87.0", "95.0"]


@pytest.mark.long
def test_the_same_seed_gives_the_same_files(tmp_path: Path) -> None:
    tiny = JoererSettings(traffic=TrafficSettings(approaches=20, start_m=(60.0, 80.0)))
    for name in "ab":
        STUDY.write(tmp_path / name, tiny, Workers())

    assert (tmp_path / "a/figure6.csv").read_bytes() == (tmp_path / "b/figure6.csv").read_bytes()
