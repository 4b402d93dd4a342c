"""Chain collisions with and without LCCA, in small campaigns."""

import csv
from pathlib import Path

import pytest

from sim_rig.propagation.path_loss import LogDistance
from sim_rig.scenario.radio_settings import CsmaSettings
from sim_rig.studies.campaign import Workers
from sim_rig.studies.catalogue import run_study
from sim_rig.studies.lcca_chain import ChainSettings, cases, run_one

SMALL = ChainSettings(cars=(6,), shares=(0.0, 1.0), reaction_medians_s=(1.5,), loss=0.0)


def test_warned_platoons_have_less_than_half_of_the_crashes() -> None:
    of_a_seed = len(cases(SMALL))
    rows = [run_one(SMALL, number) for number in range(6 * of_a_seed)]

    without, with_radios = rows[::of_a_seed], rows[1::of_a_seed]

    assert sum(row["crashes"] for row in with_radios) < sum(row["crashes"] for row in without) / 2
    assert all(row["warned"] == row["warn_messages"] == 0 for row in without)
    assert all(row["warned"] == 5 for row in with_radios)


def test_flooding_takes_one_message_from_each_car() -> None:
    row = run_one(SMALL, 1)

    assert row["flooding_messages"] == 6 * row["events"]
    assert row["warn_messages"] < row["flooding_messages"]


def test_the_table_is_written(tmp_path: Path) -> None:
    path = tmp_path / "small.yaml"
    path.write_text("runs: 2\ncars: [5]\nshares: [0.0, 1.0]\nreaction_medians_s: [1.5]\n")

    summary = run_study("lcca-chain", tmp_path / "out", path, Workers())

    assert summary.startswith("5 cars:")
    with (tmp_path / "out/table.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["share_with_radio"]) for row in rows] == [0.0, 1.0]
    assert float(rows[0]["reduction"]) == pytest.approx(0.0)


def test_over_the_channel_one_message_for_each_event_warns_all_cars() -> None:
    """Without shadowing and fading no message is lost, so none is repeated."""
    over_channel = SMALL.model_copy(update={"csma": CsmaSettings(), "background_traffic": 10})

    row = run_one(over_channel, 1)

    assert row["warned"] == 5
    assert row["warn_messages"] == row["events"]
    assert row == run_one(over_channel, 1)


def test_cars_out_of_range_on_the_channel_are_not_warned() -> None:
    weak_radio = CsmaSettings(tx_power_dbm=-10.0, path_loss=LogDistance(exponent=5.0))
    over_channel = SMALL.model_copy(update={"csma": weak_radio})

    row = run_one(over_channel, 1)

    assert row["warned"] == 0
    assert row["crashes"] == run_one(SMALL, 0)["crashes"]
