"""Who receives a broadcast of a study without channel access."""

import math

import numpy as np
import pytest

from sim_rig.studies.radio.lossy_reach import LossyReach


def reach(loss: float) -> LossyReach:
    return LossyReach(100.0, loss, np.random.default_rng(1))


def test_those_in_reach_receive_and_the_sender_does_not() -> None:
    received = reach(0.0).received(np.array([0.0, 100.0, 100.1, math.inf]))

    assert received.tolist() == [True, True, False, False]


def test_each_receiver_loses_its_own_copies() -> None:
    channel = reach(0.3)
    kept = np.array([channel.received(np.zeros(50)) for _ in range(400)])

    assert kept.mean() == pytest.approx(0.7, abs=0.02)
    assert abs(np.corrcoef(kept[:, 0], kept[:, 1])[0, 1]) < 0.15


def test_who_is_out_of_reach_does_not_change_what_others_lose() -> None:
    near, far = np.full(20, 50.0), np.full(20, 50.0)
    far[7] = 200.0
    same = np.arange(20) != 7

    assert (reach(0.5).received(near)[same] == reach(0.5).received(far)[same]).all()
