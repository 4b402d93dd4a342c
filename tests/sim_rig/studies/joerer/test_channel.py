"""Beacons of the paper's crossing over the 802.11p channel, on small samples."""

import csv
from pathlib import Path

import numpy as np
import pytest

from sim_rig.studies.campaigns.campaign import Workers
from sim_rig.studies.campaigns.catalogue import run_study
from sim_rig.studies.joerer.joerer_channel_study import (
    STUDY,
    JoererChannelSettings,
    beacons_of_channel,
    houses,
)
from sim_rig.studies.joerer.radio import BeaconSettings, is_received
from sim_rig.studies.joerer.traffic import Approaches, TrafficSettings, simulate_approaches

SMALL = JoererChannelSettings(
    traffic=TrafficSettings(approaches=120),
    start_m=((60.0, 110.0), (100.0, 150.0)),
    houses_from_m=(None, 10.0),
    radio=BeaconSettings(intervals_s=(0.5, 0.1)),
    other_stations=(0, 4),
    channel_crashes=2,
)


@pytest.fixture(scope="module")
def approaches() -> Approaches:
    traffic = TrafficSettings(approaches=6, start_m=(60.0, 90.0))
    return simulate_approaches(traffic, np.random.default_rng(4))


def share_received(approaches: Approaches, houses_from_m: float | None, others: int = 0) -> float:
    rng = np.random.default_rng(1)
    return beacons_of_channel(SMALL, approaches, houses_from_m, others, rng)[1][0.1]


@pytest.mark.parametrize(
    "distance_m", [(5.0, 300.0), (20.0, 20.0), (40.0, 40.0), (-60.0, 60.0), (12.0, 150.0)]
)
def test_houses_have_the_loss_of_table_2(distance_m: tuple[float, float]) -> None:
    """A power that just suffices with the houses of `is_received` is their loss."""
    at = np.array(distance_m)
    positions = np.array([[-at[0], 0.0]]), np.array([[0.0, -at[1]]])
    loss_db = sum(float(each.loss_db(*positions)[0]) for each in houses(10.0, 30.0))
    free_db = 20.0 * np.log10(4.0 * np.pi * np.hypot(*at) * 5.89e9 / 299_792_458)
    needed_w = 10 ** ((free_db + loss_db - 94.0) / 10) / 1e3

    assert is_received(at, BeaconSettings(transmit_power_w=needed_w * 1.01))
    assert not is_received(at, BeaconSettings(transmit_power_w=needed_w * 0.99))


def test_houses_at_the_corner_and_fading_lose_beacons(approaches: Approaches) -> None:
    in_the_open, between_houses = (share_received(approaches, each) for each in (None, 5.0))

    assert 0.5 < in_the_open < 1.0
    assert between_houses < in_the_open


def test_every_beacon_is_received_without_loss(approaches: Approaches) -> None:
    strong = SMALL.channel.model_copy(update={"nakagami_m": None, "data_rate_mbit_s": 3})
    settings = SMALL.model_copy(update={"channel": strong})

    beacons, share = beacons_of_channel(settings, approaches, None, 0, np.random.default_rng(1))

    # Frames overlap now and then: each car sends those of two intervals.
    assert share[0.1] > 0.97
    assert set(beacons[0.1].car.tolist()) == set(range(2 * len(approaches.end_s)))
    assert np.all(np.diff(beacons[0.1].car) >= 0)


@pytest.mark.long
def test_one_row_has_the_result_that_it_has_in_the_campaign(tmp_path: Path) -> None:
    run_study("joerer-channel", tmp_path, None, Workers(), SMALL.model_dump(mode="json"))

    with (tmp_path / "table.csv").open() as file:
        table = list(csv.DictReader(file))
    assert len(table) == 2 * 2 * 2 + 2 * 2 * 2
    assert {row["start_from_m"] for row in table if row["radio"] == "802.11p"} == {"60"}
    assert {row["cars"] for row in table if row["radio"] == "802.11p"} == {"4"}
    assert float(table[0]["crash_percent"]) == pytest.approx(
        STUDY.one(SMALL, 0).rows[0].crash_percent, abs=1e-3
    )
    assert (tmp_path / "figure.png").stat().st_size > 10_000
