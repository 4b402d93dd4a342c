"""Chain collisions with and without LCCA, in small campaigns."""

import csv
from dataclasses import replace
from pathlib import Path

import pytest

from sim_rig.propagation.path_loss import LogDistance
from sim_rig.scenario.radio_settings import CsmaSettings
from sim_rig.studies.campaigns.campaign import Workers
from sim_rig.studies.campaigns.catalogue import run_study
from sim_rig.studies.lcca.chain import ChainSettings
from sim_rig.studies.lcca.lcca_chain_study import STUDY
from sim_rig.studies.lcca.platoon_sight import Sight

SMALL = ChainSettings(
    cars=(6,), sights=("unlimited",), shares=(0.0, 1.0), reaction_medians_s=(1.5,), loss=0.0
)


def test_warned_platoons_have_less_than_half_of_the_crashes() -> None:
    of_a_seed = len(STUDY.cases(SMALL))
    rows = [STUDY.one(SMALL, number) for number in range(6 * of_a_seed)]

    without, with_radios = rows[::of_a_seed], rows[1::of_a_seed]

    assert sum(row.crashes for row in with_radios) < sum(row.crashes for row in without) / 2
    assert all(row.warned == row.warn_messages == 0 for row in without)
    assert all(row.warned == 5 for row in with_radios)


def test_flooding_takes_one_message_from_each_car() -> None:
    row = STUDY.one(SMALL, 1)

    assert row.flooding_messages == 6 * row.events
    assert row.warn_messages < row.flooding_messages


@pytest.mark.long
def test_the_table_is_written(tmp_path: Path) -> None:
    path = tmp_path / "small.yaml"
    path.write_text(
        "runs: 2\ncars: [5]\nshares: [0.0, 1.0]\nreaction_medians_s: [1.5]\n"
        "sights: [recommended, 30]\n"
    )

    summary = run_study("lcca-chain", tmp_path / "out", path, Workers())

    assert summary.startswith("5 cars, 30.0:")
    with (tmp_path / "out/table.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["sight"] for row in rows] == ["recommended", "recommended", "30.0", "30.0"]
    assert [float(row["share_with_radio"]) for row in rows] == [0.0, 1.0] * 2
    assert float(rows[0]["reduction"]) == pytest.approx(0.0)


def test_over_the_channel_one_message_for_each_event_warns_all_cars() -> None:
    """Without shadowing and fading no message is lost, so none is repeated."""
    over_channel = SMALL.model_copy(update={"csma": CsmaSettings(), "background_traffic": 10})

    row = STUDY.one(over_channel, 1)

    assert row.warned == 5
    assert row.warn_messages == row.events
    assert row == STUDY.one(over_channel, 1)


def test_cars_out_of_range_on_the_channel_are_not_warned() -> None:
    weak_radio = CsmaSettings(tx_power_dbm=-10.0, path_loss=LogDistance(exponent=5.0))
    over_channel = SMALL.model_copy(update={"csma": weak_radio})

    row = STUDY.one(over_channel, 1)

    assert row.warned == 0
    assert row.crashes == STUDY.one(SMALL, 0).crashes


def with_sight(sight: Sight) -> ChainSettings:
    return SMALL.model_copy(update={"sights": (sight,), "shares": (1.0,)})


@pytest.mark.long
def test_through_the_recommended_lens_most_cars_know_their_lead() -> None:
    rows = [STUDY.one(with_sight("recommended"), number) for number in range(6)]

    assert sum(row.known for row in rows) >= 0.7 * sum(row.followers for row in rows)
    assert not any(row.wrongly_known for row in rows)
    assert sum(row.warned for row in rows) >= 0.6 * sum(row.followers for row in rows)


@pytest.mark.long
def test_a_longer_lens_knows_more_cars() -> None:
    known = {
        sight: sum(STUDY.one(with_sight(sight), number).known for number in range(4))
        for sight in ("unlimited", "recommended", "rig")
    }

    assert known["unlimited"] == 4 * 5
    assert known["unlimited"] >= known["recommended"] > known["rig"]


def test_beyond_the_reach_of_plates_no_car_is_known() -> None:
    row = STUDY.one(with_sight(5.0), 0)

    assert row.known == row.warned == 0
    assert STUDY.one(with_sight(200.0), 0) == replace(
        STUDY.one(with_sight("unlimited"), 0), sight="200.0"
    )


def test_a_car_without_a_radio_is_never_known() -> None:
    half = with_sight("recommended").model_copy(update={"shares": (0.5,)})
    rows = [STUDY.one(half, number) for number in range(4)]

    assert all(row.known <= row.followers for row in rows)
    assert not any(row.wrongly_known for row in rows)


@pytest.mark.long
def test_over_the_channel_inquiries_are_answered_too() -> None:
    settings = with_sight("recommended").model_copy(
        update={"csma": CsmaSettings(), "background_traffic": 10}
    )

    row = STUDY.one(settings, 0)
    assert row.known >= 3
    assert row == STUDY.one(settings, 0)


@pytest.mark.long
def test_cautions_pass_over_cars_without_a_radio() -> None:
    """The ceiling: nobody's group reaches over them."""
    given = {"cars": (10,), "sights": ("unlimited",), "shares": (0.0, 0.4), "runs": 3}
    settings = ChainSettings.model_validate(
        given | {"cautions": ("off", "known"), "reaction_medians_s": (1.5,)}
    )
    rows = [STUDY.one(settings, number) for number in range(12)]
    crashes = {
        kind: sum(row.crashes for row in rows if (row.cautions, row.share) == kind)
        for kind in (("off", 0.0), ("off", 0.4), ("known", 0.0), ("known", 0.4))
    }

    assert crashes["known", 0.0] == crashes["off", 0.0]
    assert crashes["known", 0.4] < crashes["off", 0.4]
    assert all(row.wrongly_cautioned == 0 for row in rows)
