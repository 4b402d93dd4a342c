"""Propagation of the information about braking along a lane over the CSMA channel."""

import csv
from pathlib import Path

import numpy as np
import pytest

from sim_rig.scenario.radio_settings import CsmaSettings
from sim_rig.studies.campaigns.campaign import Workers
from sim_rig.studies.campaigns.catalogue import run_study
from sim_rig.studies.rakhshan.chain import without_radio_s
from sim_rig.studies.rakhshan.highway import draw
from sim_rig.studies.rakhshan.rakhshan_csma_study import (
    STUDY,
    ChannelTraffic,
    RakhshanCsmaSettings,
    delay_s,
)

BSM = ChannelTraffic(name="BSM", beacon_bytes=200)
LCCA = ChannelTraffic(name="LCCA", beacon_bytes=200, warns=True)
CLEAR = RakhshanCsmaSettings(channel=CsmaSettings())


def delays_s(
    settings: RakhshanCsmaSettings,
    kind: ChannelTraffic,
    interval_s: float,
    background_cars: int = 0,
) -> tuple[np.ndarray, np.ndarray]:
    """D(i) of a highway over the channel, and with brake lights only."""
    drops = draw(settings.highway, 1, np.random.default_rng(5))
    every_s = np.full(drops.reaction_s.shape[1:], interval_s)
    rng = np.random.default_rng(6)
    return delay_s(settings, drops, rng, every_s, (background_cars, kind)), without_radio_s(
        drops.reaction_s
    )


def test_without_transmit_power_only_brake_lights_inform() -> None:
    weak_radio = RakhshanCsmaSettings(
        channel=CsmaSettings(tx_power_dbm=-10.0, preamble_dbm=0.0), longest_s=60.0
    )

    by_radio, by_lights = delays_s(weak_radio, LCCA, 0.1)

    assert by_radio == pytest.approx(by_lights)


def test_beacons_inform_all_cars_within_about_an_interval() -> None:
    by_radio, by_lights = delays_s(CLEAR, BSM, 0.3)

    assert by_radio[..., :2] == pytest.approx(0.0)
    assert (by_radio <= by_lights + 1e-9).all()
    assert 0.0 < by_radio[..., 2:].max() < 0.35


def test_a_warning_informs_all_cars_at_once() -> None:
    by_radio, _ = delays_s(CLEAR, LCCA, 0.6)

    assert by_radio.max() < 0.005


def test_rarer_beacons_and_a_full_channel_inform_later() -> None:
    often, _ = delays_s(CLEAR, BSM, 0.1)
    rarely, _ = delays_s(CLEAR, BSM, 0.6)
    loaded, _ = delays_s(
        CLEAR, BSM.model_copy(update={"beacon_bytes": 1500}), 0.1, background_cars=80
    )

    assert often.mean() < rarely.mean()
    assert often.mean() < loaded.mean()


def test_a_single_run_gives_the_result_that_it_gives_in_a_campaign() -> None:
    small = RakhshanCsmaSettings(intervals_s=(0.1, 0.6), background_traffic=(0,), traffics=(BSM,))

    rows = [STUDY.one(small, number) for number in range(3)]

    assert STUDY.one(small, 2) == rows[2]
    assert rows[0] != rows[1]
    assert all(row.perfect_radio <= row.without_radio for row in rows)


@pytest.mark.long
def test_one_command_writes_table_and_figure(tmp_path: Path) -> None:
    given = {"drops": 6, "intervals_s": [0.1, 0.6], "background_traffic": [0]}

    summary = run_study("rakhshan-csma", tmp_path, None, Workers(), given)

    with (tmp_path / "table.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["traffic"] for row in rows][-2:] == ["brake lights only", "radio without delay"]
    assert len(rows) == 2 * 4 + 2
    assert float(rows[-1]["collided"]) < float(rows[0]["collided"]) + 0.05
    assert float(rows[0]["collided"]) < float(rows[-2]["collided"])
    assert "best for all" in summary
    assert (tmp_path / "figure.png").stat().st_size > 10_000
