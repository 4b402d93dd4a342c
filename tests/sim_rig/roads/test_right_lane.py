"""Cars along the middle of a road are moved into its right lane, on paths that can be steered."""

import numpy as np

from sim_rig.roads.recording import STEP_S, RecordedTraffic, Trajectory
from sim_rig.roads.retimed import retimed
from sim_rig.roads.right_lane import in_right_lane


def corner() -> Trajectory:
    """Return a car that stops at a corner, turns right on the spot, and drives on."""
    speed_m_s = np.concatenate([np.full(60, 12.0), np.zeros(30), np.full(60, 12.0)])
    heading_rad = np.where(np.arange(150) < 75, 0.0, -np.pi / 2)
    ahead = np.stack([np.cos(heading_rad), np.sin(heading_rad)], axis=1)
    middle_m = np.cumsum(speed_m_s[:, None] * STEP_S * ahead, axis=0)
    return Trajectory("a", 0, middle_m, heading_rad, speed_m_s, 4.5, 1.8)


def test_a_car_is_moved_to_the_right_of_its_road() -> None:
    before = corner()
    (drive,) = in_right_lane(RecordedTraffic([before]), 1.75).drives

    assert np.allclose(drive.middle_m[:40, 1], -1.75)
    assert np.allclose(drive.middle_m[-40:, 0], before.middle_m[-1, 0] - 1.75)


def test_a_retimed_car_moves_ahead_at_the_speed_that_it_shows() -> None:
    """Shifted after it was retimed, it moved back in corners, at another speed than its bus's."""
    (drive,) = retimed(in_right_lane(RecordedTraffic([corner()]), 1.75)).drives
    moved_m = np.diff(drive.middle_m, axis=0)
    ahead = np.stack([np.cos(drive.heading_rad), np.sin(drive.heading_rad)], axis=1)[:-1]

    along_m = (moved_m * ahead).sum(axis=1)
    assert along_m.min() > -1e-6
    shown_m_s = (drive.speed_m_s[1:] + drive.speed_m_s[:-1]) / 2.0
    assert np.abs(along_m / STEP_S - shown_m_s).max() < 0.2
