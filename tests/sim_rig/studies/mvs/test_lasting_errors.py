"""What is reported is as certain as stated where the errors of receivers last."""

import pytest

from bench.lasting_errors import world
from sim_rig.studies.mvs.lasting_errors import consistency


@pytest.mark.long
@pytest.mark.parametrize("observers", [1, 2])
def test_the_covariances_have_the_errors_that_last(observers: int) -> None:
    found = consistency(observers, world(1.5, 60.0), 12, seed=1)

    assert 2.5 < found.reported.mean_nees < 5.0
    assert found.central.mean_nees > 10.0
    assert found.reported.position_rmse_m < 1.1 * found.central.position_rmse_m
    assert found.ghosts <= 1


@pytest.mark.long
def test_what_own_sensors_measure_is_placed_relative_to_the_host_vehicle() -> None:
    found = consistency(1, world(1.5, 60.0), 6, seed=1, is_alone=True)

    assert 2.0 < found.reported.mean_nees < 5.0
    assert found.reported.position_rmse_m < 1.0
