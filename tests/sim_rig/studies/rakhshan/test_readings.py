"""Readings of what the paper leaves open, and the tables of the paper, on small samples."""

import csv
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from onboard.settings import SettingsError, parse_settings
from sim_rig.studies.campaigns.campaign import Workers
from sim_rig.studies.campaigns.catalogue import run_study
from sim_rig.studies.rakhshan import rakhshan_table1_study, rakhshan_table2_study
from sim_rig.studies.rakhshan.best_access import RakhshanSettings
from sim_rig.studies.rakhshan.highway import (
    Drops,
    Labels,
    RakhshanHighwaySettings,
    collision_share,
    collision_share_with_perfect_radio,
    collision_share_without_radio,
    delay_s,
    draw,
    road_interference,
)
from sim_rig.studies.rakhshan.iterated import iterated_collision_share, iterated_delay_s
from sim_rig.studies.rakhshan.rakhshan_readings_study import (
    CHOICES,
    RANGES,
    REPEATED,
    STUDY,
    ReadingRow,
    ReadingsSettings,
    RepeatedRow,
    has_papers_optimum,
    has_papers_reduction,
    reading,
)
from tests.typed import a

FEW = ReadingsSettings(runs=4, drops=6, repeated=1, repeated_drops=6, access=(0.01, 0.05))


def drawn(count: int = 20, **changes: object) -> tuple[RakhshanHighwaySettings, Drops]:
    settings = RakhshanHighwaySettings.model_validate(changes)
    return settings, draw(settings, count, np.random.default_rng(3))


def read_table(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"slots_per_packet": 200.0},
        {"slots_per_packet": 50.0, "random_waits": True, "synchronous": False},
    ],
)
def test_one_iteration_is_as_long_as_labels_that_stay(changes: dict[str, Any]) -> None:
    settings, drops = drawn(iteration_s=1000.0, **changes)

    iterated = iterated_delay_s(settings, drops, road_interference(settings, drops), (0.03, 0.03))

    assert iterated == pytest.approx(delay_s(settings, drops, 0.03))


def test_iterations_do_not_matter_if_all_labels_send_alike() -> None:
    settings, drops = drawn(iteration_s=0.25, slots_per_packet=200.0)
    access = np.array([0.03])

    share = iterated_collision_share(settings, drops, access, access)

    assert share == pytest.approx(collision_share(settings, drops, access, access))


def test_labels_that_are_renewed_change_the_delay() -> None:
    settings, drops = drawn(iteration_s=0.25, slots_per_packet=200.0)
    once = settings.model_copy(update={"iteration_s": 1000.0})
    interference = road_interference(settings, drops)

    often_s, once_s = (
        iterated_delay_s(each, drops, interference, (0.01, 0.1)) for each in (settings, once)
    )

    assert not np.allclose(often_s, once_s)


def test_iterations_without_a_length_are_an_error() -> None:
    settings, drops = drawn(1)

    with pytest.raises(ValueError, match="iteration_s"):
        iterated_delay_s(settings, drops, road_interference(settings, drops), (0.1, 0.1))


def test_who_knows_the_reaction_time_labels_those_that_collide() -> None:
    """Without radio, and with one deceleration for all: late is who reacts after the headway."""
    _, drops = drawn(
        labels=Labels.KNOWN_REACTION, deceleration_low_m_s2=5.0, deceleration_high_m_s2=5.0
    )

    assert np.array_equal(drops.unsafe[..., 1:], drops.reaction_s[..., 1:] > drops.lag_s[..., 1:])


def test_short_gaps_of_slow_drivers_are_unsafe() -> None:
    settings, drops = drawn(labels=Labels.GAP_AND_REACTION)

    assert drops.gap_m[drops.unsafe].max() < settings.mean_gap_m
    slow = drops.usual_log_reaction
    assert slow[drops.unsafe].min() > slow.min()
    assert 0.05 < drops.unsafe.mean() < 0.5


@pytest.mark.parametrize(("label", "expected"), [("safe", False), ("unsafe", True)])
def test_the_first_car_has_its_own_label(label: str, expected: bool) -> None:
    _, drops = drawn(first_car=label)

    assert (drops.unsafe[..., 0] == expected).all()


def test_all_cars_can_brake_alike() -> None:
    _, drops = drawn(common_deceleration=True)

    assert (np.ptp(drops.braking_m_s2, axis=(1, 2)) == 0.0).all()


def test_lanes_that_do_not_brake_have_no_collisions() -> None:
    _, all_brake = drawn(100)
    _, one_brakes = drawn(100, one_lane_brakes=True)

    share = collision_share_without_radio(one_brakes).mean()
    assert share == pytest.approx(collision_share_without_radio(all_brake).mean() / 4, rel=0.1)


@pytest.mark.parametrize("one_lane", [False, True])
def test_pile_ups_add_collisions(one_lane: bool) -> None:
    _, without = drawn(100, one_lane_brakes=one_lane)
    _, with_pile_ups = drawn(100, one_lane_brakes=one_lane, pile_ups=True)

    fewer, more = (collision_share_with_perfect_radio(each) for each in (without, with_pile_ups))

    assert (more >= fewer).all()
    assert more.mean() > 1.02 * fewer.mean()


def test_readings_are_in_range_and_each_number_has_its_own() -> None:
    readings = [reading(FEW, number) for number in range(64)]

    for name, (low, high) in RANGES.items():
        values = [getattr(each, name) for each in readings[1::2]]
        assert low <= min(values) < max(values) <= high
    for name, choices in CHOICES.items():
        assert {getattr(each, name) for each in readings} == set(choices)
    assert {each.slots_per_packet for each in readings[::2]} == {1.0}
    assert readings[5] == reading(FEW.model_copy(update={"runs": 100}), 5)
    assert len({each.model_dump_json() for each in readings}) == len(readings)


@pytest.mark.parametrize(
    ("change", "optimum", "reduction"),
    [
        ({}, True, True),
        ({"equal_access": 0.03}, False, True),
        ({"reduction": 0.19}, True, False),
        ({"safe_access": 0.05}, True, False),
        ({"unsafe_access": 0.02}, True, False),
    ],
)
def test_what_agrees_with_the_paper(
    change: dict[str, float], optimum: bool, reduction: bool
) -> None:
    row = replace(
        ReadingRow(
            unsafe_share=0.3,
            without_radio=0.5,
            least_with_equal_access=0.4,
            at_papers_optimum=0.4,
            equal_access=0.05,
            safe_access=0.01,
            unsafe_access=0.1,
            reduction=0.2,
            error_95=0.05,
            perfect_radio=0.02,
        ),
        **change,
    )

    assert (has_papers_optimum(row), has_papers_reduction(row)) == (optimum, reduction)


@pytest.mark.long
def test_one_command_writes_readings_repeated_ones_and_a_figure(tmp_path: Path) -> None:
    given = FEW.model_dump(mode="json")

    summary = run_study("rakhshan-readings", tmp_path, None, Workers(), given)

    table = read_table(tmp_path / "table.csv")
    assert [row["reading"] for row in table] == ["0", "1", "2", "3"]
    assert float(table[3]["reduction"]) == pytest.approx(STUDY.one(FEW, 3).reduction, abs=1e-5)
    repeated = read_table(tmp_path / "repeated/table.csv")
    assert len(repeated) == 2
    again = a(RepeatedRow, REPEATED.one(FEW, int(repeated[0]["reading"])))
    assert float(repeated[0]["reduction_at_random"]) == pytest.approx(
        again.reduction_at_random, abs=1e-5
    )
    assert (tmp_path / "figure.png").stat().st_size > 10_000
    assert summary.count("of 2 readings") == 2


def test_access_probabilities_must_contain_the_papers() -> None:
    with pytest.raises(SettingsError, match=r"access: 0.05 must be one of them"):
        parse_settings({"access": [0.01, 0.1]}, ReadingsSettings, "readings")


@pytest.mark.long
def test_an_interrupted_search_resumes(tmp_path: Path) -> None:
    STUDY.write(tmp_path / "once", FEW, Workers())
    STUDY.write(tmp_path / "twice", FEW.model_copy(update={"runs": 2}), Workers())
    STUDY.write(tmp_path / "twice", FEW, Workers())

    assert read_table(tmp_path / "once/table.csv") == read_table(tmp_path / "twice/table.csv")


def test_table_1_divides_the_collisions_by_kind(tmp_path: Path) -> None:
    settings = RakhshanSettings(drops=60)

    rakhshan_table1_study.STUDY.write(tmp_path, settings, Workers())

    table = {(row["information"], row["cars"]): row for row in read_table(tmp_path / "table.csv")}
    drops = draw(settings.highway, 50, np.random.default_rng(settings.seed))
    lights, radio = table["brake lights only", "all"], table["radio without delay", "all"]
    assert float(lights["percent"]) / 100 == pytest.approx(
        collision_share_without_radio(drops).mean(), abs=0.03
    )
    assert float(radio["percent"]) < float(lights["percent"])
    by_kind = [float(lights[f"collision_{kind}_percent"]) for kind in (1, 2, 3, 4)]
    assert sum(by_kind) == pytest.approx(float(lights["percent"]), abs=1e-3)
    assert table["brake lights only", "car 1"]["percent"] == table["radio", "car 1"]["percent"]


def test_table_2_has_a_row_for_each_data_rate(tmp_path: Path) -> None:
    few = RakhshanSettings(drops=4, access=(0.01, 0.03))
    rakhshan_table2_study.STUDY.write(tmp_path, few, Workers())

    table = read_table(tmp_path / "table.csv")
    assert [float(row["data_rate_mbit_s"]) for row in table] == [3, 4.5, 6, 9, 12, 18, 24]
    assert [float(row["threshold_db"]) for row in table] == [5, 6, 8, 11, 15, 20, 25]
