"""The study of hard brakings on a dense road, in a small campaign, and its road."""

import numpy as np
import pytest

from sim_rig.studies.lcca.braking_ahead_study import STUDY, BrakingAheadSettings
from sim_rig.studies.lcca.dense_road import CARS, LANES, DenseRoad
from sim_rig.studies.lcca.sparse_road import LANE_M

SMALL = BrakingAheadSettings(runs=1, hosts=1, receivers=(0.3,), seconds=20.0)


@pytest.mark.long
def test_with_good_receivers_most_brakings_ahead_raise_a_caution_and_few_others() -> None:
    row = STUDY.one(SMALL, 0)

    assert row.judgings == 2
    assert row.own_cautioned > 0.7 * row.own > 0
    assert row.beside_cautioned <= 0.1 * row.beside
    assert row.behind_cautioned == row.oncoming_cautioned == 0 < min(row.behind, row.oncoming)


def test_the_lanes_of_the_road() -> None:
    road = DenseRoad(25.0, np.random.default_rng(1))
    host = CARS + CARS // 2  # of the middle lane
    road.advance(0.1)

    ahead_m, right_m = road.offsets_m(host).T

    assert ahead_m[host - 1] > 0.0 > ahead_m[host + 1]
    lanes = [round(np.median(right_m[road.lanes == lane]) / LANE_M) for lane in range(2 * LANES)]
    assert lanes == [-1, 0, 1, -4, -3, -2]
