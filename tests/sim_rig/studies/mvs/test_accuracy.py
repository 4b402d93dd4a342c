"""Consistency of the covariances, on roads whose motion model is known."""

import numpy as np
import pytest

from sim_rig.studies.mvs.accuracy import CENTRALISED, MODELLED, MVS, NAIVE, accuracy
from sim_rig.studies.mvs.roads import FreeCars, states_of


def test_free_cars_deviate_as_white_acceleration_noise_predicts() -> None:
    road = FreeCars(100, 25.0, 3.0, 2.0, np.random.default_rng(1))
    at_once, later = (states_of(road.cars_at(t)) for t in (0.0, 3.0))
    deviation = later - at_once
    deviation[:, :2] -= 3.0 * at_once[:, 2:]

    variances = np.tile([2.0 * 3.0**3 / 3.0, 2.0 * 3.0], (2, 1)).T.ravel()
    assert deviation.var(axis=0) == pytest.approx(variances, rel=0.2)


@pytest.mark.long
def test_covariances_are_consistent_if_cars_move_as_the_filters_model() -> None:
    found = accuracy(MODELLED, 0.15, 0.0, seed=1, seconds=1.0, road=FreeCars).errors

    assert len(found[MVS].nees) > 200
    for method in (CENTRALISED, MVS):
        assert 3.0 < found[method].mean_nees < 5.0
        assert found[method].inside_95 > 0.94
    assert found[NAIVE].inside_95 < 0.9
