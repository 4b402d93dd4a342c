"""What distance and fading leave of a signal."""

import numpy as np
import pytest
from scipy import stats

from sim_rig.propagation.fading import Fading
from sim_rig.propagation.path_loss import DualSlope, LogDistance, TwoRay


def test_log_distance_loses_ten_exponents_a_decade() -> None:
    loss_db = LogDistance(reference_db=47.86, exponent=2.75).loss_db(np.array([1.0, 10.0, 100.0]))

    assert loss_db == pytest.approx([47.86, 75.36, 102.86])


def test_dual_slope_bends_at_the_breakpoint() -> None:
    loss_db = DualSlope().loss_db(np.array([10.0, 100.0, 1000.0]))

    assert loss_db == pytest.approx([67.86, 87.86, 125.86])


def test_two_rays_are_free_space_up_to_the_crossover_and_then_40_db_a_decade() -> None:
    # Wave of 51.16 mm, antennas at 1.5 m: the crossover lies at 4 pi 2.25 / 0.05116 = 552.7 m.
    model = TwoRay()
    near_db, far_db, farther_db = model.loss_db(np.array([100.0, 1_000.0, 10_000.0]))

    assert near_db == pytest.approx(87.80, abs=0.01)
    assert far_db == pytest.approx(120.0 - 40.0 * np.log10(1.5))
    assert farther_db - far_db == pytest.approx(40.0)
    assert np.diff(model.loss_db(np.array([552.6, 552.8]))) == pytest.approx(0.0, abs=0.01)


def test_antennas_in_one_place_are_taken_for_1_m_apart() -> None:
    for model in (LogDistance(), DualSlope(), TwoRay()):
        assert model.loss_db(np.zeros(1)) == model.loss_db(np.ones(1))


@pytest.mark.parametrize("nakagami_m", [0.5, 1.0, 3.0])
def test_fading_power_is_gamma_distributed_about_the_mean(nakagami_m: float) -> None:
    fading = Fading(nakagami_m, np.random.default_rng(5))

    power = fading.faded(np.full(5_000, 2.0))

    expected = stats.gamma(nakagami_m, scale=2.0 / nakagami_m)
    assert stats.kstest(power, expected.cdf).pvalue > 1e-3


def test_a_channel_that_does_not_fade_leaves_the_mean() -> None:
    mean = np.array([1.0, 2.0])
    assert np.array_equal(Fading(None, np.random.default_rng()).faded(mean), mean)
